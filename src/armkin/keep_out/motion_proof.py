"""A motion proved free between its samples.

Between two places no pair comes nearer than half the sum of its clearances there, less half of how far its bodies
move in between: from either end they can have used up only what they moved. Where that is not enough the interval
is halved; what is still open when the bodies move less than `STEP` is a hit.

A pair that is too near at the start may only get farther: its depth grows nowhere by more than `STEP`, and once free
it stays free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.keep_out.displacement_bounds import levers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.keep_out.body_pairs import Guard
    from armkin.keep_out.motion_geometry import Way

STEP = 0.01  # motion [mm] that is not looked into any further
_FIRST = 16  # intervals that a proof begins with
_AT_ONCE = 1024  # intervals that are halved together, the earliest ones: a hit is found before all is looked into
_MIN_SHARE = 1e-9  # share of a cell below which no interval is halved
_STRIDES = (64, 8, 1)  # strides of the samples that are looked at first, and in between
_GAPS = (0.5, 0.05)  # gap [mm], and share of the least clearance, by which the bound may be below what was seen


@dataclass(frozen=True)
class Proof:
    """What was found of a motion.

    free: nothing is hit, pairs that were too near at the start apart. place: of the first hit, or of the least
    clearance; pair: its index, None where nothing counts; mm: a lower bound of the clearance of all other pairs over
    the whole motion, or the clearance at the hit; escaping: pairs that were too near at the start; postures: looked at.
    """

    free: bool
    place: float
    pair: int | None
    mm: float
    escaping: tuple[int, ...]
    postures: int


def prove_motion(guard: Guard, way: Way, *, tight: bool = False, ignored_pairs: tuple[int, ...] | None = None) -> Proof:
    """Prove a motion free, or find its first hit.

    tight: look on until the bound of the clearance is near the least that was seen. ignored_pairs: those that may be
    too near to begin with, by default those that are.
    """
    if not guard.pairs:
        return Proof(free=True, place=0.0, pair=None, mm=np.inf, escaping=(), postures=0)
    places = np.unique(np.round(np.linspace(0.0, way.cells, min(way.cells, _FIRST) + 1)))
    q = way.joints_at(places)
    slide_out = np.abs(q).max(axis=0) + way.variation(np.zeros(1), np.array([float(way.cells)]))[0]
    lever = levers(guard, slide_out)
    apart = guard.clearances(q)
    start = apart[0] < 0.0
    if ignored_pairs is not None:
        start = start & np.isin(np.arange(len(start)), ignored_pairs)
    while True:
        round_ = _Round(places, apart, way.variation(places[:-1], places[1:]) @ lever, start)
        middle = round_.to_halve(tight)
        if not len(middle):
            return round_.result()
        q = way.joints_at(middle)
        positions = np.searchsorted(places, middle)
        places = np.insert(places, positions, middle)
        apart = np.insert(apart, positions, guard.clearances(q), axis=0)


def hit_samples(guard: Guard, q: Array) -> NDArray[np.bool_]:
    """Which of many neighbouring postures (N, n) hit something; most are told by those that stand some way off."""
    count = len(q)
    hit: NDArray[np.bool_] = np.zeros(count, np.bool_)
    if not guard.pairs or not count:
        return hit
    gone = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(np.abs(np.diff(q, axis=0)), axis=0)])
    lever = levers(guard, np.abs(q).max(axis=0))
    samples = np.arange(0, count, _STRIDES[0])
    samples = np.append(samples, count - 1) if samples[-1] < count - 1 else samples
    apart = guard.clearances(q[samples])
    for stride in (*_STRIDES[1:], 0):
        hit[samples] = (apart < 0).any(axis=1)
        free = (apart[:-1] + apart[1:] >= (gone[samples[1:]] - gone[samples[:-1]]) @ lever).all(axis=1)
        rows = np.flatnonzero(~free & (np.diff(samples) > 1))
        if not stride or not len(rows):
            break
        added = np.concatenate([np.arange(samples[k] + stride, samples[k + 1], stride) for k in rows])
        at = np.searchsorted(samples, added)
        samples, apart = np.insert(samples, at, added), np.insert(apart, at, guard.clearances(q[added]), axis=0)
    return hit


class _Round:
    """What is known once `clearances` (N, pairs) stand at places (N,), with bodies moving by `moved` between."""

    def __init__(self, places: Array, clearances: Array, moved: Array, start: NDArray[np.bool_]) -> None:
        self.places, self.clearances, self.start = places, clearances, start
        self.bound = (clearances[:-1] + clearances[1:] - moved) / 2
        best = np.maximum.accumulate(clearances, axis=0)
        least = np.where(start & (best < 0.0), best - STEP, 0.0)  # what a pair has to keep from here on
        required = np.concatenate([least[:1], least[:-1]])
        bad = (clearances < required).any(axis=1)
        self.hit = int(np.argmax(bad)) if bad.any() else len(places)  # the first place that is one
        self.open: NDArray[np.bool_] = np.asarray((self.bound < least[:-1]).any(axis=1))
        self.open[self.hit :] = False
        wide = np.diff(places) > _MIN_SHARE
        stuck = self.open & ~((self.bound < least[:-1]) & (moved >= STEP) & wide[:, None]).any(axis=1)
        self.stuck = int(np.argmax(stuck)) if stuck.any() else len(places)  # the first interval that ends undecided
        self.open[self.stuck :] = False
        self.lacking = np.where(self.bound < least[:-1], self.bound - least[:-1], np.inf)

    def to_halve(self, tight: bool) -> Array:
        """Places between, of the intervals that are still open; none when all is known."""
        rows = np.flatnonzero(self.open)
        if tight and not len(rows) and self.hit == self.stuck == len(self.places):
            bounds = np.where(self.start, np.inf, self.bound).min(axis=1, initial=np.inf)
            seen = float(np.where(self.start, np.inf, self.clearances).min(initial=np.inf))
            rows = np.flatnonzero(bounds < seen - max(_GAPS[0], _GAPS[1] * seen)) if np.isfinite(seen) else rows
        rows = rows[:_AT_ONCE]
        low, high = self.places[rows], self.places[rows + 1]
        cell_end = np.round((low + high) / 2)  # a cell's end, where several cells are between
        middle = np.where(high - low > 1.0, np.clip(cell_end, np.floor(low) + 1, np.ceil(high) - 1), (low + high) / 2)
        return np.asarray(middle[(middle > low) & (middle < high)])

    def result(self) -> Proof:
        """What has come out."""
        escaping = tuple(np.flatnonzero(self.start).tolist())
        count = len(self.places)
        if self.stuck < count:
            pair = int(np.argmin(self.lacking[self.stuck]))
            least_clearance = float(self.clearances[self.stuck : self.stuck + 2, pair].min())
            return Proof(
                free=False,
                place=float(self.places[self.stuck]),
                pair=pair,
                mm=least_clearance,
                escaping=escaping,
                postures=count,
            )
        if self.hit < count:
            pair = int(np.argmin(self.clearances[self.hit]))
            return Proof(
                free=False,
                place=float(self.places[self.hit]),
                pair=pair,
                mm=float(self.clearances[self.hit, pair]),
                escaping=escaping,
                postures=count,
            )
        bound = np.where(self.start, np.inf, self.bound)
        if not len(bound) or not np.isfinite(bound).any():
            pair = int(np.argmin(self.clearances[0]))
            return Proof(
                free=True,
                place=0.0,
                pair=pair,
                mm=float(self.clearances[:, pair].min()),
                escaping=escaping,
                postures=count,
            )
        row, pair = divmod(int(np.argmin(bound)), bound.shape[1])
        nearer = row + int(self.clearances[row + 1, pair] < self.clearances[row, pair])
        return Proof(
            free=True,
            place=float(self.places[nearer]),
            pair=pair,
            mm=float(bound[row, pair]),
            escaping=escaping,
            postures=count,
        )
