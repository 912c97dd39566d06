"""Where branches that are followed along the redundant joint end: two merge, or a limit is crossed."""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.interval_pieces import golden_section, margin
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.redundant.samples import BranchEnds, Changes, PossibleCrossings, Summary, nearest_other, value_at

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
        """How good ends (M,) are at values (M,): positive where they are, linear about the end, nan without the branch.

        The way to the limits [rad], or the squared distance of the nearest other branch.
        """
        row, branch = self.row[ends], self.branch[ends]
        if self.of_limits:
            return margin(self.follower.arm, self.follower.own(row, branch, value))
        q = self.follower.branches_at(row, value)
        *_, gap = nearest_other(q, branch)
        return np.asarray(np.where(np.isnan(q[np.arange(len(ends)), branch, 0]), np.nan, gap))

    def between(self, valid: Array, invalid: Array, previous: Array, rooms: tuple[Array, Array, Array]) -> Array:
        """Where each ends (M,): valid and invalid are values on its sides, previous lies beyond valid.

        By secants: across the end where the branch is there on both sides, else from the side where it is.
        """
        bracket = _Bracket(valid, invalid, previous, rooms)
        value, active = 0.5 * (valid + invalid), np.arange(len(valid))
        for k in range(HALVINGS):
            guess, fits = bracket.guess(active, may_be_secant=k < SECANTS)
            width = np.abs(bracket.high[active] - bracket.low[active])
            step, at_high = np.where(fits, np.abs(guess - value[active]), width), bracket.at_high[active]
            moves = fits | ~bracket.overshot[active]
            value[active] = np.where(at_high == 0, bracket.high[active], np.where(moves, guess, value[active]))
            keep = (step > tol.SAME_END) & (at_high != 0)
            active, guess, fits = active[keep], guess[keep], fits[keep]
            if not len(active):
                break
            room = self.room_at(active, guess)
            keep = ~(np.abs(room) < tol.NO_ROOM)
            active = active[keep]
            bracket.narrow(active, guess[keep], room[keep], fits[keep])
        return value


class _Bracket:
    """Values low and high (M,) between which ends are, valid and not; last, the value before low; the rooms there."""

    def __init__(self, valid: Array, invalid: Array, previous: Array, rooms: tuple[Array, Array, Array]) -> None:
        self.low, self.high, self.last = valid.copy(), invalid.copy(), previous.copy()
        self.at_low, self.at_high, self.at_last = np.maximum(rooms[0], tol.TINY), rooms[1].copy(), rooms[2].copy()
        # (M,) whether the last secant along the branch went past the end; whether the last guess was valid
        self.overshot, self.was_valid = np.zeros((2, len(valid)), bool)

    def guess(self, active: Int, may_be_secant: bool) -> tuple[Array, Bool]:
        """Where those that are active (m,) end by a secant, if that fits (m,), else between low and high."""
        low, high, last = self.low[active], self.high[active], self.last[active]
        a, b, c = self.at_low[active], self.at_high[active], self.at_last[active]
        overshot = self.overshot[active]
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = low + (high - low) * a / (a - b)
            extrapolated = low + (low - last) * a / (c - a)
            guess = np.where(b <= 0, secant, extrapolated)
            fits: Bool = np.asarray(((guess - low) * (high - guess) > 0) & ~overshot & may_be_secant)
        # where a secant along the branch has gone past the end, the end is close by
        between = np.where(overshot, high - BACK * (high - low), 0.5 * (low + high))
        return np.where(fits, guess, between), fits

    def narrow(self, active: Int, value: Array, room: Array, fits: Bool) -> None:
        """Take values (m,) of those that are active, and the rooms there, for the nearer side of their ends."""
        is_valid = room > 0
        self.overshot[active] = fits & np.isnan(room)
        # the Illinois rule: the value of an end that has stayed twice is halved
        self.at_high[active[is_valid & self.was_valid[active]]] *= 0.5
        self.at_low[active[~is_valid & ~self.was_valid[active]]] *= 0.5
        self.was_valid[active] = is_valid
        rows = active[is_valid]
        self.last[rows], self.at_last[rows] = self.low[rows], self.at_low[rows]
        self.low[rows], self.at_low[rows] = value[is_valid], room[is_valid]
        rows = active[~is_valid]
        self.high[rows], self.at_high[rows] = value[~is_valid], room[~is_valid]


def crossed_at(follower: Follower, changes: Changes, value: Array) -> Array:
    """Where limits are crossed (M,), known but for the rounding of their polynomials: a secant step in the joints."""
    h, joints = tol.BESIDE_CROSSING, follower.own
    m0, m1 = (margin(follower.arm, joints(changes.row, changes.branch, place)) for place in (value, value + h))
    with np.errstate(invalid="ignore", divide="ignore"):
        step = m0 * h / (m0 - m1)
        return np.asarray(np.where(np.abs(step) < h, value + step, value))


