"""The arguments of `armkin.path`, checked and handed to the walk over its moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.motion.branches import wrist_turn
from armkin.motion.branches.branch_path import Pace
from armkin.motion.joint_moves import check_jerk, check_share
from armkin.motion.path_planner.move_kinds import MOVES
from armkin.motion.path_planner.move_walk import PathOptions, Walk
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.plan.trajectory_proof import prove_plan
from armkin.motors import legal_with_same_pulses, undriven_joints

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile

TOLERANCE = 0.05  # greatest distance [mm] of the tool from its path
HOLD_FACTOR = 1.5  # greatest acceleration during a hold, in multiples of max_accel


@dataclass(frozen=True)
class PathRequest:
    """The keyword arguments of `armkin.path`, whose docstring explains each."""

    start: ArrayLike | None = None
    near: ArrayLike | None = None
    branch: str | None = None
    task: str | None = None
    tolerance: float | None = None
    corners: str | None = None
    blend: float | None = None
    speed: float = 1.0
    accel: float = 1.0
    tool_speed: float | None = None
    jerk: ArrayLike | None = None
    hold: float | None = HOLD_FACTOR
    split: bool = False
    samples: int | None = None

    def start_joints(self, arm: Arm) -> Array:
        """Joint values at the start: (n,) [rad | mm], by default home."""
        return arm.home if self.start is None else np.asarray(self.start, dtype=float)


def plan_path(arm: Arm, file: PathFile, request: PathRequest) -> PathPlan:
    """`armkin.path` for an arm without a redundant joint, whose rates are checked already."""
    from armkin.path_file import check_robot

    check_robot(file, arm.name, arm.path)
    pace = _pace(arm, file, request)
    if pace.turn:
        wrist_turn.check_wrist(arm)
    start = request.start_joints(arm)
    if arm.motors and not undriven_joints(arm):
        start = legal_with_same_pulses(arm, start)
    near = None if request.near is None else np.asarray(request.near, dtype=float)
    corner_blend = default_corner_blend(file, request.corners, request.blend)
    options = PathOptions(
        task=request.task,
        corner=corner_blend,
        near=near,
        branch=request.branch,
        split=request.split,
        samples=request.samples,
    )
    return prove_plan(Walk(arm, file, pace, start, options).plan_all(MOVES))


def _pace(arm: Arm, file: PathFile, request: PathRequest) -> Pace:
    """The speed limits and tolerance of a path. Raises UsageError for a value out of range."""
    from armkin.path_file.path_keys import MIN_TOLERANCE, MIN_TOOL_SPEED

    check_share("speed", request.speed)
    check_share("accel", request.accel)
    for name, minimum, unit in (("tool_speed", MIN_TOOL_SPEED, "mm/s"), ("tolerance", MIN_TOLERANCE, "mm")):
        value = getattr(request, name)
        if value is not None and not minimum <= value < np.inf:
            raise UsageError(f"{name} {value:g} is not possible; it is at least {minimum:g} {unit}")
    return Pace(
        speed=(file.speed or 100.0) / 100 * request.speed,
        accel=request.accel,
        tool_speed=request.tool_speed if request.tool_speed is not None else file.tool_speed,
        jerk=check_jerk(arm, request.jerk),
        hold=request.hold,
        tolerance=request.tolerance or file.tolerance or TOLERANCE,
        turn=np.deg2rad(file.turn_tolerance or 0.0),
    )


def default_corner_blend(file: PathFile, corners: str | None, blend: float | None) -> float | Literal["default"] | None:
    """The blend [mm] of corners without their own; None: the tolerance decides; "default": neither option is set."""
    if corners is not None and blend is not None:
        raise UsageError("corners and blend both say how corners are passed: give one of them")
    if blend is not None:
        return blend
    choice = corners or file.corners
    if choice == "blend" and file.blend is None:
        advice = "blend=5, or blend: 5 at the head of the file"
        raise UsageError("corners: blend needs a radius in mm", advice=advice, needs="blend")
    blends: dict[str | None, float | None] = {"stop": 0.0, "blend": file.blend, "tolerance": None}
    if choice is None:
        return "default" if file.blend is None else file.blend
    if choice not in blends:
        raise UsageError(f"corners '{choice}' is none of {', '.join(map(str, blends))}")
    return blends[choice]
