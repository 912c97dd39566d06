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
    arm, task, target, near = goals
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
        new = np.flatnonzero(found.known & (found.double | found.changed | moving))
        if len(new):
            order = np.argsort(~found.branch[new], axis=1, kind="stable")
            kept = np.take_along_axis(found.q[new], order[:, :, None], axis=1)
            there = np.take_along_axis(found.branch[new], order, axis=1)
            write(arm, out, rows[new], kept, there, order, near[rows[new]])
            out.status[rows[new]] = np.where(found.double[new], Status.BOUNDARY, Status.EXACT)
            out.status[rows[new[moving[new]]]], out.free[rows[new]] = Status.SINGULAR, found.free[new]

    def candidates(some: NDArray[np.intp]) -> tuple[Array, Bool]:
        """With the preferred values for joints that are free, and those that other values would change."""
        some = open_[some]
        first, loose = q[some], np.zeros(q[some].shape[:2], bool)
        loosened = np.flatnonzero(free[some])
        if not len(loosened):
            return first, loose
        rows = doubtful[some[loosened]]
        goal, other = entries(task, target[rows]), np.full(first.shape, np.nan)
        first[loosened], other[loosened] = (
            as_rows(runner.candidates(goal, preferred(arm, near[rows] + shift))[: arm.n], len(rows))
            for shift in (0.0, 1.0)
        )
        loose[loosened] = ~(np.abs(first[loosened] - other[loosened]).max(axis=2) < SAME)
        if not loose.any():
            return first, loose
        other[~loose] = np.nan
        return np.concatenate([first, other], axis=1), np.concatenate([loose, np.zeros_like(loose)], axis=1)

    open_ = np.flatnonzero(left)
    return examined(goals, out, doubtful[open_], candidates, runner.others)


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
