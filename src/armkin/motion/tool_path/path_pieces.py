"""Paths of the tool: lines, arcs, helices, splines and blends as pieces, each passed at unit speed.

A piece is a vector function y = (position, sums of angles, rotation vector) over its own length; the rotation
vector turns the piece's first orientation, so that a linear one is a slerp. Length counts millimetres, and 30 mm
for each radian of turning, so that a pure turn has a length, too:

    ds^2 = |dp|^2 + (30 mm |dangles|)^2
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array, numbers_within
from armkin.inverse.tasks.task import Task
from armkin.model.rotation import quaternion
from armkin.motion.tool_path.b_spline import solve_banded

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

    p: Array
    sums: Array
    turned: Array | None


def split_target(task: Task, target: ArrayLike) -> Spot:
    """The parts of a task's target (m,) or (4, 4)."""
    values = np.asarray(target, dtype=float)
    if task.orientation == "full":
        return Spot(values[:3, 3], np.zeros(0), values[:3, :3])
    p, angles = values[: task.position], values[task.position :]
    k = len(task.sums)
    axis = angles[k : k + 3] / np.linalg.norm(angles[k : k + 3]) if task.orientation == "axis" else None
    return Spot(p, angles[:k], axis)


def turn_between(task: Task, a: Spot, b: Spot) -> Array:
    """Rotation vector from one orientation to another."""
    if a.turned is None or b.turned is None:
        return np.zeros(3)
    if task.orientation == "full":
        return rotation_vectors(b.turned @ a.turned.T)
    normal = np.cross(a.turned, b.turned)
    sine = float(np.linalg.norm(normal))
    if sine < 1e-12 and a.turned @ b.turned < 0:
        raise UsageError("a move turns the tool's axis over, by half a turn: put a point in between")
    return np.asarray(normal * (math.atan2(sine, float(a.turned @ b.turned)) / max(sine, 1e-300)))


