"""`armkin.ik`: from targets to all branches within limits.

The way of a target: task -> geometry -> candidate branches -> residual of each, through the
forward kinematics -> whole turns and limits -> the few doubtful ones through `edges`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Bool, Entry
from armkin.inverse import singularities
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.tracking import follow
from armkin.inverse.branches.turns import nearest_copy, nearest_row
from armkin.inverse.closed.candidates import as_rows, entries, preferred, recorded
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.numeric.tolerances import ACCEPTED, FAR, NEARBY, SAME
from armkin.inverse.recognise import solver
from armkin.inverse.solutions import Solutions, Status
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import Task, distance, read_targets
from armkin.model.arm import actual
from armkin.model.limits import SLACK

if TYPE_CHECKING:
    from armkin.model.arm import Arm

BLOCK = 512  # poses whose rows are written joint by joint while they are in the cache
DOUBTFUL = 256  # targets examined at once


class _Out(NamedTuple):
    """Results of a batch, filled chunk by chunk."""

    q: Array
    valid: Bool
    within: Bool
    branch: NDArray[np.int8]
    status: NDArray[np.int8]
    free: Bool
    complete: Bool

    def part(self, rows: slice) -> _Out:
        return _Out(
            self.q[rows],
            self.valid[rows],
            self.within[rows],
            self.branch[rows],
            self.status[rows],
            self.free[rows],
            self.complete[rows],
        )


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
    if (turned := actual(arm)) is not arm:
        return _commanded(arm, ik(turned, targets, task, near=_actual_near(arm, near), examine=examine))
    definition, geometry = solver(arm, task)
    target, lead, rounding = read_targets(definition, targets)
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
        near=np.broadcast_to(close, (*lead, arm.n)).copy(),
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


def _empty(N: int, B: int, n: int) -> _Out:
    return _Out(
        np.empty((N, B, n)),
        np.empty((N, B), bool),
        np.empty((N, B), bool),
        np.empty((N, B), np.int8),
        np.zeros(N, np.int8),
        np.zeros((N, n), bool),
        np.ones(N, bool),
    )


def _closed(
    arm: Arm, task: Task, geometry: Geometry, target: Array, near: Array, one: Array | None, examine: bool
) -> tuple[_Out, int]:
    """Closed forms: chunks of poses that stay in the cache, entry by entry. Also the number of branch columns."""
    out: _Out | None = None
    runner = recorded(arm, task, geometry)
    straight = runner.code.always() if len(target) == 1 else runner.code.get(len(target))
    workspace: list[NDArray[np.generic]] = []
    doubts = []
    for start in range(0, max(len(target), 1), arrays.CHUNK):
        rows = slice(start, start + arrays.CHUNK)
        goal, close = target[rows], near[rows] if one is None else one
        N = len(goal)
        if straight is None:
            *values, miss, doubt = runner.candidates(entries(task, goal), preferred(arm, close))
        elif N == 1:
            one_goal = pose.read_one(goal[0]) if task.orientation == "full" else goal[0].tolist()
            *values, miss, doubt = straight.single(one_goal)
        else:
            if not workspace or workspace[-1].shape[-1] != N:
                workspace = straight.workspace(N)
            *values, miss, doubt = straight.run(entries(task, goal), workspace)
        if runner.axes is None:
            runner.axes = np.broadcast_shapes((1, 1, 1, N), *(np.shape(v) for v in values))[:-1]
        shape, B = (*runner.axes, N), math.prod(runner.axes)
        if out is None:
            out = _empty(len(target), B, arm.n)
        if N == 0:
            break
        part = out.part(rows)
        miss = (miss if np.shape(miss) == shape else np.broadcast_to(miss, shape)).reshape(B, N)
        valid = miss <= ACCEPTED**2
        _fill(arm, part, values, valid.reshape(shape), close)
        full = bool(valid.all())
        doubtful = _doubtful(miss, valid, doubt, full)
        if len(doubtful):
            doubts.append(start + doubtful)
        if not full:
            count = valid.sum(axis=0)
            part.status[count == 0] = Status.UNREACHABLE
            _pack(part, count < B)
    assert out is not None
    if doubts and examine:

        def candidates(rows: NDArray[np.intp]) -> tuple[Array, Bool]:
            """Again, with the preferred values for joints that are free; those that other values would change."""
            goal = entries(task, target[rows])
            q, other = (
                as_rows(runner.candidates(goal, preferred(arm, near[rows] + shift))[: arm.n], len(rows))
                for shift in (0.0, 1.0)
            )
            loose = ~(np.abs(q - other).max(axis=2) < SAME)
            if not loose.any():
                return q, loose
            other[~loose] = np.nan
            return np.concatenate([q, other], axis=1), np.concatenate([loose, np.zeros_like(loose)], axis=1)

        out = _examined(arm, task, out, target, near, np.concatenate(doubts), candidates, runner.others)
    return out, B


def _fill(arm: Arm, part: _Out, values: list[Array], valid: Bool, close: Array) -> None:
    """Write joint values and valid, on branch axes (b0, b1, b2, N), as rows (N, B), at their nearest legal copies."""
    *axes, N = valid.shape
    grid = part.q.reshape(N, *axes, arm.n).transpose(1, 2, 3, 0, 4)  # the branch axes in front of the poses
    within, legal = valid, []
    for i in range(arm.n):
        value, inside = _legal(arm, i, values[i], close)
        legal.append(value)
        if inside is not True:
            within = within & inside
    for start in range(0, N, BLOCK):
        some = slice(start, start + BLOCK)
        for i, value in enumerate(legal):
            grid[..., some, i] = value[..., some] if np.shape(value)[-1:] == (N,) else value
    part.valid[...] = valid.reshape(-1, N).T
    part.within[...] = within.reshape(-1, N).T
    part.branch[...] = np.arange(part.branch.shape[1], dtype=np.int8)


def _doubtful(miss: Array, valid: Bool, doubt: Entry, full: bool) -> NDArray[np.intp]:
    """Which targets are on an edge: those in doubt, and those with a branch that is nearly there.

    miss, valid: (B, N); full: valid everywhere.
    """
    if full and not np.any(doubt):
        return np.empty(0, np.intp)
    shape = np.broadcast_shapes(np.shape(doubt), (1, 1, 1, miss.shape[1]))
    edge = np.any(np.broadcast_to(doubt, shape), axis=(0, 1, 2))
    if not full:
        edge = edge | (~valid & ~(miss > NEARBY**2)).any(axis=0)  # nearly there, or not a number
    return np.flatnonzero(edge)


def _legal(arm: Arm, joint: int, value: Array, near: Array) -> tuple[Array, Entry]:
    """A joint's values at their nearest legal copies, and whether they are within limits."""
    lower, upper = float(arm.lower[joint]), float(arm.upper[joint])
    if not arm.prismatic[joint]:
        close = float(near[joint]) if near.ndim == 1 else near[:, joint]
        return nearest_copy(value, close, lower, upper)
    if lower == -np.inf and upper == np.inf:
        return value, True
    return value, (value >= lower - SLACK) & (value <= upper + SLACK)


