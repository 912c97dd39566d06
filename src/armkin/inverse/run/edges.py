"""Targets with a nearly singular candidate: what goes to `singular.components`, and where its answers are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Batch, Goals, named, wider, write
from armkin.inverse.closed.candidates import Recorded
from armkin.inverse.numeric.tolerances import ACCEPTED, FOLD_WAY, SAME
from armkin.inverse.singular import components, linkages
from armkin.inverse.singular.components import Seeds

AT_ONCE = 256  # targets examined together


class Doubts(NamedTuple):
    """Targets on an edge: rows (K,), candidates q (K, B, n), free (K,) whether a joint is free."""

    rows: NDArray[np.intp]
    q: Array
    free: Bool


def _doubts(runner: Recorded, found: list[Array], rows: NDArray[np.intp]) -> Doubts:
    """The targets that candidates were found for, as targets `rows` of a batch."""
    shape = (*runner.axes, len(rows))

    def of_each(entry: Array) -> Array:
        """Of every branch and target, (K, B)."""
        return np.broadcast_to(entry, shape).reshape(-1, len(rows)).T

    *values, _, _, free = found
    q = np.stack([of_each(value) for value in values], axis=2)
    return Doubts(rows, q, np.asarray((of_each(free) > 0).any(axis=1)))


def decided(goals: Goals, runner: Recorded, out: Batch, rows: NDArray[np.intp]) -> Batch:
    """Decide what the targets `rows` are, which are on an edge.

    Where a joint is free, the candidates are not all.
    """
    _, _, target, near = goals
    # what is singular hangs on the last digit
    some = _doubts(runner, runner.in_numbers(target[rows]), rows)
    freed = _freed(goals, runner, some)
    out, done = _on_linkages(goals, runner, out, some, freed)
    open_ = ~done
    if not open_.any():
        return out
    if len(part := np.flatnonzero(open_ & freed.narrow)):  # there may be another part
        whole = rows[part]
        freed.first[part], freed.other[part], _ = _at_two(runner, target[whole], near[whole], near[whole] + 1.0)
        freed.other[part] = np.where(freed.loose[part][:, :, None], freed.other[part], np.nan)
    rows, tight = rows[open_], some.q[open_]
    first, other, loose, at_ends = freed.first[open_], freed.other[open_], freed.loose[open_], freed.ends[open_]

    def candidates(of: NDArray[np.intp]) -> Seeds:
        """With the preferred values for joints that are free, and those that other values would change."""
        label = np.arange(first.shape[1])
        if not loose[of].any():
            return Seeds.of(first[of], label, loose[of])
        more = [first[of], other[of]]
        if runner.geometry.ends:
            more.append(tight[of])  # it may be that the joint is not quite free
        fixed = np.zeros((len(of), (len(more) - 1) * len(label)), bool)
        return Seeds.of(
            np.concatenate(more, axis=1), np.tile(label, len(more)), np.concatenate([loose[of], fixed], axis=1)
        )

    unsettled = None
    if runner.geometry.ends:
        unsettled = np.zeros(len(target), bool)
        unsettled[rows[at_ends]], out.complete[rows[at_ends]] = True, False
    return examined(goals, out, rows, candidates, runner.others, unsettled)


class _Freed(NamedTuple):
    """Candidates of K targets, those that leave a joint free with preferred values: as near `near` first (K, B, n).

    other: the same with other values, nan where these change nothing; loose: (K, B) which candidates they change;
    ends: (K,) targets on which the joints that the geometry calls ends are free; narrow: (K,) those with solutions for
    a part of these values, which `near` is not in.
    """

    first: Array
    other: Array
    loose: Bool
    ends: Bool
    narrow: Bool


def _on_linkages(goals: Goals, runner: Recorded, out: Batch, doubts: Doubts, freed: _Freed) -> tuple[Batch, Bool]:
    """The same with those targets (K,) written whose self-motions are known in closed form; which these are (K,)."""
    done, asked = np.zeros(len(doubts.rows), bool), doubts.free & ~freed.ends
    for start in range(0, len(done), AT_ONCE):
        part = start + np.flatnonzero(asked[start : start + AT_ONCE])
        q = np.stack([freed.first[part], freed.other[part]], axis=1)
        for _ in range(2):
            if not len(part):
                break
            some = goals.of(doubts.rows[part])
            found = linkages.settle(some, q, freed.loose[part])
            known = np.flatnonzero(found.known)
            if len(known):
                seeds = _seeds(found, known, freed.first[part[known]], freed.loose[part[known]])
                out = examined(goals, out, doubts.rows[part[known]], seeds.part, runner.others)
                done[part[known]] = True
            lacking = np.flatnonzero(found.lacking)
            part, q = part[lacking], q[lacking]
            if len(part):
                q = np.concatenate([q, runner.samples(some.target[lacking], some.near[lacking])], axis=1)
    return out, done


def _seeds(found: linkages.Linkages, known: NDArray[np.intp], first: Array, loose: Bool) -> Seeds:
    """Postures of known self-motions, and the candidates first (K, B, n) that are not loose (K, B)."""
    order = np.argsort(~found.listed[known], axis=1, kind="stable")
    order = order[:, : int(found.listed[known].sum(axis=1).max(initial=0))]
    there = np.take_along_axis(found.listed[known], order, axis=1)[:, :, None]
    on = np.where(there, np.take_along_axis(found.q[known], order[:, :, None], axis=1), np.nan)
    joints = np.take_along_axis(found.joints[known], order[:, :, None], axis=1)
    q = np.concatenate([np.where(loose[:, :, None], np.nan, first), on], axis=1)
    label = np.concatenate([np.broadcast_to(np.arange(first.shape[1]), first.shape[:2]), found.label[order]], axis=1)
    sure = np.concatenate([np.zeros(first.shape, bool), joints], axis=1)
    order = np.argsort(label, axis=1, kind="stable")
    q, sure = (np.take_along_axis(x, order[:, :, None], axis=1) for x in (q, sure))
    return Seeds(q, np.zeros(order.shape, bool), np.take_along_axis(label, order, axis=1), sure)


def _freed(goals: Goals, runner: Recorded, doubts: Doubts) -> _Freed:
    """Candidates of the doubted targets, with preferred values for joints that are free."""
    _, _, target, near = goals
    rows = np.flatnonzero(doubts.free)
    out = _Freed(
        first=doubts.q.copy(),
        other=np.full(doubts.q.shape, np.nan),
        loose=np.zeros(doubts.q.shape[:2], bool),
        ends=np.zeros(len(doubts.q), bool),
        narrow=np.zeros(len(doubts.q), bool),
    )
    for start in range(0, len(rows), AT_ONCE):
        part = rows[start : start + AT_ONCE]
        whole = doubts.rows[part]
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
    candidates: Callable[[NDArray[np.intp]], Seeds],
    others: Callable[[Array, Array, Bool], tuple[Array, NDArray[np.int64]]],
    unsettled: Bool | None = None,
) -> Batch:
    """Examine the doubted targets and write what is found: branches first, nan behind.

    candidates: of some of the doubted ones; others: more of them, for targets and preferred values, and whether
    branches seem lost or an elimination did not settle them; unsettled: (N,), see `components.examine`.
    """
    for start in range(0, len(doubted), AT_ONCE):
        rows = doubted[start : start + AT_ONCE]
        some = goals.of(rows)
        seeds = candidates(np.arange(start, start + len(rows)))
        incomplete = np.zeros(len(rows), bool) if unsettled is None else unsettled[rows] & ~out.complete[rows]

        def more(which: NDArray[np.int64], lost: Bool, some: Goals = some, incomplete: Bool = incomplete) -> Any:
            return others(some.target[which], some.near[which], lost | incomplete[which])

        seen = components.examine(some, seeds, more, None if unsettled is None else unsettled[rows])
        width = seen.q.shape[1]
        if width > out.q.shape[1]:
            out = wider(out, width)
        write(goals.arm, out, rows, seen.q, seen.valid, named(seen.label, seen.valid), some.near)
        out.status[rows], out.free[rows] = seen.status, seen.free
        out.complete[rows] &= ~seen.again
    return out
