"""Solves one target of a closed form in plain numbers, as numpy's calls cost more than the work for one pose.

The operations are those of a batch. Special targets (an edge, a rounded rotation, a far slide) are left to the batch.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.forward import point_numbers
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.whole_turns import nearest_number
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.near_itself import COARSE_ROOM, ROOM
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import MAX_TARGET, ROUNDED, rotation_check
from armkin.model.arm import Arm, actual_arm
from armkin.model.limits import SLACK
from armkin.model.units import TURN, radian_or_reach


@lru_cache(maxsize=64)
def short_way(arm: Arm, task: str | None) -> "OneTarget | None":
    """The solver for single targets of an arm and task, prepared at its first use; None without a closed form."""
    if actual_arm(arm) is not arm or solver(arm, task)[1].pairs is None:
        return None
    return OneTarget(arm, task)


class OneTarget:
    """A closed form for one target at a time."""

    def __init__(self, arm: Arm, task: str | None) -> None:
        definition, geometry = solver(arm, task)
        self._complete = geometry.complete
        self.orientation, self.position = definition.orientation, definition.position
        self.shape = (4, 4) if self.orientation == "full" else (len(definition.labels),)
        runner = recorded_formula(arm, definition, geometry)
        self._run, self._off = runner.code.single_pose_function(), rotation_check().single_pose_function()
        self._joints = list(zip(arm.lower.tolist(), arm.upper.tolist(), arm.prismatic.tolist(), strict=True))
        self._point, self._home, self._room = point_numbers(arm), arm.home, ROOM * arm.reach
        self._coarse = COARSE_ROOM * arm.reach if self.orientation == "full" else 0.0
        self._home_tip = self._point(*arm.home.tolist())
        self._close = [tol.STANDING_DISTANCE * unit for unit in radian_or_reach(arm).tolist()]
        output_axes, axes = runner.code.axes(), runner.axes
        self.count = math.prod(axes)
        self._plain = [not a for a in output_axes]  # whether an output is a number instead of a tuple
        places = [np.broadcast_to(np.arange(math.prod(a)).reshape(a), axes).ravel() for a in output_axes[: arm.n + 1]]
        first = np.cumsum([0, *(math.prod(a) for a in output_axes[: arm.n - 1])])
        # indices of every branch's joint values in the outputs
        index = np.stack(places[: arm.n], axis=1) + first
        self._rows = [itemgetter(*row, row[0]) for row in index.tolist()]  # one item more, as one makes no tuple
        self._all = itemgetter(*index.ravel().tolist(), 0)
        self._misses = itemgetter(*places[-1].tolist(), 0)
        self._base, self._reach = arm.link[0][: self.position, 3].tolist(), arm.reach
        self._slides, self._ordered, self._n = bool(arm.prismatic.any()), geometry.ordered, arm.n
        self._same = {"arm": arm, "task": definition, "method": geometry.name, "why": geometry.why}
        self._same["names"] = branch_names(arm, definition, geometry, self.count)

    def solve(self, target: Array, given_near: ArrayLike | None) -> Solutions | None:  # noqa: C901 - as nearest_number
        """The branches of a single target; None for a batch or a special target. given_near: `near`."""
        if target.shape != self.shape:
            return None
        near = self._home
        if given_near is not None:
            near = arrays.real_array(given_near, "near")
            if near.shape != (self._n,) or not np.isfinite(near).all():
                return None
        goal, defect = target.ravel().tolist(), 0.0
        if not math.isfinite(sum(goal)) or max(goal) > MAX_TARGET or min(goal) < -MAX_TARGET:
            return None
        own_target = target.copy()
        if self.orientation == "full":
            goal = [*goal[0:11:4], *goal[1:11:4], *goal[2:11:4], *goal[3:12:4]]
            defect = self._off(*goal)[0]
            if defect > ROUNDED:
                return None
            point = goal[9:]
        else:
            point = goal[: self.position]
            if self.orientation == "axis":
                length = math.sqrt(goal[3] * goal[3] + goal[4] * goal[4] + goal[5] * goal[5])
                if length < tol.NO_SIZE:
                    return None
                own_target[3:] /= length
                goal = own_target.tolist()
        if self._slides and math.dist(point, self._base) > tol.FAR_DISTANCE * self._reach:
            return None
        *values, miss, doubt, _ = self._run(*goal)
        if doubt if self._plain[-2] else any(doubt):
            return None
        misses = self._misses((miss,) if self._plain[-3] else miss)[:-1]
        solving = [b for b, m in enumerate(misses) if m <= tol.ACCEPTED**2]
        if len(solving) < self.count and sum(m > tol.NEARBY**2 for m in misses) + len(solving) < self.count:
            return None
        tip = self._home_tip if near is self._home else self._point(*near.tolist())
        distance = math.dist(point, tip[: self.position])
        at_near = distance <= self._room
        if not at_near and distance <= self._coarse and all(abs(x - round(x)) <= ROUNDED for x in goal[:9]):
            return None  # `near` may solve it within a rounding that only its position shows
        return self._solution(own_target, near, values, solving, defect, at_near)

    def _branch_at_near(self, near: list[float], legal: list[float], solving: list[int]) -> int | None:
        """Which of the solving branches, at their nearest legal copies, is at `near`; None if none is."""
        for place, b in enumerate(solving):
            differences = zip(self._rows[b](legal), near, self._joints, self._close, strict=False)
            if all(abs(v - c if j[2] else math.remainder(v - c, TURN)) <= bound for v, c, j, bound in differences):
                return place
        return None

    def _solution(
        self, target: Array, near: Array, values: Sequence[Any], solving: list[int], defect: float, at_near: bool
    ) -> Solutions | None:
        """The solving branches at their nearest legal copies, nan behind them; None if `near` may be another branch.

        at_near: whether the tool is at the target with the joints at `near`.
        """
        legal: list[float] = []
        inside: list[bool] = []
        near_numbers = near.tolist()
        for value, reference, joint, plain in zip(values, near_numbers, self._joints, self._plain, strict=False):
            for v in (value,) if plain else value:
                copy, fits = nearest_number(v, reference, *joint)
                legal.append(copy)
                inside.append(fits)
        B, n, count = self.count, self._n, len(solving)
        if count == B:
            q = np.array(self._all(legal)[:-1]).reshape(B, n)
        else:
            q = np.full((B, n), np.nan)
            for place, b in enumerate(solving):
                q[place] = self._rows[b](legal)[:-1]
        within = [True] * count if all(inside) else [all(self._rows[b](inside)) for b in solving]
        limits = zip(near_numbers, self._joints, strict=True)
        if at_near and all(low - SLACK <= v <= high + SLACK for v, (low, high, _) in limits):
            near_branch = self._branch_at_near(near_numbers, legal, solving)
            if near_branch is None:
                return None
            q[near_branch], within[near_branch] = near, True
        missing = B - count
        block = np.array([
            *[True] * count, *[False] * missing, *within, *[False] * missing,
            *(solving if self._ordered else range(count)), *[-1] * missing,
            *[False] * n, Status.EXACT if count else Status.UNREACHABLE, self._complete,
        ], np.int8)  # fmt: skip
        flags = block.view(np.bool_)
        end = 3 * B + n
        solutions = Solutions.__new__(Solutions)  # faster than the constructor of a frozen class
        solutions.__dict__.update(
            self._same, target=target, near=near.copy(), rounding=np.array(defect), q=q,
            valid=flags[:B], within_limits=flags[B : 2 * B], branch=block[2 * B : 3 * B], free=flags[3 * B : end],
            status=block[end : end + 1].reshape(()), complete=flags[end + 1 :].reshape(()),
        )  # fmt: skip
        return solutions
