"""Proves that a motion hits nothing, between its samples as well.

Between two places the clearance of a pair is at least half the sum of its clearances there, minus half of the distance
that its bodies move in between, because a clearance changes by at most that distance. If this bound is negative, the
interval is halved. An interval that stays undecided when the bodies move less than `STEP` counts as a hit.

A pair that overlaps at the start may only separate: its depth must not grow by more than `STEP`, and after separating
it must not overlap again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.keep_out.displacement_bounds import approach_rates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.keep_out.body_pairs import Guard
    from armkin.keep_out.motion_geometry import JointMotion

STEP = 0.01  # motion [mm] of the bodies below which no interval is halved
_FIRST = 16  # intervals at the start of a proof
_AT_ONCE = 1024  # intervals halved together, the earliest first, so that an early hit ends the proof soon
_MIN_SHARE = 1e-9  # share of a cell below which no interval is halved
_STRIDES = (64, 8, 1)  # strides of the samples, from coarse to fine
_GAP = 0.5  # allowed gap [mm] between bound and least sampled clearance
_GAP_SHARE = 0.05  # the same as a share of the clearance; the larger of both counts
_DEPTH_GAP = 0.05  # allowed gap [mm] where something is hit, up to _FINE_SAMPLES
_FINE_SAMPLES = 4096  # number of samples


@dataclass(frozen=True)
class Proof:
    """The result of a proof.

    free: whether nothing is hit that must not be. place: of the first hit, or of the least clearance; pair: its index,
    None without pairs; mm: a lower bound of the clearance of all pairs over the whole motion; escaping: pairs that
    overlap at the start; postures: number of samples.
    """

    free: bool
    place: float
    pair: int | None
    mm: float
    escaping: tuple[int, ...]
    postures: int


def prove_motion(
    guard: Guard,
    motion: JointMotion,
    *,
    tight: bool = False,
    may_hit: bool = False,
    ignored_pairs: tuple[int, ...] | None = None,
) -> Proof:
    """Prove a motion free, or find its first hit.

    tight: refine until the bound is close to the least sampled clearance. may_hit: find no hit, the bound alone.
    ignored_pairs: pairs that may overlap at the start, by default all that do.
    """
    if not guard.pairs:
        return Proof(free=True, place=0.0, pair=None, mm=np.inf, escaping=(), postures=0)
    places = np.unique(np.round(np.linspace(0.0, motion.cells, min(motion.cells, _FIRST) + 1)))
    q = motion.joints_at(places)
    slide_out = np.abs(q).max(axis=0) + motion.variation(np.zeros(1), np.array([float(motion.cells)]))[0]
    rates = approach_rates(guard, slide_out)
    clearances = guard.clearances(q)
    overlaps_at_start = clearances[0] < 0.0
    if ignored_pairs is not None:
        overlaps_at_start = overlaps_at_start & np.isin(np.arange(len(overlaps_at_start)), ignored_pairs)
    while True:
        motions = motion.variation(places[:-1], places[1:]) @ rates
        refinement = _Round(places, clearances, motions, overlaps_at_start, may_hit=may_hit)
        middle = refinement.to_halve(tight)
        if not len(middle):
            return refinement.result()
        q = motion.joints_at(middle)
        positions = np.searchsorted(places, middle)
        places = np.insert(places, positions, middle)
        clearances = np.insert(clearances, positions, guard.clearances(q), axis=0)


def hit_samples(guard: Guard, q: Array) -> NDArray[np.bool_]:
    """Which of many neighbouring postures (N, n) hit something; clearances of a few decide most of the others."""
    count = len(q)
    hit: NDArray[np.bool_] = np.zeros(count, np.bool_)
    if not guard.pairs or not count:
        return hit
    length = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(np.abs(np.diff(q, axis=0)), axis=0)])
    rates = approach_rates(guard, np.abs(q).max(axis=0))
    samples = np.arange(0, count, _STRIDES[0])
    samples = np.append(samples, count - 1) if samples[-1] < count - 1 else samples
    gaps = guard.clearances(q[samples])
    for stride in (*_STRIDES[1:], 0):
        hit[samples] = (gaps < 0).any(axis=1)
        is_free = (gaps[:-1] + gaps[1:] >= (length[samples[1:]] - length[samples[:-1]]) @ rates).all(axis=1)
        rows = np.flatnonzero(~is_free & (np.diff(samples) > 1))
        if not stride or not len(rows):
            break
        new_samples = np.concatenate([np.arange(samples[row] + stride, samples[row + 1], stride) for row in rows])
        rank = np.searchsorted(samples, new_samples)
        samples = np.insert(samples, rank, new_samples)
        gaps = np.insert(gaps, rank, guard.clearances(q[new_samples]), axis=0)
    return hit


class _Round:
    """One refinement of a proof: `clearances` (N, pairs) at places (N,), and the motions of the bodies in between."""

    def __init__(
        self, places: Array, clearances: Array, motions: Array, overlaps_at_start: NDArray[np.bool_], *, may_hit: bool
    ) -> None:
        self.places, self.clearances, self.start = places, clearances, overlaps_at_start
        self.bound = (clearances[:-1] + clearances[1:] - motions) / 2
        greatest = np.maximum.accumulate(clearances, axis=0)
        # least allowed clearance from there on
        allowed = np.where(overlaps_at_start & (greatest < 0.0), greatest - STEP, 0.0) - (np.inf if may_hit else 0.0)
        required_clearances = np.concatenate([allowed[:1], allowed[:-1]])
        is_hit = (clearances < required_clearances).any(axis=1)
        self.hit = int(np.argmax(is_hit)) if is_hit.any() else len(places)  # the first place of a hit
        self.open: NDArray[np.bool_] = np.asarray((self.bound < allowed[:-1]).any(axis=1))
        self.open[self.hit :] = False
        is_divisible = np.diff(places) > _MIN_SHARE
        is_stuck = self.open & ~((self.bound < allowed[:-1]) & (motions >= STEP) & is_divisible[:, None]).any(axis=1)
        # the first undecided interval that is too small to halve
        self.stuck = int(np.argmax(is_stuck)) if is_stuck.any() else len(places)
        self.open[self.stuck :] = False
        self.lacking = np.where(self.bound < allowed[:-1], self.bound - allowed[:-1], np.inf)

    def to_halve(self, tight: bool) -> Array:
        """Places at which undecided intervals are split; empty when the proof is complete."""
        rows = np.flatnonzero(self.open)
        if tight and not len(rows):
            lowest = float(self.clearances.min())
            is_fine = lowest < 0.0 and len(self.places) < _FINE_SAMPLES
            gap = _DEPTH_GAP if is_fine else max(_GAP, _GAP_SHARE * abs(lowest))
            rows = np.flatnonzero(self.bound.min(axis=1) < lowest - gap)
        rows = rows[:_AT_ONCE]
        low, high = self.places[rows], self.places[rows + 1]
        cell_end = np.round((low + high) / 2)  # an interval of several cells is split at the end of a cell
        middle = np.where(high - low > 1.0, np.clip(cell_end, np.floor(low) + 1, np.ceil(high) - 1), (low + high) / 2)
        return np.asarray(middle[(middle > low) & (middle < high)])

    def result(self) -> Proof:
        """The result after the last refinement."""
        row, pair = divmod(int(np.argmin(self.bound)), self.bound.shape[1])
        index, mm = row + int(self.clearances[row + 1, pair] < self.clearances[row, pair]), float(self.bound[row, pair])
        count, is_free = len(self.places), self.stuck == self.hit == len(self.places)
        if self.stuck < count:
            index, pair = self.stuck, int(np.argmin(self.lacking[self.stuck]))
        elif self.hit < count:
            index, pair = self.hit, int(np.argmin(self.clearances[self.hit]))
        escaping = tuple(np.flatnonzero(self.start).tolist())
        place = float(self.places[index])
        return Proof(free=is_free, place=place, pair=pair, mm=mm, escaping=escaping, postures=count)
