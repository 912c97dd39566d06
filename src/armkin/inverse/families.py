"""One joint more than the target asks for: curves of answers, as intervals of the redundant joint.

The redundant joint is the last or the first one, whichever leaves a closed form. Its motion only moves the target of
the other joints, T = Z(q) T' or T' Z(q), so one solver, prepared once, answers every value of it. Its answers are
followed along a whole turn by their branches; where a branch begins or ends to be real, or to be within limits, is
found by bisection. A family is a piece of the curve along which the joint is monotone; a row is a legal interval of
one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.tracking import follow
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import REACH
from armkin.inverse.solvers.redundant import Redundancy, moved, redundancy
from armkin.inverse.tasks.task import read_near, read_targets
from armkin.keep_out.clearance import clear
from armkin.model import units
from armkin.model.arm import actual

if TYPE_CHECKING:
    from armkin.model.arm import Arm

AT_ONCE = 24_000  # targets of the other joints solved together
FINER = 24  # times as many values where none had an answer
HALVINGS = 34  # of half a degree: 3e-11 degrees
GOLDEN = 44  # steps to the posture nearest to `near`
FREE = np.deg2rad(0.1)  # [rad] and reaches / 573: step between postures that are asked whether they are free
Ik = Callable[..., Solutions]


class _Postures(NamedTuple):
    """Answers at values of the redundant joint: q (..., B, n), whether they are there and within limits (..., B)."""

    q: Array
    valid: Bool
    legal: Bool


class _Follower(NamedTuple):
    """Answers of some targets (N, ...) at any value of the redundant joint; near: (N, n)."""

    ik: Ik
    arm: Arm
    free: Redundancy
    target: Array
    near: Array

    @property
    def labelled(self) -> bool:
        """Whether a branch keeps its index along the turn, as that of a closed form does."""
        return self.free.geometry.ordered and self.free.geometry.pairs is not None

    def at(self, rows: NDArray[np.intp], t: Array) -> _Postures:
        """All branches of targets (M,) at values t (M,), each in the column of its index."""
        return self._legal(rows, self._found(rows, t))

    def _found(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Branches (M, B, n), nan where there is none."""
        goal = moved(self.arm, self.free, self.target[rows], t)
        s = self.ik(self.free.rest, goal, self.free.task.name, examine=False)
        M, B, r = len(t), s.q.shape[1], self.free.joint
        number = s.branch if self.labelled else np.where(s.valid, np.arange(B), -1)
        out = np.full((M, B + 1, self.arm.n), np.nan)
        place = np.arange(M)[:, None], np.where(number < 0, B, number)
        out[*place, :r], out[*place, r], out[*place, r + 1 :] = s.q[:, :, :r], t[:, None], s.q[:, :, r:]
        return out[:, :B]

    def _legal(self, rows: NDArray[np.intp], q: Array) -> _Postures:
        """Postures (M, B, n) at their nearest legal copies."""
        valid = ~np.isnan(q[:, :, 0])
        q, legal = nearest_row(self.arm, np.where(valid[:, :, None], q, 0.0), self.near[rows][:, None])
        q[~valid] = np.nan
        return _Postures(q, valid, legal & valid)

    def along(self, t: Array) -> _Postures:
        """Of every target at all of t (K,), linked along it: q (N, K, B, n)."""
        N, K = len(self.target), len(t)
        found = self.at(np.repeat(np.arange(N), K), np.tile(t, N))
        B = found.valid.shape[1]
        q, valid, legal = found.q.reshape(N, K, B, -1), found.valid.reshape(N, K, B), found.legal.reshape(N, K, B)
        if self.labelled:
            return _Postures(q, valid, legal)
        kept = [i for i in range(self.arm.n) if i != self.free.joint]
        for k in range(N):
            goal = moved(self.arm, self.free, np.repeat(self.target[k : k + 1], K, axis=0), t)
            number = follow(self.free.rest, self.free.task, q[k][:, :, kept], goal)
            q[k] = _in_columns(q[k], number)
            legal[k] = _in_columns(legal[k][:, :, None].astype(float), number)[:, :, 0] == 1.0
        return _Postures(q, ~np.isnan(q[..., 0]), legal)

    def one(self, rows: NDArray[np.intp], branch: NDArray[np.intp], t: Array, like: Array) -> _Postures:
        """One branch each (M,): that of its index, or, of an elimination, the one nearest to postures like (M, n)."""
        q, each = self._found(rows, t), np.arange(len(rows))
        if not self.labelled:
            apart = np.abs(np.remainder(q - like[:, None] + np.pi, 2 * np.pi) - np.pi).max(axis=2)
            apart = np.where(apart < 0.5, apart, np.inf)
            branch = apart.argmin(axis=1)
            q[np.isinf(apart)] = np.nan
        one = self._legal(rows, q[each, branch][:, None])
        return _Postures(one.q[:, 0], one.valid[:, 0], one.legal[:, 0])

    def motion(self, rows: NDArray[np.intp], q: Array) -> Array:
        """Sum of |change| from near [deg | mm]: q (M, ..., n) -> (M, ...); inf where there is no posture."""
        unit = np.where(self.arm.prismatic, 1.0, 180 / np.pi)
        near = self.near[rows].reshape(len(rows), *[1] * (q.ndim - 2), -1)
        total = (np.abs(q - near) * unit).sum(axis=-1)
        return np.where(np.isnan(total), np.inf, total)


