"""Targets with a nearly singular candidate: prepares their seeds for `singular.groups`, and writes its answers."""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import branch_rows, rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int, slices
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, Seeds, write_branches
from armkin.inverse.closed.candidates import Recorded
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import groups, linkages, near_itself, surfaces
from armkin.inverse.tasks.task import targets_at

AT_ONCE = 1024  # targets examined in one call


class _Doubts(NamedTuple):
    """K targets on an edge and their candidates from the formulas."""

    rows: Int  # (K,) rows of the batch
    tight: Array  # (K, B, n) candidates as the formulas give them
    first: Array  # (K, B, n) candidates with the values of `near` for free joints
    second: Array  # (K, B, n) candidates with other values for these, nan where they change nothing
    loose: Bool  # (K, B) which candidates they change
    free: Bool  # (K,) whether a joint is free
    ends: Bool  # (K,) whether joints in the geometry's `ends` are free
    narrow: Bool  # (K,) whether only a range of values without `near` has solutions
    simple: Bool  # (K, B) branches on no edge, of targets that `near` does not solve


def decide_edges(goals: Goals, runner: Recorded, batch: Batch, rows: Int) -> Batch:
    """Decide the branches of the targets `rows`, which are on an edge, at most `AT_ONCE`.

    The candidates do not include all branches where a joint is free.
    """
    doubts = _doubted_targets(goals, runner, rows)
    parts, pending = _linkage_seeds(goals, runner, doubts), np.ones(len(rows), bool)
    for part_rows, seeds in parts:
        pending[part_rows] = False
        if runner.geometry.ends:
            batch = examine_targets(goals, batch, rows[part_rows], seeds, runner.others)
    unsettled = None
    if pending.any():
        seeds = _free_joint_seeds(goals, runner, doubts, pending)
        parts = [*([] if runner.geometry.ends else parts), (np.flatnonzero(pending), seeds)]
        if runner.geometry.ends:
            free_ends, unsettled = rows[pending & doubts.ends], np.zeros(len(goals.target), bool)
            unsettled[free_ends], batch.complete[free_ends] = True, False
    elif runner.geometry.ends:
        return batch
    seeds = stack_rows([seeds for _, seeds in parts])
    rows = rows[np.concatenate([part for part, _ in parts])]
    return examine_targets(goals, batch, rows, seeds, runner.others, unsettled)


def _free_joint_seeds(goals: Goals, runner: Recorded, doubts: _Doubts, pending: Bool) -> Seeds:
    """Seeds of pending targets (K,) with the preferred values for free joints, and those that other values change."""
    if len(part := np.flatnonzero(pending & doubts.narrow)):  # another range of values may have solutions
        target, near = goals.target[doubts.rows[part]], goals.near[doubts.rows[part]]
        doubts.first[part], second, _ = _candidates_at_two(runner, target, near, near + 1.0)
        doubts.second[part] = np.where(doubts.loose[part][:, :, None], second, np.nan)
    _, tight, first, second, loose, *_, simple = rows_of(doubts, pending)
    seed_sets = [first, second] if loose.any() else [first]
    if runner.geometry.ends:
        is_loose: Bool = np.asarray(loose.any(axis=1))
        seed_sets.append(np.where(is_loose[:, None, None], tight, np.nan))
    label = np.tile(np.arange(loose.shape[1]), len(seed_sets))
    if len(seed_sets) > 1:
        padding = np.zeros((len(loose), (len(seed_sets) - 1) * loose.shape[1]), bool)
        loose, simple = (np.concatenate([x, padding], axis=1) for x in (loose, simple))
    return Seeds.of(np.concatenate(seed_sets, axis=1), label, loose, simple)


def _linkage_seeds(goals: Goals, runner: Recorded, doubts: _Doubts) -> list[tuple[Int, Seeds]]:
    """The targets whose self-motions have a closed form, with their seeds."""
    decided: list[tuple[Int, Seeds]] = []
    if not (goals.task.constraints == goals.arm.n and goals.task.orientation == "full"):
        return decided
    part = np.flatnonzero(doubts.free & ~doubts.ends)
    q = np.stack([doubts.first[part], doubts.second[part]], axis=1)
    for _ in range(2):
        if not len(part):
            break
        subset, loose = goals.of(doubts.rows[part]), doubts.loose[part]
        # the loose candidates come first
        B = np.arange(loose.shape[1])
        column = np.argsort(~loose, axis=1, kind="stable")[:, : max(int(loose.sum(axis=1).max()), 1)]
        ordered = np.take_along_axis(q, column[:, None, :, None], axis=2)
        linkage = linkages.decide_self_motions(subset, ordered, np.take_along_axis(loose, column, axis=1))
        if len(rows := np.flatnonzero(linkage.known)):
            # postures of known self-motions and candidates that are not loose, sorted by labels
            k, present = part[rows], ~np.isnan(linkage.q[rows, :, 0])
            slot = np.argsort(~present, axis=1, kind="stable")[:, : int(present.sum(axis=1).max())]
            fixed_q = np.where(loose[rows][:, :, None], np.nan, doubts.first[k])
            label = np.take_along_axis(np.tile(column[rows], q.shape[1]), slot, axis=1)
            label = np.concatenate([np.broadcast_to(B, loose[rows].shape), label], axis=1)
            order = np.argsort(label, axis=1, kind="stable")
            curve, joints = (np.take_along_axis(x[rows], slot[:, :, None], axis=1) for x in (linkage.q, linkage.joints))
            moving = np.concatenate([np.zeros(fixed_q.shape, bool), joints], axis=1)
            seeds = Seeds(
                q=np.take_along_axis(np.concatenate([fixed_q, curve], axis=1), order[:, :, None], axis=1),
                loose=np.zeros(order.shape, bool),
                label=np.take_along_axis(label, order, axis=1),
                sure=np.take_along_axis(moving, order[:, :, None], axis=1),
                simple=np.take_along_axis(np.pad(doubts.simple[k], ((0, 0), (0, slot.shape[1]))), order, axis=1),
            )
            decided.append((k, seeds))
        unknown = np.flatnonzero(linkage.lacking)
        part, q = part[unknown], q[unknown]
        if len(part):
            q = np.concatenate([q, runner.samples(subset.target[unknown], subset.near[unknown])], axis=1)
    return decided


