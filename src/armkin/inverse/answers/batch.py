"""The goals of a batch, and the arrays of its results, with functions that write, pack and widen their rows."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

OWN_LABEL = -1  # label of a posture that comes from `near`


class Goals(NamedTuple):
    """The input of a solver: targets (N, m) or (N, 4, 4) of a task, and the postures to stay close to (N, n)."""

    arm: Arm
    task: Task
    target: Array
    near: Array

    def of(self, rows: Int) -> Self:
        """The goals of some rows."""
        return self._replace(target=self.target[rows], near=self.near[rows])


class Seeds(NamedTuple):
    """Candidate branches of K targets."""

    q: Array  # (K, B, n), nan for none
    loose: Bool  # (K, B) whether a candidate depends on the value preferred for a free joint
    label: Int  # (K, B) in the solver's own numbering
    sure: Bool  # (K, B, n) joints that move along a known self-motion, for one posture of each
    simple: Bool  # (K, B) branches that need no examination, as no closed form doubts them

    @classmethod
    def of(cls, q: Array, label: Int, loose: Bool | None = None, simple: Bool | None = None) -> Self:
        """Candidates without a known self-motion; by default none is loose and none is simple."""
        none, label = np.zeros(q.shape[:2], bool), np.broadcast_to(label, q.shape[:2])
        sure = np.zeros(q.shape, bool)
        return cls(q, none if loose is None else loose, label, sure, none if simple is None else simple)


class Examined(NamedTuple):
    """The result of examining K targets."""

    q: Array  # (K, W, n) branches, nan past the last
    valid: Bool  # (K, W)
    label: Int  # (K, W) branch of each posture in the solver's own numbering
    status: NDArray[np.int8]  # (K,)
    free: Bool  # (K, n)
    again: Bool  # (K,) whether more postures have to be tried
    surface: Bool  # (K,) whether a self-motion is a surface
    moved: Bool  # (K, n) joints that move along self-motions that are not fully known
    beyond: Bool  # (K,) whether all nearby roots lie beyond a fold


class Batch(NamedTuple):
    """q (N, B, n), valid, within, branch (N, B), status (N,), free (N, n), complete (N,)."""

    q: Array
    valid: Bool
    within: Bool
    branch: NDArray[np.int8]
    status: NDArray[np.int8]
    free: Bool
    complete: Bool


def empty_batch(N: int, B: int, n: int) -> Batch:
    """Arrays for N targets with B branches of n joints, which the solver fills."""
    valid, within = np.empty((2, N, B), bool)
    branch, status, free = np.empty((N, B), np.int8), np.zeros(N, np.int8), np.zeros((N, n), bool)
    return Batch(np.empty((N, B, n)), valid, within, branch, status, free, np.ones(N, bool))


Text = tuple[tuple[str, ...], str, str]  # `Solutions.names`, method and why


def as_solutions(
    goals: Goals, near: Array, batch_shape: tuple[int, ...], batch: Batch, rounding: Array, text: Text
) -> Solutions:
    """The answer of a batch of shape batch_shape; near: (n,) or (*batch_shape, n), as it was given."""
    arm, task, target, _ = goals
    reference = np.broadcast_to(near.copy(), (*batch_shape, arm.n))
    shaped = (x.reshape((*batch_shape, *x.shape[1:])) for x in (*batch, target, rounding))
    q, valid, within, branch, status, free, complete, target, rounding = shaped
    return Solutions(arm, task, target, reference, q, valid, within, branch, status, free, *text, complete, rounding)


def write_branches(arm: Arm, batch: Batch, rows: Int, q: Array, valid: Bool, label: Int, near: Array) -> Batch:
    """Write branches (K, W, n) of some targets, with labels (K, W) of `complete_labels`, at their nearest legal copies
    and nan behind them; returns the same batch, or a wider one if they need more columns."""
    if q.shape[1] > batch.q.shape[1]:
        batch = stack_rows([batch, empty_batch(0, q.shape[1], arm.n)])
    width, label = q.shape[1], np.where(valid, label, -1)
    ordered = np.sort(label, axis=1)
    if ((label < 0) & valid).any() or ((np.diff(ordered) == 0) & (ordered[:, 1:] >= 0)).any():
        label = complete_labels(label, valid)
    copies, inside = nearest_row(arm, np.nan_to_num(q), near[:, None, :])
    batch.q[rows], batch.branch[rows] = np.nan, -1
    batch.valid[rows] = batch.within[rows] = False
    batch.q[rows, :width] = np.where(valid[:, :, None], copies, np.nan)
    batch.valid[rows, :width] = valid
    batch.within[rows, :width] = inside & valid
    batch.branch[rows, :width] = label
    return batch


def complete_labels(label: Int, valid: Bool) -> Int:
    """Labels (K, W) in which branches without a label, or with a duplicate one, get the smallest unused number."""
    fixed = np.where(valid, label, -1)
    for row in np.flatnonzero(((label < 0) & valid).any(axis=1) | (np.diff(np.sort(fixed, axis=1)) == 0).any(axis=1)):
        used: set[int] = set()
        for b in np.flatnonzero(valid[row]):
            if fixed[row, b] < 0 or fixed[row, b] in used:
                fixed[row, b] = next(i for i in range(fixed.shape[1] + len(used) + 1) if i not in {*used, *fixed[row]})
            used.add(int(fixed[row, b]))
    return fixed


def pack_branches(part: Batch, count: Int) -> None:
    """Move the branches of every target, count (N,) of them, to the front, with nan behind."""
    B, columns = part.valid.shape[1], int(count.max(initial=0))
    rows = np.flatnonzero(count < columns)
    front = np.arange(B) < count[rows, None]
    # source index of each entry; the index behind the last one stands for an empty place
    source = np.full(front.size, front.size)
    source[np.flatnonzero(front)] = np.flatnonzero(part.valid[rows])
    arrays = (part.q, np.nan), (part.within, False), (part.branch, -1)
    for array, missing in arrays:
        width = array.shape[2:]
        padded = np.empty((front.size + 1, *width), array.dtype)
        array.take(rows, axis=0, out=padded[:-1].reshape(len(rows), B, *width), mode="clip")
        padded[-1] = missing
        array[rows] = padded.take(source, axis=0).reshape(len(rows), B, *width)
    if columns < B:  # full rows are moved as slices
        part.valid[rows] = np.arange(B) < columns
        present = np.flatnonzero(part.valid)
        for array, missing in arrays:
            width = array.shape[2:]
            array[:, :columns] = array.reshape(-1, *width).take(present, axis=0).reshape(len(count), columns, *width)
            array[:, columns:] = missing
        part.valid[...] = np.arange(B) < columns
    part.valid[rows] = front