def hidden_stretches(follower: Follower, t: Array, turns: PossibleCrossings) -> tuple[Changes, Array]:
    """Stretches (S,) between two samples, legal ones (set_before: no) or gaps (yes), and their two ends (2, S)."""
    row, k, branch, room = turns
    sign = np.sign(room[:, 0])
    rows = _Ends(follower, row, branch, True)
    every = np.arange(len(row))

    def depth(value: Array) -> Array:
        """Below zero: such a stretch."""
        return sign * rows.room_at(every, value)

    begin, end = value_at(t, row, k), value_at(t, row, k + 1)
    _, _, peak, min_depth = golden_section(depth, begin, end, PEAK)
    top = -min_depth
    hidden = np.flatnonzero(top > 0)
    row, k, branch = row[hidden], k[hidden], branch[hidden]
    sign, peak, top = sign[hidden], peak[hidden], top[hidden]
    sides = _Ends(follower, np.tile(row, 2), np.tile(branch, 2), True)
    at_sample = room[hidden].T.ravel()
    outer, inner = np.concatenate([begin[hidden], end[hidden]]), np.tile(peak, 2)
    is_legal = np.tile(sign < 0, 2)  # the stretch is the legal one
    valid, invalid = np.where(is_legal, inner, outer), np.where(is_legal, outer, inner)
    at_inner = np.tile(-sign * top, 2)
    rooms = np.where(is_legal, at_inner, at_sample), np.where(is_legal, at_sample, at_inner)
    ends = sides.between(valid, invalid, valid, (*rooms, np.full(len(valid), np.nan)))
    return Changes(row, k, branch, sign > 0), ends.reshape(2, -1)


def _merging_ends(follower: Follower, t: Array, gone: BranchEnds) -> tuple[Array, Array]:
    """Where branches end to be there (G,), in the order of `BranchEnds`, and how far within limits they are then.

    Of two that are nearest to each other before both vanish one is asked, if it has joined the other one there.
    """
    changes, every = gone.at, np.arange(len(gone.twin))
    last = changes.value(0, t)
    number = {key: i for i, key in enumerate(zip(*(column.tolist() for column in changes), strict=True))}
    keys = zip(changes.row.tolist(), changes.k.tolist(), gone.twin.tolist(), changes.set_before.tolist(), strict=True)
    twin = np.array([number.get(key, i) for i, key in enumerate(keys)], np.intp)
    first = np.where((twin < every) & (twin[twin] == every), twin, every)  # which end is asked for each
    value, room, met = np.empty(len(every)), np.empty(len(every)), np.zeros(len(every), bool)
    leaders = np.flatnonzero(first == every)
    while len(leaders):
        ends = _Ends(follower, changes.row[leaders], changes.branch[leaders], False)
        rooms = gone.apart[leaders, 0], np.full(len(leaders), np.nan), gone.apart[leaders, 1]
        value[leaders] = ends.between(last[leaders], changes.value(1, t)[leaders], changes.value(-1, t)[leaders], rooms)
        rows = np.flatnonzero(~met & np.isin(first, leaders))
        value[rows] = value[first[rows]]
        offset = np.clip(last[rows] - value[rows], -tol.BEFORE_MERGING, tol.BEFORE_MERGING)
        q = follower.branches_at(changes.row[rows], value[rows] + offset)
        step, _, gaps = nearest_other(q, changes.branch[rows])
        joints = q[np.arange(len(rows)), changes.branch[rows]]
        present = ~np.isnan(joints[:, 0])
        middle = margin(follower.arm, joints + 0.5 * np.where(gaps < MERGING, 1.0, 0.0)[:, None] * np.nan_to_num(step))
        room[rows] = np.where(present, middle, gone.room[rows])
        met[rows] = (first[rows] == rows) | (present & (gaps <= tol.JOINED_SHARE * gone.apart[rows, 0]))
        leaders = rows[~met[rows]]
        first[leaders] = leaders
    return value, room


class Places(NamedTuple):
    """Where curves end: the values at which branches end to be there, and to be legal, or begin to, of all changes."""

    there: Array
    legal: Array
    short: Changes  # the ends of branches that legal stretches lie at that hold no sample
    ends: tuple[Array, Array]  # where the branch ends, and where its limit is crossed


def places_of(follower: Follower, summary: Summary) -> Places:
    """All ends of some targets.

    Where two branches merge both are legal, or none: one that is not at the next sample is for a stretch.
    """
    t, vanishing, illegal = summary.t, summary.ends.at, summary.crossings.at
    merging, room = _merging_ends(follower, t, summary.ends)
    room0, room1 = summary.crossings.rooms.T
    # which of the branches that are not legal at the next sample end there, too, and where
    ending = np.isnan(room1)
    place = np.zeros(len(ending), np.intp)
    place[ending] = number_of(vanishing, illegal.row[ending], illegal.k[ending], illegal.branch[ending], t.shape[1])
    if len(vanishing.row):
        room1 = np.where(ending, room[place], room1)
    to_end = ending & (room1 >= 0.0)
    legal = np.empty(len(ending))
    legal[to_end] = merging[place[to_end]]
    crossing, place = rows_of(illegal, ~to_end), place[~to_end]
    single = (room >= 0.0) & ~summary.ends.legal
    short = rows_of(vanishing, single)
    row, branch = np.concatenate([crossing.row, short.row]), np.concatenate([crossing.branch, short.branch])
    end = crossing.value(1, t)
    if len(vanishing.row):
        end = np.where(ending[~to_end], merging[place], end)
    inner, outer = np.concatenate([crossing.value(0, t), merging[single]]), np.concatenate([end, short.value(0, t)])
    at_inner = np.concatenate([room0[~to_end], room[single]])
    rooms = at_inner, np.concatenate([room1[~to_end], summary.ends.room[single]]), np.full(len(row), np.nan)
    crossed = _Ends(follower, row, branch, True).between(inner, outer, inner, rooms)
    legal[~to_end] = crossed[: len(crossing.row)]
    return Places(merging, legal, short, (merging[single], crossed[len(crossing.row) :]))


def number_of(changes: Changes, row: Int, k: Int, branch: Int, K: int) -> Int:
    """Which of changes, in their order, are those behind samples k (M,) of K; of some that are among them."""
    B = 1 + int(max(changes.branch.max(initial=0), branch.max(initial=0)))
    return np.searchsorted((changes.row * K + changes.k) * B + changes.branch, (row * K + k) * B + branch)