def _in_columns(q: Array, number: NDArray[np.integer]) -> Array:
    """Rows (M, B, n) in the columns of their numbers (M, B), nan where there is none; -1: left away."""
    M, B, n = q.shape
    out = np.full((M, B + 1, n), np.nan)
    out[np.arange(M)[:, None], np.where(number < 0, B, number)] = q
    return out[:, :B]


class _Pieces(NamedTuple):
    """Legal intervals, and families without one: of which target and branch (P,), ends a <= b (P,) [rad]."""

    row: NDArray[np.intp]
    branch: NDArray[np.intp]
    a: Array
    b: Array
    legal: Bool
    start: Array  # (P, n) the posture of some sample inside, the nearest to near
    at: Array  # (P,) its value of the redundant joint


def _ends(find: _Follower, t: Array, found: _Postures, good: Bool, legal: bool) -> dict[tuple[int, int, int], float]:
    """Where good (N, K, B) changes between samples k and k + 1: (target, branch, k) -> value of the joint."""
    h = t[1] - t[0]
    after = np.roll(good, -1, axis=1)
    row, k, branch = np.nonzero(good != after)
    inside, low = good[row, k, branch], t[k]
    lo, hi = np.where(inside, low, low + h), np.where(inside, low + h, low)  # good at lo
    like = np.where(inside[:, None], found.q[row, k, branch], found.q[row, (k + 1) % len(t), branch])
    for _ in range(HALVINGS):
        if not len(row):
            break
        middle = 0.5 * (lo + hi)
        there = find.one(row, branch, middle, like)
        keep = there.legal if legal else there.valid
        lo, hi = np.where(keep, middle, lo), np.where(keep, hi, middle)
        like = np.where(keep[:, None], there.q, like)
    return dict(zip(zip(row.tolist(), branch.tolist(), k.tolist(), strict=True), lo.tolist(), strict=True))


def _pieces(find: _Follower, t: Array, found: _Postures) -> _Pieces:
    """All pieces of the curves of some targets."""
    K, h = len(t), float(t[1] - t[0])
    motion = find.motion(np.arange(len(find.target)), found.q)
    rows = []
    for legal, good in ((True, found.legal), (False, _families_without(found))):
        ends = _ends(find, t, found, good, legal)
        first = good & ~np.roll(good, 1, axis=1)
        first[:, 0] |= good.all(axis=1)
        for row, k, branch in np.argwhere(first).tolist():
            column = np.roll(good[row, :, branch], -k)
            count = K if column.all() else int(column.argmin())
            whole = count == K
            place = (k + np.arange(count)) % K
            at = int(motion[row, place, branch].argmin())
            a, b = (
                (-np.pi, np.pi) if whole else (ends[row, branch, (k - 1) % K], ends[row, branch, (k + count - 1) % K])
            )
            inside = t[k] + at * h
            a, b = inside - (inside - a) % (2 * np.pi), inside + (b - inside) % (2 * np.pi)
            if whole:
                a, b = -np.pi, np.pi
            rows.append((row, branch, a, b, legal, found.q[row, (k + at) % K, branch], inside))
    if not rows:
        none = np.zeros(0)
        return _Pieces(none.astype(int), none.astype(int), none, none, none > 0, np.zeros((0, find.arm.n)), none)
    return _Pieces(*(np.array(column) for column in zip(*rows, strict=True)))


def _families_without(found: _Postures) -> Bool:
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


def _nearest(find: _Follower, pieces: _Pieces, h: float) -> Array:
    """The postures (P, n) of intervals that move the joints least: golden section around the best sample."""
    row, branch, like = pieces.row, pieces.branch, pieces.start
    whole = pieces.b - pieces.a >= 2 * np.pi
    low = np.where(whole, pieces.at - h, np.maximum(pieces.a, pieces.at - h))
    high = np.where(whole, pieces.at + h, np.minimum(pieces.b, pieces.at + h))
    best, least = like.copy(), find.motion(row, like)

    def motion(t: Array) -> Array:
        there = find.one(row, branch, t, like)
        cost = np.where(there.legal | ~pieces.legal & there.valid, find.motion(row, there.q), np.inf)
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
        _of_chunk(_Follower(ik, true, turned, goal[k : k + some], each[k : k + some] * arm.ratio))
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


def _of_chunk(find: _Follower, finer: int = 1) -> _Rows:
    """Of some targets; what has no answer is asked again alone: all of a nearly stretched arm's lie within a degree."""
    N, K = len(find.target), find.free.samples * finer
    t = np.asarray(-np.pi + (np.arange(K) + 0.5) * (2 * np.pi / K), np.float64)
    found = find.along(t)
    none = np.flatnonzero(~found.valid.any(axis=(1, 2)))
    if finer == 1 and find.labelled and len(none) and N > 1:
        parts = [_of_chunk(find._replace(target=find.target[[k]], near=find.near[[k]])) for k in none]
        rest = np.setdiff1d(np.arange(N), none)
        if len(rest):
            parts.append(_of_chunk(find._replace(target=find.target[rest], near=find.near[rest])))
        return _joined(parts, np.concatenate([none, rest]))
    if finer == 1 and find.labelled and len(none):
        return _of_chunk(find, FINER)
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


def _all_short(find: _Follower, found: _Postures) -> Bool:
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


def _free(find: _Follower, pieces: _Pieces, q: Array) -> Array:
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
