"""Targets with a nearly singular candidate: regular ones are accepted in bulk, the others analysed one by one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Batch, Goals, named, wider, write
from armkin.inverse.answers.solutions import Status
from armkin.inverse.closed.candidates import Recorded, as_rows, entries, preferred
from armkin.inverse.numeric.tolerances import ACCEPTED, SAME
from armkin.inverse.singular import components, lines, regular_targets

AT_ONCE = 256  # targets examined together


class Doubts(NamedTuple):
    """Targets on an edge: rows (K,), candidates q (K, B, n), valid (K, B) accepted ones, free (K,) a joint is free."""

    rows: NDArray[np.intp]
    q: Array
    valid: Bool
    free: Bool


def as_doubts(runner: Recorded, found: list[Array], rows: NDArray[np.intp], some: NDArray[np.intp]) -> Doubts:
    """Some of the targets that candidates were found for, as targets `rows` of a batch."""
    shape = (*runner.axes, len(some))

    def of_some(entry: Array) -> Array:
        """Of every branch and target, (K, B)."""
        own = entry[..., some] if np.ndim(entry) and entry.shape[-1] > 1 else entry  # constants are numbers
        return np.broadcast_to(own, shape).reshape(-1, len(some)).T

    *values, miss, _, free = found
    q = np.stack([of_some(value) for value in values], axis=2)
    return Doubts(rows, q, of_some(miss) <= ACCEPTED**2, np.asarray((of_some(free) > 0).any(axis=1)))


def decided(goals: Goals, runner: Recorded, out: Batch, doubts: Doubts) -> Batch:
    """Decide what doubted targets are: those that are regular all at once, the others posture by posture.

    Where a joint is free, the candidates are not all.
    """
    arm, _, target, near = goals
    left = doubts.free.copy()
    for start in range(0, len(left), AT_ONCE):
        part = start + np.flatnonzero(~doubts.free[start : start + AT_ONCE])
        if not len(part):
            continue
        rows = doubts.rows[part]
        found = regular_targets.settle(goals.of(rows), doubts.q[part], doubts.valid[part])
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
    if not left.any():
        return out

    rows = doubts.rows[left]  # what is singular hangs on the last digit
    some = as_doubts(runner, runner.in_numbers(target[rows]), rows, np.arange(len(rows)))
    first, other, loose, ends = _freed(goals, runner, some)
    at_ends = np.zeros(len(rows), bool)
    at_ends[ends] = True
    open_ = ~_on_lines(goals, out, rows, first, other, loose, some.free & ~at_ends)
    if not open_.any():
        return out
    rows, first, other, loose = rows[open_], first[open_], other[open_], loose[open_]
    some = Doubts(rows, some.q[open_], some.valid[open_], some.free[open_])
    ends = np.flatnonzero(at_ends[open_])

    def candidates(of: NDArray[np.intp]) -> tuple[Array, Bool]:
        """With the preferred values for joints that are free, and those that other values would change."""
        if not loose[of].any():
            return first[of], loose[of]
        more = [other[of]]
        if runner.geometry.ends:
            more.append(some.q[of])  # it may be that the joint is not quite free
        fixed = np.zeros((len(of), sum(part.shape[1] for part in more)), bool)
        return np.concatenate([first[of], *more], axis=1), np.concatenate([loose[of], fixed], axis=1)

    unsettled = None
    if runner.geometry.ends:
        unsettled = np.zeros(len(target), bool)
        unsettled[rows[ends]], out.complete[rows[ends]] = True, False
    return examined(goals, out, rows, candidates, runner.others, unsettled)


def _on_lines(
    goals: Goals, out: Batch, rows: NDArray[np.intp], first: Array, other: Array, loose: Bool, asked: Bool
) -> Bool:
    """Write those of the asked targets rows (K,) that are singular by two joints about one line alone; which (K,)."""
    done = np.zeros(len(rows), bool)
    for start in range(0, len(rows), AT_ONCE):
        part = start + np.flatnonzero(asked[start : start + AT_ONCE])
        if not len(part):
            continue
        line = lines.settle(goals.of(rows[part]), first[part], other[part], loose[part])
        order = np.argsort(~line.branch, axis=1, kind="stable")[line.known]
        there = np.take_along_axis(line.branch[line.known], order, axis=1)
        part = part[line.known]
        kept = np.take_along_axis(first[part], order[:, :, None], axis=1)
        write(goals.arm, out, rows[part], kept, there, order, goals.near[rows[part]])
        out.status[rows[part]], out.free[rows[part]] = Status.SINGULAR, line.free[line.known]
        done[part] = True
    return done


def _freed(goals: Goals, runner: Recorded, doubts: Doubts) -> tuple[Array, Array, Bool, NDArray[np.intp]]:
    """Candidates of the doubted targets, those that leave a joint free with preferred values, as near `near`.

    And the same with other values, nan where these change nothing; which candidates they change (K, B); and the targets
    on which the joints that the geometry calls ends are free.
    """
    arm, task, target, near = goals
    rows = np.flatnonzero(doubts.free)
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
    doubted: NDArray[np.intp],
    candidates: Callable[[NDArray[np.intp]], tuple[Array, Bool]],
    others: Callable[[Array, Array, Bool], tuple[Array, NDArray[np.int64]]],
    unsettled: Bool | None = None,
) -> Batch:
    """Examine the doubted targets and write what is found: branches first, nan behind.

    candidates: joint values (K, M, n) for some of the doubted ones, and which depend on `near` (K, M); others: more
    of them, for targets and preferred values, and whether branches seem lost or an elimination did not settle them;
    unsettled: (N,), see `components.examine`.
    """
    for start in range(0, len(doubted), AT_ONCE):
        rows = doubted[start : start + AT_ONCE]
        some, columns = goals.of(rows), out.q.shape[1]
        q, loose = candidates(np.arange(start, start + len(rows)))

        incomplete = np.zeros(len(rows), bool) if unsettled is None else unsettled[rows] & ~out.complete[rows]

        def more(which: NDArray[np.int64], lost: Bool, some: Goals = some, incomplete: Bool = incomplete) -> Any:
            return others(some.target[which], some.near[which], lost | incomplete[which])

        label = np.arange(q.shape[1]) % max(columns, 1)
        seen = components.examine(some, q, label, loose, more, None if unsettled is None else unsettled[rows])
        width = seen.q.shape[1]
        if width > out.q.shape[1]:
            out = wider(out, width)
        write(goals.arm, out, rows, seen.q, seen.valid, named(seen.label, seen.valid), some.near)
        out.status[rows], out.free[rows] = seen.status, seen.free
        out.complete[rows] &= ~seen.again
    return out
