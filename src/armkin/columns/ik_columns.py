"""Targets to the columns of `ik`: one row a target with its best branch, or one a branch.

What `armkin.inverse.choose_branch` answers target by target, on arrays; only
branches that are listed get their residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.columns.table import Table, Words, joined
from armkin.formula.arrays import numbers_within
from armkin.inverse import choose_branch
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import find_branches
from armkin.inverse.numeric.tolerances import EQUAL
from armkin.inverse.tasks.residuals import residual
from armkin.model import limits, units
from armkin.model.lock_joints import unlock

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool

BLOCK = 2_048  # targets of which all arrays fit the cache
_STATUS = tuple(status.name.lower() for status in Status)


class BranchTable(NamedTuple):
    """Columns of the branches of some targets, and which targets have no best branch (N,)."""

    table: Table
    unsolved: Bool


def columns(
    request: choose_branch.Request,
    targets: Array,
    rows: NDArray[np.integer],
    all_branches: bool,
    quick: Callable[..., tuple[NDArray[np.intp], Array] | None] | None = None,
    **more: Any,
) -> BranchTable:
    """The columns of ik: targets (N, ...) [mm, rad], rows (N,) their numbers; all_branches: not the best alone.

    more: of `armkin.ik`. The request sweeps no joint. quick: `nearest` by machine code, None where it does not serve.
    """
    arm, near = request.arm, units.joints_in(request.arm, request.near_out)
    kept = [i for i, name in enumerate(arm.joint_names) if name not in request.held]
    s = request.ik(choose_branch.locked_arm(request), targets, request.task, near=near[kept], **more)
    q, within = s.q, s.within_limits
    if request.held:
        values = units.joints_in(arm, [request.held.get(name, 0.0) for name in arm.joint_names])
        q = unlock(arm, {name: values[arm.joint_names.index(name)] for name in request.held}, s.q)
        within = within & ~limits.outside(arm, q).any(axis=-1)
    free = within & s.clear if arm.keep_out else within
    names = () if request.branch is None else find_branches(s.names, request.branch)
    parts = [
        _listed(request, _Answers(s, slice(i, i + BLOCK), q, within, free, near, names), rows, all_branches, quick)
        for i in range(0, max(len(q), 1), BLOCK)
    ]
    return BranchTable(joined([part.table for part in parts]), np.concatenate([part.unsolved for part in parts]))


class _Answers(NamedTuple):
    """Some targets of a batch: q (N, B, n) of the whole arm, within limits, and free besides (N, B); near (n,).

    names: the branches that may be taken, none for all.
    """

    s: Solutions
    rows: slice
    q: Array
    within_limits: Bool
    free: Bool
    near: Array
    names: Sequence[int]


def _listed(
    request: choose_branch.Request, answers: _Answers, rows: NDArray[np.integer], all_branches: bool, quick: Any
) -> BranchTable:
    s, some, scale = answers.s, answers.rows, units.scale(request.arm)
    q, within, free, valid = answers.q[some], answers.within_limits[some], answers.free[some], s.valid[some]
    wanted = free if request.branch is None else free & np.isin(s.branch[some], answers.names)
    if all_branches:
        unsolved, motion = ~_any_column(wanted), _motion(q, answers.near, scale)
        key = np.where(valid, motion.round(EQUAL), np.inf)
        count = valid.sum(axis=1)
        lines = np.maximum(count, 1)
        target = np.repeat(np.arange(len(lines)), lines)
        there = np.repeat(count > 0, lines)
        place = numbers_within(lines)
        branch = _ranked(key, valid, within, free)[target[there], place[there]]
        motion = motion[target[there], branch]
    else:
        best, motion = (quick and quick(q, wanted, answers.near, scale)) or nearest(q, wanted, answers.near, scale)
        target, there = np.arange(len(best)), best >= 0
        unsolved, branch, motion = ~there, best[there], motion[there]
    chosen = target[there], branch
    values = _Lines(target, there, q[chosen], within[chosen], motion, *chosen)
    return BranchTable(_table(request, s, rows[some], some, values), unsolved)


def nearest(q: Array, candidates: Bool, near: Array, scale: Array) -> tuple[NDArray[np.intp], Array]:
    """The branch (N,) of q (N, B, n) that moves the joints least of those wanted (N, B), -1 if none is; and how far.

    Motions are sums of |change| from near (n,), each joint by its scale (n,); to `EQUAL` decimals the first one counts.
    """
    there, motion = _any_column(candidates), _motion(q, near, scale)
    if not q.shape[1]:
        return np.full(len(q), -1), np.full(len(q), np.nan)
    branch = np.where(candidates, motion.round(EQUAL), np.inf).argmin(axis=1)
    return np.where(there, branch, -1), motion[np.arange(len(q)), branch]


def _any_column(flags: Bool) -> Bool:
    """``flags.any(axis=1)`` of a few columns, column by column, which is quicker."""
    found = np.zeros(len(flags), bool)
    for column in flags.T:
        found |= column
    return found


def _ranked(key: Array, valid: Bool, within_limits: Bool, free: Bool) -> NDArray[np.intp]:
    """Branches (N, B) in the order in which they are listed: free, with hits, outside limits; equal ones as found."""
    rank = np.argsort(key, axis=1, kind="stable")
    other = np.flatnonzero((free != valid).any(axis=1))
    if len(other):
        k, v, w, f = key[other], valid[other], within_limits[other], free[other]
        rank[other] = np.lexsort((k, w & ~f, ~w, ~v), axis=-1)
    return rank


def _motion(q: Array, near: Array, scale: Array) -> Array:
    """Sums of |change| from near (n,), each joint by its scale: (N, B, n) -> (N, B), as numpy would add them up."""
    if q.shape[-1] > 7:
        return _sum(np.abs(q - near) / scale)
    total = np.zeros(q.shape[:-1])
    for i, (start, unit) in enumerate(zip(near, scale, strict=True)):
        away = q[..., i] - start  # joint by joint: no array of all of them
        np.abs(away, out=away)
        away /= unit
        total += away
    return total


def _sum(values: Array) -> Array:
    """``values.sum(axis=-1)``, to the same bits: numpy adds up to seven numbers from left to right, but slowly."""
    if values.shape[-1] > 7:
        return np.asarray(values.sum(axis=-1))
    total = values[..., 0].copy()
    for i in range(1, values.shape[-1]):
        total += values[..., i]
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


def _table(
    request: choose_branch.Request, s: Solutions, rows: NDArray[np.integer], rows_of_part: slice, lines: _Lines
) -> Table:
    """One line for each target, or branch of it, with numbers where there is a branch."""
    there, every = lines.has_branch, bool(lines.has_branch.all())
    mm, rad = _missed(request, s, rows_of_part, lines)
    names = tuple(name.replace(",", "") for name in s.names)  # so that `cut` sees one column
    label = np.full(len(there), -1)
    label[there] = s.branch[rows_of_part][lines.target, lines.branch]
    table: Table = {
        "row": rows[lines.line_target],
        "status": Words(s.status[rows_of_part][lines.line_target], _STATUS),
        "branch": Words(label, names),
    }
    joints = np.ascontiguousarray(units.joints_out(request.arm, lines.q).T)
    legal = np.zeros(len(there), bool)
    legal[there] = lines.within_limits
    table |= dict(zip(request.arm.joint_names, joints, strict=True)) | {"within_limits": legal}
    table |= {"residual_mm": mm, "residual_deg": units.angles_out(rad), "motion": lines.motion}
    if every:
        return table
    numbers = (*request.arm.joint_names, "residual_mm", "residual_deg", "motion")
    return table | {name: _with_gaps(np.asarray(table[name]), there) for name in numbers}


def _missed(request: choose_branch.Request, s: Solutions, part: slice, lines: _Lines) -> tuple[Array, Array]:
    """What some branches miss: (K,) [mm] and (K,) [rad]."""
    q = s.q[part][lines.target, lines.branch] if request.held else lines.q
    target = s.target[part] if len(q) == len(lines.has_branch) == len(s.target[part]) else s.target[part][lines.target]
    missing = residual(s.task, request.fk(s.arm, q), q, target)
    p = s.task.position
    return _norm(missing[:, :p]), _norm(missing[:, p:])


def _norm(values: Array) -> Array:
    """Lengths of rows."""
    total = np.zeros(len(values))
    for column in values.T:
        total += column * column
    return np.asarray(np.sqrt(total))


def _with_gaps(values: Array, present: Bool) -> Array:
    """Values where they are `present`, nan elsewhere."""
    out = np.full(len(present), np.nan)
    out[present] = values
    return out
