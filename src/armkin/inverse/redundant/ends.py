"""Where branches that are followed along the redundant joint end: two merge, or a limit is crossed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, wrapped
from armkin.inverse.numeric.tolerances import BEFORE_MERGING, NO_ROOM, SAME_END, TINY
from armkin.inverse.redundant.pieces import Int, golden_section, margin

if TYPE_CHECKING:
    from armkin.inverse.redundant.follower import Follower, Samples

HALVINGS = 60  # steps to where a branch ends, at most
SECANTS = 24  # of which the later ones halve
BACK = 0.1  # of what is left, from past an end to where the branch is there
MERGING = 0.01  # [rad^2] branches that merge are less than so far apart
PEAK = 12  # steps to where a branch is nearest to its limits, or farthest beyond them


class _Ends:
    """Places where branches end to be good, each between a value that is and one that is not.

    of_limits: a limit is crossed there; else the branch merges with another one, and both vanish.
    """

    def __init__(self, find: Follower, row: Int, branch: Int, of_limits: bool) -> None:
        self.find, self.row, self.branch, self.of_limits = find, row, branch, of_limits

    def rooms(self, some: Int, q: Array) -> Array:
        """How good ends (M,) are at postures q (M, B, n) of all branches: positive where they are, linear about
        the end, nan where the branch is not there.

        The way to the limits [rad], or the squared distance of the nearest other branch.
        """
        index = np.arange(len(some))
        own = q[index, self.branch[some]]
        if self.of_limits:
            return margin(self.find.arm, own)
        _, apart = _beside(q, self.branch[some])
        return np.asarray(np.where(np.isnan(own[:, 0]), np.nan, apart))

    def between(self, good: Array, bad: Array, before: Array, rooms: tuple[Array, Array, Array]) -> Array:
        """Where each ends (M,): good and bad are the values on its sides, before lies beyond good.

        By secants: across the end where the branch is there on both sides, else from the side where it is.
        """
        lo, hi, last = good.copy(), bad.copy(), before.copy()
        at_lo, at_hi, at_last = np.maximum(rooms[0], TINY), rooms[1].copy(), rooms[2].copy()
        out, going = 0.5 * (lo + hi), np.arange(len(lo))
        over, side = np.zeros(len(lo), bool), np.zeros(len(lo), bool)
        for k in range(HALVINGS):
            low, high, a, b, c = lo[going], hi[going], at_lo[going], at_hi[going], at_last[going]
            with np.errstate(invalid="ignore", divide="ignore"):
                across = low + (high - low) * a / (a - b)
                along = low + (low - last[going]) * a / (c - a)
                guess = np.where(b <= 0, across, along)
                inside = ((guess - low) * (high - guess) > 0) & ~over[going] & (k < SECANTS)
            step = np.where(inside, np.abs(guess - out[going]), np.abs(high - low))
            # a secant along the branch that has gone past the end: it is close by
            guess = np.where(inside, guess, np.where(over[going], high - BACK * (high - low), 0.5 * (low + high)))
            out[going] = np.where(b == 0, high, np.where(inside | ~over[going], guess, out[going]))
            left = (step > SAME_END) & (b != 0)
            going, guess, inside = going[left], guess[left], inside[left]
            if not len(going):
                break
            room = self.rooms(going, self.find.found(self.row[going], guess))
            left = ~(np.abs(room) < NO_ROOM)
            going, guess, inside, room = going[left], guess[left], inside[left], room[left]
            better = room > 0
            over[going] = inside & np.isnan(room)
            # Illinois: an end that stays twice counts for half
            at_hi[going[better & side[going]]] *= 0.5
            at_lo[going[~better & ~side[going]]] *= 0.5
            side[going] = better
            some = going[better]
            last[some], at_last[some] = lo[some], at_lo[some]
            lo[some], at_lo[some] = guess[better], room[better]
            some = going[~better]
            hi[some], at_hi[some] = guess[~better], room[~better]
        return out


def _beside(q: Array, branch: Int) -> tuple[Array, Array]:
    """Of branches (M,) among postures (M, B, n) the nearest other one: how far its joints are (M, n), squared (M,)."""
    index = np.arange(len(q))
    away = wrapped(q - q[index, branch][:, None])
    apart = (away**2).sum(axis=2)
    apart[index, branch] = np.inf
    apart = np.where(np.isnan(apart), np.inf, apart)
    nearest = apart.argmin(axis=1)
    return away[index, nearest], apart[index, nearest]


class Changes(NamedTuple):
    """Between which samples (M,) flags (N, K, B) change, and on which side they are set."""

    row: Int
    k: Int  # the sample before the change
    branch: Int
    set_before: Bool

    @classmethod
    def of(cls, flags: Bool) -> Changes:
        row, k, branch = np.nonzero(flags != np.roll(flags, -1, axis=1))
        return cls(row, k, branch, flags[row, k, branch])

    def some(self, which: Bool) -> Changes:
        return Changes(self.row[which], self.k[which], self.branch[which], self.set_before[which])

    def sample(self, offset: int, K: int) -> Int:
        """The sample 0, 1, ... steps from the side where they are set towards the other one; -1: away from it."""
        return np.asarray(np.where(self.set_before, self.k + offset, self.k + 1 - offset) % K)

    def value(self, offset: int, t: Array) -> Array:
        """As `sample`, the value of the joint, not less than the first one's if it goes over the end."""
        return np.asarray(t[self.k] + (t[1] - t[0]) * np.where(self.set_before, offset, 1 - offset))


