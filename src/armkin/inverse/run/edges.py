"""Targets with a nearly singular candidate: what goes to `singular.components`, and where its answers are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Batch, Goals, wider, write
from armkin.inverse.closed.candidates import Recorded, as_rows
from armkin.inverse.numeric.tolerances import ACCEPTED, FOLD_WAY, SAME
from armkin.inverse.singular import components, linkages
from armkin.inverse.singular.components import Seeds

AT_ONCE = 256  # targets examined together


class _Doubts(NamedTuple):
    """K targets on an edge: as rows of a batch (K,), candidates as the formulas have them (K, B, n), and with preferred
    values for joints that are free: as near `near` first (K, B, n).

    other: the same with other values, nan where these change nothing; loose: (K, B) which candidates they change;
    free: (K,) whether a joint is; ends: (K,) targets on which the joints that the geometry calls ends are free;
    narrow: (K,) those with solutions for a part of these values, which `near` is not in.
    """

    rows: NDArray[np.intp]
    tight: Array
    first: Array
    other: Array
    loose: Bool
    free: Bool
    ends: Bool
    narrow: Bool


def decided(goals: Goals, runner: Recorded, out: Batch, rows: NDArray[np.intp]) -> Batch:
    """Decide what the targets `rows` are, which are on an edge.

    Where a joint is free, the candidates are not all.
    """
    _, _, target, near = goals
    doubts = _doubts(goals, runner, rows)
    out, done = _on_linkages(goals, runner, out, doubts)
    if done.all():
        return out
    if len(part := np.flatnonzero(~done & doubts.narrow)):  # there may be another part
        whole = rows[part]
        doubts.first[part], other, _ = _at_two(runner, target[whole], near[whole], near[whole] + 1.0)
        doubts.other[part] = np.where(doubts.loose[part][:, :, None], other, np.nan)
    arrays: tuple[NDArray[Any], ...] = doubts
    rows, tight, first, other, loose, _, at_ends, _ = (array[~done] for array in arrays)
    # with the preferred values for joints that are free, and those that other values would change
    more, unsettled = [first, other], None
    if runner.geometry.ends:
        hangs: Bool = np.asarray(loose.any(axis=1))
        more.append(np.where(hangs[:, None, None], tight, np.nan))  # it may be that the joint is not quite free
        unsettled = np.zeros(len(target), bool)
        unsettled[rows[at_ends]], out.complete[rows[at_ends]] = True, False
    if not loose.any():
        del more[1:]
    q, fixed = np.concatenate(more, axis=1), np.zeros((len(rows), (len(more) - 1) * loose.shape[1]), bool)
    label = np.tile(np.arange(loose.shape[1]), len(more))
    seeds = Seeds.of(q, label, np.concatenate([loose, fixed], axis=1))
    return examined(goals, out, rows, seeds, runner.others, unsettled)


def _on_linkages(goals: Goals, runner: Recorded, out: Batch, doubts: _Doubts) -> tuple[Batch, Bool]:
    """The same with those targets (K,) written whose self-motions are known in closed form; which these are (K,)."""
    done, asked = np.zeros(len(doubts.rows), bool), doubts.free & ~doubts.ends
    if not (goals.task.constraints == goals.arm.n and goals.task.orientation == "full"):
        return out, done
    for start in range(0, len(done), AT_ONCE):
        part = start + np.flatnonzero(asked[start : start + AT_ONCE])
        q = np.stack([doubts.first[part], doubts.other[part]], axis=1)
        for _ in range(2):
            if not len(part):
                break
            some, loose = goals.of(doubts.rows[part]), doubts.loose[part]
            found = linkages.settle(some, q, loose)
            if len(known := np.flatnonzero(found.known)):
                # postures of known self-motions, and the candidates that are not loose, by their labels
                fixed = np.where(loose[known][:, :, None], np.nan, doubts.first[part[known]])
                label = np.concatenate([np.arange(loose.shape[1]), found.label])
                order = np.argsort(label, kind="stable")
                at = np.concatenate([fixed, found.q[known]], axis=1)[:, order]
                sure = np.concatenate([np.zeros(fixed.shape, bool), found.joints[known]], axis=1)[:, order]
                seeds = Seeds.of(at, label[order])._replace(sure=sure)
                out = examined(goals, out, doubts.rows[part[known]], seeds, runner.others)
                done[part[known]] = True
            lacking = np.flatnonzero(found.lacking)
            part, q = part[lacking], q[lacking]
            if len(part):
                q = np.concatenate([q, runner.samples(some.target[lacking], some.near[lacking])], axis=1)
    return out, done


def _doubts(goals: Goals, runner: Recorded, rows: NDArray[np.intp]) -> _Doubts:
    """The targets `rows`, with preferred values for joints that are free."""
    _, _, target, near = goals
    # what is singular hangs on the last digit
    *values, _, _, free = runner.in_numbers(target[rows])
    tight = as_rows(values, len(rows))
    out = _Doubts(
        rows=rows,
        tight=tight,
        first=tight.copy(),
        other=np.full(tight.shape, np.nan),
        loose=np.zeros(tight.shape[:2], bool),
        free=np.asarray((np.reshape(free, (-1, len(rows))) > 0).any(axis=0)),
        ends=np.zeros(len(rows), bool),
        narrow=np.zeros(len(rows), bool),
    )
    freed = np.flatnonzero(out.free)
    for start in range(0, len(freed), AT_ONCE):
        part = freed[start : start + AT_ONCE]
        whole = rows[part]
        first, second, solved = _at_two(runner, target[whole], near[whole], near[whole] + 1.0)
        apart = np.abs(first - second)
        changed = ~(apart.max(axis=2) < SAME)
        lost = np.flatnonzero(changed.any(axis=1) & ~(changed & solved.any(axis=0)).any(axis=1))
        if len(lost):  # solutions for some values of the free joints alone, or for one
            rest = whole[lost]
            best = near[rest] + runner.best_shift(target[rest], near[rest], changed[lost])
            first[lost], second[lost], solved = _at_two(runner, target[rest], best, best + FOLD_WAY)
            out.narrow[part[lost]] = solved[1].any(axis=1)
        out.first[part], out.loose[part] = first, changed
        out.other[part] = np.where(changed[:, :, None], second, np.nan)
        apart = np.minimum(apart, np.abs(apart - 2 * np.pi))[:, :, list(runner.geometry.ends)]
        out.ends[part] = (apart > SAME).any(axis=(1, 2))
    return out


def _at_two(runner: Recorded, target: Array, values: Array, others: Array) -> tuple[Array, Array, Bool]:
    """Candidates for two values of free joints, (N, B, n) each, and which solve their targets (2, N, B)."""
    found = runner.with_values(np.concatenate([target, target]), np.concatenate([values, others]))
    solved = found[..., -1].reshape(2, len(target), -1) <= ACCEPTED**2
    return found[: len(target), :, :-1], found[len(target) :, :, :-1], solved


def examined(
    goals: Goals,
    out: Batch,
    doubted: NDArray[np.intp],
    seeds: Seeds,
    others: Callable[[Array, Array, Bool], tuple[Array, NDArray[np.int64]]],
    unsettled: Bool | None = None,
) -> Batch:
    """Examine the doubted targets and write what is found: branches first, nan behind.

    seeds: candidates of these; others: more of them, for targets and preferred values, and whether
    branches seem lost or an elimination did not settle them; unsettled: (N,), see `components.examine`.
    """
    for start in range(0, len(doubted), AT_ONCE):
        rows = doubted[start : start + AT_ONCE]
        some = goals.of(rows)
        incomplete = np.zeros(len(rows), bool) if unsettled is None else unsettled[rows] & ~out.complete[rows]

        def more(which: NDArray[np.int64], lost: Bool, some: Goals = some, incomplete: Bool = incomplete) -> Any:
            return others(some.target[which], some.near[which], lost | incomplete[which])

        arrays: tuple[NDArray[Any], ...] = seeds
        part = Seeds(*(array[start : start + AT_ONCE] for array in arrays))
        seen = components.examine(some, part, more, None if unsettled is None else unsettled[rows])
        width = seen.q.shape[1]
        if width > out.q.shape[1]:
            out = wider(out, width)
        write(goals.arm, out, rows, seen.q, seen.valid, seen.label, some.near)
        out.status[rows], out.free[rows] = seen.status, seen.free
        out.complete[rows] &= ~seen.again
    return out
