"""All branches along a route, linked from sample to sample by a certificate instead of a jump threshold.

On a straight step D in joint space the tip leaves its chord by at most 1/8 sum_jk |D_j| |D_k| r(j, k): the second
derivatives of the forward kinematics are levers, at most r, the reach beyond the later of the two joints. Two
solutions of neighbouring samples are one branch if that is within the tolerance. Steps where a branch finds no
such partner are divided, until it does or they are too short to mean anything: there it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.solutions import Status
from armkin.motion.branches.branch_columns import Columns, Samples
from armkin.motion.branches.joint_steps import chord_bound, joint_change, largest_form, levers, whole_turns

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_STEP = 1e-9  # step, as a share of the route, below which what is not linked is a jump
END_ACCURACY = 0.002  # accuracy [mm] with which the end of a branch, or the crossing of a limit, is found
_TORN_PARTS = 3  # parts of a step in which branches end: where they are more, branches end everywhere
_PART_COUNTS = (8, 32)  # parts of a step that is divided: with many such steps, and with few
_CHUNK_SAMPLES = 1024  # samples solved at once, if the parts are no fewer
_MAX_SAMPLES = 50_000  # samples added at most
_BLOCK_STEPS = 16_384  # steps looked at together


def link_branches(
    arm: Arm, targets: Callable[[Array], Array], s: Array, *, task: str | None, tolerance: float, near: Array
) -> Columns:
    """All branches at samples s of a route, every step certified or divided as far as it makes sense.

    targets: lengths (N,) to targets; near: joint values for joints that are free.
    """
    work = _Linking(arm, targets, task, tolerance, near, float(s[-1]))
    work.start(s)
    work.settle()
    return work.columns


class _Linking:
    """The samples so far, and which steps are still open."""

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
        self.fresh = np.zeros(0, bool)  # samples that were added
        self.wide = [  # joints whose copies overlap: a run may end at a limit though another copy is legal
            j
            for j in range(arm.n)
            if not arm.prismatic[j]
            and arm.upper[j] - arm.lower[j] > self.turn[j] - 1e-6
            and np.isfinite(arm.upper[j] - arm.lower[j])
        ]

    def start(self, s: Array) -> None:
        """Solve the first samples and link them."""
        self.columns = self.samples.solve_first(s)
        N, B = len(s), self.columns.q.shape[1]
        self.columns.partner = np.full((N - 1, B), -1, np.int16)
        self.open = np.ones(N - 1, bool)  # steps to look at
        self.torn = np.zeros(N - 1, bool)  # steps with a branch that has no partner
        self.both = np.zeros(N - 1, bool)  # steps with one at either end, which may be the same branch
        self.crossing = np.zeros(N - 1, bool)  # steps in which a joint passes a limit
        self._link()

    def settle(self) -> None:
        """Divide the steps that need it, apart from all the others, three samples around each."""
        c = self.columns
        steps = np.flatnonzero(self.torn | self.crossing)
        if not len(steps):
            return
        rows = np.stack([np.maximum(steps - 1, 0), steps, steps + 1], axis=1).ravel()
        samples = self.samples
        part = _Linking(samples.arm, samples.targets, samples.task, self.tolerance, samples.near, self.length)
        part.samples = samples
        part.columns = c.take_rows(rows)
        part.columns.partner = c.partner[rows[:-1]]
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
        """Take over what was added to the steps, and their links."""
        B = max(self.columns.q.shape[1], part.columns.q.shape[1])
        c, p, fresh = self.columns.pad_to(B), part.columns.pad_to(B), part.fresh
        positions = np.repeat(steps + 1, np.bincount(group[fresh], minlength=len(steps)))
        links = np.append(p.partner, np.full((1, B), -1, np.int16), axis=0)
        # the left end of each step is the second sample of its group
        second = np.flatnonzero(~fresh)[1::3]
        c.partner = c.partner.copy()
        c.partner[steps] = links[second]
        added = p.take_rows(np.flatnonzero(fresh))
        added.partner = links[fresh]
        self.columns = c.insert_rows(positions, added)

    def divide(self) -> bool:
        """Divide what has no partner yet, or holds an end that is not known finely enough; False: all is done.

        A branch without a partner of which the step's other end knows nothing ends in that step, whatever is found
        inside: where it does is all that is asked.
        """
        c = self.columns
        h = np.diff(c.s)
        least = np.where(self.both, max(MIN_STEP * self.length, 1e-9), END_ACCURACY)
        steps = np.flatnonzero((self.torn | self.crossing) & (h > 1.5 * least))
        # Ends need no more than the formulas; their samples on edges are dear to examine.
        singular = c.status == Status.SINGULAR
        plain = ~(self.both | singular[:-1] | singular[1:])[steps]
        quick = bool(plain.any())
        steps = steps[plain] if quick else steps
        if not len(steps) or self.added > _MAX_SAMPLES:
            return False
        parts = int(np.clip(_CHUNK_SAMPLES // len(steps), *_PART_COUNTS))
        f = np.arange(1, parts) / parts
        lengths = (c.s[steps, None] + h[steps, None] * f).ravel()
        columns = self.samples.solve_at(lengths, examine=not quick)
        self.where = rows = np.repeat(steps + 1, parts - 1)
        self.fresh = np.insert(self.fresh, rows, True)
        self.added += len(lengths)
        self.columns = c.insert_rows(rows, columns)
        fresh = np.zeros(len(c.s) - 1, bool)
        fresh[steps] = True
        self.open = np.insert(fresh, rows, True)
        self.torn = np.insert(self.torn & ~fresh, rows, False)
        self.both = np.insert(self.both & ~fresh, rows, False)
        self.crossing = np.insert(self.crossing & ~fresh, rows, False)
        begins = np.flatnonzero(fresh) + (parts - 1) * np.arange(len(steps))  # begins of the divided steps
        self._link()
        self._give_up(begins[:, None] + np.arange(parts))
        return True

    def _give_up(self, steps: Int) -> None:
        """Leave what no dividing links: steps (M, parts) of singular postures, whose free joints stand anywhere."""
        singular = self.columns.status == Status.SINGULAR
        inside = (singular[:-1] & singular[1:])[steps]
        mostly_torn = (self.torn[steps] & inside).sum(axis=1, keepdims=True) > _TORN_PARTS
        self.torn[steps[mostly_torn & inside]] = False

    def _link(self) -> None:
        """Find partners in the open steps."""
        rows, valid = np.flatnonzero(self.open), self.columns.valid
        for k in range(0, len(rows), _BLOCK_STEPS):
            self._link_rows(rows[k : k + _BLOCK_STEPS], valid)
        self.open[:] = False

    def _link_rows(self, rows: Int, valid: Bool) -> None:
        c, first, behind = self.columns, int(rows[0]), int(rows[-1]) + 1
        every = behind - first == len(rows)
        left, right = (slice(first, behind), slice(first + 1, behind + 1)) if every else (rows, rows + 1)
        good, wrapped = self._certify(c.q[left], c.q[right], valid[left] & valid[right])
        column = np.arange(c.q.shape[1], dtype=np.int16)
        c.partner[rows] = np.where(good, column, np.int16(-1))
        straight = (good == (valid[left] | valid[right])).all(axis=1)
        self.torn[rows], self.both[rows] = False, False
        flips = (c.within_limits[left] != c.within_limits[right]) & good
        if self.wide:
            flips |= self._crossed_limits(c.q, left, right, wrapped) & good
        self.crossing[rows] = flips.any(axis=1)
        for i in rows[~straight]:
            self._match_step(int(i), valid)

    def _certify(self, a: Array, b: Array, present: Bool) -> tuple[Bool, Bool]:
        """Which branches (M, B, n) at steps' ends are one, by a cheap bound and where that is too coarse by the bound.

        present: (M, B). Returns that, and which of the cheaply refused ones go the other way round: (M, B) each.
        """
        D = b - a
        if self.scale is not None:
            D *= self.scale
        with np.errstate(invalid="ignore"):
            good = self.top * np.einsum("mbi,mbi->mb", D, D) <= self.tolerance
        k, j = np.nonzero(present & ~good)
        wrapped = np.zeros(good.shape, bool)
        if len(k):
            shorter = joint_change(self.arm, a[k, j], b[k, j])
            good[k, j] = chord_bound(self.lever, shorter) <= self.tolerance
            wrapped[k, j] = np.abs(b[k, j] - a[k, j] - shorter).max(axis=1) > 1.0
        return good, wrapped

    def _match_step(self, i: int, valid: Bool) -> None:
        """Partners of one step, whatever their columns: certified pairs, the smoothest first."""
        c, arm = self.columns, self.arm
        left, right = np.flatnonzero(valid[i]), np.flatnonzero(valid[i + 1])
        D = joint_change(arm, c.q[i, left][:, None], c.q[i + 1, right][None])
        certified = chord_bound(self.lever, D) <= self.tolerance
        guess = np.zeros((len(left), arm.n))
        if i > 0 and c.s[i] > c.s[i - 1]:
            ratio = (c.s[i + 1] - c.s[i]) / (c.s[i] - c.s[i - 1])
            for k, b in enumerate(left):
                before = np.flatnonzero(c.partner[i - 1] == b)
                if len(before):
                    guess[k] = joint_change(arm, c.q[i - 1, before[0]], c.q[i, b]) * min(ratio, 10.0)
        cost = np.where(certified, np.linalg.norm(D - guess[:, None], axis=2), np.inf)
        c.partner[i] = -1
        while np.isfinite(cost).any():
            a, b = np.unravel_index(int(cost.argmin()), cost.shape)
            c.partner[i, left[a]] = right[b]
            cost[a, :], cost[:, b] = np.inf, np.inf
        # A branch without a copy within limits at either end carries nothing: where it goes on is not asked.
        alone, arriving = left[c.partner[i, left] < 0], np.setdiff1d(right, c.partner[i])
        self.torn[i] = c.within_limits[i, alone].any() or c.within_limits[i + 1, arriving].any()
        self.both[i] = self.torn[i] and len(alone) and len(arriving)

    def _crossed_limits(self, q: Array, starts: Int | slice, ends: Int | slice, wrapped: Bool) -> Bool:
        """Which columns of steps have a wide joint that passes one of its limits, whole turns apart: (M, B)."""
        crossed = wrapped.copy()
        for j in self.wide:
            value = q[:, :, j]
            for limit in (self.arm.lower[j], self.arm.upper[j]):
                crossed |= np.floor((value[starts] - limit) / self.turn[j]) != np.floor(
                    (value[ends] - limit) / self.turn[j]
                )
        k, b = np.nonzero(wrapped)  # joints that go the other way round
        if len(k):
            start, end = q[starts][k, b], q[ends][k, b]
            unwrapped_end = start + joint_change(self.arm, start, end)
            crossed[k, b] = False
            for j in self.wide:
                for limit in (self.arm.lower[j], self.arm.upper[j]):
                    before, after = (np.floor((x[:, j] - limit) / self.turn[j]) for x in (start, unwrapped_end))
                    crossed[k, b] |= before != after
        return crossed