def _doubted_targets(goals: Goals, runner: Recorded, rows: Int) -> _Doubts:
    """The targets `rows` with values for free joints; candidates on no edge that miss their target are nan."""
    arm, task, target, near = goals.of(rows)
    # the last digit may decide about singularity, so use plain numbers, which do not depend on the batch
    outputs = branch_rows(runner.in_numbers(target), len(rows))
    tight, (miss, edge, free) = outputs[:, :, :-3], np.moveaxis(outputs[:, :, -3:], 2, 0)
    is_plain: Bool = np.asarray((edge == 0.0) & (free == 0.0) & (not runner.geometry.ends))
    is_plain[targets_at(task, target, position(arm, near), near_itself.ROOM * arm.reach)] = False
    is_wrong = is_plain & (miss > tol.NEARBY**2)
    tight = np.where(is_wrong[:, :, None], np.nan, tight)
    ends, narrow = np.zeros((2, len(rows)), bool)
    doubts = _Doubts(
        rows=rows, tight=tight, first=tight.copy(), second=np.full(tight.shape, np.nan), ends=ends, narrow=narrow,
        loose=np.zeros(tight.shape[:2], bool), free=np.asarray((free > 0.0).any(axis=1)),
        simple=is_plain & (miss <= tol.ACCEPTED**2),
    )  # fmt: skip
    part = np.flatnonzero(doubts.free)
    if len(part):
        goal, reference = target[part], near[part]
        first, second, solved = _candidates_at_two(runner, goal, reference, reference + 1.0)
        differences = np.abs(first - second)
        changed = ~((differences.max(axis=2) < tol.ROUNDING_DISTANCE) | is_plain[part])
        k = np.flatnonzero(changed.any(axis=1) & ~(changed & solved.any(axis=0)).any(axis=1))
        if len(k):  # only some values of the free joints, or one, have solutions
            shift, single = runner.best_shift(goal[k], reference[k], changed[k])
            best = reference[k] + shift
            first[k], second[k], solved = _candidates_at_two(runner, goal[k], best, best + tol.FOLD_WAY)
            doubts.narrow[part[k]] = solved[1].any(axis=1)
            single &= ~doubts.narrow[part[k]]
            doubts.free[part[k]], second[k[single]] = ~single, np.nan  # one possible value is no freedom
        doubts.first[part] = np.where(is_plain[part][:, :, None], doubts.first[part], first)
        doubts.second[part], doubts.loose[part] = np.where(changed[:, :, None], second, np.nan), changed
        differences = np.minimum(differences, np.abs(differences - 2 * np.pi))[:, :, list(runner.geometry.ends)]
        doubts.ends[part] = (differences > tol.ROUNDING_DISTANCE).any(axis=(1, 2))
    return doubts


def _candidates_at_two(runner: Recorded, target: Array, values: Array, second: Array) -> tuple[Array, Array, Bool]:
    """Candidates for two values of free joints, (N, B, n) each, and whether they solve their targets (2, N, B)."""
    rows = runner.with_values(np.concatenate([target, target]), np.concatenate([values, second]))
    solved = rows[..., -1].reshape(2, len(target), -1) <= tol.ACCEPTED**2
    return rows[: len(target), :, :-1], rows[len(target) :, :, :-1], solved


def examine_targets(
    goals: Goals, batch: Batch, doubted: Int, seeds: Seeds, more: groups.More, unsettled: Bool | None = None
) -> Batch:
    """Examine the doubted targets and write their branches, with nan behind.

    seeds: their candidates; more, unsettled: (N,), see `groups.examine`.
    """
    for part in slices(len(doubted), AT_ONCE):
        rows = doubted[part]
        subset = goals.of(rows)
        lacking = (None, None) if unsettled is None else (unsettled[rows], unsettled[rows] & ~batch.complete[rows])
        decision = groups.examine(subset, rows_of(seeds, part), more, *lacking)
        if decision.surface.any():
            decision = surfaces.list_swept(subset, decision)
        batch = write_branches(goals.arm, batch, rows, decision.q, decision.valid, decision.label, subset.near)
        batch.status[rows], batch.free[rows] = decision.status, decision.free
        batch.complete[rows] &= ~decision.again
    return batch
