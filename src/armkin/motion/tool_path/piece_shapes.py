"""The shapes of a path's pieces: lines, circles, helices, arcs and splines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.inverse.tasks.task import Task
from armkin.motion.tool_path.b_spline import solve_banded
from armkin.motion.tool_path.path_pieces import (
    MIN_LENGTH,
    PER_RADIAN,
    Piece,
    Spot,
    divide_spans,
    relative_values,
    table_intervals,
    turn_between,
    unit_speed_piece,
    weights,
)


def line(task: Task, a: Spot, b: Spot) -> Piece:
    """A straight line; orientation by slerp, sums linearly."""
    distance = float(np.linalg.norm(b.position - a.position))
    piece = _uniform_piece(task, a, b, lambda f: a.position + f[:, None] * (b.position - a.position), distance)
    return replace(piece, rate=distance / piece.length) if piece.length > 0 else piece


def circle(task: Task, a: Spot, centre: Array, normal: Array, angle: float, rise: float, end: Spot | None) -> Piece:
    """An arc or a helix from `a` about `centre`, by `angle` [rad], rising by `rise` [mm] along the normal in all."""
    n = normal / np.linalg.norm(normal)
    radial = a.position - centre
    radial = radial - n * (n @ radial) if len(a.position) == 3 else radial
    radius = float(np.linalg.norm(radial))
    if radius < 1e-6:
        raise UsageError("the circle's centre lies on the point where the circle starts: it has no radius")
    tangent = np.cross(n, radial) if len(a.position) == 3 else np.array([-radial[1], radial[0]]) * n[-1]
    base = a.position - radial

    def position(f: Array) -> Array:
        angles = (f * angle)[:, None]
        point = base + np.cos(angles) * radial + np.sin(angles) * tangent
        return np.asarray(point + f[:, None] * rise * n if len(a.position) == 3 else point)

    length = math.hypot(radius * angle, rise)
    end_spot = end or Spot(position(np.ones(1))[0], a.sums, a.orientation)
    return _uniform_piece(task, a, end_spot, position, length)


def arc(task: Task, a: Spot, via: Array, b: Spot) -> Piece:
    """The arc of a circle from `a` through `via` to `b`. Raises UsageError if they are on one line."""
    start, middle, stop = (np.append(x, 0.0)[:3] for x in (a.position, via, b.position))
    u, v = middle - start, stop - start
    n = np.cross(u, v)
    area = float(n @ n)
    if area < (1e-9 * float(np.linalg.norm(u) + 1) * float(np.linalg.norm(v) + 1)) ** 2 or area < 1e-12:
        raise UsageError("the arc's start, via and to lie on one line, or two of them are the same: use line")
    centre = start + (np.cross(n, u) * (v @ v) + np.cross(v, n) * (u @ u)) / (2 * area)
    x, y = start - centre, stop - centre
    unit = n / math.sqrt(area)
    angle = math.atan2(float(unit @ np.cross(x, y)), float(x @ y)) % (2 * math.pi)
    normal = unit if len(a.position) == 3 else unit[2:]
    return circle(task, a, centre[: len(a.position)], normal, angle, 0.0, b)


def spline(task: Task, a: Spot, points: Sequence[Spot]) -> Piece:
    """A natural cubic spline through points, its parameter the square roots of chord lengths (centripetal)."""
    spots = [a, *points]
    y = np.array([relative_values(task, a, s) for s in spots])
    chord = np.linalg.norm(np.diff(y * weights(task), axis=0), axis=1)
    if chord.min() < MIN_LENGTH:
        raise UsageError("a spline passes the same point twice in a row: leave one out")
    u = np.concatenate([[0.0], np.cumsum(np.sqrt(chord))])
    coefficients = _natural_spline(u, y)

    def curve(v: Array) -> tuple[Array, Array]:
        i = np.clip(np.searchsorted(u, v, side="right") - 1, 0, len(u) - 2)
        w = (v - u[i])[:, None]
        c0, c1, c2, c3 = (c[i] for c in coefficients)
        return c0 + w * (c1 + w * (c2 + w * c3)), c1 + w * (2 * c2 + 3 * w * c3)

    v = divide_spans(u, table_intervals(len(u) - 1))
    tangent = curve(v)[1] * weights(task)
    reversals = np.flatnonzero((tangent[2:] * tangent[:-2]).sum(axis=1) < 0)
    if len(reversals):
        place = ", ".join(f"{x:.6g}" for x in curve(v[reversals[:1] + 1])[0][0, : task.position])
        raise UsageError(f"a spline turns back by half a turn near {place}: use lines, which stop there")
    return unit_speed_piece(task, a, curve, u)[0]


def _uniform_piece(task: Task, a: Spot, b: Spot, position: Callable[[Array], Array], length: float) -> Piece:
    """A piece with constant rates of position, sums and turning; position: function of the fraction of its length."""
    w = turn_between(task, a, b)
    change = b.sums - a.sums
    angle = math.hypot(float(np.linalg.norm(change)), float(np.linalg.norm(w)))
    piece_length = math.hypot(length, PER_RADIAN * angle)

    def curve(s: Array) -> Array:
        f = s / piece_length if piece_length > 0 else np.zeros_like(s)
        parts = [position(f), a.sums + f[:, None] * change, f[:, None] * w]
        return np.concatenate(parts, axis=1)

    return Piece(task, a, curve, piece_length)


def _natural_spline(u: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Coefficients of the natural cubic spline through (u, y), a row for each span."""
    h = np.diff(u)
    slope = np.diff(y, axis=0) / h[:, None]
    second = np.zeros_like(y)
    if len(u) > 2:
        bands = np.stack([2 * (h[:-1] + h[1:]), np.append(h[1:-1], 0.0)])
        second[1:-1] = solve_banded(bands, 3 * np.diff(slope, axis=0))
    hh = h[:, None]
    return y[:-1], slope - hh * (2 * second[:-1] + second[1:]) / 3, second[:-1], np.diff(second, axis=0) / (3 * hh)
