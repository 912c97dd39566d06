"""A planned path on a board: laid out before anything moves, carried out part by part, the gripper between."""

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

Lay = Callable[[Trajectory, "NDArray[np.int64]"], "Planned"]  # a trajectory from counts, on some board


def lay_parts(plan: PathPlan, start: Sequence[int], lay: Lay) -> list[Planned]:
    """A plan's approach, if it has one, and its motion between the gripper's, from counts.

    Raises UsageError if the board is too slow for it.
    """
    motion = plan.motion
    edges = [0, *(marker.before for marker in plan.markers), len(motion.stretches)]
    laid, begin, q = [], np.asarray(start, dtype=np.int64), motion.start
    if plan.approach is not None:
        laid.append(lay(plan.approach, begin))
        begin = laid[0].end
    for a, b in pairwise(edges):
        trajectory = Trajectory(plan.arm, q, motion.stretches[a:b])
        part = lay(trajectory, begin)
        laid.append(part)
        begin, q = part.end, trajectory.end
    return laid


def check_gripper(plan: PathPlan, board: Board) -> None:
    """Raise UsageError if the plan needs a gripper that the board does not move, or a value it cannot reach."""
    for marker in plan.markers:
        if marker.kind == "grip":
            board.check_grip(marker.value)


def check_pauses(plan: PathPlan, answers: bool) -> None:
    """Raise UsageError if the plan rests until Enter, and nobody answers."""
    if not answers and any(marker.kind == "pause" for marker in plan.markers):
        raise UsageError("the path rests until Enter (M0, wait: enter), and there is no terminal to press it")


def follow_plan(
    board: Board,
    plan: PathPlan,
    laid: Sequence[Planned],
    progress: Progress,
    first: int = 0,
    ask: Callable[[], object] = lambda: None,
) -> None:
    """Carry out a plan's parts from the `first` on, which are `laid`, and what the gripper does between them.

    ask: what ends a rest until Enter.
    """
    elapsed, total = 0.0, sum(part.duration for part in laid)
    markers: list[Marker | None] = list(plan.markers)
    if plan.approach is not None:  # no marker stands behind it
        markers.insert(0, None)
    for k, part in enumerate(laid, first):
        if part.trajectory.stretches:
            begun = elapsed
            board.machine.run([part], lambda seconds, _, begun=begun: progress(begun + seconds, total))  # type: ignore[misc]
            elapsed += part.duration
        marker = markers[k] if k < len(markers) else None
        if marker is not None and marker.kind == "pause":
            ask()
        elif marker is not None:
            board.grip(marker.value)
