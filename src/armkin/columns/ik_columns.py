"""The columns of `ik`: a row for each target with its best branch, or a row for each branch.

The answers are those of `armkin.inverse.choose_branch`, computed on arrays; only listed
branches get a residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.columns.joint_columns import joint_columns
from armkin.columns.table import Table, Words, join_tables
from armkin.formula.arrays import numbers_within
from armkin.inverse import choose_branch
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import find_branches
from armkin.inverse.numeric.tolerances import EQUAL_DECIMALS
from armkin.inverse.tasks.residuals import residual
from armkin.model import limits, units
from armkin.model.lock_joints import unlock

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool

BRANCH_COLUMNS = ("row", "status", "branch", "within_limits", "residual_mm", "residual_deg", "motion")  # beside joints
BLOCK_TARGETS = 2_048  # targets processed together, so that their arrays fit the cache
_STATUS = tuple(status.name.lower() for status in Status)


class BranchTable(NamedTuple):
    """Columns of the branches of some targets, and which targets have no best branch (N,)."""

    table: Table
    is_unsolved: Bool


def branch_columns(
    request: choose_branch.Request,
    targets: Array,
    rows: NDArray[np.integer],
    all_branches: bool,
    nearest_in_c: Callable[..., tuple[NDArray[np.intp], Array] | None] | None = None,
    **options: Any,
) -> BranchTable:
    """The columns of ik: targets (N, ...) [mm, rad], rows (N,) their numbers; all_branches: not the best alone.

    nearest_in_c: `nearest_branches` by machine code; None where it does not serve. options: of `armkin.ik`. The request
    sweeps no joint.
    """
    arm, near = request.arm, units.joints_in(request.arm, request.near_out)
    free_indices = [i for i, name in enumerate(arm.joint_names) if name not in request.held]
    solutions = request.ik(choose_branch.locked_arm(request), targets, request.task, near=near[free_indices], **options)
    q, within_limits = solutions.q, solutions.within_limits
    if request.held:
        values = units.joints_in(arm, [request.held.get(name, 0.0) for name in arm.joint_names])
        q = unlock(arm, {name: values[arm.joint_names.index(name)] for name in request.held}, solutions.q)
        within_limits = within_limits & ~limits.outside_limits(arm, q).any(axis=-1)
    is_free = within_limits & solutions.clear if arm.keep_out else within_limits
    names = () if request.branch is None else find_branches(solutions.names, request.branch)
    parts = []
    for i in range(0, max(len(q), 1), BLOCK_TARGETS):
        block = slice(i, i + BLOCK_TARGETS)
        answers = _Answers(solutions, block, q, within_limits, is_free, near, names)
        parts.append(_list_branches(request, answers, rows, all_branches, nearest_in_c))
    return BranchTable(
        join_tables([part.table for part in parts]), np.concatenate([part.is_unsolved for part in parts])
    )


class _Answers(NamedTuple):
    """Some targets of a batch: q (N, B, n) of the whole arm, within limits, and free besides (N, B); near (n,).

    names: the branches that may be taken, none for all.
    """

    solutions: Solutions
    rows: slice
    q: Array
    within_limits: Bool
    is_free: Bool
    near: Array
    names: Sequence[int]


def _list_branches(
    request: choose_branch.Request, answers: _Answers, rows: NDArray[np.integer], all_branches: bool, nearest_in_c: Any
) -> BranchTable:
    """Lines of a block of targets: all their branches, or the nearest one (`nearest_in_c`)."""
    solutions, block, scale = answers.solutions, answers.rows, units.joint_scale(request.arm)
    q, valid = answers.q[block], solutions.valid[block]
    within_limits, is_free = answers.within_limits[block], answers.is_free[block]
    allowed = is_free if request.branch is None else is_free & np.isin(solutions.branch[block], answers.names)
    if all_branches:
        motion = _joint_motion(q, answers.near, scale)
        key = np.where(valid, motion.round(EQUAL_DECIMALS), np.inf)
        lines = _lines_of_all(q, motion, within_limits, valid, _rank_branches(key, valid, within_limits, is_free))
        is_unsolved = ~_any_column(allowed)
    else:
        arguments = q, allowed, answers.near, scale
        nearest, motion = (nearest_in_c and nearest_in_c(*arguments)) or nearest_branches(*arguments)
        is_unsolved, lines = nearest < 0, _lines_of_nearest(q, motion, within_limits, nearest)
    return BranchTable(_branch_table(request, solutions, rows[block], block, lines), is_unsolved)


def _lines_of_all(q: Array, motion: Array, within_limits: Bool, valid: Bool, ranked: NDArray[np.intp]) -> _Lines:
    """Lines of all branches q (N, B, n) that are valid (N, B), in the order ranked (N, B); one of a target without."""
    count = valid.sum(axis=1)
    lines = np.maximum(count, 1)
    target, has_branch = np.repeat(np.arange(len(lines)), lines), np.repeat(count > 0, lines)
    row = target[has_branch]
    branch = ranked[row, numbers_within(lines)[has_branch]]
    return _Lines(target, has_branch, q[row, branch], within_limits[row, branch], motion[row, branch], row, branch)


def _lines_of_nearest(q: Array, motion: Array, within_limits: Bool, nearest: NDArray[np.intp]) -> _Lines:
    """A line of each target, with its nearest branch (N,) of q (N, B, n), -1 for none; motion: (N,) to that one."""
    has_branch = nearest >= 0
    row, branch = np.flatnonzero(has_branch), nearest[has_branch]
    legal, target = within_limits[row, branch], np.arange(len(nearest))
    return _Lines(target, has_branch, q[row, branch], legal, motion[has_branch], row, branch)


def nearest_branches(q: Array, candidates: Bool, near: Array, scale: Array) -> tuple[NDArray[np.intp], Array]:
    """The branch (N,) of q (N, B, n) that moves the joints least of those wanted (N, B), -1 if none is; and how far.

    Motions are sums of |change| from near (n,), each joint by its scale (n,). Of those that are equal to
    `EQUAL_DECIMALS` decimals the first one counts.
    """
    has_branch, motion = _any_column(candidates), _joint_motion(q, near, scale)
    if not q.shape[1]:
        return np.full(len(q), -1), np.full(len(q), np.nan)
    branch = np.where(candidates, motion.round(EQUAL_DECIMALS), np.inf).argmin(axis=1)
    return np.where(has_branch, branch, -1), motion[np.arange(len(q)), branch]


def _any_column(flags: Bool) -> Bool:
    """``flags.any(axis=1)`` for few columns, column by column, which is faster."""
    any_flag = np.zeros(len(flags), bool)
    for column in flags.T:
        any_flag |= column
    return any_flag


def _rank_branches(key: Array, valid: Bool, within_limits: Bool, is_free: Bool) -> NDArray[np.intp]:
    """Branches (N, B) in the order of a list: free, with hits, outside limits; equal ones in their old order."""
    rank = np.argsort(key, axis=1, kind="stable")
    mixed_rows = np.flatnonzero((is_free != valid).any(axis=1))
    if len(mixed_rows):
        mixed_within, mixed_free = within_limits[mixed_rows], is_free[mixed_rows]
        rank[mixed_rows] = np.lexsort(
            (key[mixed_rows], mixed_within & ~mixed_free, ~mixed_within, ~valid[mixed_rows]), axis=-1
        )
    return rank


def _joint_motion(q: Array, near: Array, scale: Array) -> Array:
    """Sums of |change| from near (n,), each joint by its scale: (N, B, n) -> (N, B), as numpy would add them up."""
    if q.shape[-1] > 7:
        return np.asarray((np.abs(q - near) / scale).sum(axis=-1))
    total = np.zeros(q.shape[:-1])
    for i, (start, unit) in enumerate(zip(near, scale, strict=True)):
        change = q[..., i] - start  # joint by joint, without an array of all joints
        np.abs(change, out=change)
        change /= unit
        total += change
    return total


class _Lines(NamedTuple):
    """Lines (L,), of the targets `line_target`, with K of them a branch: `has_branch`, and what the branches are."""

    line_target: NDArray[np.intp]  # (L,)
    has_branch: Bool  # (L,)
    q: Array  # (K, n)
    within_limits: Bool  # (K,)
    motion: Array  # (K,)
    target: NDArray[np.intp]  # (K,)
    branch: NDArray[np.intp]  # (K,)


def _branch_table(
    request: choose_branch.Request, solutions: Solutions, rows: NDArray[np.integer], rows_of_part: slice, lines: _Lines
) -> Table:
    """One line for each target, or branch of it, with numbers where there is a branch."""
    present, all_present = lines.has_branch, bool(lines.has_branch.all())
    distances, angles = _residuals(request, solutions, rows_of_part, lines)
    names = tuple(name.replace(",", "") for name in solutions.names)  # `cut` must see one column
    label = np.full(len(present), -1)
    label[present] = solutions.branch[rows_of_part][lines.target, lines.branch]
    table: Table = {
        "row": rows[lines.line_target],
        "status": Words(solutions.status[rows_of_part][lines.line_target], _STATUS),
        "branch": Words(label, names),
    }
    joints = np.ascontiguousarray(units.joints_out(request.arm, lines.q).T)
    within_limits = np.zeros(len(present), bool)
    within_limits[present] = lines.within_limits
    joint_names = joint_columns(request.arm.joint_names)
    table |= dict(zip(joint_names, joints, strict=True)) | {"within_limits": within_limits}
    table |= {"residual_mm": distances, "residual_deg": units.angles_out(angles), "motion": lines.motion}
    if all_present:
        return table
    numbers = (*joint_names, "residual_mm", "residual_deg", "motion")
    return table | {name: _fill_gaps(np.asarray(table[name]), present) for name in numbers}


def _residuals(request: choose_branch.Request, solutions: Solutions, part: slice, lines: _Lines) -> tuple[Array, Array]:
    """What some branches miss: (K,) [mm] and (K,) [rad]."""
    q = solutions.q[part][lines.target, lines.branch] if request.held else lines.q
    target = solutions.target[part]
    if not len(q) == len(lines.has_branch) == len(target):
        target = target[lines.target]
    residuals = residual(solutions.task, request.fk(solutions.arm, q), q, target)
    position_size = solutions.task.position
    return _row_norms(residuals[:, :position_size]), _row_norms(residuals[:, position_size:])


def _row_norms(values: Array) -> Array:
    """Lengths of rows."""
    total = np.zeros(len(values))
    for column in values.T:
        total += column * column
    return np.asarray(np.sqrt(total))


def _fill_gaps(values: Array, present: Bool) -> Array:
    """Values where they are `present`, nan elsewhere."""
    padded = np.full(len(present), np.nan)
    padded[present] = values
    return padded
