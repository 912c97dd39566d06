"""`armkin.ik`: computes all branches of targets, and which of them are within limits.

Steps for a target: task -> geometry -> candidate branches -> their residuals by the forward
kinematics -> whole turns and limits -> examination of the few targets in doubt.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.engines.threads import check_workers, share_rows
from armkin.formula import arrays
from armkin.formula.array_tuples import replace_rows, rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int
from armkin.forward import position
from armkin.inverse.answers import rounding as target_rounding
from armkin.inverse.answers.batch import Batch, Goals, Seeds, as_solutions, empty_batch, pack_branches
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.tracking import follow_branches
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.elimination.merge import projection
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.families import families
from armkin.inverse.redundant.position_first import solve_position_first
from armkin.inverse.run import chunks
from armkin.inverse.run import single as one_target
from armkin.inverse.run.edges import examine_targets
from armkin.inverse.singular import legal_postures, near_itself
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import Task, distance, flat_targets, read_near, read_targets, targets_around, targets_at
from armkin.model.arm import Arm, actual_arm

THREAD_POSES = 256  # fewest poses of an elimination for a thread, and size of its chunks


def ik(
    arm: Arm,
    targets: ArrayLike,
    task: str | None = None,
    *,
    near: ArrayLike | None = None,
    examine: bool = True,
    workers: int = 1,
    rounding: ArrayLike | None = None,
    position_first: bool = False,
) -> Solutions:
    """All real branches of inverse kinematics.

    Args:
        arm: the arm, as `armkin.load` gives it.
        targets: (..., m) [mm, rad] by the task, or (..., 4, 4) [mm] for task "pose"; leading axes are a batch.
        task: what targets prescribe, a name of the table in docs/solver.md; by default the arm's own task.
        near: (n,) or (..., n) [rad | mm] joint values to stay close to; by default home.
        examine: False leaves targets on an edge (branches that all but meet, joints that are free) as the formulas have
            them: some of their branches may be missing.
        workers: threads that share a large batch, whose results are the same.
        rounding: () or (...) [reaches, rad] how far the targets' numbers may be off; by default what the arrays show.
            near, where it solves its target to within that, is a branch and the best one.
        position_first: arms of four or five joints asked for task "pose" keep the position and come as near to the
            rotation as they can (`armkin.inverse.redundant.position_first`).

    Returns:
        The branches, `q` (..., B, n) [rad | mm], with their names, whether each is within limits, and the `best` one.

    Raises:
        UsageError: the task does not fit the arm, a target or near is malformed, or workers is below 1.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> s = armkin.ik(arm, [390, 80, 300])
    >>> s.names[s.branch[s.best]], np.rad2deg(s.q[s.best]).round(4).tolist()
    ('left, elbow up', [10.1529, 44.656, -46.5354])
    """
    if workers != 1:
        check_workers(workers)
    redundant = redundancy(arm, task)
    values, single = arrays.real_array(targets, "targets"), arrays.is_single(targets)
    is_simple = rounding is None and not (single or position_first) and examine and redundant is None
    if is_simple and (values.ndim == 1 or values.shape == (4, 4)):  # a batch prepares nothing for one
        single_solver = one_target.short_way(arm, task)
        if single_solver is not None and (solutions := single_solver.solve(values, near)) is not None:
            return solutions
    options: dict[str, Any] = {"examine": examine, "workers": workers, "rounding": rounding}
    if (turned := actual_arm(arm)) is not arm:
        s = ik(turned, targets, task, near=_actual_near(arm, near), position_first=position_first, **options)
        return _as_commanded(arm, s)
    if position_first:
        return solve_position_first(ik, arm, task, targets, near)
    if redundant is not None:
        return families(ik, arm, redundant, targets, near, rounding)
    return solve_by(arm, *solver(arm, task), values, near, single=single, **options)


def solve_by(
    arm: Arm,
    task: Task,
    geometry: Geometry,
    values: Array,
    near: ArrayLike | None,
    *,
    single: bool = False,
    examine: bool = True,
    workers: int = 1,
    rounding: ArrayLike | None = None,
) -> Solutions:
    """`ik` by a given solver, for an arm with ratios of 1; single: whether the targets were given in float32."""
    targets, batch_shape = flat_targets(task, values)
    reference = read_near(arm, near, batch_shape)
    nears = np.broadcast_to(reference.reshape(-1, arm.n), (len(targets), arm.n))
    common = reference if reference.ndim == 1 else None
    if geometry.pairs:
        solved = chunks.solve_closed_form(Goals(arm, task, targets, nears), geometry, common, examine, workers)
        batch, count, target, defect, unsolved = solved
        goals = Goals(arm, task, target, nears)
        if len(unsolved):
            batch = _by_slower_class(goals, geometry.doubts, batch, unsolved, examine, workers)
    else:
        target, _, defect = read_targets(task, values)
        target = target.copy() if np.may_share_memory(target, values) else target  # the caller may change its arrays
        goals = Goals(arm, task, target, nears)
        batch, count = _row_by_row(goals, geometry, examine, workers)
    rounded, bounds = target_rounding.of_targets(arm, task, target, (targets, defect), single, rounding, batch_shape)
    if examine:
        batch = _better_postures(goals, batch, bounds)
    if arm.prismatic.any():
        batch.complete[distance(arm, task, target) > tol.FAR_DISTANCE] = False
    if not geometry.ordered:
        batch.branch[...] = follow_branches(arm, task, batch.q, target)
    names = branch_names(arm, task, geometry, count)
    names += tuple(f"branch {i + 1}" for i in range(count, batch.q.shape[1]))
    return as_solutions(goals, reference, batch_shape, batch, rounded, (names, geometry.name, geometry.why))


def _better_postures(goals: Goals, batch: Batch, bounds: Array) -> Batch:
    """The batch with legal postures of self-motions, `near` where it solves its target to within bounds (N,), and
    postures that hit nothing, where there are such."""
    edge = np.flatnonzero((batch.status == Status.BOUNDARY) | (batch.status == Status.SINGULAR))
    if len(illegal := edge[~batch.within[edge].any(axis=1)]):
        batch = legal_postures.with_legal_postures(goals, batch, illegal)
    if bounds.max(initial=0.0) > near_itself.ROUNDED:
        batch = near_itself.list_near(goals, batch, bounds)
    return legal_postures.with_free_postures(goals, batch) if goals.arm.keep_out else batch


def columns(
    arm: Arm, targets: Array, task: str | None = None, *, kept: bool = False
) -> Iterator[chunks.Columns] | None:
    """Branches of targets (N, m) or (N, 4, 4) as columns in parts, for callers that only count them.

    None for an arm without a closed form, or with other ratios than 1. kept: whether the arrays of a part stay valid
    after the next part is computed. Raises RedundantArmError where the answers of a target are curves.
    """
    definition, geometry = solver(arm, task)
    if geometry.pairs is None or actual_arm(arm) is not arm:
        return None
    return chunks.columns(arm, definition, geometry, targets, kept)


def isolated_branches(arm: Arm, targets: ArrayLike, task: str | None = None, **more: Any) -> Solutions:
    """`ik` for following single branches; raises RedundantArmError if the answers of a target are curves."""
    solver(actual_arm(arm), task)
    return ik(arm, targets, task, **more)


def _actual_near(arm: Arm, near: ArrayLike | None) -> Array | None:
    """Actual joint values of commanded ones; values of a wrong shape stay unchanged, so that `ik` refuses them."""
    reference = None if near is None else arrays.real_array(near, "near")
    return reference * arm.ratio if reference is not None and reference.shape[-1:] == (arm.n,) else reference


def _as_commanded(arm: Arm, solved: Solutions) -> Solutions:
    """Solutions in commanded joint values, from those in actual ones."""
    near, interval, task = solved.near / arm.ratio, solved.interval, solved.task.name
    if interval is not None and (redundant := redundancy(arm, task)) is not None:
        interval = np.sort(interval / arm.ratio[redundant.joint], axis=-1)
    return replace(solved, arm=arm, task=task_for(arm, task), near=near, q=solved.q / arm.ratio, interval=interval)


def _by_slower_class(
    goals: Goals, geometry: Geometry | None, batch: Batch, doubted: Int, examine: bool, workers: int
) -> Batch:
    """The batch after solving targets in doubt by the slower class that the closed form names."""
    assert geometry is not None
    part = goals.of(doubted)
    if not geometry.pairs:
        return replace_rows(batch, doubted, _row_by_row(part, geometry, examine, workers)[0])
    solved, _, target, _, unsolved = chunks.solve_closed_form(part, geometry, None, examine, workers)
    if len(unsolved):
        solved = _by_slower_class(part._replace(target=target), geometry.doubts, solved, unsolved, examine, workers)
    return replace_rows(batch, doubted, solved)


def _row_by_row(goals: Goals, geometry: Geometry, examine: bool, workers: int) -> tuple[Batch, int]:
    """The batch of a solver that returns joint values by rows, and its number of branch columns."""
    assert geometry.rows is not None
    arm, task, target, near = goals
    solve = (geometry.unmoved if examine else None) or geometry.rows
    parts = share_rows(lambda rows: solve(target[rows]), len(target), workers, THREAD_POSES, THREAD_POSES)
    q, doubt, complete, lost, guesses = stack_rows(parts)
    B = q.shape[1]
    batch = empty_batch(len(target), B, arm.n)
    batch.q[...], is_within = nearest_row(arm, q, near[:, None, :])
    batch.valid[...] = ~np.isnan(q).any(axis=2)
    batch.within[...] = is_within & batch.valid
    batch.branch[...] = np.where(batch.valid, np.arange(B), -1)
    batch.complete[...] = complete
    count = batch.valid.sum(axis=1)
    batch.status[count == 0] = Status.UNREACHABLE
    for rows in arrays.slices(len(count), arrays.CHUNK):
        pack_branches(rows_of(batch, rows), count[rows])
    if examine:
        at_near = targets_at(task, target, position(arm, near), near_itself.ROOM * arm.reach)
        doubt[near_itself.put_near(goals, batch, at_near)] = True
    doubted = np.flatnonzero(doubt)
    if examine and len(doubted):
        candidates = q[doubted] if guesses is None else np.concatenate([q[doubted], guesses[doubted]], axis=1)
        seeds = Seeds.of(candidates, np.arange(candidates.shape[1]) % max(B, 1))

        def others(target: Array, near: Array, lost: Bool) -> tuple[Array, Int, Bool]:
            """Branches of targets around these on both sides, as two merged roots become real on one of the sides.

            Such branches give no information about self-motions and about ends of the workspace.
            """
            candidates = solve(targets_around(arm, task, target).reshape(-1, *target.shape[1:])).q
            candidates = candidates.reshape(len(target), -1, arm.n)
            return candidates, np.arange(candidates.shape[1]) % max(B, 1), lost

        is_unsettled = np.zeros(len(target), bool) if lost is None else lost
        batch = examine_targets(goals, batch, doubted, seeds, others, is_unsettled)
        order = projection(arm.prismatic, batch.q[doubted]).argsort(axis=1)  # independent of the search
        for array in (batch.q, batch.valid, batch.within, batch.branch):
            table = array[doubted]
            array[doubted] = np.take_along_axis(table, order.reshape(order.shape + (1,) * (table.ndim - 2)), axis=1)
    return batch, B
