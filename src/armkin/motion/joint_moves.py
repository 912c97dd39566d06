"""Coordinated joint moves: trajectories of straight lines in joint space through given joint values.

Moves with joints outside their limits or without rates raise an error here, before the arm moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model.limits import check_limits
from armkin.motion.timing.profile import rest_profile, seven_phases, trapezoid
from armkin.motion.timing.trajectory import Straight, Trajectory
from armkin.motors import motor_accel, pulses, undriven_joints

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_SHARE = 1e-4  # least share of a joint's max_speed or max_accel


def plan_joint_moves(arm: Arm, start: ArrayLike, targets: ArrayLike, *, speed: float = 1.0) -> Trajectory:
    """Moves from joint values through joint targets, stopping at each, all joints together, within their rates.

    start: (n,); targets: (n,) or (w, n) [rad | mm]; speed: fraction of each joint's max_speed.
    Raises NoSolutionError for a target outside the limits, UsageError if max_speed or max_accel is missing.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> p = plan_joint_moves(arm, arm.home, np.deg2rad([-30, 5, -5]))
    >>> round(p.duration, 4), np.rad2deg(p.top_speed).round().tolist()
    (1.9167, [21.0, 60.0, 60.0])
    """
    check_rates(arm)
    check_share("speed", speed)
    goals = np.atleast_2d(np.asarray(targets, dtype=float))
    check_limits(arm, goals)
    begin = np.asarray(start, dtype=float)
    stretches = []
    for goal in goals:
        stretches.append(straight_move(arm, begin, goal, speed))
        begin = goal
    return Trajectory(arm, np.asarray(start, dtype=float), tuple(stretches))


def check_share(name: str, value: float) -> None:
    """Raise UsageError for a fraction of a limit below MIN_SHARE or above 1."""
    if not MIN_SHARE <= value <= 1:
        low = 100 * MIN_SHARE
        raise UsageError(f"{name} {100 * value:g} % is not possible; it goes from {low:g} to 100 percent")


def straight_move(
    arm: Arm, start: Array, end: Array, speed: float = 1.0, share: float = 1.0, jerk: Array | None = None
) -> Straight:
    """The fastest straight line in joint space from rest to rest: (n,), (n,) [rad | mm].

    speed, share: fractions of max_speed and max_accel; jerk: (n,) [rad/s3 | mm/s3], by default as `check_jerk` says.

    A motor that drives several joints keeps to `motor_accel`, since a board brakes motors and not joints on a hold, and
    the joints' max_accel must hold then, too. On a short move its rounded whole steps count as well.
    """
    change = np.abs(end - start)
    moves = change > 1e-12
    if not moves.any():
        return Straight(start, end, rest_profile(0.0))
    top_speed = float((arm.max_speed[moves] / change[moves]).min()) * speed
    accel = float((arm.max_accel[moves] / change[moves]).min())
    motor_travel = np.abs(arm.motor_gain @ (end - start))
    if arm.motors and not undriven_joints(arm):
        motor_travel = np.maximum(motor_travel, np.abs(np.diff(pulses(arm, [start, end]), axis=0)[0]))
    if motor_travel.any():
        accel = min(accel, float((motor_accel(arm)[motor_travel > 0] / motor_travel[motor_travel > 0]).min()))
    accel *= share
    limit = check_jerk(arm, jerk)
    if limit is None:
        return Straight(start, end, trapezoid(1.0, top_speed, accel))
    return Straight(start, end, seven_phases(1.0, top_speed, accel, float((limit[moves] / change[moves]).min())))


def approach_move(
    arm: Arm, present: Array, start: Array, speed: float = 1.0, share: float = 1.0, jerk: Array | None = None
) -> Trajectory | None:
    """The joint move from the arm's joint values (n,) to a plan's start; None if they are the same.

    They are the same if the motors have the same counts in both. speed, share, jerk: as in `straight_move`.
    """
    equal = np.abs(start - present).max() <= 1e-12
    if equal or (arm.motors and not undriven_joints(arm) and np.array_equal(pulses(arm, start), pulses(arm, present))):
        return None
    return Trajectory(arm, present, (straight_move(arm, present, start, speed, share, jerk),))


def check_jerk(arm: Arm, jerk: ArrayLike | None) -> Array | None:
    """The greatest jerk of every joint, (n,) [rad/s3 | mm/s3]: the one asked for, else the arm's if all have one.

    Raises UsageError for values that are no jerk.
    """
    limit = None if jerk is None else np.broadcast_to(np.asarray(jerk, dtype=float), (arm.n,))
    if limit is None and np.isfinite(arm.max_jerk).all():
        limit = arm.max_jerk
    if limit is not None and not (np.isfinite(limit).all() and (limit > 0).all()):
        raise UsageError("jerk must be above 0 and finite")
    return limit


def missing_rates(arm: Arm) -> dict[str, list[str]]:
    """Keys that motion needs and the robot file lacks: {"max_speed": [joint, ...], ...}."""
    joints_of_key = {
        key: [name for name, value in zip(arm.joint_names, values, strict=True) if np.isnan(value)]
        for key, values in (("max_speed", arm.max_speed), ("max_accel", arm.max_accel))
    }
    return {key: names for key, names in joints_of_key.items() if names}


_EXAMPLES = {("deg", "max_speed"): 30, ("deg", "max_accel"): 60, ("mm", "max_speed"): 20, ("mm", "max_accel"): 50}


def rate_lines(arm: Arm) -> list[str]:
    """Lines that add the `missing_rates` to a robot file."""
    unit = {name: "mm" if slides else "deg" for name, slides in zip(arm.joint_names, arm.prismatic, strict=True)}
    lines = []
    for key, names in missing_rates(arm).items():
        for size in ("deg", "mm"):
            joints = [name for name in names if unit[name] == size]
            if joints:
                time = "s" if key == "max_speed" else "s2"
                example = _EXAMPLES[size, key]
                note = f"to joint{'s' * (len(joints) > 1)} {', '.join(joints)}"
                lines.append(f"{key}: {example}   # {size}/{time}, for example; {note}")
    return lines


def check_rates(arm: Arm) -> None:
    """Raise UsageError, naming every joint, if a max_speed or max_accel is missing."""
    joints_of_key = missing_rates(arm)
    if joints_of_key:
        complaints = [f"joint{'s' * (len(names) > 1)} {', '.join(names)} ha{'ve' if len(names) > 1 else 's'} no {key}"
                   for key, names in joints_of_key.items()]  # fmt: skip
        lines = rate_lines(arm)
        raise UsageError(
            f"{', '.join(complaints)}: motion needs {'them' if len(lines) > 1 else 'one'}{_advice_to_add(arm, lines)}",
            robot_file=arm.path,
            lines_to_add=lines,
        )


def _advice_to_add(arm: Arm, lines: list[str]) -> str:
    """The advice, for the error text, to add lines to the robot file."""
    return "".join([f"; add to {arm.path or arm.name}:", *(f"\n  {line}" for line in lines)])
