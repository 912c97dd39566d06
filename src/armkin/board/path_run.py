"""A planned path on a board: laid out before anything moves, carried out part by part, the gripper between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.board.backend import Planned, Progress
    from armkin.board.backend.board import Board
    from armkin.motion.path_plan import PathPlan

Lay = Callable[[Trajectory, "NDArray[np.int64]"], "Planned"]  # a trajectory from counts, on some board


def parts(plan: PathPlan, start: Sequence[int], lay: Lay) -> list[Planned]:
    """A plan's approach, if it has one, and its motion between the gripper's, from counts.

    Raises UsageError if the board is too slow for it.
    """
    whole = plan.motion
    edges = [0, *(marker.before for marker in plan.markers), len(whole.stretches)]
    found, at, q = [], np.asarray(start, dtype=np.int64), whole.start
    if plan.approach is not None:
        found.append(lay(plan.approach, at))
        at = found[0].end
    for a, b in pairwise(edges):
        trajectory = Trajectory(plan.arm, q, whole.stretches[a:b])
        one = lay(trajectory, at)
        found.append(one)
        at, q = one.end, trajectory.end
    return found


def check_gripper(plan: PathPlan, board: Board) -> None:
    """Raise UsageError if the plan needs a gripper that the board does not move, or a value it cannot reach."""
    for marker in plan.markers:
        board.grip_value(marker.value)


def follow(board: Board, plan: PathPlan, laid: Sequence[Planned], progress: Progress, first: int = 0) -> None:
    """Carry out a plan's parts from the `first` on, which are `laid`, and what the gripper does between them."""
    done, total = 0.0, sum(one.duration for one in laid)
    markers = [None] * (plan.approach is not None) + [marker.value for marker in plan.markers]
    for k, one in enumerate(laid, first):
        if one.trajectory.stretches:
            begun = done
            board.machine.run([one], lambda seconds, _, begun=begun: progress(begun + seconds, total))  # type: ignore[misc]
            done += one.duration
        if k < len(markers) and (value := markers[k]) is not None:
            board.grip(value)
