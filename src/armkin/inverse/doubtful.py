"""Targets that a solver doubts: decided all at once where that will do, else posture by posture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse import regular_targets, singularities
from armkin.inverse.batch import Batch, Goals, named, wider, write
from armkin.inverse.closed.candidates import Recorded, as_rows, entries, preferred
from armkin.inverse.numeric.tolerances import SAME
from armkin.inverse.solutions import Status

AT_ONCE = 256  # targets examined together


class Doubts(NamedTuple):
    """Targets on an edge: rows (K,), candidates q (K, B, n), valid (K, B) accepted ones, free (K,) a joint is free."""

    rows: NDArray[np.intp]
    q: Array
    valid: Bool
    free: Bool


def decided(goals: Goals, runner: Recorded, out: Batch, doubts: Doubts) -> Batch:
    """Decide what doubtful targets are: those that are regular all at once, the others posture by posture.

    Where a joint is free, the candidates are not all.
    """
    arm, _, target, near = goals
    doubtful, q, valid, free = doubts
    left = free.copy()
    for start in range(0, len(doubtful), AT_ONCE):
        part = start + np.flatnonzero(~free[start : start + AT_ONCE])
        rows = doubtful[part]
        if not len(part):
            continue
        found = regular_targets.settle(goals.of(rows), q[part], valid[part])
        left[part] = ~found.known
        moving = np.asarray(found.free.any(axis=1))
        new = np.flatnonzero(found.known)
        if len(new):
            order = np.argsort(~found.branch[new], axis=1, kind="stable")
            kept = np.take_along_axis(found.q[new], order[:, :, None], axis=1)
            there = np.take_along_axis(found.branch[new], order, axis=1)
            write(arm, out, rows[new], kept, there, order, near[rows[new]])
            out.status[rows[new]] = np.where(found.double[new], Status.BOUNDARY, Status.EXACT)
            out.status[rows[new[moving[new]]]], out.free[rows[new]] = Status.SINGULAR, found.free[new]

    open_ = np.flatnonzero(left)
    first, other, loose, ends = _freed(goals, runner, doubts, open_[free[open_]])

    def candidates(some: NDArray[np.intp]) -> tuple[Array, Bool]:
        """With the preferred values for joints that are free, and those that other values would change."""
        some = open_[some]
        if not loose[some].any():
            return first[some], loose[some]
        more = [other[some]]
        if runner.geometry.ends:
            more.append(q[some])  # it may be that the joint is not quite free
        fixed = np.zeros((len(some), sum(part.shape[1] for part in more)), bool)
        return np.concatenate([first[some], *more], axis=1), np.concatenate([loose[some], fixed], axis=1)

    unsettled = None
    if runner.geometry.ends:
        unsettled = np.zeros(len(target), bool)
        unsettled[doubtful[ends]], out.complete[doubtful[ends]] = True, False
    return examined(goals, out, doubtful[open_], candidates, runner.others, unsettled)


def _freed(
    goals: Goals, runner: Recorded, doubts: Doubts, rows: NDArray[np.intp]
) -> tuple[Array, Array, Bool, NDArray[np.intp]]:
    """Candidates of the doubtful targets, those that leave a joint free with preferred values, as near `near`.

    And the same with other values, nan where these change nothing; which candidates they change (K, B); and the targets
    on which the joints that the geometry calls ends are free. rows: the targets that leave joints free.
    """
    arm, task, target, near = goals
    first, loose = doubts.q.copy(), np.zeros(doubts.q.shape[:2], bool)
    other, ends = np.full(first.shape, np.nan), [rows[:0]]
    for start in range(0, len(rows), AT_ONCE):
        part = rows[start : start + AT_ONCE]
        whole = doubts.rows[part]
        goal = entries(task, target[whole])
        first[part], second = (
            as_rows(runner.candidates(goal, preferred(arm, near[whole] + shift))[: arm.n], len(part))
            for shift in (0.0, 1.0)
        )
        apart = np.abs(first[part] - second)
        changed = ~(apart.max(axis=2) < SAME)
        loose[part] = changed
        other[part] = np.where(changed[:, :, None], second, np.nan)
        apart = np.minimum(apart, np.abs(apart - 2 * np.pi))[:, :, list(runner.geometry.ends)]
        ends.append(part[(apart > SAME).any(axis=(1, 2))])
    return first, other, loose, np.concatenate(ends)


def examined(
    goals: Goals,
    out: Batch,
    doubtful: NDArray[np.intp],
    candidates: Callable[[NDArray[np.intp]], tuple[Array, Bool]],
    others: Callable[[Array, Array, Bool], tuple[Array, NDArray[np.int64]]],
    unsettled: Bool | None = None,
) -> Batch:
    """Examine the doubtful targets and write what is found: branches first, nan behind.

    candidates: joint values (K, M, n) for some of the doubtful ones, and which depend on `near` (K, M); others: more
    of them, for targets and preferred values, and whether branches seem lost or an elimination did not settle them;
    unsettled: (N,), see `singularities.examine`.
    """
    for start in range(0, len(doubtful), AT_ONCE):
        rows = doubtful[start : start + AT_ONCE]
        some, columns = goals.of(rows), out.q.shape[1]
        q, loose = candidates(np.arange(start, start + len(rows)))

        incomplete = np.zeros(len(rows), bool) if unsettled is None else unsettled[rows] & ~out.complete[rows]

        def more(which: NDArray[np.int64], lost: Bool, some: Goals = some, incomplete: Bool = incomplete) -> Any:
            return others(some.target[which], some.near[which], lost | incomplete[which])

        label = np.arange(q.shape[1]) % max(columns, 1)
        seen = singularities.examine(some, q, label, loose, more, None if unsettled is None else unsettled[rows])
        width = seen.q.shape[1]
        if width > out.q.shape[1]:
            out = wider(out, width)
        write(goals.arm, out, rows, seen.q, seen.valid, named(seen.label, seen.valid), some.near)
        out.status[rows], out.free[rows] = seen.status, seen.free
        out.complete[rows] &= ~seen.again
    return out
