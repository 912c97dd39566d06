"""All branches at samples of a route, each in the column of its name."""

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

_NEWTON_STEPS, _MAX_MOVEMENT = 8, 1e-6  # Newton steps on a self-motion; movement [rad | mm] of a joint that is not free
_BLOCK_SAMPLES = 16_384  # samples solved at once at most
_STRIDE = 8  # stride of the few samples that are solved first


@dataclass
class Columns:
    """Branches of samples along a route, and their links."""

    s: Array  # (N,) [mm]
    q: Array  # (N, B, n), principal values; nan where there is no branch
    name: NDArray[np.int16]  # (N, B) index into names, -1: none
    status: NDArray[np.int8]  # (N,)
    within_limits: Bool  # (N, B) within limits, of some copy
    names: tuple[str, ...] = ()
    complete: bool = True
    partner: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))  # (N - 1, B) column, or -1

    @property
    def valid(self) -> Bool:
        """Where a branch is: (N, B)."""
        return np.asarray(~np.isnan(self.q[:, :, 0]))

    def take_rows(self, rows: Int) -> Columns:
        """Some samples, without their links."""
        parts = (self.s[rows], self.q[rows], self.name[rows], self.status[rows], self.within_limits[rows])
        return Columns(*parts, self.names, self.complete)

    def pad_to(self, B: int) -> Columns:
        """The samples with B columns of branches at least."""
        return Columns(
            self.s,
            _pad(self.q, B),
            _pad(self.name, B, -1),
            self.status,
            _pad(self.within_limits, B, 0),
            self.names,
            self.complete,
            _pad(self.partner, B, -1),
        )

    def insert_rows(self, rows: Int, new: Columns) -> Columns:
        """The samples with others before the rows `rows`; the links of both stay, as far as they have any."""
        B = max(self.q.shape[1], new.q.shape[1])
        wide, new = self.pad_to(B), new.pad_to(B)
        links = new.partner if len(new.partner) else np.full((len(new.s), B), -1, np.int16)
        return Columns(
            np.insert(wide.s, rows, new.s),
            np.insert(wide.q, rows, new.q, axis=0),
            np.insert(wide.name, rows, new.name, axis=0),
            np.insert(wide.status, rows, new.status),
            np.insert(wide.within_limits, rows, new.within_limits, axis=0),
            wide.names,
            wide.complete and new.complete,
            np.insert(wide.partner, rows, links, axis=0),
        )


