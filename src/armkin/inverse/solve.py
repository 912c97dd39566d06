"""`armkin.ik`: from targets to all branches within limits.

The way of a target: task -> geometry -> candidate branches -> residual of each, through the
forward kinematics -> whole turns and limits -> the few doubtful ones through `doubtful`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Bool, Entry
from armkin.inverse import one_target
from armkin.inverse.batch import Batch, empty, pack
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.tracking import follow
from armkin.inverse.branches.turns import nearest_copy, nearest_row
from armkin.inverse.closed.candidates import entries, preferred, recorded
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.doubtful import decided, examined
from armkin.inverse.many_starts import many_starts
from armkin.inverse.numeric.tolerances import ACCEPTED, FAR, NEARBY
from armkin.inverse.recognise import solver
from armkin.inverse.solutions import Solutions, Status
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import Task, around, distance, read_targets
from armkin.model.arm import actual
from armkin.model.limits import SLACK

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def ik(
    arm: Arm, targets: ArrayLike, task: str | None = None, *, near: ArrayLike | None = None, examine: bool = True
) -> Solutions:
    """All real branches of inverse kinematics.

    targets: (..., m) by the task [mm, rad], or (..., 4, 4) for task "pose"; task: by default the
    arm's own; near: (n,) or (..., n) [rad | mm] joint values to stay close to, by default home;
    examine: False leaves targets on an edge (branches that all but meet, joints that are free) as the formulas have
    them: some of their branches may be missing.
    Raises UsageError if the task does not fit the arm or a target is malformed.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> s = armkin.ik(arm, [390, 80, 300])
    >>> s.names[s.branch[s.best]], np.rad2deg(s.q[s.best]).round(4).tolist()
    ('left, elbow up', [10.1529, 44.656, -46.5354])
    """
    values = arrays.real(targets, "targets")
    if examine and values.ndim <= 2 and (alone := one_target.solve(arm, values, task, near)) is not None:
        return alone
    if (turned := actual(arm)) is not arm:
        return _commanded(arm, ik(turned, targets, task, near=_actual_near(arm, near), examine=examine))
    definition, geometry = solver(arm, task)
    target, lead, rounding = read_targets(definition, values)
    close = arm.home if near is None else arrays.real(near, "near")
    if close.shape != (arm.n,) and close.shape != (*lead, arm.n):
        raise UsageError(f"near has shape {close.shape}; expected ({arm.n},) or {(*lead, arm.n)}")
    if not np.isfinite(close).all():
        raise UsageError("near holds nan or infinity; every joint value must be finite")
    many = close.ndim == 1 and len(target) != 1
    each = np.broadcast_to(close, (len(target), arm.n)) if many else close.reshape(-1, arm.n)
    one = close if close.ndim == 1 else None
    if geometry.pairs:
        out, count = _closed(arm, definition, geometry, target, each, one, examine)
    else:
        out, count = _rows(arm, definition, geometry, target, each, examine)
    if arm.prismatic.any():
        out.complete[distance(arm, definition, target) > FAR] = False
    if not geometry.ordered:
        out.branch[...] = follow(arm, definition, out.q, target)
    names = branch_names(arm, definition, geometry, count)
    names += tuple(f"branch {i + 1}" for i in range(count, out.q.shape[1]))
    each_branch = (*lead, out.q.shape[1])
    return Solutions(
        arm=arm,
        task=definition,
        target=target.reshape(lead + target.shape[1:]).copy(),  # the caller's arrays may change
        near=np.broadcast_to(close.copy(), (*lead, arm.n)),
        q=out.q.reshape(*each_branch, arm.n),
        valid=out.valid.reshape(each_branch),
        within_limits=out.within.reshape(each_branch),
        branch=out.branch.reshape(each_branch),
        status=out.status.reshape(lead),
        free=out.free.reshape(*lead, arm.n),
        names=names,
        method=geometry.name,
        why=geometry.why,
        complete=out.complete.reshape(lead),
        rounding=rounding.reshape(lead),
    )


def _actual_near(arm: Arm, near: ArrayLike | None) -> Array | None:
    """Commanded values as actual ones; what has a wrong shape is left for `ik` to refuse."""
    close = None if near is None else arrays.real(near, "near")
    return close * arm.ratio if close is not None and close.shape[-1:] == (arm.n,) else close


def _commanded(arm: Arm, found: Solutions) -> Solutions:
    """Solutions in actual joint values as those in commanded ones."""
    q, near = found.q / arm.ratio, found.near / arm.ratio
    return replace(found, arm=arm, task=task_for(arm, found.task.name), near=near, q=q)


def _closed(
    arm: Arm, task: Task, geometry: Geometry, target: Array, near: Array, one: Array | None, examine: bool
) -> tuple[Batch, int]:
    """Closed forms: chunks of poses that stay in the cache, entry by entry. Also the number of branch columns."""
    out: Batch | None = None
    runner = recorded(arm, task, geometry)
    straight = runner.code.always() if len(target) == 1 else runner.code.get(len(target))
    workspace: list[NDArray[np.generic]] = []
    doubts = []
    for start in range(0, max(len(target), 1), arrays.CHUNK):
        rows = slice(start, start + arrays.CHUNK)
        goal, close = target[rows], near[rows] if one is None else one
        N = len(goal)
        if straight is None:
            *values, miss, doubt, free = runner.candidates(entries(task, goal), preferred(arm, close))
        elif N == 1:
            one_goal = pose.read_one(goal[0]) if task.orientation == "full" else goal[0].tolist()
            *values, miss, doubt, free = straight.single(one_goal)
        else:
            if not workspace or workspace[-1].shape[-1] != N:
                workspace = straight.workspace(N)
            *values, miss, doubt, free = straight.run(entries(task, goal), workspace)
        if runner.axes is None:
            runner.axes = np.broadcast_shapes((1, 1, 1, N), *(np.shape(v) for v in values))[:-1]
        shape, B = (*runner.axes, N), math.prod(runner.axes)
        if out is None:
            out = empty(len(target), B, arm.n)
        if N == 0:
            break
        part = out.part(rows)
        miss = (miss if np.shape(miss) == shape else np.broadcast_to(miss, shape)).reshape(B, N)
        valid = miss <= ACCEPTED**2
        _fill(arm, part, values, valid.reshape(shape), close)
        full = bool(valid.all())
        doubtful = _doubtful(miss, valid, doubt, full)
        if not full:
            count = valid.sum(axis=0)
            part.status[count == 0] = Status.UNREACHABLE
            pack(part, count)
        if len(doubtful):
            q, loose = np.empty((*runner.axes, len(doubtful), arm.n)), np.zeros((*runner.axes, len(doubtful)), bool)
            for i, value in enumerate(values):
                q[..., i] = value[..., doubtful] if np.shape(value)[-1:] == (N,) else value
            loose |= np.greater(
                free[..., doubtful] if np.shape(free)[-1:] == (N,) else free, 0
            )  # constants are numbers
            q = q.reshape(B, -1, arm.n).transpose(1, 0, 2)
            doubts.append((start + doubtful, q, valid[:, doubtful].T, loose.reshape(B, -1).any(axis=0)))
    assert out is not None
    if doubts and examine:
        out = decided(arm, task, runner, out, target, near, *map(np.concatenate, zip(*doubts, strict=True)))
    return out, B


def _fill(arm: Arm, part: Batch, values: list[Array], valid: Bool, close: Array) -> None:
    """Write joint values and valid, on branch axes (b0, b1, b2, N), as rows (N, B), at their nearest legal copies."""
    *axes, N = valid.shape
    grid = part.q.reshape(N, *axes, arm.n).transpose(1, 2, 3, 0, 4)  # the branch axes in front of the poses
    within, legal = valid, []
    for i in range(arm.n):
        value, inside = _legal(arm, i, values[i], close)
        legal.append(value)
        if inside is not True:
            within = within & inside
    for i, value in enumerate(legal):
        grid[..., i] = value
    for mask, out in ((valid, part.valid), (within, part.within)):
        out[...] = True if mask.all() else mask.reshape(-1, N).T
    part.branch[...] = np.arange(part.branch.shape[1], dtype=np.int8)


def _doubtful(miss: Array, valid: Bool, doubt: Entry, full: bool) -> NDArray[np.intp]:
    """Which targets are on an edge: those in doubt, and those with a branch that is nearly there.

    miss, valid: (B, N); full: valid everywhere.
    """
    N = miss.shape[1]
    if np.shape(doubt)[-1:] != (N,):
        doubt = np.broadcast_to(doubt, (*np.shape(doubt)[:-1], N))
    edge = np.flatnonzero(doubt) % N
    if not full:  # nearly there, or not a number
        edge = np.concatenate([edge, np.flatnonzero(~valid & ~(miss > NEARBY**2)) % N])
    return np.unique(edge) if len(edge) else edge


def _legal(arm: Arm, joint: int, value: Array, near: Array) -> tuple[Array, Entry]:
    """A joint's values at their nearest legal copies, and whether they are within limits."""
    lower, upper = float(arm.lower[joint]), float(arm.upper[joint])
    if not arm.prismatic[joint]:
        close = float(near[joint]) if near.ndim == 1 else near[:, joint]
        return nearest_copy(value, close, lower, upper)
    if lower == -np.inf and upper == np.inf:
        return value, True
    return value, (value >= lower - SLACK) & (value <= upper + SLACK)


