"""Pieces of a path of the tool, each passed at unit speed.

A piece is a vector function y = (position, sums of angles, rotation vector) over its own length; the rotation
vector turns the piece's first orientation, so that a linear one is a slerp. Length counts millimetres, and 30 mm
for each radian of turning, so that a pure turn has a length, too:

    ds^2 = |dp|^2 + (30 mm |dangles|)^2
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array, numbers_within
from armkin.inverse.tasks.task import Task
from armkin.model.rotation import quaternion

PER_RADIAN = 30.0  # length [mm] that counts for a radian of turning
MIN_LENGTH = 1e-9  # pieces below this length [mm] are left out
_GAUSS_NODES = (np.array([-1, 1]) / math.sqrt(3) + 1) / 2
_TABLE_INTERVALS, _MIN_TABLE_INTERVALS = 96, 4  # most and fewest intervals of a curved span's length table
_ALL_TABLE_INTERVALS = 20_000  # intervals of all length tables together
_EVEN_SLOPE, _LENGTH_ERROR = 1e-9, 1e-6  # relative change of a slope that counts as constant; error [mm] of a length


def rotation_matrices(w: Array) -> Array:
    """Rotation matrices of rotation vectors: (..., 3) [rad] -> (..., 3, 3) (Rodrigues)."""
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(w, -1, 0)
    zero = np.zeros_like(x)
    W = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*w.shape[:-1], 3, 3)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * W + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (W @ W))


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors of rotation matrices, of at most half a turn: (..., 3, 3) -> (..., 3) [rad]."""
    q = quaternion(R)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(size > 1e-12, angle / np.maximum(size, 1e-300), 2.0))


@dataclass(frozen=True)
class Spot:
    """The parts of a target: position, sums of angles, and an orientation (3, 3), a direction (3,) or None."""

    position: Array
    sums: Array
    orientation: Array | None


def split_target(task: Task, target: ArrayLike) -> Spot:
    """The parts of a task's target (m,) or (4, 4)."""
    values = np.asarray(target, dtype=float)
    if task.orientation == "full":
        return Spot(values[:3, 3], np.zeros(0), values[:3, :3])
    position, angles = values[: task.position], values[task.position :]
    sum_count = len(task.sums)
    axis = (
        angles[sum_count : sum_count + 3] / np.linalg.norm(angles[sum_count : sum_count + 3])
        if task.orientation == "axis"
        else None
    )
    return Spot(position, angles[:sum_count], axis)


def turn_between(task: Task, a: Spot, b: Spot) -> Array:
    """The rotation vector (3,) [rad] that takes the orientation of a to that of b, zero for a task without one."""
    if a.orientation is None or b.orientation is None:
        return np.zeros(3)
    if task.orientation == "full":
        return rotation_vectors(b.orientation @ a.orientation.T)
    normal = np.cross(a.orientation, b.orientation)
    sine = float(np.linalg.norm(normal))
    if sine < 1e-12 and a.orientation @ b.orientation < 0:
        raise UsageError("a move turns the tool's axis over, by half a turn: put a point in between")
    return np.asarray(normal * (math.atan2(sine, float(a.orientation @ b.orientation)) / max(sine, 1e-300)))


@dataclass(frozen=True)
class Dense:
    """The given points from which a piece was fitted; all lengths [mm] are along the piece."""

    given_lengths: Array  # (N,) where each point is passed
    points: Array  # (N, 2 or 3) the points' positions
    bends: Array  # (k,) where the curvature jumps
    spans: Array  # (m,) where its cubics begin and end
    begins: Array  # (c,) where each of its speeds begins
    speed: Array  # (c,) fraction of the joints' max_speed; nan: the path's
    tool_speed: Array  # (c,) [mm/s]; nan: the path's

    def part(self, a: float, b: float) -> Dense:
        """The points and lengths of the part from length a to b [mm]."""
        is_given, bends = ((x > a) & (x < b) for x in (self.given_lengths, self.bends))
        return replace(
            self,
            given_lengths=self.given_lengths[is_given] - a,
            points=self.points[is_given],
            bends=self.bends[bends] - a,
            spans=self.spans[(self.spans > a) & (self.spans < b)] - a,
            begins=self.begins - a,
        )


