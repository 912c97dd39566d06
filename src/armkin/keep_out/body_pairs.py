"""Which pairs of an arm's bodies and keep-outs count, and how far apart each is in a posture."""

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
from armkin.robot_file.keep_out_keys import SELF, keep_out_names, keep_out_problems

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.model.arm import Arm

CHUNK = 2048  # postures at once: few calls of numpy, and what they need stays in the cache
POSTURES = 256  # postures in which a pair that always overlaps is looked for, home among them
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)


class Pair(NamedTuple):
    """A body and what it is held against."""

    body: int  # index of `Bodies.names`; of two bodies the later one
    other: int | None  # the other body; None: an obstacle
    name: str  # name of the other body


@dataclass(frozen=True, eq=False)
class Guard:
    """An arm's pairs; `distances` has their columns in this order."""

    arm: Arm
    bodies: Bodies
    obstacles: tuple[tuple[str, Shape], ...]
    pairs: tuple[Pair, ...]
    left_out: tuple[tuple[str, str], ...]
    moving: NDArray[np.intp]  # segments that are held against obstacles, by body
    first: NDArray[np.intp]  # where in `moving` each body begins
    ours: NDArray[np.intp]  # (M,) segments of the later body, by pair of bodies
    theirs: NDArray[np.intp]  # (M,) of the earlier one
    starts: NDArray[np.intp]  # where in them each pair begins

    def distances(self, q: Array) -> Array:
        """Signed distance of every pair, `clearance` not taken off: q (N, n) [rad | mm] -> (N, pairs) [mm]."""
        mm = np.empty((len(q), len(self.pairs)))
        for k in range(0, len(q), CHUNK):
            mm[k : k + CHUNK] = self._distances(q[k : k + CHUNK]).T
        return mm

    def _distances(self, q: Array) -> Array:
        """(pairs, N)"""
        a, b = segment_ends(self.arm, q)
        radius, owner = self.bodies.radius, self.bodies.owner
        parts = []
        if len(self.moving):
            begin, end = a[:, self.moving], b[:, self.moving]
            less = radius[owner[self.moving]][:, None]
            parts = [np.minimum.reduceat(shape.distance(begin, end) - less, self.first) for _, shape in self.obstacles]
        if len(self.ours):
            i, j = self.ours, self.theirs
            apart = segment_distance(a[:, i], b[:, i], a[:, j], b[:, j])
            apart -= (radius[owner[i]] + radius[owner[j]])[:, None]
            parts.append(np.minimum.reduceat(apart, self.starts))
        return np.concatenate(parts) if parts else np.empty((0, len(q)))

    def clearances(self, q: Array) -> Array:
        """Distance of every pair less the arm's `clearance`: q (N, n) -> (N, pairs) [mm]; negative is a hit."""
        return self.distances(q) - self.arm.clearance

    def least_clearances(self, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least clearance and its pair: q (N, n) -> (N,), (N,); nan where a joint value is, inf where none counts."""
        mm, pairs = np.full(len(q), np.inf), np.zeros(len(q), np.intp)
        for k in range(0, len(q) if self.pairs else 0, CHUNK):
            mm[k : k + CHUNK], pairs[k : k + CHUNK] = self._least_distances(q[k : k + CHUNK])
        mm -= self.arm.clearance
        mm[np.isnan(q).any(axis=1)] = np.nan
        return mm, pairs

    def _least_distances(self, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least distance and its pair. A segment is as near as its middle, and nearer by half its length at most:
        most are too far to be the nearest, and only the others are looked at.
        """
        a, b = segment_ends(self.arm, q)
        of_middles, halves = self._middle_distances(a, b)
        bound = np.min([part.min(axis=0) for part in of_middles if len(part)], axis=0) + 1e-9 * self.arm.reach
        distances = np.full((sum(map(len, of_middles)), len(q)), np.inf)
        row = 0
        for k, (far, half) in enumerate(zip(of_middles, halves, strict=True)):
            segments, poses = np.nonzero(far - half <= bound)
            distances[row + segments, poses] = self._exact_distances(k, a, b, segments, poses)
            row += len(far)
        nearest = distances.argmin(axis=0)
        return distances[nearest, np.arange(len(q))], self._pair_of_row[nearest]

    def _middle_distances(self, a: Array, b: Array) -> tuple[list[Array], list[Array]]:
        """Distances (S, N) of the segments' middles from each obstacle, and at last from each other; and by how much
        the segments (S, N) may be nearer: half their length."""
        middle, way = (a + b) / 2, b - a
        half = np.sqrt(np.einsum("ksn,ksn->sn", way, way)) / 2
        radius, moving = self._segment_radius[:, None], self.moving
        i, j = self.ours, self.theirs
        distances = [shape.of_points(middle[:, moving]) - radius[moving] for _, shape in self.obstacles]
        halves = [half[moving]] * len(distances)
        if len(i):
            apart = middle[:, i] - middle[:, j]
            distances.append(np.sqrt(np.einsum("ksn,ksn->sn", apart, apart)) - radius[i] - radius[j])
            halves.append(half[i] + half[j])
        return distances, halves

    def _exact_distances(self, k: int, a: Array, b: Array, rows: NDArray[np.intp], poses: NDArray[np.intp]) -> Array:
        """Distances (M,) from obstacle k, or of segments from each other, of rows of `_middle_distances` at poses."""
        radius = self._segment_radius
        if k < len(self.obstacles):
            segment = self.moving[rows]
            return self.obstacles[k][1].distance(a[:, segment, poses], b[:, segment, poses]) - radius[segment]
        i, j = self.ours[rows], self.theirs[rows]
        axes_apart = segment_distance(a[:, i, poses], b[:, i, poses], a[:, j, poses], b[:, j, poses])
        return axes_apart - radius[i] - radius[j]

    @cached_property
    def _segment_radius(self) -> Array:
        """Radius (S,) [mm] of each segment's body."""
        return np.asarray(self.bodies.radius[self.bodies.owner])

    @cached_property
    def _pair_of_row(self) -> NDArray[np.intp]:
        """The pair of every segment against every obstacle, and of every two segments held against each other."""
        body = np.searchsorted(self.first, np.arange(len(self.moving)), side="right") - 1
        of_obstacles = [body + k * len(self.first) for k in range(len(self.obstacles))]
        crossing = np.searchsorted(self.starts, np.arange(len(self.ours)), side="right") - 1
        return np.concatenate([*of_obstacles, crossing + len(self.obstacles) * len(self.first)]).astype(np.intp)

    def pair_names(self, pair: int) -> tuple[str, str]:
        """The names of a pair: body, and what it is held against."""
        return self.bodies.names[self.pairs[pair].body], self.pairs[pair].name


@lru_cache(maxsize=64)
def guard(arm: Arm) -> Guard:
    """The pairs of an arm with keep-outs; pairs of bodies that overlap in all postures looked at are left out."""
    entries = list(zip(keep_out_names(arm.keep_out), arm.keep_out, strict=True))
    obstacles = tuple((name, shape_of(entry)) for name, entry in entries if entry.kind != SELF)
    if not any(entry.kind == SELF for _, entry in entries):
        return _guard_of_pairs(arm, obstacles, [], ())
    form = bodies(arm)
    existing = [k for k in range(arm.n + 1) if form.exists(k)]
    pairs = [(later, earlier) for later in existing for earlier in existing if later - earlier >= 2]
    apart = _guard_of_pairs(arm, (), pairs, ()).distances(sample_postures(arm)).max(axis=0, initial=-np.inf)
    counting = [pair for pair, most in zip(pairs, apart, strict=True) if most >= 0.0]
    left = tuple((form.names[i], form.names[j]) for i, j in pairs if (i, j) not in counting)
    return _guard_of_pairs(arm, obstacles, counting, left)


def _guard_of_pairs(
    arm: Arm,
    obstacles: tuple[tuple[str, Shape], ...],
    pairs: list[tuple[int, int]],
    left_out: tuple[tuple[str, str], ...],
) -> Guard:
    """A guard of bodies against obstacles, and of pairs (later, earlier) of bodies; left_out: pairs that overlap."""
    form = bodies(arm)
    solid = [k for k in range(1, arm.n + 1) if form.exists(k)]
    moving = np.flatnonzero(np.isin(form.owner, solid))
    segments = [np.flatnonzero(form.owner == k) for k in range(arm.n + 1)]
    segment_pairs = [[(i, j) for i in segments[later] for j in segments[earlier]] for later, earlier in pairs]
    flat = np.array([segment_pair for part in segment_pairs for segment_pair in part], dtype=np.intp).reshape(-1, 2)
    sizes = [len(part) for part in segment_pairs]
    listed = [Pair(k, None, name) for name, _ in obstacles for k in solid]
    listed += [Pair(later, earlier, form.names[earlier]) for later, earlier in pairs]
    return Guard(
        arm=arm,
        bodies=form,
        obstacles=obstacles,
        pairs=tuple(listed),
        left_out=left_out,
        moving=moving,
        first=np.flatnonzero(np.diff(form.owner[moving], prepend=-1)),
        ours=flat[:, 0],
        theirs=flat[:, 1],
        starts=np.cumsum([0, *sizes[:-1]], dtype=np.intp) if sizes else np.empty(0, np.intp),
    )


def sample_postures(arm: Arm) -> Array:
    """Home, and the first points of the Halton sequence in the first n primes, scaled to the limits: (256, n)."""
    span = np.where(arm.prismatic, arm.reach, np.pi)
    low = np.where(np.isfinite(arm.lower), arm.lower, -span)
    high = np.where(np.isfinite(arm.upper), arm.upper, span)
    unit = np.array([[_radical_inverse(i, base) for base in _PRIMES[: arm.n]] for i in range(1, POSTURES)])
    return np.concatenate([arm.home[None], low + unit * (high - low)])


def _radical_inverse(index: int, base: int) -> float:
    """The digits of an index behind the point, in reverse: 6 = 110 in base 2 is 0.011 (Halton 1960)."""
    value, share = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value += digit * share
        share /= base
    return value


def check_keep_out(arm: Arm) -> None:
    """Raise RobotFileError for names that clash, and for an obstacle that is hit in every posture looked at."""
    source = arm.scene or arm.path or arm.name
    for path, text in keep_out_problems(arm.keep_out, ["base", *arm.joint_names]):
        raise RobotFileError(f"{source}: keep_out {int(path[1]) + 1}: {text}", file=source)
    held = guard(arm)
    apart = held.clearances(sample_postures(arm))
    for name, _ in held.obstacles:
        columns = [k for k, pair in enumerate(held.pairs) if pair.other is None and pair.name == name]
        if columns and (apart[:, columns].min(axis=1) < 0).all():
            hint = "is the base's z right?" if name.startswith("floor") else "does the arm stand in it?"
            raise RobotFileError(f"{source}: {name} is hit in every posture: {hint}", file=source, keep_out=name)