def _rows(arm: Arm, task: Task, geometry: Geometry, target: Array, near: Array, examine: bool) -> tuple[_Out, int]:
    """Solvers that return joint values row by row. Also the number of branch columns."""
    assert geometry.rows is not None
    q, doubt, complete = geometry.rows(target)
    B = q.shape[1]
    out = _empty(len(target), B, arm.n)
    out.q[...], inside = nearest_row(arm, q, near[:, None, :])
    out.valid[...] = ~np.isnan(q).any(axis=2)
    out.within[...] = inside & out.valid
    out.branch[...] = np.where(out.valid, np.arange(B), -1)
    out.complete[...] = complete
    count = out.valid.sum(axis=1)
    out.status[count == 0] = Status.UNREACHABLE
    _pack(out, count < B)
    if examine and doubt.any():
        out = _examined(
            arm,
            task,
            out,
            target,
            near,
            np.flatnonzero(doubt),
            lambda rows: (q[rows], np.zeros(q[rows].shape[:2], bool)),
            None,
        )
    return out, B


def _examined(
    arm: Arm,
    task: Task,
    out: _Out,
    target: Array,
    near: Array,
    doubtful: NDArray[np.intp],
    candidates: Callable[[NDArray[np.intp]], tuple[Array, Bool]],
    others: Callable[[Array, Array], tuple[Array, NDArray[np.int64]]] | None,
) -> _Out:
    """Examine the doubtful targets and write what is found: branches first, nan behind.

    candidates: joint values (K, M, n) for some targets, and which depend on `near` (K, M); others: more of them,
    for targets and preferred values.
    """
    for start in range(0, len(doubtful), DOUBTFUL):
        rows = doubtful[start : start + DOUBTFUL]
        goal, close, columns = target[rows], near[rows], out.q.shape[1]
        q, loose = candidates(rows)

        def more(some: NDArray[np.int64], goal: Array = goal, close: Array = close) -> Any:
            assert others is not None
            return others(goal[some], close[some])

        seen = singularities.examine(
            arm, task, q, np.arange(q.shape[1]) % columns, loose, goal, close, None if others is None else more
        )
        width = seen.q.shape[1]
        if width > out.q.shape[1]:
            out = _wider(out, width)
        q, inside = nearest_row(arm, np.nan_to_num(seen.q), close[:, None, :])
        out.q[rows], out.valid[rows], out.within[rows], out.branch[rows] = np.nan, False, False, -1
        out.q[rows, :width] = np.where(seen.valid[:, :, None], q, np.nan)
        out.valid[rows, :width] = seen.valid
        out.within[rows, :width] = inside & seen.valid
        out.branch[rows, :width] = _named(seen.label, seen.valid)
        out.status[rows], out.free[rows] = seen.status, seen.free
        out.complete[rows] &= ~seen.again
    return out