@dataclass(frozen=True)
class Piece:
    """A smooth part of a path, passed at unit speed."""

    task: Task
    first: Spot
    curve: Callable[[Array], Array]  # s (N,) -> y (N, dim): position, sums, rotation vector
    length: float
    speed: float | None = None  # fraction of the joints' max_speed, of this move
    tool_speed: float | None = None  # [mm/s] of this move
    rate: float | None = None  # millimetres of a straight line's position for each of length
    dense: Dense | None = None  # points that became one curve

    def targets(self, s: Array) -> Array:
        """Targets (N, m) or (N, 4, 4) at lengths s (N,)."""
        y = self.curve(np.clip(s, 0.0, self.length))
        n, k = self.task.position, len(self.task.sums)
        if self.first.orientation is None:
            return y[:, : n + k]
        w = y[:, n + k :]
        R = rotation_matrices(w) if w.any() else np.broadcast_to(np.eye(3), (len(y), 3, 3))
        if self.task.orientation == "axis":
            return np.concatenate([y[:, : n + k], R @ self.first.orientation], axis=1)
        T = np.zeros((len(y), 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = R @ self.first.orientation, y[:, :3], 1.0
        return T

    @cached_property
    def last(self) -> Spot:
        """The spot at its end."""
        return split_target(self.task, self.targets(np.array([self.length]))[0])

    def direction(self, s: float) -> Array:
        """d(position, sums, angle)/ds at s, angles in units of PER_RADIAN: a unit vector (dim,)."""
        h = min(1e-5 * self.length, 1e-3)
        a, b = max(s - h, 0.0), min(s + h, self.length)
        start, end = (split_target(self.task, t) for t in self.targets(np.array([a, b])))
        w = turn_between(self.task, start, end)
        change = np.concatenate([end.position - start.position, PER_RADIAN * (end.sums - start.sums), PER_RADIAN * w])
        return np.asarray(change / (b - a))

    def part(self, a: float, b: float) -> Piece:
        """The part from length a to b."""
        begin = split_target(self.task, self.targets(np.array([a]))[0])
        n = self.task.position + len(self.task.sums)
        rotation = rotation_matrices(self.curve(np.array([a]))[:, n:])[0]

        def curve(s: Array) -> Array:
            y = self.curve(s + a)
            if self.first.orientation is None:
                return y
            w = rotation_vectors(rotation_matrices(y[:, n:]) @ rotation.T)
            return np.concatenate([y[:, :n], w], axis=1)

        dense = None if self.dense is None else self.dense.part(a, b)
        return replace(self, first=begin, curve=curve, length=b - a, dense=dense)


def unit_speed_piece(
    task: Task, first: Spot, curve: Callable[[Array], tuple[Array, Array]], u: Array
) -> tuple[Piece, Callable[[Array], Array]]:
    """A piece from a curve over any parameter, which gives points and derivatives and is smooth between the values u.

    Also returns the function from parameters to lengths.
    """
    scale = weights(task)
    grid = np.append(divide_spans(u, _table_sizes(curve, u, scale)), u[-1])
    step = np.diff(grid)
    nodes = grid[:-1, None] + step[:, None] * _GAUSS_NODES
    speed = np.linalg.norm(curve(nodes.ravel())[1] * scale, axis=1).reshape(nodes.shape)
    s = np.concatenate([[0.0], np.cumsum(speed.mean(axis=1) * step)])
    y, left = curve(grid)
    right = curve(grid[1:] - 1e-9 * step)[1]  # a corner has two directions
    left, right = (d / np.maximum(np.linalg.norm(d * scale, axis=1), 1e-12)[:, None] for d in (left[:-1], right))
    components = np.flatnonzero((y != y[0]).any(axis=0))
    h, constant = np.diff(s), y[0]
    y0, d0, d1 = y[:-1, components], left[:, components], right[:, components]
    d0, d1 = d0 * h[:, None], d1 * h[:, None]  # left, right: dy/ds
    chord = y[1:, components] - y0
    powers = np.stack([y0.T, d0.T, (3 * chord - 2 * d0 - d1).T, (d0 + d1 - 2 * chord).T])  # (4, d, intervals)
    inner_lengths = s[1:-1]

    def curve_by_length(x: Array) -> Array:
        i = inner_lengths.searchsorted(x, side="right")
        f = (x - s.take(i)) / h.take(i)
        c0, c1, c2, c3 = powers.take(i, axis=2)
        y_at = np.repeat(constant[:, None], len(x), axis=1)
        y_at[components] = c0 + f * (c1 + f * (c2 + f * c3))
        return y_at.T

    return Piece(task, first, curve_by_length, float(s[-1])), lambda v: np.interp(v, grid, s)


def _table_sizes(curve: Callable[[Array], tuple[Array, Array]], u: Array, scale: Array) -> NDArray[np.intp]:
    """The number of intervals of the length table in each span between the values u; 1 for a span of constant speed."""
    f = (np.arange(4) + 0.5) / 4
    v = u[:-1, None] + np.diff(u)[:, None] * f
    slopes = (curve(v.ravel())[1] * scale).reshape(*v.shape, -1)
    largest = np.abs(slopes).max(axis=(1, 2))
    length = np.linalg.norm(slopes, axis=2).mean(axis=1) * np.diff(u)
    count = np.ceil((length / _LENGTH_ERROR) ** 0.25)  # Hermite's error falls with the fourth power
    is_constant = np.abs(slopes - slopes[:, :1]).max(axis=(1, 2)) <= _EVEN_SLOPE * largest
    return np.where(is_constant, 1, np.clip(count, _MIN_TABLE_INTERVALS, table_intervals(len(u) - 1))).astype(np.intp)


def table_intervals(spans: int) -> int:
    """The most intervals of the length table in each of `spans` spans."""
    return int(np.clip(_ALL_TABLE_INTERVALS // max(spans, 1), _MIN_TABLE_INTERVALS, _TABLE_INTERVALS))


def divide_spans(u: Array, parts: NDArray[np.intp] | int) -> Array:
    """Divide every span between the values u into equal parts; the last value is left out."""
    count = np.broadcast_to(parts, len(u) - 1)
    share = numbers_within(count) / np.repeat(count, count)
    return np.asarray(np.repeat(u[:-1], count) + np.repeat(np.diff(u), count) * share)


def relative_values(task: Task, a: Spot, b: Spot) -> Array:
    """Spot b as values y of a piece that starts at spot a."""
    return np.concatenate([b.position, b.sums, turn_between(task, a, b)])


def weights(task: Task) -> Array:
    """The length that a unit of each component of y counts."""
    return np.concatenate([np.ones(task.position), np.full(len(task.sums) + 3, PER_RADIAN)])
