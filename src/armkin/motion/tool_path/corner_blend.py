"""Rounds the corner between two pieces of a path."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.tasks.task import Task
from armkin.motion.tool_path.path_pieces import Piece, relative_values, unit_speed_piece, weights


class Blend(NamedTuple):
    """A rounded corner: what is left of the first piece, the curve, what is left of the second one."""

    first: Piece
    middle: Piece
    second: Piece
    radius: float  # [mm]


def blend(task: Task, a: Piece, b: Piece, radius: float, side: float) -> Blend:
    """Round the corner of two pieces within a sphere around it.

    side: the first piece's length before the blend at its other end. The radius is `radius`, or less to leave half of
    each side.
    """
    corner, half_side = b.first.position, max(a.length - side / 2, 0.0)
    radius = min(radius, *(_distance_from(piece, corner, s) for piece, s in ((a, half_side), (b, b.length / 2))))
    cut_a = _length_at_radius(a, corner, radius, a.length, half_side)
    cut_b = _length_at_radius(b, corner, radius, 0.0, b.length / 2)
    first, second = a.part(0.0, cut_a), b.part(cut_b, b.length)
    start, end = first.last, second.first
    y0, y1 = relative_values(task, start, start), relative_values(task, start, end)
    scale = weights(task)
    d0, d1 = a.direction(cut_a) / scale, b.direction(cut_b) / scale
    k = task.position + len(task.sums)
    d1[k:] = _rotation_rate(y1[k:], d1[k:])
    size = (a.length - cut_a) + cut_b
    cubic = (y0, size * d0, 3 * (y1 - y0) - size * (2 * d0 + d1), 2 * (y0 - y1) + size * (d0 + d1))

    def curve(v: Array) -> tuple[Array, Array]:
        w = v[:, None]
        c0, c1, c2, c3 = cubic
        return c0 + w * (c1 + w * (c2 + w * c3)), c1 + w * (2 * c2 + 3 * w * c3)

    middle, _ = unit_speed_piece(task, start, curve, np.array([0.0, 1.0]))
    speed, tool_speed = _lower_speed(a.speed, b.speed), _lower_speed(a.tool_speed, b.tool_speed)
    return Blend(first, replace(middle, speed=speed, tool_speed=tool_speed), second, radius)


def _lower_speed(a: float | None, b: float | None) -> float | None:
    """The lower of two speeds, None: not limited."""
    return min((speed for speed in (a, b) if speed is not None), default=None)


def _distance_from(piece: Piece, corner: Array, s: float) -> float:
    """Distance of a piece's place from a corner [mm]."""
    return float(np.linalg.norm(piece.curve(np.array([s]))[0, : piece.task.position] - corner))


def _length_at_radius(piece: Piece, corner: Array, radius: float, near_end: float, far_end: float) -> float:
    """Length at which a piece is `radius` away from its corner, between the corner's length and the farthest."""
    if piece.rate:
        return near_end + math.copysign(radius / piece.rate, far_end - near_end)
    for _ in range(6):  # each step divides the interval by 100
        s = np.linspace(near_end, far_end, 101)
        distances = np.linalg.norm(piece.curve(s)[:, : piece.task.position] - corner, axis=1)
        interval = min(int(np.argmax(distances[1:] >= radius)), 99) if (distances[1:] >= radius).any() else 99
        near_end, far_end = float(s[interval]), float(s[interval + 1])
    return far_end


def _rotation_rate(w: Array, omega: Array) -> Array:
    """Rate of a rotation vector w whose rotation turns at omega (inverse of the left Jacobian of SO(3))."""
    angle = float(np.linalg.norm(w))
    factor = 1 / 12 if angle < 1e-4 else (1 - angle / 2 / math.tan(angle / 2)) / angle**2
    return np.asarray(omega - np.cross(w, omega) / 2 + factor * np.cross(w, np.cross(w, omega)))
