"""All branches along a route, linked from sample to sample by a certificate instead of a jump threshold.

On a straight step D in joint space the tip leaves its chord by at most 1/8 sum_jk |D_j| |D_k| r(j, k): the second
derivatives of the forward kinematics are levers, at most r, the reach beyond the later of the two joints. Two
solutions of neighbouring samples are one branch if this bound is within the tolerance. A step on which a branch finds
no partner is divided until it finds one or the step is too short, and then the branch ends there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.solutions import Status
from armkin.motion.branches.branch_columns import BranchColumns, Samples
from armkin.motion.branches.joint_steps import chord_bound, joint_change, largest_form, levers, whole_turns

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_STEP = 1e-9  # shortest step, as a share of the route: branches not linked on it are separate
END_ACCURACY = 0.002  # accuracy [mm] of the place where a branch ends or a joint crosses a limit
_TORN_PARTS = 3  # a step with branch ends in more parts than this is not divided further
_PART_COUNTS = (8, 32)  # least and greatest number of parts of a divided step
_CHUNK_SAMPLES = 1024  # samples that a round of divisions aims at
_MAX_SAMPLES = 50_000  # most samples added by divisions
_BLOCK_STEPS = 16_384  # steps certified in one call


def link_branches(
    arm: Arm, targets: Callable[[Array], Array], s: Array, *, task: str | None, tolerance: float, near: Array
) -> BranchColumns:
    """All branches at samples s of a route, with every step certified or divided down to the shortest length.

    targets: lengths (N,) to targets; near: joint values for joints that are free.
    """
    work = _Linking(arm=arm, targets=targets, task=task, tolerance=tolerance, near=near, length=float(s[-1]))
    work.start(s)
    work.divide_unlinked_steps()
    return work.columns


class _Linking:
    """The columns so far, and which steps between their samples have to be linked or divided."""

    def __init__(
        self,
        arm: Arm,
        targets: Callable[[Array], Array],
        task: str | None,
        tolerance: float,
        near: Array,
        length: float,
    ) -> None:
        self.arm, self.tolerance, self.length = arm, tolerance, length
        self.samples = Samples(arm, targets, task, near, length)
        self.lever = levers(arm)
        self.turn = whole_turns(arm)
        self.scale, self.top = largest_form(arm, self.lever)
        self.added = 0
        self.fresh = np.zeros(0, bool)  # whether a sample was added by a division
        span = arm.upper - arm.lower
        turns = ~arm.prismatic & (span > self.turn - 1e-6) & np.isfinite(span)
        self.wide: list[int] = np.flatnonzero(turns).tolist()  # a range over a whole turn: two copies may be legal

    def start(self, s: Array) -> None:
        """Solve the first samples and link them."""
        self.columns = self.samples.solve_first(s)
        N, B = len(s), self.columns.q.shape[1]
        self.columns.partner = np.full((N - 1, B), -1, np.int16)
        self.open = np.ones(N - 1, bool)  # steps to be linked
        self.torn = np.zeros(N - 1, bool)  # steps with a branch that has no partner
        self.both = np.zeros(N - 1, bool)  # steps with an unlinked branch at either end, maybe the same
        self.crossing = np.zeros(N - 1, bool)  # steps in which a joint passes a limit
        self._link()

    def divide_unlinked_steps(self) -> None:
        """Divide the unlinked steps in a small table of their own, with three samples around each."""
        columns = self.columns
        steps = np.flatnonzero(self.torn | self.crossing)
        if not len(steps):
            return
        rows = np.stack([np.maximum(steps - 1, 0), steps, steps + 1], axis=1).ravel()
        samples = self.samples
        part = _Linking(
            arm=samples.arm,
            targets=samples.targets,
            task=samples.task,
            tolerance=self.tolerance,
            near=samples.near,
            length=self.length,
        )
        part.samples = samples
        part.columns = columns.take_rows(rows)
        part.columns.partner = columns.partner[rows[:-1]]
        part.columns.partner[2::3] = -1  # the samples between the groups have no partner
        part.open = np.zeros(len(rows) - 1, bool)
        part.torn, part.both, part.crossing = part.open.copy(), part.open.copy(), part.open.copy()
        part.torn[1::3], part.both[1::3] = self.torn[steps], self.both[steps]
        part.crossing[1::3] = self.crossing[steps]
        part.fresh = np.zeros(len(rows), bool)
        group = np.repeat(np.arange(len(steps)), 3)
        while part.divide():
            group = np.insert(group, part.where, group[np.maximum(part.where - 1, 0)])
        self._take_over(part, steps, group)

    def _take_over(self, part: _Linking, steps: Int, group: Int) -> None:
        """Insert the samples that divisions have added, with their links."""
        B = max(self.columns.q.shape[1], part.columns.q.shape[1])
        columns, part_columns, is_new = self.columns.pad_to(B), part.columns.pad_to(B), part.fresh
        positions = np.repeat(steps + 1, np.bincount(group[is_new], minlength=len(steps)))
        links = np.append(part_columns.partner, np.full((1, B), -1, np.int16), axis=0)
        # the left end of each step is the second sample of its group
        left_ends = np.flatnonzero(~is_new)[1::3]
        columns.partner = columns.partner.copy()
        columns.partner[steps] = links[left_ends]
        added_columns = part_columns.take_rows(np.flatnonzero(is_new))
        added_columns.partner = links[is_new]
        self.columns = columns.insert_rows(positions, added_columns)

    def divide(self) -> bool:
        """Divide the steps with unlinked branches or limit crossings once; False: none is left to divide.

        A branch that has no counterpart at the step's other end must end within the step. Only the place of that end
        is wanted, to END_ACCURACY.
        """
        columns = self.columns
        step_lengths = np.diff(columns.s)
        min_step = np.where(self.both, max(MIN_STEP * self.length, 1e-9), END_ACCURACY)
        steps = np.flatnonzero((self.torn | self.crossing) & (step_lengths > 1.5 * min_step))
        # Steps that only hold an end go first, by the formulas alone: singular samples are expensive to examine.
        singular = columns.status == Status.SINGULAR
        is_plain = ~(self.both | singular[:-1] | singular[1:])[steps]
        skip_singular = bool(is_plain.any())
        steps = steps[is_plain] if skip_singular else steps
        if not len(steps) or self.added > _MAX_SAMPLES:
            return False
        parts = int(np.clip(_CHUNK_SAMPLES // len(steps), *_PART_COUNTS))
        fractions = np.arange(1, parts) / parts
        lengths = (columns.s[steps, None] + step_lengths[steps, None] * fractions).ravel()
        added_columns = self.samples.solve_at(lengths, examine=not skip_singular)
        self.where = rows = np.repeat(steps + 1, parts - 1)
        self.fresh = np.insert(self.fresh, rows, True)
        self.added += len(lengths)
        self.columns = columns.insert_rows(rows, added_columns)
        is_divided = np.zeros(len(columns.s) - 1, bool)
        is_divided[steps] = True
        self.open = np.insert(is_divided, rows, True)
        self.torn = np.insert(self.torn & ~is_divided, rows, False)
        self.both = np.insert(self.both & ~is_divided, rows, False)
        self.crossing = np.insert(self.crossing & ~is_divided, rows, False)
        # first part of each divided step
        first_parts = np.flatnonzero(is_divided) + (parts - 1) * np.arange(len(steps))
        self._link()
        self._give_up(first_parts[:, None] + np.arange(parts))
        return True

    def _give_up(self, steps: Int) -> None:
        """Stop dividing steps (M, parts) between singular postures: their free joints have no continuous values."""
        singular = self.columns.status == Status.SINGULAR
        between_singular = (singular[:-1] & singular[1:])[steps]
        mostly_torn = (self.torn[steps] & between_singular).sum(axis=1, keepdims=True) > _TORN_PARTS
        self.torn[steps[mostly_torn & between_singular]] = False

    def _link(self) -> None:
        """Find partners in the open steps."""
        rows, valid = np.flatnonzero(self.open), self.columns.valid
        for k in range(0, len(rows), _BLOCK_STEPS):
            self._link_rows(rows[k : k + _BLOCK_STEPS], valid)
        self.open[:] = False

    def _link_rows(self, rows: Int, valid: Bool) -> None:
        columns, first, end = self.columns, int(rows[0]), int(rows[-1]) + 1
        contiguous = end - first == len(rows)
        left, right = (slice(first, end), slice(first + 1, end + 1)) if contiguous else (rows, rows + 1)
        is_certified, is_wrapped = self._certify(columns.q[left], columns.q[right], valid[left] & valid[right])
        column = np.arange(columns.q.shape[1], dtype=np.int16)
        columns.partner[rows] = np.where(is_certified, column, np.int16(-1))
        all_linked = (is_certified == (valid[left] | valid[right])).all(axis=1)
        self.torn[rows], self.both[rows] = False, False
        flips = (columns.within_limits[left] != columns.within_limits[right]) & is_certified
        if self.wide:
            flips |= self._crossed_limits(columns.q, left, right, is_wrapped) & is_certified
        self.crossing[rows] = flips.any(axis=1)
        for i in rows[~all_linked]:
            self._match_step(int(i), valid)

    def _certify(self, a: Array, b: Array, present: Bool) -> tuple[Bool, Bool]:
        """Which branches (M, B, n) at the ends of steps are the same: by a cheap bound, then by the exact one.

        present: (M, B). Returns (M, B) whether certified, and whether the step wraps round by a whole turn.
        """
        D = b - a
        if self.scale is not None:
            D *= self.scale
        with np.errstate(invalid="ignore"):
            is_certified = self.top * np.einsum("mbi,mbi->mb", D, D) <= self.tolerance
        step, column = np.nonzero(present & ~is_certified)
        is_wrapped = np.zeros(is_certified.shape, bool)
        if len(step):
            change = joint_change(self.arm, a[step, column], b[step, column])
            is_certified[step, column] = chord_bound(self.lever, change) <= self.tolerance
            is_wrapped[step, column] = np.abs(b[step, column] - a[step, column] - change).max(axis=1) > 1.0
        return is_certified, is_wrapped

    def _match_step(self, i: int, valid: Bool) -> None:
        """Pair the branches of step i across columns: certified pairs, the smoothest first."""
        columns, arm = self.columns, self.arm
        left, right = np.flatnonzero(valid[i]), np.flatnonzero(valid[i + 1])
        D = joint_change(arm, columns.q[i, left][:, None], columns.q[i + 1, right][None])
        is_certified = chord_bound(self.lever, D) <= self.tolerance
        guess = np.zeros((len(left), arm.n))
        if i > 0 and columns.s[i] > columns.s[i - 1]:
            ratio = (columns.s[i + 1] - columns.s[i]) / (columns.s[i] - columns.s[i - 1])
            for row, b in enumerate(left):
                previous = np.flatnonzero(columns.partner[i - 1] == b)
                if len(previous):
                    guess[row] = joint_change(arm, columns.q[i - 1, previous[0]], columns.q[i, b]) * min(ratio, 10.0)
        cost = np.where(is_certified, np.linalg.norm(D - guess[:, None], axis=2), np.inf)
        columns.partner[i] = -1
        while np.isfinite(cost).any():
            a, b = np.unravel_index(int(cost.argmin()), cost.shape)
            columns.partner[i, left[a]] = right[b]
            cost[a, :], cost[:, b] = np.inf, np.inf
        # A branch that is outside the limits at this end carries nothing, so its partner does not matter.
        unpaired_branches, new_branches = left[columns.partner[i, left] < 0], np.setdiff1d(right, columns.partner[i])
        self.torn[i] = (
            columns.within_limits[i, unpaired_branches].any() or columns.within_limits[i + 1, new_branches].any()
        )
        self.both[i] = self.torn[i] and len(unpaired_branches) and len(new_branches)

    def _crossed_limits(self, q: Array, starts: Int | slice, ends: Int | slice, is_wrapped: Bool) -> Bool:
        """Whether a wide joint passes one of its limits (or a copy of it) on a step, for each column: (M, B)."""
        is_crossed = is_wrapped.copy()
        for joint in self.wide:
            value = q[:, :, joint]
            for limit in (self.arm.lower[joint], self.arm.upper[joint]):
                is_crossed |= np.floor((value[starts] - limit) / self.turn[joint]) != np.floor(
                    (value[ends] - limit) / self.turn[joint]
                )
        step, column = np.nonzero(is_wrapped)  # steps on which a joint wraps round by a whole turn
        if len(step):
            start, end = q[starts][step, column], q[ends][step, column]
            unwrapped_end = start + joint_change(self.arm, start, end)
            is_crossed[step, column] = False
            for joint in self.wide:
                for limit in (self.arm.lower[joint], self.arm.upper[joint]):
                    n0, n1 = (np.floor((x[:, joint] - limit) / self.turn[joint]) for x in (start, unwrapped_end))
                    is_crossed[step, column] |= n0 != n1
        return is_crossed
