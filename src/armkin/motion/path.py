"""`armkin.path`: moves of the tool and the joints as one plan in time, on the right branch, within all limits."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.inverse.solvers.redundant import redundancy
from armkin.motion import path_numbers, wrist_turn
from armkin.motion.branch_path import Pace
from armkin.motion.free import checked
from armkin.motion.moves import MOVES
from armkin.motion.path_plan import PathPlan
from armkin.motion.plan import check_jerk, check_rates, check_share
from armkin.motion.walk import Walk, Wishes
from armkin.motors import settled, undriven

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile

TOLERANCE = 0.05  # [mm]
HOLD = 1.5  # of max_accel, on a hold


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
    hold: float | None = HOLD,
    split: bool = False,
    samples: int | None = None,
) -> PathPlan:
    """A plan through moves: time-optimal, on the branch that carries the whole way.

    moves: a path file's name, its model or its data (millimetres, degrees), or targets (w, m) or (w, 4, 4)
    [mm, rad] to pass on straight lines. corners: how those without their own blend are passed, "stop", "blend" or
    "tolerance" (dense points become one smooth curve). start: (n,) where the arm stands, by default home; near: (n,)
    which branches are preferred, by default the start. speed, accel: fractions of the joints' limits; tool_speed:
    [mm/s]; jerk: [rad/s3 | mm/s3] for all joints or each; hold: how many times max_accel a joint may be asked for
    when the board holds on the path, None: no matter. split: change the branch, by a joint move, where none
    carries on. Where the moves begin elsewhere than at `start`, the plan's `approach` is the joint move from there to
    its first posture, and no part of its motion. With one joint more than the task asks for, the redundant one is
    held (`PathPlan.held`), as near to where it stands as carries the whole path. Raises UsageError for moves that
    make no sense, NoSolutionError if some part is not carried: its `plan` then tells how far every branch goes.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof")
    >>> plan = armkin.path(arm, [[390, 80, 300], [390, -80, 300]], tool_speed=100.0)
    >>> armkin.fk(arm, plan.q(plan.duration))[:3, 3].round(6).tolist()
    [390.0, -80.0, 300.0]
    """
    from armkin.path_file import check_robot
    from armkin.path_file.model import LEAST_TOLERANCE, LEAST_TOOL_SPEED

    check_rates(arm)
    file = path_numbers.moves(arm, moves, task)
    check_robot(file, arm.name, arm.path)
    if (spare := redundancy(arm, task or file.task)) is not None and path_numbers.of_tool(file):
        from armkin.motion.redundant import path_redundant

        return path_redundant(
            arm, file, spare, start=start, near=near, branch=branch, task=task, tolerance=tolerance, corners=corners,
            blend=blend, speed=speed, accel=accel, tool_speed=tool_speed, jerk=jerk, hold=hold, split=split,
            samples=samples,
        )  # fmt: skip
    for name, value in (("speed", speed), ("accel", accel)):
        check_share(name, value)
    for name, least, given in (("tool_speed", LEAST_TOOL_SPEED, tool_speed), ("tolerance", LEAST_TOLERANCE, tolerance)):
        if given is not None and not least <= given < np.inf:
            raise UsageError(
                f"{name} {given:g} is not possible; it is at least {least:g} mm{'/s' * (name == 'tool_speed')}"
            )
    pace = Pace(
        (file.speed or 100.0) / 100 * speed,
        accel,
        tool_speed if tool_speed is not None else file.tool_speed,
        check_jerk(arm, jerk),
        hold,
        tolerance or file.tolerance or TOLERANCE,
        np.deg2rad(file.turn_tolerance or 0.0),
    )
    if pace.turn:
        wrist_turn.check(arm)
    here = arm.home if start is None else np.asarray(start, dtype=float)
    if arm.motors and not undriven(arm):
        here = settled(arm, here)
    near = None if near is None else np.asarray(near, dtype=float)
    wish = corners_wished(file, corners, blend)
    return checked(Walk(arm, file, pace, here, Wishes(task, wish, near, branch, split, samples)).walked(MOVES))


def corners_wished(file: PathFile, corners: str | None, blend: float | None) -> float | Literal["default"] | None:
    """The blend of corners without their own [mm], None: by the tolerance; "default": nothing is said of them."""
    if corners is not None and blend is not None:
        raise UsageError("corners and blend both say how corners are passed: give one of them")
    if blend is not None:
        return blend
    said = corners or file.corners
    if said == "blend" and file.blend is None:
        raise UsageError("corners: blend needs a radius: blend: 5 at the head of the path, in mm")
    known: dict[str | None, float | None] = {"stop": 0.0, "blend": file.blend, "tolerance": None}
    if said is None:
        return "default" if file.blend is None else file.blend
    if said not in known:
        raise UsageError(f"corners '{said}' is none of {', '.join(map(str, known))}")
    return known[said]