def _named(label: NDArray[np.int64], valid: Bool) -> NDArray[np.int64]:
    """Labels (K, W) with the smallest free number for branches that have none, or one of another."""
    out = np.where(valid, label, -1)
    for row in np.flatnonzero(((label < 0) & valid).any(axis=1) | (np.diff(np.sort(out, axis=1)) == 0).any(axis=1)):
        taken: set[int] = set()
        for b in np.flatnonzero(valid[row]):
            if out[row, b] < 0 or out[row, b] in taken:
                out[row, b] = next(i for i in range(out.shape[1] + len(taken) + 1) if i not in {*taken, *out[row]})
            taken.add(int(out[row, b]))
    return out


def _wider(out: _Out, width: int) -> _Out:
    """The same with more columns, empty."""
    N, B, n = out.q.shape
    wide = _empty(N, width, n)
    wide.q[:, :B], wide.valid[:, :B], wide.within[:, :B], wide.branch[:, :B] = out.q, out.valid, out.within, out.branch
    wide.status[...], wide.free[...], wide.complete[...] = out.status, out.free, out.complete
    wide.q[:, B:], wide.valid[:, B:], wide.within[:, B:], wide.branch[:, B:] = np.nan, False, False, -1
    return wide


def _pack(part: _Out, partial: Bool) -> None:
    """Move the branches of some targets to the front, nan behind."""
    some = np.flatnonzero(partial)
    if not len(some):
        return
    valid = part.valid[some]
    count = valid.sum(axis=1)
    row, column = np.nonzero(valid)
    place = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)  # each row's own 0, 1, 2 ...
    for array, missing in ((part.q, np.nan), (part.within, False), (part.branch, -1)):
        old = array[some]
        new = np.full_like(old, missing)
        new[row, place] = old[row, column]
        array[some] = new
    part.valid[some] = np.arange(valid.shape[1]) < count[:, None]
