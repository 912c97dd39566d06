"""One joint more than the target asks for: curves of answers, as intervals of the redundant joint.

The redundant joint is the last or the first one, whichever leaves a closed form. Its motion only moves the target of
the other joints, T = Z(q) T' or T' Z(q), so one solver, prepared once, answers every value of it. Its answers are
followed along a whole turn by their branches; where a branch begins or ends to be real, or to be within limits, is
found by bisection. A family is a piece of the curve along which the joint is monotone; a row is a legal interval of
one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.followed import Follower, Ik, Postures
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import REACH, SOLUTION
from armkin.inverse.solvers.redundant import Redundancy, moved, redundancy
from armkin.inverse.tasks.task import distance, read_near, read_targets
from armkin.keep_out.clearance import clear
from armkin.model import units
from armkin.model.arm import actual

if TYPE_CHECKING:
    from armkin.model.arm import Arm

AT_ONCE = 24_000  # targets of the other joints solved together
FINER = 24  # times as many values where none had an answer
HALVINGS = 24  # of half a degree: 3e-8 degrees
GOLDEN = 34  # steps to the posture nearest to `near`
FREE = np.deg2rad(0.1)  # [rad] and reaches / 573: step between postures that are asked whether they are free


_Place = tuple[bool, int, int, int]  # legal, target, branch, sample


class _Pieces(NamedTuple):
    """Legal intervals, and families without one: of which target and branch (P,), ends a <= b (P,) [rad]."""

    row: NDArray[np.intp]
    branch: NDArray[np.intp]
    a: Array
    b: Array
    legal: Bool
    start: Array  # (P, n) the posture of some sample inside, the nearest to near
    at: Array  # (P,) its value of the redundant joint

    def of(self, some: Bool) -> _Pieces:
        """Some of them."""
        row, branch, a, b, legal, start, at = self
        return _Pieces(row[some], branch[some], a[some], b[some], legal[some], start[some], at[some])


def _ends(
    find: Follower, t: Array, found: Postures, kinds: dict[bool, Bool]
) -> dict[tuple[bool, int, int, int], float]:
    """Where good (N, K, B) changes between samples k and k + 1: where -> value of the joint.

    kinds: for legal postures and for those that are there which samples are good.
    """
    h = t[1] - t[0]
    places = [(legal, good, np.nonzero(good != np.roll(good, -1, axis=1))) for legal, good in kinds.items()]
    row, k, branch = (np.concatenate([place[i] for *_, place in places]) for i in range(3))
    inside = np.concatenate([good[place] for _, good, place in places])
    of_legal = np.concatenate([np.full(len(place[0]), legal) for legal, _, place in places])
    low = t[k]
    lo, hi = np.where(inside, low, low + h), np.where(inside, low + h, low)  # good at lo
    like = np.where(inside[:, None], found.q[row, k, branch], found.q[row, (k + 1) % len(t), branch])
    for _ in range(HALVINGS if len(row) else 0):
        middle = 0.5 * (lo + hi)
        there = find.one(row, branch, middle, like)
        keep = np.where(of_legal, there.legal, there.valid)
        lo, hi = np.where(keep, middle, lo), np.where(keep, hi, middle)
        like = np.where(keep[:, None], there.q, like)
    keys = zip(of_legal.tolist(), row.tolist(), branch.tolist(), k.tolist(), strict=True)
    return dict(zip(keys, lo.tolist(), strict=True))


def _pieces(find: Follower, t: Array, found: Postures) -> _Pieces:
    """All pieces of the curves of some targets."""
    K, h = len(t), float(t[1] - t[0])
    motion = find.motion(np.arange(len(find.target)), found.q)
    kinds = {True: found.legal, False: _families_without(found)}
    ends, rows = _ends(find, t, found, kinds), []
    costs = np.concatenate([motion, motion], axis=1).transpose(0, 2, 1).copy()  # a piece may pass the end of the turn
    for legal, good in kinds.items():
        first = good & ~np.roll(good, 1, axis=1)
        first[:, 0] |= good.all(axis=1)
        places = np.argwhere(first)
        counts = _lengths(good)[tuple(places.T)].tolist()
        for (row, k, branch), count in zip(places.tolist(), counts, strict=True):
            at = int(costs[row, branch, k : k + count].argmin())
            inside = t[k] + at * h
            if count == K:
                a, b = -np.pi, np.pi
            else:
                a, b = ends[legal, row, branch, (k - 1) % K], ends[legal, row, branch, (k + count - 1) % K]
                a, b = inside - (inside - a) % (2 * np.pi), inside + (b - inside) % (2 * np.pi)
            rows.append((row, branch, a, b, legal, found.q[row, (k + at) % K, branch], inside))
    if not rows:
        none = np.zeros(0)
        return _Pieces(none.astype(int), none.astype(int), none, none, none > 0, np.zeros((0, find.arm.n)), none)
    return _Pieces(*(np.array(column) for column in zip(*rows, strict=True)))


def _lengths(good: Bool) -> NDArray[np.intp]:
    """How many samples of good (N, K, B) follow one another from each on, itself included, K at most."""
    K = good.shape[1]
    index = np.arange(2 * K)[:, None]
    bad = np.where(np.concatenate([good, good], axis=1), 2 * K, index)
    next_bad = np.minimum.accumulate(bad[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(np.minimum(next_bad - index, K)[:, :K])


def _families_without(found: Postures) -> Bool:
    """Samples (N, K, B) of families that have no legal posture: pieces between places where a branch is not real."""
    valid = found.valid
    first = valid & ~np.roll(valid, 1, axis=1)
    number = np.cumsum(first, axis=1)
    number = np.where(number == 0, number[:, -1:], number)  # what begins before the turn ends at its end
    N, K, B = valid.shape
    legal = np.zeros((N, K + 1, B), bool)
    row, branch = np.arange(N)[:, None, None], np.arange(B)
    np.logical_or.at(legal, (row, number, branch), found.legal)
    return np.asarray(valid & ~legal[row, number, branch])


def _nearest(find: Follower, pieces: _Pieces, h: float) -> Array:
    """The postures (P, n) of intervals that move the joints least: golden section around the best sample.

    Of families without a legal posture it is that sample.
    """
    if not pieces.legal.all():
        out, some = pieces.start.copy(), pieces.legal
        out[some] = _nearest(find, pieces.of(some), h)
        return out
    row, branch, like = pieces.row, pieces.branch, pieces.start
    whole = pieces.b - pieces.a >= 2 * np.pi
    low = np.where(whole, pieces.at - h, np.maximum(pieces.a, pieces.at - h))
    high = np.where(whole, pieces.at + h, np.minimum(pieces.b, pieces.at + h))
    best, least = like.copy(), find.motion(row, like)

    def motion(t: Array) -> Array:
        there = find.one(row, branch, t, like)
        cost = np.where(there.legal, find.motion(row, there.q), np.inf)
        better = cost < least
        best[better], least[better] = there.q[better], cost[better]
        return cost

    own = find.near[row, find.free.joint]
    own = own + np.round((pieces.at - own) / (2 * np.pi)) * 2 * np.pi
    motion(np.where((own >= pieces.a) & (own <= pieces.b), own, pieces.at))
    motion(low)
    motion(high)
    ratio = (5**0.5 - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = motion(left), motion(right)
    for _ in range(GOLDEN):
        go = at_left <= at_right
        low, high = np.where(go, low, left), np.where(go, right, high)
        new = np.where(go, high - ratio * (high - low), low + ratio * (high - low))
        cost = motion(new)
        left, right = np.where(go, new, right), np.where(go, left, new)
        at_left, at_right = np.where(go, cost, at_right), np.where(go, at_left, cost)
    return best


def families(
    ik: Ik, arm: Arm, free: Redundancy, targets: ArrayLike, near: ArrayLike | None, rounding: ArrayLike | None
) -> Solutions:
    """Legal intervals of the redundant joint, and families without one: `armkin.ik` of such an arm.

    q: (..., B, n) of each the posture nearest to near; `Solutions.interval`: (..., B, 2) [rad].
    """
    task = free.task
    goal, lead, off = read_targets(task, targets)
    close = read_near(arm, near, lead)
    each = np.broadcast_to(close.reshape(-1, arm.n), (len(goal), arm.n))
    true = actual(arm)
    turned = free if true is arm else redundancy(true, task.name)
    assert turned is not None
    some = max(AT_ONCE // free.samples, 1)
    parts = [
        _of_chunk(Follower(ik, true, turned, goal[k : k + some], each[k : k + some] * arm.ratio))
        for k in range(0, len(goal), some)
    ]
    B = max((part.q.shape[1] for part in parts), default=0)
    q = np.concatenate([np.zeros((0, B, arm.n)), *(_wider(part.q, B, np.nan) for part in parts)])
    interval = np.concatenate([np.zeros((0, B, 2)), *(_wider(part.interval, B, np.nan) for part in parts)])
    legal = np.concatenate([np.zeros((0, B)), *(_wider(part.legal, B, 0.0) for part in parts)])
    branch = np.concatenate([np.zeros((0, B)), *(_wider(part.branch, B, -1.0) for part in parts)])
    boundary = np.concatenate([np.zeros(0, bool), *(part.boundary for part in parts)])
    valid = branch >= 0
    status = np.where(valid.any(axis=1), np.where(boundary, Status.BOUNDARY, Status.EXACT), Status.UNREACHABLE)
    given = off if rounding is None else np.broadcast_to(np.asarray(rounding, float), lead).reshape(-1)
    names = ik(free.rest, moved(arm, free, goal[:1], np.zeros(1)), task.name, examine=False).names if len(goal) else ()
    names += tuple(f"branch {i + 1}" for i in range(len(names), 1 + int(branch.max(initial=-1))))
    joint = arm.joint_names[free.joint]
    return Solutions(
        arm=arm,
        task=task,
        target=goal.reshape(*lead, *goal.shape[1:]),
        near=np.broadcast_to(close.copy(), (*lead, arm.n)),
        q=(q / arm.ratio).reshape(*lead, B, arm.n),
        valid=valid.reshape(*lead, B),
        within_limits=(legal > 0).reshape(*lead, B),
        branch=branch.astype(np.int8).reshape(*lead, B),
        status=status.astype(np.int8).reshape(lead),
        free=np.zeros((*lead, arm.n), bool),
        names=names,
        method=f"families of {joint}",
        why=f"{joint} is redundant; the other joints: {free.geometry.name}, at {free.samples} values of it",
        complete=np.zeros(lead, bool),
        rounding=given.reshape(lead),
        interval=(interval / arm.ratio[free.joint]).reshape(*lead, B, 2),
    )


class _Rows(NamedTuple):
    """Of some targets: q (N, B, n), interval (N, B, 2), legal (N, B), branch (N, B), boundary (N,)."""

    q: Array
    interval: Array
    legal: Array
    branch: Array
    boundary: Bool


def _joined(parts: list[_Rows], rows: NDArray[np.intp]) -> _Rows:
    """Parts one below the other, in the order of rows (N,)."""
    B, order = max(part.q.shape[1] for part in parts), np.argsort(rows)
    q, interval, legal, branch = (
        np.concatenate([_wider(np.asarray(part[i]), B, none) for part in parts])[order]
        for i, none in enumerate((np.nan, np.nan, 0.0, -1.0))
    )
    return _Rows(q, interval, legal, branch, np.concatenate([part.boundary for part in parts])[order])


def _wider(values: Array, B: int, none: float) -> Array:
    out = np.full((len(values), B, *values.shape[2:]), none)
    out[:, : values.shape[1]] = values
    return out


def _of_chunk(find: Follower, finer: int = 1) -> _Rows:
    """Of some targets; what has no answer is asked again alone: all of a nearly stretched arm's lie within a degree."""
    N, K = len(find.target), find.free.samples * finer
    t = np.asarray(-np.pi + (np.arange(K) + 0.5) * (2 * np.pi / K), np.float64)
    found = find.along(t)
    if finer == 1 and find.labelled:
        near_enough = find.arm.prismatic.any() | (distance(find.arm, find.free.task, find.target) <= 1.0 + SOLUTION)
        none = np.flatnonzero(~found.valid.any(axis=(1, 2)) & near_enough)
        if len(none):
            parts = [_of_chunk(find._replace(target=find.target[[k]], near=find.near[[k]]), FINER) for k in none]
            rest = np.setdiff1d(np.arange(N), none)
            if len(rest):
                parts.append(_of_chunk(find._replace(target=find.target[rest], near=find.near[rest])))
            return _joined(parts, np.concatenate([none, rest]))
    pieces = _pieces(find, t, found)
    q = _nearest(find, pieces, float(t[1] - t[0])) if len(pieces.row) else pieces.start
    if not find.labelled and len(q):  # an elimination's answers near singular postures are less exact
        q = newton.correct(find.arm, find.free.task, q, find.target[pieces.row])[0]
    if find.arm.keep_out:
        q = _free(find, pieces, q)
    own = pieces.at + 2 * np.pi * np.round((q[:, find.free.joint] - pieces.at) / (2 * np.pi))
    shift = (own - pieces.at)[:, None]
    interval = np.stack([pieces.a, pieces.b], axis=1)
    whole = pieces.b - pieces.a >= 2 * np.pi
    interval = np.where(whole[:, None], [-np.pi, np.pi], interval + shift)
    count = np.bincount(pieces.row, minlength=N)
    B = int(count.max(initial=0))
    order = np.lexsort((~pieces.legal, pieces.row))
    place = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    out = _Rows(
        np.full((N, B, find.arm.n), np.nan), np.full((N, B, 2), np.nan), np.zeros((N, B)), np.full((N, B), -1.0),
        _all_short(find, found),
    )  # fmt: skip
    where = pieces.row[order], place
    out.q[where], out.interval[where] = q[order], interval[order]
    out.legal[where], out.branch[where] = pieces.legal[order], pieces.branch[order]
    return out


