"""The targets of a path's tool moves, computed before a branch or a place for the arm is chosen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.motion.branches.branch_path import Pace
from armkin.motion.path_planner.move_kinds import MOVES
from armkin.motion.path_planner.move_walk import PathOptions, Walk
from armkin.motion.path_planner.path_request import TOLERANCE, default_corner_blend
from armkin.motion.tool_path.piece_shapes import line
from armkin.motion.tool_path.route import join_pieces

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.path_file import Move, PathFile


def route_targets(arm: Arm, file: PathFile, step: float) -> tuple[Task, list[Array]]:
    """The task, and the targets of every route that the tool follows on one branch, about `step` [mm] apart.

    Joint moves between two routes may change the branch; a single point is a route of one target. Raises UsageError
    for a route that begins at joint values, since its targets would move with the arm.
    """
    corner = default_corner_blend(file, None, None)
    pace = Pace(tolerance=file.tolerance or TOLERANCE)
    options = PathOptions(task=file.task, corner=corner, near=None, branch=None, split=False, samples=None)
    outline = _Outline(arm, file, pace, arm.home, options)
    outline.step, outline.targets_per_route = step, []
    outline.plan_all(MOVES)
    if not outline.targets_per_route:
        raise UsageError("the path has no target of the tool: it says nothing of where to put an arm")
    return outline.task, outline.targets_per_route


class _Outline(Walk):
    """A walk that records the targets of its routes and plans nothing."""

    step: float
    targets_per_route: list[Array]

    def _begin(self) -> None:
        start = self.file.start
        if start is not None and not isinstance(start, str) and start.joints is None:
            self.begin_group(self.target(start.point))  # type: ignore[arg-type]
        self.begun = self.q

    def take_posture(self) -> None:
        """Raises UsageError: an outline has no posture."""
        raise UsageError("a way along the tool's axes hangs on the posture: give place offsets in the frame of targets")

    def _plan_group(self) -> None:
        """Append the targets along the pieces since the last joint move, and begin a new group."""
        if self.goal is not None:
            if self.pieces:
                route, _ = join_pieces(self.task, self.pieces, self.blends, frozenset(self.pauses), self.pace.tolerance)
                even_lengths = np.linspace(0.0, route.length, max(int(np.ceil(route.length / self.step)) + 1, 3))
                s = np.union1d(even_lengths, route.breaks)
                self.targets_per_route.append(route.targets(s))
            else:
                self.targets_per_route.append(line(self.task, self.goal, self.goal).targets(np.zeros(1)))
        elif self.pieces:
            raise UsageError(
                "this way begins where joint values leave the tool, which moves with the arm: put a point before it"
            )
        self.goal = None
        self.pieces, self.blends, self.pauses = [], [], {}

    def append_joint_move(self, goal: Array, move: Move | None) -> None:
        """Record the joint values at the end of a joint move."""
        self.q = goal
