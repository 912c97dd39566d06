"""All branches at the samples of a route as arrays, in which every named branch has its own column."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.numeric.newton import correct
from armkin.inverse.numeric.tolerances import CONVERGING
from armkin.inverse.solve import isolated_branches as ik
from armkin.inverse.tasks.choose_task import task_for
from armkin.model.arm import actual_arm
from armkin.model.limits import outside_limits
from armkin.motion.branches.joint_steps import joint_change

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_NEWTON_STEPS = 8  # Newton steps on a self-motion
_MAX_MOVEMENT = 1e-6  # movement [rad | mm] allowed to joints that are not free
_BLOCK_SAMPLES = 16_384  # most samples solved in one call
_STRIDE = 8  # every 8th sample is solved first


@dataclass
class BranchColumns:
    """Branches of samples along a route, and their links."""

    s: Array  # (N,) [mm]
    q: Array  # (N, B, n), principal values; nan where there is no branch
    name: NDArray[np.int16]  # (N, B) index into names, -1: none
    status: NDArray[np.int8]  # (N,)
    within_limits: Bool  # (N, B) whether some whole-turn copy is within the limits
    names: tuple[str, ...] = ()
    complete: bool = True
    partner: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))  # (N - 1, B) column, or -1

    @property
    def valid(self) -> Bool:
        """Whether a column holds a branch: (N, B)."""
        return np.asarray(~np.isnan(self.q[:, :, 0]))

    def take_rows(self, rows: Int) -> BranchColumns:
        """The samples of the given rows, without their links."""
        parts = (self.s[rows], self.q[rows], self.name[rows], self.status[rows], self.within_limits[rows])
        return BranchColumns(*parts, self.names, self.complete)

    def pad_to(self, B: int) -> BranchColumns:
        """The samples with B columns of branches at least."""
        return BranchColumns(
            s=self.s,
            q=_pad(self.q, B),
            name=_pad(self.name, B, -1),
            status=self.status,
            within_limits=_pad(self.within_limits, B, 0),
            names=self.names,
            complete=self.complete,
            partner=_pad(self.partner, B, -1),
        )

    def insert_rows(self, rows: Int, new: BranchColumns) -> BranchColumns:
        """The columns with new samples inserted before `rows`; all samples keep their links."""
        B = max(self.q.shape[1], new.q.shape[1])
        padded, new = self.pad_to(B), new.pad_to(B)
        links = new.partner if len(new.partner) else np.full((len(new.s), B), -1, np.int16)
        return BranchColumns(
            s=np.insert(padded.s, rows, new.s),
            q=np.insert(padded.q, rows, new.q, axis=0),
            name=np.insert(padded.name, rows, new.name, axis=0),
            status=np.insert(padded.status, rows, new.status),
            within_limits=np.insert(padded.within_limits, rows, new.within_limits, axis=0),
            names=padded.names,
            complete=padded.complete and new.complete,
            partner=np.insert(padded.partner, rows, links, axis=0),
        )


@dataclass
class Samples:
    """Solves a route at samples; near: (n,) values for joints that are free; length: [mm] of the route."""

    arm: Arm
    targets: Callable[[Array], Array]
    task: str | None
    near: Array
    length: float
    stays: bool = False  # whether the whole route is singular, so that free joints keep their values

    def solve_first(self, s: Array) -> BranchColumns:
        """All branches at the first samples s (N,), increasing.

        Singular postures are expensive to examine. A route that starts at one is solved at every 8th sample first, and
        samples between two unreachable ones are not solved at all.
        """
        if len(s) <= 2 * _STRIDE or self.solve_at(s[:1]).status[0] != Status.SINGULAR:
            return self.solve_at(s)
        sparse = np.append(np.arange(0, len(s) - 1, _STRIDE), len(s) - 1)
        sparse_columns = self.solve_at(s[sparse])
        if (sparse_columns.status == Status.SINGULAR).all():
            self.stays = True
            return self.solve_at(s)
        unreachable = sparse_columns.status == Status.UNREACHABLE
        inner_rows = np.setdiff1d(np.arange(len(s)), sparse)
        is_skipped = (unreachable[:-1] & unreachable[1:])[np.searchsorted(sparse, inner_rows) - 1]
        parts = [sparse_columns]
        if not is_skipped.all():
            parts.append(self.solve_at(s[inner_rows[~is_skipped]]))
        if is_skipped.any():
            empty, lengths = (
                sparse_columns.take_rows(np.flatnonzero(unreachable)[[0] * int(is_skipped.sum())]),
                s[inner_rows[is_skipped]],
            )
            parts.append(replace(empty, s=lengths))
        columns = _concatenate(parts)
        return columns.take_rows(np.argsort(columns.s, kind="stable"))

    def solve_at(self, s: Array, examine: bool = True) -> BranchColumns:
        """All branches at samples, without links; solved in blocks to bound the memory."""
        parts = [self._solve_block(s[k : k + _BLOCK_SAMPLES], examine) for k in range(0, len(s), _BLOCK_SAMPLES)]
        return parts[0] if len(parts) == 1 else _concatenate(parts)

    def _solve_block(self, s: Array, examine: bool) -> BranchColumns:
        """All branches at samples s (N,), on a singularity those 1e-7 of the length beside it."""
        solutions = ik(self.arm, self.targets(s), self.task, near=self.near, examine=examine)
        q, name, is_legal = solutions.q, solutions.branch.astype(np.int16), solutions.within_limits
        singular = np.flatnonzero(solutions.status == Status.SINGULAR)
        if len(singular):
            # Some joints are free exactly on a singularity, but determined 1e-7 of the path length beside it.
            s_beside = np.clip(s[singular] + 1e-7 * self.length, 0.0, self.length)
            s_beside = np.where(s_beside == s[singular], s[singular] - 1e-7 * self.length, s_beside)
            neighbours = ik(self.arm, self.targets(s_beside), self.task, near=self.near)
            # Keep the singular posture where its neighbour has no branch, for example with a stretched arm.
            is_replaced = (neighbours.status != Status.SINGULAR) & neighbours.valid.any(axis=1)
            B = max(q.shape[1], neighbours.q.shape[1])
            q, name, is_legal = _pad(q, B).copy(), _pad(name, B, -1).copy(), _pad(is_legal, B, 0).copy()
            is_legal[singular[is_replaced]] = _pad(neighbours.within_limits, B, 0)[is_replaced]
            q[singular[is_replaced]] = _pad(neighbours.q, B)[is_replaced]
            name[singular[is_replaced]] = _pad(neighbours.branch.astype(np.int16), B, -1)[is_replaced]
            if self.stays and len(stay := singular[~is_replaced]):
                q[stay] = self._hold_free_joints(q[stay], self.targets(s[stay]), solutions.free[stay], is_legal[stay])
        return _columns_by_name(solutions, s, q, name, is_legal)

    def _hold_free_joints(self, q: Array, target: Array, free: Bool, within_limits: Bool) -> Array:
        """Singular postures (M, B, n) whose free joints (M, n) are moved as near as possible to `near`."""
        rows, branches = np.nonzero(~np.isnan(q[:, :, 0]) & within_limits)
        if not len(rows):
            return q
        arm, task = self.arm, task_for(self.arm, self.task)
        start, is_free = q[rows, branches], free[rows]
        postures, miss = correct(
            actual_arm(arm), task, np.where(is_free, self.near, start) * arm.ratio, target[rows], steps=_NEWTON_STEPS
        )
        postures /= arm.ratio
        others_rest = np.where(is_free, 0.0, np.abs(joint_change(arm, start, postures))).max(axis=1) < _MAX_MOVEMENT
        is_accepted = others_rest & (miss <= CONVERGING) & ~outside_limits(arm, postures).any(axis=1)
        q[rows[is_accepted], branches[is_accepted]] = postures[is_accepted]
        return q


def _concatenate(parts: list[BranchColumns]) -> BranchColumns:
    """The samples of all parts in order, padded to the same number of columns."""
    B = max(part.q.shape[1] for part in parts)
    padded = [part.pad_to(B) for part in parts]
    return BranchColumns(
        s=np.concatenate([part.s for part in padded]),
        q=np.concatenate([part.q for part in padded]),
        name=np.concatenate([part.name for part in padded]),
        status=np.concatenate([part.status for part in padded]),
        within_limits=np.concatenate([part.within_limits for part in padded]),
        names=max((part.names for part in parts), key=len),
        complete=all(part.complete for part in parts),
    )


def _columns_by_name(
    solutions: Solutions, s: Array, q: Array, name: NDArray[np.int16], within_limits: Bool
) -> BranchColumns:
    """Solutions as columns, each named branch moved to the column of its number."""
    B = q.shape[1]
    width = max(B, int(name.max(initial=-1)) + 1)
    status, complete = solutions.status.astype(np.int8), bool(np.all(solutions.complete))
    misplaced_rows = np.flatnonzero(((name >= 0) & (name != np.arange(B))).any(axis=1))
    q, name, within_limits = (_pad(x, width, fill) for x, fill in ((q, np.nan), (name, -1), (within_limits, 0)))
    if len(misplaced_rows):
        q, name, within_limits = q.copy(), name.copy(), within_limits.copy()
        old_q, old_name, old_within = q[misplaced_rows], name[misplaced_rows], within_limits[misplaced_rows]
        q[misplaced_rows], name[misplaced_rows], within_limits[misplaced_rows] = np.nan, -1, False
        row, column = np.nonzero((old_name >= 0) & ~np.isnan(old_q[:, :, 0]))
        number = old_name[row, column]
        q[misplaced_rows[row], number] = old_q[row, column]
        name[misplaced_rows[row], number] = number
        within_limits[misplaced_rows[row], number] = old_within[row, column]
    return BranchColumns(
        s=s, q=q, name=name, status=status, within_limits=within_limits, names=solutions.names, complete=complete
    )


def _pad(values: NDArray, B: int, fill: float = np.nan) -> NDArray:  # type: ignore[type-arg]
    """The values with B columns on axis 1 at least, the new ones `fill`."""
    added_count = B - values.shape[1]
    if added_count <= 0:
        return values
    padding = np.full((values.shape[0], added_count, *values.shape[2:]), fill, values.dtype)
    return np.concatenate([values, padding], axis=1)