def _all_short(find: Follower, found: Postures) -> Bool:
    """Whether no joint moves by REACH along any family of a target (N,), from its samples."""
    if not find.labelled:  # the pieces of a linked branch say nothing of the whole curve
        return np.zeros(len(found.valid), bool)
    together = found.valid
    for shift in range(1, 2 + int(REACH / (2 * np.pi / found.valid.shape[1]))):
        together = together & np.roll(found.valid, -shift, axis=1)
    short = np.asarray(found.valid.any(axis=(1, 2)) & ~together.any(axis=(1, 2)))
    for k in np.flatnonzero(short).tolist():
        q, valid = found.q[k], found.valid[k]
        step = np.abs(np.remainder(np.roll(q, -1, axis=0) - q + np.pi, 2 * np.pi) - np.pi)
        way = np.where((valid & np.roll(valid, -1, axis=0))[..., None], np.nan_to_num(step), 0.0).sum(axis=0)
        short[k] = 2.0 * way.max(initial=0.0) < REACH
    return short


def _free(find: Follower, pieces: _Pieces, q: Array) -> Array:
    """The nearest postures of legal intervals that hit nothing, to `FREE`; where there is none, q as it is."""
    out = q.copy()
    for p in np.flatnonzero(pieces.legal & ~clear(find.arm, q)):
        a, b = pieces.a[p], pieces.b[p]
        t = np.linspace(a, b, max(int((b - a) / FREE) + 2, 2))[1:-1]
        rows = np.full(len(t), pieces.row[p])
        there = find.one(rows, np.full(len(t), pieces.branch[p]), t, np.broadcast_to(q[p], (len(t), find.arm.n)))
        good = there.legal & clear(find.arm, np.nan_to_num(there.q))
        if good.any():
            motion = np.where(good, find.motion(rows, there.q), np.inf)
            out[p] = there.q[motion.argmin()]
    return out


def intervals_out(s: Solutions) -> list[list[list[float]]] | None:
    """Intervals (N, B, 2) of the redundant joint [deg]; None where no joint is."""
    if s.interval is None:
        return None
    found: list[list[list[float]]] = units.angles_out(s.interval).tolist()
    return found