@dataclass
class Samples:
    """What solves a route at samples; near: joint values (n,) for joints that are free; length: [mm] of the route."""

    arm: Arm
    targets: Callable[[Array], Array]
    task: str | None
    near: Array
    length: float
    stays: bool = False  # whether all of the route is singular: free joints then stay

    def solve_first(self, s: Array) -> Columns:
        """All branches at the first samples (N,), increasing.

        From a singular posture on, where all may be dear to examine, a few of them are solved first: between two that
        are out of reach nobody looks.
        """
        if len(s) <= 2 * _STRIDE or self.solve_at(s[:1]).status[0] != Status.SINGULAR:
            return self.solve_at(s)
        sparse = np.append(np.arange(0, len(s) - 1, _STRIDE), len(s) - 1)
        sampled = self.solve_at(s[sparse])
        if (sampled.status == Status.SINGULAR).all():
            self.stays = True
            return self.solve_at(s)
        unreachable = sampled.status == Status.UNREACHABLE
        between = np.setdiff1d(np.arange(len(s)), sparse)
        unsolved = (unreachable[:-1] & unreachable[1:])[np.searchsorted(sparse, between) - 1]
        parts = [sampled]
        if not unsolved.all():
            parts.append(self.solve_at(s[between[~unsolved]]))
        if unsolved.any():
            empty, lengths = (
                sampled.take_rows(np.flatnonzero(unreachable)[[0] * int(unsolved.sum())]),
                s[between[unsolved]],
            )
            parts.append(replace(empty, s=lengths))
        columns = _concatenate(parts)
        return columns.take_rows(np.argsort(columns.s, kind="stable"))

    def solve_at(self, s: Array, examine: bool = True) -> Columns:
        """All branches at samples, not linked yet; of very many in parts, to bound the memory that takes."""
        parts = [self._solve_block(s[k : k + _BLOCK_SAMPLES], examine) for k in range(0, len(s), _BLOCK_SAMPLES)]
        return parts[0] if len(parts) == 1 else _concatenate(parts)

    def _solve_block(self, s: Array, examine: bool) -> Columns:
        solutions = ik(self.arm, self.targets(s), self.task, near=self.near, examine=examine)
        q, name, within = solutions.q, solutions.branch.astype(np.int16), solutions.within_limits
        singular = np.flatnonzero(solutions.status == Status.SINGULAR)
        if len(singular):
            # Exactly on a singularity some joints are free: 1e-7 of the path's length beside it they are determined.
            aside = np.clip(s[singular] + 1e-7 * self.length, 0.0, self.length)
            aside = np.where(aside == s[singular], s[singular] - 1e-7 * self.length, aside)
            beside = ik(self.arm, self.targets(aside), self.task, near=self.near)
            # Where there is nothing beside it, a stretched arm's wrist for example, the posture there stays.
            good = (beside.status != Status.SINGULAR) & beside.valid.any(axis=1)
            B = max(q.shape[1], beside.q.shape[1])
            q, name, within = _pad(q, B).copy(), _pad(name, B, -1).copy(), _pad(within, B, 0).copy()
            within[singular[good]] = _pad(beside.within_limits, B, 0)[good]
            q[singular[good]] = _pad(beside.q, B)[good]
            name[singular[good]] = _pad(beside.branch.astype(np.int16), B, -1)[good]
            if self.stays and len(stay := singular[~good]):
                q[stay] = self._hold_free_joints(q[stay], self.targets(s[stay]), solutions.free[stay], within[stay])
        return _columns_by_name(solutions, s, q, name, within)

    def _hold_free_joints(self, q: Array, target: Array, free: Bool, within_limits: Bool) -> Array:
        """Singular postures (M, B, n) with their free joints (M, n) as near as they can be to where the arm stands."""
        rows, b = np.nonzero(~np.isnan(q[:, :, 0]) & within_limits)
        if not len(rows):
            return q
        arm, task = self.arm, task_for(self.arm, self.task)
        start, loose = q[rows, b], free[rows]
        postures, miss = correct(
            actual_arm(arm), task, np.where(loose, self.near, start) * arm.ratio, target[rows], steps=_NEWTON_STEPS
        )
        postures /= arm.ratio
        same = np.where(loose, 0.0, np.abs(joint_change(arm, start, postures))).max(axis=1) < _MAX_MOVEMENT
        good = same & (miss <= CONVERGING) & ~outside_limits(arm, postures).any(axis=1)
        q[rows[good], b[good]] = postures[good]
        return q


def _concatenate(parts: list[Columns]) -> Columns:
    """Samples of all the parts, one part after another."""
    B = max(part.q.shape[1] for part in parts)
    wide = [part.pad_to(B) for part in parts]
    return Columns(
        np.concatenate([part.s for part in wide]),
        np.concatenate([part.q for part in wide]),
        np.concatenate([part.name for part in wide]),
        np.concatenate([part.status for part in wide]),
        np.concatenate([part.within_limits for part in wide]),
        max((part.names for part in parts), key=len),
        all(part.complete for part in parts),
    )


def _columns_by_name(solutions: Solutions, s: Array, q: Array, name: NDArray[np.int16], within_limits: Bool) -> Columns:
    """Rows of solutions with every named branch in the column of its number."""
    B = q.shape[1]
    wide = max(B, int(name.max(initial=-1)) + 1)
    status, complete = solutions.status.astype(np.int8), bool(np.all(solutions.complete))
    misplaced = np.flatnonzero(((name >= 0) & (name != np.arange(B))).any(axis=1))
    q, name, within_limits = (_pad(x, wide, fill) for x, fill in ((q, np.nan), (name, -1), (within_limits, 0)))
    if len(misplaced):
        q, name, within_limits = q.copy(), name.copy(), within_limits.copy()
        old_q, old_name, old_within = q[misplaced], name[misplaced], within_limits[misplaced]
        q[misplaced], name[misplaced], within_limits[misplaced] = np.nan, -1, False
        row, column = np.nonzero((old_name >= 0) & ~np.isnan(old_q[:, :, 0]))
        place = old_name[row, column]
        q[misplaced[row], place] = old_q[row, column]
        name[misplaced[row], place] = place
        within_limits[misplaced[row], place] = old_within[row, column]
    return Columns(s, q, name, status, within_limits, solutions.names, complete)


def _pad(values: NDArray, B: int, fill: float = np.nan) -> NDArray:  # type: ignore[type-arg]
    """The values with B columns on axis 1 at least, the new ones `fill`."""
    missing = B - values.shape[1]
    if missing <= 0:
        return values
    padding = np.full((values.shape[0], missing, *values.shape[2:]), fill, values.dtype)
    return np.concatenate([values, padding], axis=1)
