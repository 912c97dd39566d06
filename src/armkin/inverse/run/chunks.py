"""Solves batches by closed forms, in chunks of poses that fit the cache."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from armkin.formula import arrays
from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, empty_batch, pack_branches
from armkin.inverse.answers.solutions import Status
from armkin.inverse.branches.whole_turns import nearest_copy
from armkin.inverse.closed.candidates import recorded_formula, target_entries
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.run.edges import AT_ONCE, decide_edges
from armkin.inverse.run.folds import Doubted, decide_folds
from armkin.inverse.run.workers import share_rows
from armkin.inverse.singular import near_itself
from armkin.inverse.tasks.task import Task, read_poses
from armkin.model.arm import Arm

TURNED_AT_ONCE = 512  # poses transposed at once, which fit a core's cache


class Solved(NamedTuple):
    """Targets solved by a closed form."""

    batch: Batch
    width: int  # branch columns of the class
    target: Array  # (N, m) or (N, 4, 4), as read
    rounding: Array  # (N,) defect of their rotations
    unsolved: Int  # targets on an edge, if the class has a slower solver for them


def solve(goals: Goals, geometry: Geometry, common: Array | None, examine: bool, workers: int) -> Solved:  # noqa: C901 - one pass over a batch's arrays
    """All branches of targets, whose poses need not have been read yet; common: (n,) `near`, if one serves all."""
    arm, task, raw, near = goals
    runner, N = recorded_formula(arm, task, geometry), len(raw)
    step = -(-N // -(-N // runner.code.at_once())) if N else 1  # equal parts, which can share buffers
    batch = empty_batch(N, math.prod(runner.axes), arm.n)
    target, rounding = np.empty_like(raw), np.zeros(N)
    tip = None if common is None else position(arm, common)

    def solve_part(rows: slice) -> list[Doubted]:
        """Solve some rows in one thread; returns those on an edge."""
        workspace: list[NDArray[Any]] = []
        on_edge: list[Doubted] = []
        for start in range(rows.start, rows.stop, step):
            chunk = slice(start, min(start + step, rows.stop))
            goal, columns, close = raw[chunk], None, near[chunk] if common is None else common
            if task.orientation == "full":
                goal, rounding[chunk], columns = read_poses(goal)
            target[chunk] = goal
            if len(goal) == 1:
                values = runner.in_numbers(goal)
            else:
                workspace = workspace or runner.code.workspace(len(goal))
                buffers = [buffer[..., : len(goal)] for buffer in workspace]
                values = list(runner.code.run(target_entries(task, goal) if columns is None else columns, buffers))
            x = goal[:, 0] if columns is None else cast("Array", columns[9])
            at_tip = np.empty(0, np.intp)
            if examine:
                at_tip = near_itself.at_tip(arm, task, goal, position(arm, close) if tip is None else tip, x)
            part = Goals(arm, task, goal, near[chunk])
            doubted = _write(part, runner.axes, rows_of(batch, chunk), values, close, at_tip)
            if len(doubted.rows):
                on_edge.append(doubted._replace(rows=start + doubted.rows))
        return on_edge

    parts = [solve_part(slice(0, N))] if workers == 1 else share_rows(solve_part, N, workers, step, step)
    doubted = [chunk for on_edge in parts for chunk in on_edge]
    batch.complete[...] = geometry.complete
    rows = np.concatenate([np.empty(0, np.intp), *(chunk.rows for chunk in doubted)])
    if geometry.doubts is None:
        if examine and doubted:
            goals = goals._replace(target=target)
            if any(chunk.plain.any() for chunk in doubted) and not geometry.ends:
                rows = decide_folds(goals, runner, batch, stack_rows(doubted))
            for start in range(0, len(rows), AT_ONCE):
                batch = decide_edges(goals, runner, batch, rows[start : start + AT_ONCE])
        rows = rows[:0]
    return Solved(batch, math.prod(runner.axes), target, rounding, rows)


def _write(goals: Goals, axes: tuple[int, ...], part: Batch, outputs: list[Any], near: Array, at_tip: Int) -> Doubted:
    """Write a chunk's branches, on axes (b0, b1, b2, N), as rows (N, B) at their nearest legal copies; returns the
    targets on an edge. at_tip: the result of `near_itself.at_tip`, empty without examination.
    """
    arm = goals.arm
    *values, miss, doubt, free = outputs
    N = len(part.q)
    shape, B = (*axes, N), math.prod(axes)
    miss = (miss if np.shape(miss) == shape else np.broadcast_to(miss, shape)).reshape(B, N)
    valid = within = miss <= tol.ACCEPTED**2
    all_valid, legal = bool(valid.all()), np.empty((*axes, arm.n, N))
    for i, value in enumerate(values):
        lower, upper = float(arm.lower[i]), float(arm.upper[i])
        reference = float(near[i]) if near.ndim == 1 else near[:, i]
        value, is_inside = nearest_copy(value, reference, lower, upper, bool(arm.prismatic[i]))
        legal[..., i, :] = value
        if is_inside is not True:
            within = (within.reshape(shape) & is_inside).reshape(B, N)
    columns, rows = legal.reshape(-1, N), part.q.reshape(N, -1)
    for chunk in arrays.slices(N, TURNED_AT_ONCE):
        rows[chunk] = columns[:, chunk].T
    part.valid[...] = True if all_valid else valid.T
    part.within[...] = part.valid if within is valid else within.T
    part.branch[...] = _every_branch(B, arrays.CHUNK)[:N]
    on_edge = _on_edge(doubt, miss, None if all_valid else valid)
    if len(at_tip):
        on_edge = np.union1d(on_edge, near_itself.put_near(goals, part, at_tip))
    flags = (np.broadcast_to(x, shape)[..., on_edge].reshape(B, -1).T for x in (miss.reshape(shape), doubt, free))
    missed, edge, loose = flags if len(on_edge) else np.empty((3, 0, B))
    plain: Bool = np.asarray(~(loose > 0.0).any(axis=1) & np.isin(on_edge, at_tip, invert=True))
    doubted = Doubted(on_edge, part.q[on_edge], missed, edge > 0.0, plain)
    if not all_valid:
        count = valid.view(np.int8).sum(axis=0, dtype=np.int8)
        part.status[count == 0] = Status.UNREACHABLE
        pack_branches(part, count)
    return doubted


def _on_edge(doubt: Any, miss: Array, valid: Bool | None) -> Int:
    """The targets that are in doubt or have a branch that nearly solves; miss, valid: (B, N); valid None: all valid."""
    N = miss.shape[1]
    if np.shape(doubt)[-1:] != (N,):
        doubt = np.broadcast_to(doubt, (*np.shape(doubt)[:-1], N))
    doubted = np.flatnonzero(doubt) % N
    if valid is not None:
        clear = miss > tol.NEARBY**2
        if np.count_nonzero(clear) + np.count_nonzero(valid) < miss.size:  # some branch nearly solves, or is nan
            doubted = np.concatenate([doubted, np.flatnonzero(~(valid | clear)) % N])
    return np.unique(doubted) if len(doubted) else doubted


class Columns(NamedTuple):
    """Branches of some targets as arrays (B, N), without choice of their copies."""

    rows: slice
    values: list[Array]  # n arrays (B, N) [rad | mm], modulo whole turns
    miss: Array  # (B, N) squared residual
    valid: Bool  # (B, N)
    left: Int  # targets on an edge, whose branches may be wrong


def columns(arm: Arm, task: Task, geometry: Geometry, target: Array, kept: bool = False) -> Iterator[Columns]:
    """Branches of targets (N, m) or (N, 4, 4) by a closed form, for callers that only count them.

    kept: whether the arrays of a part stay valid when the next one is computed.

    Targets that are not `left` have the branches that `armkin.ik` finds; `left` ones must be solved by `armkin.ik`.
    """
    runner = recorded_formula(arm, task, geometry)
    step, B, tip = runner.code.at_once(), math.prod(runner.axes), position(arm, arm.home)
    workspace: list[NDArray[Any]] = []
    for start in range(0, len(target), step):
        goal = target[start : start + step]
        N = len(goal)
        if kept or not workspace or workspace[-1].shape[-1] != N:
            workspace = runner.code.workspace(N)
        *outputs, doubt, _ = runner.code.run(target_entries(task, goal), workspace)
        shape = (*runner.axes, N)
        *values, miss = (np.broadcast_to(column, shape).reshape(B, N) for column in outputs)
        valid: Bool = np.asarray(miss <= tol.ACCEPTED**2)
        left = np.union1d(_on_edge(doubt, miss, valid), near_itself.at_tip(arm, task, goal, tip))
        yield Columns(slice(start, start + N), values, miss, valid, left)


@lru_cache(maxsize=8)
def _every_branch(B: int, N: int) -> NDArray[np.int8]:
    """The indices of all branches of N targets, (N, B); cached, as copying is faster than repeating a row."""
    return np.tile(np.arange(B, dtype=np.int8), (N, 1))
