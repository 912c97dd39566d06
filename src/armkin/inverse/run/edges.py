"""Targets with a nearly singular candidate: what goes to `singular.components`, and where its answers are written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int, slices
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, Seeds, write_branches
from armkin.inverse.closed.candidates import Recorded, as_rows
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import components, linkages, near_itself, surfaces

AT_ONCE = 1024  # targets examined together


class _Doubts(NamedTuple):
    """K targets on an edge: as rows of a batch (K,), candidates as the formulas have them (K, B, n), and with preferred
    values for joints that are free: as near `near` first (K, B, n).

    other: the same with other values, nan where these change nothing; loose: (K, B) which candidates they change;
    free: (K,) whether a joint is; ends: (K,) targets on which the joints that the geometry calls ends are free;
    narrow: (K,) those with solutions for a part of these values, which `near` is not in; simple: (K, B) branches that
    are on no edge, of targets that `near` does not solve.
    """

    rows: Int
    tight: Array
    first: Array
    other: Array
    loose: Bool
    free: Bool
    ends: Bool
    narrow: Bool
    simple: Bool


def decide_edges(goals: Goals, runner: Recorded, batch: Batch, rows: Int) -> Batch:
    """Decide what the targets `rows` are, which are on an edge: at most `AT_ONCE`.

    Where a joint is free, the candidates are not all.
    """
    _, _, target, near = goals
    doubts = _doubted_targets(goals, runner, rows)
    parts, left = _on_linkages(goals, runner, doubts), np.ones(len(rows), bool)
    for part_rows, seeds in parts:
        left[part_rows] = False
        if runner.geometry.ends:
            batch = examine_targets(goals, batch, rows[part_rows], seeds, runner.others)
    unsettled = None
    if left.any():
        if len(part := np.flatnonzero(left & doubts.narrow)):  # there may be another part
            narrow = rows[part]
            doubts.first[part], second, _ = _candidates_at_two(runner, target[narrow], near[narrow], near[narrow] + 1.0)
            doubts.other[part] = np.where(doubts.loose[part][:, :, None], second, np.nan)
        open_, tight, first, second, loose, _, at_ends, _, simple = rows_of(doubts, left)
        # seeds: with the preferred values for free joints, and what other values of these would change
        more = [first, second] if loose.any() else [first]
        if runner.geometry.ends:
            hangs: Bool = np.asarray(loose.any(axis=1))
            more.append(np.where(hangs[:, None, None], tight, np.nan))  # it may be that the joint is not quite free
            unsettled = np.zeros(len(target), bool)
            unsettled[open_[at_ends]], batch.complete[open_[at_ends]] = True, False
        label = np.tile(np.arange(loose.shape[1]), len(more))
        if len(more) > 1:
            fixed = np.zeros((len(loose), (len(more) - 1) * loose.shape[1]), bool)
            loose, simple = (np.concatenate([x, fixed], axis=1) for x in (loose, simple))
        seeds = Seeds.of(np.concatenate(more, axis=1), label, loose, simple)
        parts = [*([] if runner.geometry.ends else parts), (np.flatnonzero(left), seeds)]
    elif runner.geometry.ends:
        return batch
    seeds = stack_rows([seeds for _, seeds in parts])
    rows = rows[np.concatenate([part for part, _ in parts])]
    return examine_targets(goals, batch, rows, seeds, runner.others, unsettled)


def _on_linkages(goals: Goals, runner: Recorded, doubts: _Doubts) -> list[tuple[Int, Seeds]]:
    """The targets whose self-motions are known in closed form, with their seeds."""
    settled: list[tuple[Int, Seeds]] = []
    if not (goals.task.constraints == goals.arm.n and goals.task.orientation == "full"):
        return settled
    part = np.flatnonzero(doubts.free & ~doubts.ends)
    q = np.stack([doubts.first[part], doubts.other[part]], axis=1)
    for _ in range(2):
        if not len(part):
            break
        subset, loose = goals.of(doubts.rows[part]), doubts.loose[part]
        # the loose candidates come first
        B = np.arange(loose.shape[1])
        column = np.argsort(~loose, axis=1, kind="stable")[:, : max(int(loose.sum(axis=1).max()), 1)]
        ordered = np.take_along_axis(q, column[:, None, :, None], axis=2)
        linked = linkages.settle(subset, ordered, np.take_along_axis(loose, column, axis=1))
        if len(rows := np.flatnonzero(linked.known)):
            # postures of known self-motions, and the candidates that are not loose, by their labels
            whose, present = part[rows], ~np.isnan(linked.q[rows, :, 0])
            places = np.argsort(~present, axis=1, kind="stable")[:, : int(present.sum(axis=1).max())]
            fixed = np.where(loose[rows][:, :, None], np.nan, doubts.first[whose])
            label = np.take_along_axis(np.tile(column[rows], q.shape[1]), places, axis=1)
            label = np.concatenate([np.broadcast_to(B, loose[rows].shape), label], axis=1)
            order = np.argsort(label, axis=1, kind="stable")
            curve, joints = (np.take_along_axis(x[rows], places[:, :, None], axis=1) for x in (linked.q, linked.joints))
            motion = np.concatenate([np.zeros(fixed.shape, bool), joints], axis=1)
            seeds = Seeds(
                q=np.take_along_axis(np.concatenate([fixed, curve], axis=1), order[:, :, None], axis=1),
                loose=np.zeros(order.shape, bool),
                label=np.take_along_axis(label, order, axis=1),
                sure=np.take_along_axis(motion, order[:, :, None], axis=1),
                simple=np.take_along_axis(np.pad(doubts.simple[whose], ((0, 0), (0, places.shape[1]))), order, axis=1),
            )
            settled.append((whose, seeds))
        lacking = np.flatnonzero(linked.lacking)
        part, q = part[lacking], q[lacking]
        if len(part):
            q = np.concatenate([q, runner.samples(subset.target[lacking], subset.near[lacking])], axis=1)
    return settled


def _doubted_targets(goals: Goals, runner: Recorded, rows: Int) -> _Doubts:
    """The targets `rows`, with preferred values for joints that are free; what is on no edge and misses is nan."""
    arm, task, target, near = goals.of(rows)
    # whether a target is singular depends on the last digit: plain numbers give every batch the same
    outputs = as_rows(runner.in_numbers(target), len(rows))
    tight, (miss, edge, free) = outputs[:, :, :-3], np.moveaxis(outputs[:, :, -3:], 2, 0)
    plain: Bool = np.asarray((edge == 0.0) & (free == 0.0) & (not runner.geometry.ends))
    plain[near_itself.at_tip(arm, task, target, position(arm, near))] = False
    gone = plain & (miss > tol.NEARBY**2)
    doubts = _Doubts(
        rows=rows,
        tight=np.where(gone[:, :, None], np.nan, tight),
        first=np.where(gone[:, :, None], np.nan, tight),
        other=np.full(tight.shape, np.nan),
        loose=np.zeros(tight.shape[:2], bool),
        free=np.asarray((free > 0.0).any(axis=1)),
        ends=np.zeros(len(rows), bool),
        narrow=np.zeros(len(rows), bool),
        simple=plain & (miss <= tol.ACCEPTED**2),
    )
    part = np.flatnonzero(doubts.free)
    if len(part):
        goal, reference = target[part], near[part]
        first, second, solved = _candidates_at_two(runner, goal, reference, reference + 1.0)
        apart = np.abs(first - second)
        changed = ~((apart.max(axis=2) < tol.SAME) | plain[part])
        lost = np.flatnonzero(changed.any(axis=1) & ~(changed & solved.any(axis=0)).any(axis=1))
        if len(lost):  # solutions for some values of the free joints alone, or for one
            shift, single = runner.best_shift(goal[lost], reference[lost], changed[lost])
            best = reference[lost] + shift
            first[lost], second[lost], solved = _candidates_at_two(runner, goal[lost], best, best + tol.FOLD_WAY)
            doubts.narrow[part[lost]] = solved[1].any(axis=1)
            single &= ~doubts.narrow[part[lost]]
            doubts.free[part[lost]], second[lost[single]] = ~single, np.nan  # one value alone is no freedom
        doubts.first[part] = np.where(plain[part][:, :, None], doubts.first[part], first)
        doubts.other[part], doubts.loose[part] = np.where(changed[:, :, None], second, np.nan), changed
        apart = np.minimum(apart, np.abs(apart - 2 * np.pi))[:, :, list(runner.geometry.ends)]
        doubts.ends[part] = (apart > tol.SAME).any(axis=(1, 2))
    return doubts


def _candidates_at_two(runner: Recorded, target: Array, values: Array, second: Array) -> tuple[Array, Array, Bool]:
    """Candidates for two values of free joints, (N, B, n) each, and which solve their targets (2, N, B)."""
    rows = runner.with_values(np.concatenate([target, target]), np.concatenate([values, second]))
    solved = rows[..., -1].reshape(2, len(target), -1) <= tol.ACCEPTED**2
    return rows[: len(target), :, :-1], rows[len(target) :, :, :-1], solved


def examine_targets(
    goals: Goals, batch: Batch, doubted: Int, seeds: Seeds, more: components.More, unsettled: Bool | None = None
) -> Batch:
    """Examine the doubted targets and write what is found: branches first, nan behind.

    seeds: candidates of these; more, unsettled: (N,), see `components.examine`.
    """
    for part in slices(len(doubted), AT_ONCE):
        rows = doubted[part]
        subset = goals.of(rows)
        lacking = (None, None) if unsettled is None else (unsettled[rows], unsettled[rows] & ~batch.complete[rows])
        decision = components.examine(subset, rows_of(seeds, part), more, *lacking)
        if decision.surface.any():
            decision = surfaces.list_swept(subset, decision)
        batch = write_branches(goals.arm, batch, rows, decision.q, decision.valid, decision.label, subset.near)
        batch.status[rows], batch.free[rows] = decision.status, decision.free
        batch.complete[rows] &= ~decision.again
    return batch
