"""Solves batches by closed forms, in chunks of poses that fit the cache."""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.engines.threads import share_rows
from armkin.formula import arrays
from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, empty_batch, pack_branches
from armkin.inverse.answers.solutions import Status
from armkin.inverse.branches.whole_turns import nearest_copy
from armkin.inverse.closed.candidates import Recorded, recorded_formula, target_entries
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.run.edges import AT_ONCE, decide_edges
from armkin.inverse.run.folds import Doubted, decide_folds
from armkin.inverse.singular import near_itself
from armkin.inverse.tasks.task import Task, read_poses, targets_at
from armkin.model.arm import Arm

_Read = tuple[Array, Array | float, Sequence[Any]]  # targets as they are solved, defects of rotations, entries
TURNED_AT_ONCE = 512  # poses transposed at once, which fit a core's cache


class Solved(NamedTuple):
    """Targets solved by a closed form."""

    batch: Batch
    width: int  # branch columns of the class
    target: Array  # (N, m) or (N, 4, 4), as read
    rounding: Array  # (N,) defect of their rotations
    unsolved: Int  # targets on an edge, if the class has a slower solver for them


def solve_closed_form(goals: Goals, geometry: Geometry, common: Array | None, examine: bool, workers: int) -> Solved:
    """Solve targets, poses as they were given, for all branches; common: (n,) [rad | mm] `near`, if one serves all."""
    arm, task, raw, near = goals
    runner, N = recorded_formula(arm, task, geometry), len(raw)
    step = -(-N // -(-N // runner.code.at_once())) if N else 1  # equal parts, which can share buffers
    batch = empty_batch(N, math.prod(runner.axes), arm.n)
    target, rounding = np.empty_like(raw), np.zeros(N)
    tip, is_pose = None if common is None else position(arm, common), task.orientation == "full"

    def solve_rows(rows: slice) -> list[Doubted]:
        """Solve some rows in one thread, chunk after chunk; returns those on an edge."""
        workspace: list[NDArray[Any]] = []
        on_edge: list[Doubted] = []
        for start in range(rows.start, rows.stop, step):
            chunk = slice(start, min(start + step, rows.stop))
            given = raw[chunk]
            read: _Read = read_poses(given) if is_pose else (given, 0.0, target_entries(task, given))
            goal, rounding[chunk], entries = read
            target[chunk] = goal
            if len(goal) == 1:
                outputs = runner.in_numbers(goal)
            else:
                workspace = workspace or runner.code.workspace(len(goal))
                outputs = list(runner.code.run(entries, [buffer[..., : len(goal)] for buffer in workspace]))
            close = near[chunk] if common is None else common
            at_tip = np.empty(0, np.intp)
            if examine:
                tips, x = position(arm, close) if tip is None else tip, entries[9 if is_pose else 0]
                at_tip = targets_at(task, goal, tips, near_itself.ROOM * arm.reach, x)
            part = Goals(arm, task, goal, near[chunk])
            doubted = _write_chunk(part, (*runner.axes, len(goal)), rows_of(batch, chunk), outputs, close, at_tip)
            if len(doubted.rows):
                on_edge.append(doubted._replace(rows=start + doubted.rows))
        return on_edge

    doubted = [chunk for part in share_rows(solve_rows, N, workers, step, step) for chunk in part]
    batch.complete[...] = geometry.complete
    unsolved = np.empty(0, np.intp)
    if geometry.doubts is not None:
        unsolved = np.concatenate([unsolved, *(chunk.rows for chunk in doubted)])
    elif examine and doubted:
        batch = _decide_doubted(goals._replace(target=target), runner, batch, stack_rows(doubted))
    return Solved(batch, math.prod(runner.axes), target, rounding, unsolved)


def _decide_doubted(goals: Goals, runner: Recorded, batch: Batch, doubted: Doubted) -> Batch:
    """The batch after an examination of targets on an edge: of folds by their curvature, else in full."""
    rows = doubted.rows
    if doubted.plain.any() and not runner.geometry.ends:
        rows = decide_folds(goals, runner, batch, doubted)
    for start in range(0, len(rows), AT_ONCE):
        batch = decide_edges(goals, runner, batch, rows[start : start + AT_ONCE])
    return batch


def _write_chunk(
    goals: Goals, shape: tuple[int, ...], part: Batch, outputs: list[Any], near: Array, at_tip: Int
) -> Doubted:
    """Write a chunk's branches, of a shape (b0, b1, b2, N), as rows (N, B) at their nearest legal copies; returns the
    targets on an edge. at_tip: those where the tool is at `near`, none without examination."""
    *values, miss, doubt, _ = outputs
    miss = np.broadcast_to(miss, shape)
    valid = (miss <= tol.ACCEPTED**2).reshape(-1, shape[-1])
    some_invalid = None if valid.all() else valid
    _write_branches(goals.arm, part, shape, values, near, valid)
    on_edge = _on_edge(doubt, miss.reshape(valid.shape), some_invalid)
    if len(at_tip):
        on_edge = np.union1d(on_edge, near_itself.put_near(goals, part, at_tip))
    at_edge = (np.broadcast_to(x, shape)[..., on_edge].reshape(len(valid), -1).T for x in outputs[-3:])
    miss_at_edge, doubt, is_free = at_edge if len(on_edge) else np.empty((3, 0, len(valid)))
    plain: Bool = np.asarray(~(is_free > 0.0).any(axis=1) & np.isin(on_edge, at_tip, invert=True))
    doubted = Doubted(on_edge, part.q[on_edge], miss_at_edge, doubt > 0.0, plain)
    if some_invalid is not None:
        count = valid.view(np.int8).sum(axis=0, dtype=np.int8)
        part.status[count == 0] = Status.UNREACHABLE
        pack_branches(part, count)
    return doubted


def _write_branches(arm: Arm, part: Batch, shape: tuple[int, ...], values: list[Any], near: Array, valid: Bool) -> None:
    """Write all branches, values of a shape (b0, b1, b2, N) of which those are valid (B, N), into a part of a batch."""
    *axes, N = shape
    legal, within = np.empty((*axes, arm.n, N)), valid
    for i, value in enumerate(values):
        lower, upper = float(arm.lower[i]), float(arm.upper[i])
        reference = float(near[i]) if near.ndim == 1 else near[:, i]
        legal[..., i, :], is_inside = nearest_copy(value, reference, lower, upper, bool(arm.prismatic[i]))
        if is_inside is not True:
            within = (within.reshape(shape) & is_inside).reshape(valid.shape)
    columns, rows = legal.reshape(-1, N), part.q.reshape(N, -1)
    for chunk in arrays.slices(N, TURNED_AT_ONCE):
        rows[chunk] = columns[:, chunk].T
    part.valid[...] = valid.T
    part.within[...] = part.valid if within is valid else within.T
    part.branch[...] = _every_branch(len(valid), arrays.CHUNK)[:N]


def _on_edge(doubt: Any, miss: Array, valid: Bool | None) -> Int:
    """The targets (D,) in doubt, or with an invalid branch that nearly solves; miss, valid: (B, N); None: all valid."""
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
        left = np.union1d(_on_edge(doubt, miss, valid), targets_at(task, goal, tip, near_itself.ROOM * arm.reach))
        yield Columns(slice(start, start + N), values, miss, valid, left)


@lru_cache(maxsize=8)
def _every_branch(B: int, N: int) -> NDArray[np.int8]:
    """The indices of all branches of N targets, (N, B); cached, as copying is faster than repeating a row."""
    return np.tile(np.arange(B, dtype=np.int8), (N, 1))
