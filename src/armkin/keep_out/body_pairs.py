"""The pairs of bodies and keep-outs that may collide, and the distance of each pair in a posture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.errors import RobotFileError
from armkin.formula.arrays import Array
from armkin.keep_out.bodies import Bodies, bodies, segment_ends
from armkin.keep_out.shapes import Shape, shape_of
from armkin.keep_out.shapes.segment_distances import segment_distance
from armkin.robot_file.keep_out_keys import SELF, keep_out_names

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.model.arm import Arm

CHUNK = 2048  # postures computed together: few numpy calls, and their arrays fit the cache
POSTURES = 256  # postures, home among them, in which a pair has to overlap to be ignored
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)


class Pair(NamedTuple):
    """A body, and the other body or obstacle that it may hit."""

    body: int  # index in `Bodies.names`; for two bodies the later one
    other: int | None  # the other body, or None for an obstacle
    name: str  # name of the other body or obstacle


@dataclass(frozen=True, eq=False)
class Guard:
    """The pairs of an arm, in the order of the columns of `distances`."""

    arm: Arm
    bodies: Bodies
    obstacles: tuple[tuple[str, Shape], ...]
    pairs: tuple[Pair, ...]
    left_out: tuple[tuple[str, str], ...]
    moving_segments: NDArray[np.intp]  # segments that may hit obstacles, sorted by body
    first: NDArray[np.intp]  # index in `moving_segments` of the first segment of each body
    ours: NDArray[np.intp]  # (M,) segments of the later body, sorted by pair of bodies
    theirs: NDArray[np.intp]  # (M,) segments of the earlier body
    starts: NDArray[np.intp]  # index in `ours` and `theirs` of the first item of each pair

    def distances(self, q: Array) -> Array:
        """Signed distance of every pair, without subtracting `clearance`: q (N, n) [rad | mm] -> (N, pairs) [mm]."""
        distances = np.empty((len(q), len(self.pairs)))
        for start in range(0, len(q), CHUNK):
            distances[start : start + CHUNK] = self._distances(q[start : start + CHUNK]).T
        return distances

    def _distances(self, q: Array) -> Array:
        """Signed distances (pairs, N) [mm]."""
        a, b = segment_ends(self.arm, q)
        radius, owner = self.bodies.radius, self.bodies.owner
        parts = []
        if len(self.moving_segments):
            begin, end = a[:, self.moving_segments], b[:, self.moving_segments]
            body_radius = radius[owner[self.moving_segments]][:, None]
            parts = [
                np.minimum.reduceat(shape.distance(begin, end) - body_radius, self.first) for _, shape in self.obstacles
            ]
        if len(self.ours):
            i, j = self.ours, self.theirs
            distance = segment_distance(a[:, i], b[:, i], a[:, j], b[:, j])
            distance -= (radius[owner[i]] + radius[owner[j]])[:, None]
            parts.append(np.minimum.reduceat(distance, self.starts))
        return np.concatenate(parts) if parts else np.empty((0, len(q)))

    def clearances(self, q: Array) -> Array:
        """Distance of every pair minus the arm's `clearance`: q (N, n) -> (N, pairs) [mm]; negative for a hit."""
        return self.distances(q) - self.arm.clearance

    def least_clearances(self, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least clearance and its pair: q (N, n) -> (N,), (N,); nan for joint values of nan, inf without pairs."""
        clearances, pairs = np.full(len(q), np.inf), np.zeros(len(q), np.intp)
        for start in range(0, len(q) if self.pairs else 0, CHUNK):
            chunk = slice(start, start + CHUNK)
            clearances[chunk], pairs[chunk] = self._least_distances(q[chunk])
        clearances -= self.arm.clearance
        clearances[np.isnan(q).any(axis=1)] = np.nan
        return clearances, pairs

    def _least_distances(self, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least distance and its pair.

        The distance of a segment is at least the distance of its middle minus half its length. This bound excludes most
        segments, and exact distances are computed only for the others.
        """
        a, b = segment_ends(self.arm, q)
        mid_distances, half_lengths = self._middle_distances(a, b)
        bound = np.min([part.min(axis=0) for part in mid_distances if len(part)], axis=0) + 1e-9 * self.arm.reach
        distances = np.full((sum(map(len, mid_distances)), len(q)), np.inf)
        row = 0
        for k, (distance, half_length) in enumerate(zip(mid_distances, half_lengths, strict=True)):
            segments, poses = np.nonzero(distance - half_length <= bound)
            distances[row + segments, poses] = self._exact_distances(k, a, b, segments, poses)
            row += len(distance)
        nearest = distances.argmin(axis=0)
        return distances[nearest, np.arange(len(q))], self._pair_of_row[nearest]

    def _middle_distances(self, a: Array, b: Array) -> tuple[list[Array], list[Array]]:
        """Distances (S, N) of the middles of segments from each obstacle, and last from each other, and half the length
        of the segments (S, N), by which they may be nearer."""
        middle, direction = (a + b) / 2, b - a
        half_length = np.sqrt(np.einsum("ksn,ksn->sn", direction, direction)) / 2
        radius = self._segment_radius[:, None]
        i, j = self.ours, self.theirs
        moving_middles, moving_radius = middle[:, self.moving_segments], radius[self.moving_segments]
        distances = [shape.of_points(moving_middles) - moving_radius for _, shape in self.obstacles]
        half_lengths = [half_length[self.moving_segments]] * len(distances)
        if len(i):
            offset = middle[:, i] - middle[:, j]
            distances.append(np.sqrt(np.einsum("ksn,ksn->sn", offset, offset)) - radius[i] - radius[j])
            half_lengths.append(half_length[i] + half_length[j])
        return distances, half_lengths

    def _exact_distances(self, k: int, a: Array, b: Array, rows: NDArray[np.intp], poses: NDArray[np.intp]) -> Array:
        """Exact distances (M,) for rows of item k of `_middle_distances` in some poses."""
        radius = self._segment_radius
        if k < len(self.obstacles):
            segment = self.moving_segments[rows]
            return self.obstacles[k][1].distance(a[:, segment, poses], b[:, segment, poses]) - radius[segment]
        i, j = self.ours[rows], self.theirs[rows]
        axis_distance = segment_distance(a[:, i, poses], b[:, i, poses], a[:, j, poses], b[:, j, poses])
        return axis_distance - radius[i] - radius[j]

    @cached_property
    def _segment_radius(self) -> Array:
        """Radius (S,) [mm] of each segment's body."""
        return np.asarray(self.bodies.radius[self.bodies.owner])

    @cached_property
    def _pair_of_row(self) -> NDArray[np.intp]:
        """The index of the pair for each row: segments and obstacles, then two segments of different bodies."""
        body = np.searchsorted(self.first, np.arange(len(self.moving_segments)), side="right") - 1
        of_obstacles = [body + k * len(self.first) for k in range(len(self.obstacles))]
        segment_pair = np.searchsorted(self.starts, np.arange(len(self.ours)), side="right") - 1
        return np.concatenate([*of_obstacles, segment_pair + len(self.obstacles) * len(self.first)]).astype(np.intp)

    def pair_names(self, pair: int) -> tuple[str, str]:
        """The names of a pair: the body, and the other body or obstacle."""
        return self.bodies.names[self.pairs[pair].body], self.pairs[pair].name


@lru_cache(maxsize=64)
def guard(arm: Arm) -> Guard:
    """The pairs of an arm with keep-outs, without pairs of bodies that overlap in all sampled postures."""
    entries = list(zip(keep_out_names(arm.keep_out), arm.keep_out, strict=True))
    obstacles = tuple((name, shape_of(entry)) for name, entry in entries if entry.kind != SELF)
    if not any(entry.kind == SELF for _, entry in entries):
        return _guard_of_pairs(arm, obstacles, [], ())
    form = bodies(arm)
    body_numbers = [body for body in range(arm.n + 1) if form.exists(body)]
    pairs = [(i, j) for i in body_numbers for j in body_numbers if i - j >= 2]
    maxima = _guard_of_pairs(arm, (), pairs, ()).distances(sample_postures(arm)).max(axis=0, initial=-np.inf)
    possible_pairs = [pair for pair, greatest in zip(pairs, maxima, strict=True) if greatest >= 0.0]
    left = tuple((form.names[i], form.names[j]) for i, j in pairs if (i, j) not in possible_pairs)
    return _guard_of_pairs(arm, obstacles, possible_pairs, left)


def _guard_of_pairs(
    arm: Arm,
    obstacles: tuple[tuple[str, Shape], ...],
    pairs: list[tuple[int, int]],
    left_out: tuple[tuple[str, str], ...],
) -> Guard:
    """The guard for obstacles and for pairs (later, earlier) of bodies; left_out: names of ignored pairs."""
    arm_bodies = bodies(arm)
    solid = [body for body in range(1, arm.n + 1) if arm_bodies.exists(body)]
    moving_segments = np.flatnonzero(np.isin(arm_bodies.owner, solid))
    segments = [np.flatnonzero(arm_bodies.owner == body) for body in range(arm.n + 1)]
    segment_pairs = [[(i, j) for i in segments[later] for j in segments[earlier]] for later, earlier in pairs]
    rows = np.array([segment_pair for part in segment_pairs for segment_pair in part], dtype=np.intp).reshape(-1, 2)
    sizes = [len(part) for part in segment_pairs]
    named_pairs = [Pair(body, None, name) for name, _ in obstacles for body in solid]
    named_pairs += [Pair(later, earlier, arm_bodies.names[earlier]) for later, earlier in pairs]
    return Guard(
        arm=arm,
        bodies=arm_bodies,
        obstacles=obstacles,
        pairs=tuple(named_pairs),
        left_out=left_out,
        moving_segments=moving_segments,
        first=np.flatnonzero(np.diff(arm_bodies.owner[moving_segments], prepend=-1)),
        ours=rows[:, 0],
        theirs=rows[:, 1],
        starts=np.cumsum([0, *sizes[:-1]], dtype=np.intp) if sizes else np.empty(0, np.intp),
    )


def sample_postures(arm: Arm) -> Array:
    """Home, and 255 points of the Halton sequence of the first n primes, scaled to the limits: (256, n)."""
    span = np.where(arm.prismatic, arm.reach, np.pi)
    low = np.where(np.isfinite(arm.lower), arm.lower, -span)
    high = np.where(np.isfinite(arm.upper), arm.upper, span)
    unit = np.array([[_radical_inverse(i, base) for base in _PRIMES[: arm.n]] for i in range(1, POSTURES)])
    return np.concatenate([arm.home[None], low + unit * (high - low)])


def _radical_inverse(index: int, base: int) -> float:
    """The digits of an index reversed behind the point: 6 = 110 in base 2 gives 0.011 (Halton 1960)."""
    value, share = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value += digit * share
        share /= base
    return value


def check_keep_out(arm: Arm) -> None:
    """Raise RobotFileError for an obstacle that is hit in every sampled posture."""
    source = arm.scene or arm.path or arm.name
    arm_guard = guard(arm)
    clearances = arm_guard.clearances(sample_postures(arm))
    for name, _ in arm_guard.obstacles:
        columns = [number for number, pair in enumerate(arm_guard.pairs) if pair.other is None and pair.name == name]
        if columns and (clearances[:, columns].min(axis=1) < 0).all():
            hint = "is the base's z right?" if name.startswith("floor") else "does the arm stand in it?"
            raise RobotFileError(f"{source}: {name} is hit in every posture: {hint}", file=source, keep_out=name)
