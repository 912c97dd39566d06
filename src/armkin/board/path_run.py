"""Runs a planned path on a board: checks all parts first, then carries them out with the gripper moves between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.motion.timing.trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.board.backend import Planned, Progress
    from armkin.board.backend.board import Board
    from armkin.motion.plan.path_plan import Marker, PathPlan

PlanTrajectory = Callable[[Trajectory, "NDArray[np.int64]"], "Planned"]  # a board's plan of a trajectory from counts


def plan_parts(plan: PathPlan, start: Sequence[int], plan_trajectory: PlanTrajectory) -> list[Planned]:
    """The approach of a plan, if it has one, and the parts of its motion between gripper moves, as plans for a board.

    Raises UsageError if the board is too slow for it.
    """
    motion = plan.motion
    edges = [0, *(marker.before for marker in plan.markers), len(motion.stretches)]
    parts, begin, q = [], np.asarray(start, dtype=np.int64), motion.start
    if plan.approach is not None:
        parts.append(plan_trajectory(plan.approach, begin))
        begin = parts[0].end
    for a, b in pairwise(edges):
        trajectory = Trajectory(plan.arm, q, motion.stretches[a:b])
        part = plan_trajectory(trajectory, begin)
        parts.append(part)
        begin, q = part.end, trajectory.end
    return parts


def check_gripper(plan: PathPlan, board: Board) -> None:
    """Raise UsageError if the plan needs a gripper that the board does not move, or a value it cannot reach."""
    for marker in plan.markers:
        if marker.kind == "grip":
            board.check_grip(marker.value)


def check_pauses(plan: PathPlan, answers: bool) -> None:
    """Raise UsageError if the plan has a pause until Enter and there is no terminal."""
    if not answers and any(marker.kind == "pause" for marker in plan.markers):
        raise UsageError("the path rests until Enter (M0, wait: enter), and there is no terminal to press it")


def follow_plan(
    board: Board,
    plan: PathPlan,
    parts: Sequence[Planned],
    progress: Progress,
    first: int = 0,
    ask: Callable[[], object] = lambda: None,
) -> None:
    """Carry out the parts of a plan, numbered from `first` on, and the gripper moves between them.

    parts: as plans for the board; ask: waits for the user to end a pause.
    """
    elapsed, total = 0.0, sum(part.duration for part in parts)
    markers: list[Marker | None] = list(plan.markers)
    if plan.approach is not None:  # no marker follows the approach
        markers.insert(0, None)
    for number, part in enumerate(parts, first):
        if part.trajectory.stretches:
            offset = elapsed
            board.machine.run([part], lambda seconds, _, offset=offset: progress(offset + seconds, total))  # type: ignore[misc]
            elapsed += part.duration
        marker = markers[number] if number < len(markers) else None
        if marker is not None and marker.kind == "pause":
            ask()
        elif marker is not None:
            board.grip(marker.value)