def _rows(arm: Arm, task: Task, geometry: Geometry, target: Array, near: Array, examine: bool) -> tuple[Batch, int]:
    """Solvers that return joint values row by row. Also the number of branch columns."""
    assert geometry.rows is not None
    q, doubt, complete, lost, guesses = geometry.rows(target)
    B = q.shape[1]
    out = empty(len(target), B, arm.n)
    out.q[...], inside = nearest_row(arm, q, near[:, None, :])
    out.valid[...] = ~np.isnan(q).any(axis=2)
    out.within[...] = inside & out.valid
    out.branch[...] = np.where(out.valid, np.arange(B), -1)
    out.complete[...] = complete
    count = out.valid.sum(axis=1)
    out.status[count == 0] = Status.UNREACHABLE
    pack(out, count)
    doubtful = np.flatnonzero(doubt)
    if examine and len(doubtful):
        solve = geometry.rows

        def candidates(some: NDArray[np.intp]) -> tuple[Array, Bool]:
            found = q[doubtful[some]]
            if guesses is not None:
                found = np.concatenate([found, guesses[doubtful[some]]], axis=1)
            return found, np.zeros(found.shape[:2], bool)

        def others(target: Array, near: Array, lost: Bool) -> tuple[Array, NDArray[np.int64]]:
            """Branches of targets around these, on both sides: what two roots in one leave is real on one of them.

            And of targets that may lack branches what Newton's method finds from many starts.
            """
            there = around(arm, task, target)
            found = solve(there.reshape(-1, *target.shape[1:])).q
            found = found.reshape(len(target), -1, arm.n)
            if lost.any():  # few columns let clusters of roots be averaged: see `singularities.means`
                found = np.concatenate([found, many_starts(arm, task, target, lost)], axis=1)
            return found, np.arange(found.shape[1]) % max(B, 1)

        out = examined(
            arm,
            task,
            out,
            target,
            near,
            doubtful,
            candidates,
            others,
            np.zeros(len(target), bool) if lost is None else lost,
        )
    return out, B
