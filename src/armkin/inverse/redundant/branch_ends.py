"""Where branches that are followed along the redundant joint end: two merge, or a limit is crossed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Int
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.interval_pieces import golden_section, margin
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.redundant.samples import Changes, Gone, Summary, Turns, nearest_other, value_at

HALVINGS = 60  # steps, at most, to where a branch ends
SECANTS = 24  # secant steps to a branch's end, of which the later ones halve
BACK = 0.1  # share of what is left, from past an end, by which a step goes back to where the branch is
MERGING = 0.01  # squared distance [rad^2] below which branches may merge
PEAK = 12  # steps to where a branch is nearest to its limits, or farthest beyond them


class _Ends:
    """Places where branches end to be good, each between a value that is and one that is not.

    of_limits: a limit is crossed there; else the branch merges with another one, and both vanish.
    """

    def __init__(self, follower: Follower, row: Int, branch: Int, of_limits: bool) -> None:
        self.follower, self.of_limits = follower, of_limits
        self.row, self.branch = row, branch

    def room_at(self, ends: Int, value: Array) -> Array:
        """How good ends (M,) are at values (M,): positive where they are, linear about the end, nan where the branch is
        not there.

        The way to the limits [rad], or the squared distance of the nearest other branch.
        """
        row, branch = self.row[ends], self.branch[ends]
        if self.of_limits:
            return margin(self.follower.arm, self.follower.own(row, branch, value))
        q = self.follower.branches_at(row, value)
        *_, apart = nearest_other(q, branch)
        return np.asarray(np.where(np.isnan(q[np.arange(len(ends)), branch, 0]), np.nan, apart))

    def between(self, good: Array, bad: Array, before: Array, rooms: tuple[Array, Array, Array]) -> Array:
        """Where each ends (M,): good and bad are the values on its sides, before lies beyond good.

        By secants: across the end where the branch is there on both sides, else from the side where it is.
        """
        lo, hi, last = good.copy(), bad.copy(), before.copy()
        at_lo, at_hi, at_last = np.maximum(rooms[0], tol.TINY), rooms[1].copy(), rooms[2].copy()
        value, going = 0.5 * (lo + hi), np.arange(len(lo))
        over, side = np.zeros(len(lo), bool), np.zeros(len(lo), bool)
        for k in range(HALVINGS):
            low, high = lo[going], hi[going]
            a, b, c = at_lo[going], at_hi[going], at_last[going]
            with np.errstate(invalid="ignore", divide="ignore"):
                across = low + (high - low) * a / (a - b)
                along = low + (low - last[going]) * a / (c - a)
                guess = np.where(b <= 0, across, along)
                inside = ((guess - low) * (high - guess) > 0) & ~over[going] & (k < SECANTS)
            step = np.where(inside, np.abs(guess - value[going]), np.abs(high - low))
            # where a secant along the branch has gone past the end, the end is close by
            guess = np.where(inside, guess, np.where(over[going], high - BACK * (high - low), 0.5 * (low + high)))
            value[going] = np.where(b == 0, high, np.where(inside | ~over[going], guess, value[going]))
            left = (step > tol.SAME_END) & (b != 0)
            going, guess, inside = going[left], guess[left], inside[left]
            if not len(going):
                break
            room = self.room_at(going, guess)
            left = ~(np.abs(room) < tol.NO_ROOM)
            going, guess = going[left], guess[left]
            inside, room = inside[left], room[left]
            better = room > 0
            over[going] = inside & np.isnan(room)
            # the Illinois rule: the value of an end that has stayed twice is halved
            at_hi[going[better & side[going]]] *= 0.5
            at_lo[going[~better & ~side[going]]] *= 0.5
            side[going] = better
            moved = going[better]
            last[moved], at_last[moved] = lo[moved], at_lo[moved]
            lo[moved], at_lo[moved] = guess[better], room[better]
            moved = going[~better]
            hi[moved], at_hi[moved] = guess[~better], room[~better]
        return value


def crossed_at(follower: Follower, changes: Changes, value: Array) -> Array:
    """Where limits are crossed (M,), known but for the rounding of their polynomials: a secant step in the joints."""
    h, own = tol.BESIDE_CROSSING, follower.own
    near, far = (margin(follower.arm, own(changes.row, changes.branch, place)) for place in (value, value + h))
    with np.errstate(invalid="ignore", divide="ignore"):
        step = near * h / (near - far)
        return np.asarray(np.where(np.abs(step) < h, value + step, value))


def hidden_stretches(follower: Follower, t: Array, turns: Turns) -> tuple[Changes, Array]:
    """Stretches (S,) that lie between two samples: legal ones (set_before: no), and such as are not between legal ones
    (yes); where both begin and end (2, S)."""
    row, k, branch, room = turns
    sign = np.sign(room[:, 0])
    rows = _Ends(follower, row, branch, True)
    every = np.arange(len(row))

    def depth(value: Array) -> Array:
        """Below zero: such a stretch."""
        return sign * rows.room_at(every, value)

    begin, end = value_at(t, row, k), value_at(t, row, k + 1)
    _, _, peak, least = golden_section(depth, begin, end, PEAK)
    top = -least
    hidden = np.flatnonzero(top > 0)
    row, k, branch = row[hidden], k[hidden], branch[hidden]
    sign, peak, top = sign[hidden], peak[hidden], top[hidden]
    beside = _Ends(follower, np.tile(row, 2), np.tile(branch, 2), True)
    at_sample = room[hidden].T.ravel()
    outer, inner = np.concatenate([begin[hidden], end[hidden]]), np.tile(peak, 2)
    inside = np.tile(sign < 0, 2)  # the stretch is the legal one
    good, bad = np.where(inside, inner, outer), np.where(inside, outer, inner)
    at_inner = np.tile(-sign * top, 2)
    rooms = np.where(inside, at_inner, at_sample), np.where(inside, at_sample, at_inner)
    ends = beside.between(good, bad, good, (*rooms, np.full(len(good), np.nan)))
    return Changes(row, k, branch, sign > 0), ends.reshape(2, -1)


def _merging_ends(follower: Follower, t: Array, gone: Gone) -> tuple[Array, Array]:
    """Where branches end to be there (G,), in the order of `Gone`, and how far within limits they are then.

    Of two that are nearest to each other before both vanish one is asked, if it has joined the other one there.
    """
    changes, every = gone.at, np.arange(len(gone.twin))
    good = changes.value(0, t)
    number = {key: i for i, key in enumerate(zip(*(column.tolist() for column in changes), strict=True))}
    whose = zip(changes.row.tolist(), changes.k.tolist(), gone.twin.tolist(), changes.set_before.tolist(), strict=True)
    twin = np.array([number.get(key, i) for i, key in enumerate(whose)], np.intp)
    first = np.where((twin < every) & (twin[twin] == every), twin, every)  # which end is asked for each
    value, room, joined = np.empty(len(every)), np.empty(len(every)), np.zeros(len(every), bool)
    leaders = np.flatnonzero(first == every)
    while len(leaders):
        ends = _Ends(follower, changes.row[leaders], changes.branch[leaders], False)
        rooms = gone.apart[leaders, 0], np.full(len(leaders), np.nan), gone.apart[leaders, 1]
        value[leaders] = ends.between(good[leaders], changes.value(1, t)[leaders], changes.value(-1, t)[leaders], rooms)
        rows = np.flatnonzero(~joined & np.isin(first, leaders))
        value[rows] = value[first[rows]]
        back = np.clip(good[rows] - value[rows], -tol.BEFORE_MERGING, tol.BEFORE_MERGING)
        q = follower.branches_at(changes.row[rows], value[rows] + back)
        away, _, apart = nearest_other(q, changes.branch[rows])
        mine = q[np.arange(len(rows)), changes.branch[rows]]
        present = ~np.isnan(mine[:, 0])
        middle = margin(follower.arm, mine + 0.5 * np.where(apart < MERGING, 1.0, 0.0)[:, None] * np.nan_to_num(away))
        room[rows] = np.where(present, middle, gone.room[rows])
        joined[rows] = (first[rows] == rows) | (present & (apart <= tol.JOINED * gone.apart[rows, 0]))
        leaders = rows[~joined[rows]]
        first[leaders] = leaders
    return value, room


class Places(NamedTuple):
    """Where curves end: the values at which branches end to be there, and to be legal, or begin to, of all changes."""

    there: Array
    legal: Array
    short: Changes  # the ends of branches that legal stretches lie at that hold no sample
    ends: tuple[Array, Array]  # where the branch ends, and where its limit is crossed


def places_of(follower: Follower, shown: Summary) -> Places:
    """All ends of some targets.

    Where two branches merge both are legal, or none: one that is not at the next sample is for a stretch.
    """
    t, gone, illegal = shown.t, shown.gone.at, shown.crossed.at
    merged, room = _merging_ends(follower, t, shown.gone)
    inside, outside = shown.crossed.rooms.T
    # which of the branches that are not legal at the next sample end there, too, and where
    ending = np.isnan(outside)
    place = np.zeros(len(ending), np.intp)
    place[ending] = number_of(gone, illegal.row[ending], illegal.k[ending], illegal.branch[ending], t.shape[1])
    if len(gone.row):
        outside = np.where(ending, room[place], outside)
    to_end = ending & (outside >= 0.0)
    legal = np.empty(len(ending))
    legal[to_end] = merged[place[to_end]]
    crossing, place = rows_of(illegal, ~to_end), place[~to_end]
    lone = (room >= 0.0) & ~shown.gone.legal
    short = rows_of(gone, lone)
    row, branch = np.concatenate([crossing.row, short.row]), np.concatenate([crossing.branch, short.branch])
    far = crossing.value(1, t)
    if len(gone.row):
        far = np.where(ending[~to_end], merged[place], far)
    good, bad = np.concatenate([crossing.value(0, t), merged[lone]]), np.concatenate([far, short.value(0, t)])
    at_good = np.concatenate([inside[~to_end], room[lone]])
    rooms = at_good, np.concatenate([outside[~to_end], shown.gone.room[lone]]), np.full(len(row), np.nan)
    crossed = _Ends(follower, row, branch, True).between(good, bad, good, rooms)
    legal[~to_end] = crossed[: len(crossing.row)]
    return Places(merged, legal, short, (merged[lone], crossed[len(crossing.row) :]))


def number_of(changes: Changes, row: Int, k: Int, branch: Int, K: int) -> Int:
    """Which of changes, in their order, are those behind samples k (M,) of K; of some that are among them."""
    B = 1 + int(max(changes.branch.max(initial=0), branch.max(initial=0)))
    return np.searchsorted((changes.row * K + changes.k) * B + changes.branch, (row * K + k) * B + branch)
