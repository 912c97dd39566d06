"""What samples along the redundant joint show of some targets: runs of answers, and between which samples they change.

All that stands of every sample is asked for a few targets at a time, while it is in the cache; what is kept is little.
"""

from typing import NamedTuple, Self

import numpy as np

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.boundaries import on_both_sides
from armkin.inverse.redundant.interval_pieces import best_samples, holding_none, may_turn_back, runs
from armkin.inverse.redundant.other_joints import Follower, Sampled

AT_A_TIME = 8_000  # samples worked on at once: they stay in the cache


class Changes(NamedTuple):
    """Between which samples of branches flags change, and on which side they are set."""

    row: Int
    k: Int  # the sample before the change
    branch: Int
    set_before: Bool

    @classmethod
    def of(cls, flags: Bool) -> Self:
        """All of flags (N, K, B)."""
        row, k, branch = np.nonzero(flags != np.roll(flags, -1, axis=1))
        return cls(row, k, branch, flags[row, k, branch])

    def sample(self, offset: int, K: int) -> Int:
        """The sample 0, 1, ... steps from the side where they are set towards the other one; -1: away from it."""
        return np.asarray(np.where(self.set_before, self.k + offset, self.k + 1 - offset) % K)

    def value(self, offset: int, t: Array) -> Array:
        """The joint's value, of samples at t (N, K), where `sample` is; whole turns on if that goes over the end."""
        return value_at(t, self.row, np.where(self.set_before, self.k + offset, self.k + 1 - offset))


def value_at(t: Array, row: Int, k: Int) -> Array:
    """Values of the joint at samples k (M,) of targets (M,), whole turns on beyond the last one: t (N, K)."""
    turns, k = np.divmod(k, t.shape[1])
    return np.asarray(t[row, k] + 2 * np.pi * turns)


class BranchEnds(NamedTuple):
    """The G places along the redundant joint at which a branch appears or vanishes; each field has G rows."""

    at: Changes
    twin: Int  # the other branch that is nearest at the last sample with the branch
    apart: Array  # (G, 2) squared distance [rad^2] from the twin at that sample, and one sample before it
    room: Array  # distance [rad | mm] from the limits at that sample
    legal: Bool


class LimitCrossings(NamedTuple):
    """The C places at which a branch turns legal or illegal, at a limit or where it ends; each field has C rows."""

    at: Changes
    rooms: Array  # (C, 2) distance [rad | mm] from the limits at the legal sample and the next; nan without the branch


class PossibleCrossings(NamedTuple):
    """The T pairs of neighbouring samples between which a branch may cross a limit and come back."""

    row: Int
    k: Int
    branch: Int
    rooms: Array  # (T, 2) distance [rad | mm] from the limits at both samples


class SampleRuns(NamedTuple):
    """R runs of neighbouring samples at which a branch exists, or is legal; each field has R rows."""

    row: Int
    branch: Int
    first: Int
    length: Int
    best: Int  # the least costly sample, from the first one
    start: Array  # (R, n) its posture
    within: Bool  # whether one of them is legal


class Summary(NamedTuple):
    """All that samples of N targets show."""

    ends: BranchEnds
    crossings: LimitCrossings
    possible_crossings: PossibleCrossings
    legal_runs: SampleRuns
    present_runs: SampleRuns
    has_hidden: Bool  # (N,) branches seem to be there between two values at which they are not
    is_lost: Bool  # (N,) none is there at any of them
    is_short: Bool  # (N,) no joint moves by REACH along any
    t: Array  # (N, K) the samples' values of the joint


