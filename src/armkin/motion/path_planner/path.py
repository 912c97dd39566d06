"""`armkin.path`: a plan of moves, and which joint it holds where one is redundant."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.motion.joint_moves import check_rates
from armkin.motion.path_planner.choose_held_value import path_redundant
from armkin.motion.path_planner.path_request import HOLD_FACTOR, PathRequest, plan_path
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.tool_path import path_numbers

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile


def path(
    arm: Arm,
    moves: str | os.PathLike[str] | PathFile | Mapping[str, Any] | ArrayLike,
    *,
    start: ArrayLike | None = None,
    near: ArrayLike | None = None,
    branch: str | None = None,
    task: str | None = None,
    tolerance: float | None = None,
    corners: str | None = None,
    blend: float | None = None,
    speed: float = 1.0,
    accel: float = 1.0,
    tool_speed: float | None = None,
    jerk: ArrayLike | None = None,
    hold: float | None = HOLD_FACTOR,
    split: bool = False,
    samples: int | None = None,
) -> PathPlan:
    """A plan through moves: time-optimal, on the branch that carries the whole way.

    Where the moves begin elsewhere than at `start`, the plan's `approach` is the joint move from there to its first
    posture, and no part of its motion. With one joint more than the task asks for, the redundant one is held
    (`PathPlan.held`), as near to where it stands as carries the whole path.

    Args:
        arm: the arm, as `armkin.load` gives it.
        moves: a path file's name, its model or its data (millimetres, degrees), or targets (w, m) or (w, 4, 4) [mm,
            rad] to pass on straight lines.
        start: (n,) [rad | mm] where the arm stands; by default home.
        near: (n,) [rad | mm] which branches are preferred; by default the start.
        branch: name of the branch to begin on, where the moves begin at a target.
        task: what targets prescribe; by default the file's, else the arm's own task.
        tolerance: [mm] between plan and path; by default the file's, else 0.05.
        corners: how those without their own blend are passed, "stop", "blend" or "tolerance" (dense points become one
            smooth curve).
        blend: [mm] radius of the sphere that rounds corners without their own; in place of `corners`.
        speed: [1] fraction of the joints' max_speed.
        accel: [1] fraction of the joints' max_accel.
        tool_speed: [mm/s] at most, along the tool's way; by default the file's.
        jerk: () or (n,) [rad/s3 | mm/s3] for all joints or each; by default the robot file's, where all joints have
            one.
        hold: [1] how many times max_accel a joint may be asked for when the board holds on the path, None: no matter.
        split: change the branch, by a joint move, where none carries on.
        samples: targets along each way that are solved at first; by default one a mm, 200 at least.

    Returns:
        The plan: `duration` [s], joint values `q(t)` [rad | mm] over time, and what was found about its branches.

    Raises:
        FileError: the path file cannot be read.
        PathFileError: it is not valid; the message has its line.
        UsageError: moves that make no sense, options out of range, or an arm without max_speed and max_accel.
        NoSolutionError: some part is not carried; its `plan` tells how far every branch goes.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof")
    >>> plan = armkin.path(arm, [[390, 80, 300], [390, -80, 300]], tool_speed=100.0)
    >>> armkin.fk(arm, plan.q(plan.duration))[:3, 3].round(6).tolist()
    [390.0, -80.0, 300.0]
    """
    request = PathRequest(
        start=start,
        near=near,
        branch=branch,
        task=task,
        tolerance=tolerance,
        corners=corners,
        blend=blend,
        speed=speed,
        accel=accel,
        tool_speed=tool_speed,
        jerk=jerk,
        hold=hold,
        split=split,
        samples=samples,
    )
    check_rates(arm)
    file = path_numbers.as_path_file(arm, moves, task)
    if (redundant_joint := redundancy(arm, task or file.task)) is not None and path_numbers.moves_tool(file):
        return path_redundant(arm, file, redundant_joint, request)
    return plan_path(arm, file, request)