def hidden_stretches(find: Follower, t: Array, found: Samples) -> tuple[Changes, Array]:
    """Stretches (S,) that lie between two samples: legal ones (set_before: no), and such as are not between legal ones
    (yes); where both begin and end (2, S)."""
    room = found.room
    row, k, branch = np.nonzero(found.turns)
    sign = np.sign(room[row, k, branch])
    rows = _Ends(find, row, branch, True)
    every = np.arange(len(row))

    def depth(value: Array) -> Array:
        """Below zero: such a stretch."""
        return sign * rows.rooms(every, find.found(row, value))

    _, _, peak, least = golden_section(depth, t[k], t[k] + (t[1] - t[0]), PEAK)
    top = -least
    some = np.flatnonzero(top > 0)
    row, k, branch = row[some], k[some], branch[some]
    sign, peak, top = sign[some], peak[some], top[some]
    near = _Ends(find, np.tile(row, 2), np.tile(branch, 2), True)
    sample = np.concatenate([k, (k + 1) % len(t)])
    at_sample = room[near.row, sample, near.branch]
    outer, inner = np.concatenate([t[k], t[k] + (t[1] - t[0])]), np.tile(peak, 2)
    inside = np.tile(sign < 0, 2)  # the stretch is the legal one
    good, bad = np.where(inside, inner, outer), np.where(inside, outer, inner)
    at_inner = np.tile(-sign * top, 2)
    rooms = np.where(inside, at_inner, at_sample), np.where(inside, at_sample, at_inner)
    ends = near.between(good, bad, good, (*rooms, np.full(len(good), np.nan)))
    return Changes(row, k, branch, sign > 0), ends.reshape(2, -1)


class Places(NamedTuple):
    """Where curves end: the values at which branches of samples (N, K, B) end to be there, and to be legal, before the
    sample k + 1, or begin to; nan where nothing changes. And legal stretches that hold no sample."""

    there: Array
    legal: Array
    short: Changes  # the ends of branches that they lie at
    ends: tuple[Array, Array]  # of these: where the branch ends, and where its limit is crossed


def places_of(find: Follower, t: Array, found: Samples) -> Places:
    """All ends of some targets, of samples along t.

    Where two branches merge both are legal, or none: one that is not at the next sample is for a stretch.
    """
    K, arm = len(t), find.arm
    gone = Changes.of(found.valid)

    def at(of: Changes, offset: int) -> Array:
        return np.asarray(found.q[of.row, of.sample(offset, K)])

    ends = _Ends(find, gone.row, gone.branch, False)
    every = np.arange(len(gone.row))
    good, bad = gone.value(0, t), gone.value(1, t)
    rooms = ends.rooms(every, at(gone, 0)), np.full(len(every), np.nan), ends.rooms(every, at(gone, -1))
    merged = ends.between(good, bad, gone.value(-1, t), rooms)
    q = find.found(gone.row, merged + np.clip(good - merged, -BEFORE_MERGING, BEFORE_MERGING))
    away, apart = _beside(q, gone.branch)
    own = q[every, gone.branch] + 0.5 * np.where(apart < MERGING, 1.0, 0.0)[:, None] * np.nan_to_num(away)
    room = margin(arm, np.where(np.isnan(own), at(gone, 0)[every, gone.branch], own))
    there = np.full(found.valid.shape, np.nan)
    number = np.zeros(found.valid.shape, np.intp)
    place = gone.row, gone.k, gone.branch
    there[place], number[place] = merged, every

    illegal = Changes.of(found.legal)
    which = number[illegal.row, illegal.k, illegal.branch]
    beside = ~found.valid[illegal.row, illegal.sample(1, K), illegal.branch]  # the branch ends there, too
    to_end = beside & (room[which] >= 0.0) if len(every) else beside
    legal = np.full(found.valid.shape, np.nan)
    done = illegal.some(to_end)
    legal[done.row, done.k, done.branch] = merged[which[to_end]]
    crossing, which, beside = illegal.some(~to_end), which[~to_end], beside[~to_end]
    short = (room >= 0.0) & ~found.legal[gone.row, gone.sample(0, K), gone.branch]
    lone = gone.some(short)
    row, branch = np.concatenate([crossing.row, lone.row]), np.concatenate([crossing.branch, lone.branch])
    ends = _Ends(find, row, branch, True)

    def margins(of: Changes, offset: int) -> Array:
        return margin(arm, at(of, offset)[np.arange(len(of.row)), of.branch])

    far, outside = crossing.value(1, t), margins(crossing, 1)
    if len(every):
        far, outside = np.where(beside, merged[which], far), np.where(beside, room[which], outside)
    good = np.concatenate([crossing.value(0, t), merged[short]])
    bad = np.concatenate([far, lone.value(0, t)])
    rooms = (
        np.concatenate([margins(crossing, 0), room[short]]),
        np.concatenate([outside, margins(lone, 0)]),
        np.full(len(row), np.nan),
    )
    crossed = ends.between(good, bad, good, rooms)
    count = len(crossing.row)
    legal[crossing.row, crossing.k, crossing.branch] = crossed[:count]
    return Places(there, legal, lone, (merged[short], crossed[count:]))