@dataclass(frozen=True)
class Dense:
    """The given points from which a piece was fitted; all lengths [mm] are along the piece."""

    given: Array  # (N,) where each point is passed
    points: Array  # (N, 2 or 3) the points' positions
    bends: Array  # (k,) where the curvature jumps
    spans: Array  # (m,) where its cubics begin and end
    begins: Array  # (c,) where each of its speeds begins
    speed: Array  # (c,) fraction of the joints' max_speed; nan: the path's
    tool_speed: Array  # (c,) [mm/s]; nan: the path's

    def part(self, a: float, b: float) -> Dense:
        """The points and lengths of the part from length a to b [mm]."""
        given, bends = ((x > a) & (x < b) for x in (self.given, self.bends))
        return replace(
            self,
            given=self.given[given] - a,
            points=self.points[given],
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
        if self.first.turned is None:
            return y[:, : n + k]
        w = y[:, n + k :]
        R = rotation_matrices(w) if w.any() else np.broadcast_to(np.eye(3), (len(y), 3, 3))
        if self.task.orientation == "axis":
            return np.concatenate([y[:, : n + k], R @ self.first.turned], axis=1)
        T = np.zeros((len(y), 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = R @ self.first.turned, y[:, :3], 1.0
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
        change = np.concatenate([end.p - start.p, PER_RADIAN * (end.sums - start.sums), PER_RADIAN * w])
        return np.asarray(change / (b - a))

    def part(self, a: float, b: float) -> Piece:
        """The part from length a to b."""
        begin = split_target(self.task, self.targets(np.array([a]))[0])
        n = self.task.position + len(self.task.sums)
        rotation = rotation_matrices(self.curve(np.array([a]))[:, n:])[0]

        def curve(s: Array) -> Array:
            y = self.curve(s + a)
            if self.first.turned is None:
                return y
            w = rotation_vectors(rotation_matrices(y[:, n:]) @ rotation.T)
            return np.concatenate([y[:, :n], w], axis=1)

        dense = None if self.dense is None else self.dense.part(a, b)
        return replace(self, first=begin, curve=curve, length=b - a, dense=dense)


def line(task: Task, a: Spot, b: Spot) -> Piece:
    """A straight line; orientation by slerp, sums linearly."""
    size = float(np.linalg.norm(b.p - a.p))
    piece = _uniform_piece(task, a, b, lambda f: a.p + f[:, None] * (b.p - a.p), size)
    return replace(piece, rate=size / piece.length) if piece.length > 0 else piece


def circle(task: Task, a: Spot, centre: Array, normal: Array, angle: float, rise: float, end: Spot | None) -> Piece:
    """An arc or a helix from `a` about `centre`, by `angle` [rad], rising by `rise` [mm] along the normal in all."""
    n = normal / np.linalg.norm(normal)
    radial = a.p - centre
    radial = radial - n * (n @ radial) if len(a.p) == 3 else radial
    radius = float(np.linalg.norm(radial))
    if radius < 1e-6:
        raise UsageError("the circle's centre lies on the point where the circle starts: it has no radius")
    tangent = np.cross(n, radial) if len(a.p) == 3 else np.array([-radial[1], radial[0]]) * n[-1]
    base = a.p - radial

    def position(f: Array) -> Array:
        t = (f * angle)[:, None]
        point = base + np.cos(t) * radial + np.sin(t) * tangent
        return np.asarray(point + f[:, None] * rise * n if len(a.p) == 3 else point)

    length = math.hypot(radius * angle, rise)
    b = end or Spot(position(np.ones(1))[0], a.sums, a.turned)
    return _uniform_piece(task, a, b, position, length)


def arc(task: Task, a: Spot, via: Array, b: Spot) -> Piece:
    """The arc of a circle from `a` through `via` to `b`. Raises UsageError if they are on one line."""
    p, q, r = (np.append(x, 0.0)[:3] for x in (a.p, via, b.p))
    u, v = q - p, r - p
    n = np.cross(u, v)
    area = float(n @ n)
    if area < (1e-9 * float(np.linalg.norm(u) + 1) * float(np.linalg.norm(v) + 1)) ** 2 or area < 1e-12:
        raise UsageError("the arc's start, via and to lie on one line, or two of them are the same: use line")
    centre = p + (np.cross(n, u) * (v @ v) + np.cross(v, n) * (u @ u)) / (2 * area)
    x, y = p - centre, r - centre
    unit = n / math.sqrt(area)
    angle = math.atan2(float(unit @ np.cross(x, y)), float(x @ y)) % (2 * math.pi)
    normal = unit if len(a.p) == 3 else unit[2:]
    return circle(task, a, centre[: len(a.p)], normal, angle, 0.0, b)


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

    v = divide_spans(u, _table_intervals(len(u) - 1))
    tangent = curve(v)[1] * weights(task)
    reversals = np.flatnonzero((tangent[2:] * tangent[:-2]).sum(axis=1) < 0)
    if len(reversals):
        place = ", ".join(f"{x:.6g}" for x in curve(v[reversals[:1] + 1])[0][0, : task.position])
        raise UsageError(f"a spline turns back by half a turn near {place}: use lines, which stop there")
    return unit_speed_piece(task, a, curve, u)[0]


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
    corner, half_side = b.first.p, max(a.length - side / 2, 0.0)
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


def _length_at_radius(piece: Piece, corner: Array, radius: float, inner: float, outer: float) -> float:
    """Length at which a piece is `radius` away from its corner, between the corner's length and the farthest."""
    if piece.rate:
        return inner + math.copysign(radius / piece.rate, outer - inner)
    for _ in range(6):  # each step divides the interval by 100
        s = np.linspace(inner, outer, 101)
        distances = np.linalg.norm(piece.curve(s)[:, : piece.task.position] - corner, axis=1)
        interval = min(int(np.argmax(distances[1:] >= radius)), 99) if (distances[1:] >= radius).any() else 99
        inner, outer = float(s[interval]), float(s[interval + 1])
    return outer


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
    moving = np.flatnonzero((y != y[0]).any(axis=0))
    h, constant = np.diff(s), y[0]
    y0, d0, d1 = y[:-1, moving], left[:, moving] * h[:, None], right[:, moving] * h[:, None]  # left, right: dy/ds
    chord = y[1:, moving] - y0
    powers = np.stack([y0.T, d0.T, (3 * chord - 2 * d0 - d1).T, (d0 + d1 - 2 * chord).T])  # (4, d, intervals)
    inner = s[1:-1]

    def curve_by_length(x: Array) -> Array:
        i = inner.searchsorted(x, side="right")
        f = (x - s.take(i)) / h.take(i)
        c0, c1, c2, c3 = powers.take(i, axis=2)
        y_at = np.repeat(constant[:, None], len(x), axis=1)
        y_at[moving] = c0 + f * (c1 + f * (c2 + f * c3))
        return y_at.T

    return Piece(task, first, curve_by_length, float(s[-1])), lambda v: np.interp(v, grid, s)


def _table_sizes(curve: Callable[[Array], tuple[Array, Array]], u: Array, scale: Array) -> NDArray[np.intp]:
    """The number of intervals of the length table in each span between the values u; 1 for a span of constant speed."""
    f = (np.arange(4) + 0.5) / 4
    v = u[:-1, None] + np.diff(u)[:, None] * f
    slopes = (curve(v.ravel())[1] * scale).reshape(*v.shape, -1)
    largest = np.abs(slopes).max(axis=(1, 2))
    length = np.linalg.norm(slopes, axis=2).mean(axis=1) * np.diff(u)
    needed = np.ceil((length / _LENGTH_ERROR) ** 0.25)  # Hermite's error falls with the fourth power
    is_constant = np.abs(slopes - slopes[:, :1]).max(axis=(1, 2)) <= _EVEN_SLOPE * largest
    return np.where(is_constant, 1, np.clip(needed, _MIN_TABLE_INTERVALS, _table_intervals(len(u) - 1))).astype(np.intp)


def _table_intervals(spans: int) -> int:
    """The most intervals of the length table in each of `spans` spans."""
    return int(np.clip(_ALL_TABLE_INTERVALS // max(spans, 1), _MIN_TABLE_INTERVALS, _TABLE_INTERVALS))


def divide_spans(u: Array, parts: NDArray[np.intp] | int) -> Array:
    """Divide every span between the values u into equal parts; the last value is left out."""
    count = np.broadcast_to(parts, len(u) - 1)
    share = numbers_within(count) / np.repeat(count, count)
    return np.asarray(np.repeat(u[:-1], count) + np.repeat(np.diff(u), count) * share)


def relative_values(task: Task, a: Spot, b: Spot) -> Array:
    """Spot b as values y of a piece that starts at spot a."""
    return np.concatenate([b.p, b.sums, turn_between(task, a, b)])


def weights(task: Task) -> Array:
    """The length that a unit of each component of y counts."""
    return np.concatenate([np.ones(task.position), np.full(len(task.sums) + 3, PER_RADIAN)])


def _rotation_rate(w: Array, omega: Array) -> Array:
    """Rate of a rotation vector w whose rotation turns at omega (inverse of the left Jacobian of SO(3))."""
    angle = float(np.linalg.norm(w))
    factor = 1 / 12 if angle < 1e-4 else (1 - angle / 2 / math.tan(angle / 2)) / angle**2
    return np.asarray(omega - np.cross(w, omega) / 2 + factor * np.cross(w, np.cross(w, omega)))


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