def summary_of_samples(follower: Follower, t: Array, places: Array | None = None) -> Summary:
    """What samples of all targets along t (K,) show, and those beside all places (N, V) where something may change."""
    N = len(follower.target)
    at_once = max(AT_A_TIME // len(t), 1)
    parts = (np.arange(k, min(k + at_once, N)) for k in range(0, max(N, 1), at_once))
    if places is None:
        return stack_rows([_summarise(follower.samples_at(rows, t), rows, False) for rows in parts])
    extra = on_both_sides(places)
    return stack_rows([_summarise(follower.samples_at(rows, t, extra[rows]), rows, True) for rows in parts])


def place_between(t: Array, changes: Changes, places: Array) -> Array:
    """The place, of (N, V) on a turn, of each change (M,) between samples at t (N, K); inf where there is none."""
    low, nearby = value_at(t, changes.row, changes.k)[:, None], places[changes.row]
    width = value_at(t, changes.row, changes.k + 1)[:, None] - low
    with np.errstate(invalid="ignore"):
        distance = np.remainder(nearby - low, 2 * np.pi)
        return np.asarray(np.where(distance <= width, low + distance, np.inf).min(axis=1, initial=np.inf))


def _summarise(sampled: Sampled, rows: Int, complete: bool) -> Summary:
    """What samples of some targets, rows (S,) of all, show; complete: nothing happens between them that they do not."""
    valid, legal, room = sampled.valid, sampled.legal, sampled.room
    gone, crossed = Changes.of(valid), Changes.of(legal)
    K, every = valid.shape[1], np.arange(len(gone.row))
    last, previous = gone.sample(0, K), gone.sample(-1, K)
    twin, gap = nearest_other(sampled.postures(gone.row, last), gone.branch)[1:]
    postures = sampled.postures(gone.row, previous)
    gap_back = np.where(np.isnan(postures[every, gone.branch, 0]), np.nan, nearest_other(postures, gone.branch)[2])
    cells = gone.row, last, gone.branch
    rooms = [room[crossed.row, crossed.sample(k, K), crossed.branch] for k in (0, 1)]
    row, k, branch = turns = np.nonzero(np.zeros_like(valid) if complete else may_turn_back(room, sampled.t))
    hidden: Bool = np.zeros(len(rows), bool)
    if not complete:
        misses = np.where(valid, np.nan, -np.sqrt(sampled.missed))
        hidden = np.asarray(may_turn_back(misses, sampled.t).any(axis=(1, 2)))
    present = _runs(sampled, valid, rows)
    return Summary(
        BranchEnds(
            gone._replace(row=rows[gone.row]), twin, np.stack([gap, gap_back], axis=1), room[cells], legal[cells]
        ),
        LimitCrossings(crossed._replace(row=rows[crossed.row]), np.stack(rooms, axis=1)),
        PossibleCrossings(rows[row], k, branch, np.stack([room[turns], room[row, (k + 1) % K, branch]], axis=1)),
        _runs(sampled, legal, rows),
        present,
        hidden,
        np.asarray(~valid.any(axis=(1, 2))),
        _all_short(sampled, present.row - rows[0], present.first, present.length) if len(rows) else np.zeros(0, bool),
        sampled.t,
    )


def nearest_other(q: Array, branch: Int) -> tuple[Array, Int, Array]:
    """The nearest other of postures (M, B, n) to branches (M,): joint changes (M, n), number (M,), distance^2 (M,)."""
    index = np.arange(len(q))
    change = wrap_angle(q - q[index, branch][:, None])
    square = (change**2).sum(axis=2)
    square[index, branch] = np.inf
    square = np.where(np.isnan(square), np.inf, square)
    nearest = square.argmin(axis=1)
    return change[index, nearest], nearest, square[index, nearest]


def _runs(sampled: Sampled, mask: Bool, rows: Int) -> SampleRuns:
    """The runs of samples of a mask (S, K, B)."""
    K, B = mask.shape[1:]
    samples, legal = (flags.transpose(0, 2, 1).reshape(-1, K) for flags in (mask, sampled.legal))
    cost = sampled.cost.transpose(0, 2, 1).reshape(-1, K)
    curve, first, length = runs(samples, np.zeros_like(samples))
    best_sample = best_samples(cost, curve, first, length) if len(curve) else first
    row, branch = curve // B, curve % B
    start = sampled.postures(row, (first + best_sample) % K)[np.arange(len(row)), branch]
    return SampleRuns(rows[row], branch, first, length, best_sample, start, ~holding_none(legal, curve, first, length))


def _all_short(sampled: Sampled, row: Int, first: Int, length: Int) -> Bool:
    """Whether no joint moves by REACH along any family of a target (S,), of which runs (R,) of samples are there."""
    over_reach = value_at(sampled.t, row, first + length - 1) - value_at(sampled.t, row, first) > tol.REACH
    is_short = np.asarray(sampled.valid.any(axis=(1, 2)))
    is_short[row[over_reach]] = False
    for k in np.flatnonzero(is_short).tolist():
        K, valid = sampled.valid.shape[1], sampled.valid[k]
        q = sampled.postures(np.full(K, k), np.arange(K))
        step = np.abs(wrap_angle(np.roll(q, -1, axis=0) - q))
        travel = np.where((valid & np.roll(valid, -1, axis=0))[..., None], np.nan_to_num(step), 0.0).sum(axis=0)
        is_short[k] = 2.0 * travel.max(initial=0.0) < tol.REACH
    return is_short
