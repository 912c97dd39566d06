"""Coordinated moves: joint values in, a trajectory of straight lines in joint space out.

What a move may not do is refused here, before anything moves: joints outside their limits, missing rates.
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
    """Moves from joint values through joint targets, stopping at each, all joints together.

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
    """Raise UsageError for a fraction of a limit that is no plan's: below MIN_SHARE, or above 1."""
    if not MIN_SHARE <= value <= 1:
        low = 100 * MIN_SHARE
        raise UsageError(f"{name} {100 * value:g} % is not possible; it goes from {low:g} to 100 percent")


def straight_move(
    arm: Arm, start: Array, end: Array, speed: float = 1.0, share: float = 1.0, jerk: Array | None = None
) -> Straight:
    """The fastest straight line in joint space from rest to rest: (n,), (n,) [rad | mm].

    speed, share: fractions of max_speed and max_accel; jerk: (n,) [rad/s3 | mm/s3].

    A motor that turns several joints keeps to `motor_accel`, so that a hold, of which a board knows motors
    only, is within the joints' max_accel; with its whole steps, too, which on a way of few are more than the joints'.
    """
    change = np.abs(end - start)
    moving = change > 1e-12
    if not moving.any():
        return Straight(start, end, rest_profile(0.0))
    top = float((arm.max_speed[moving] / change[moving]).min()) * speed
    accel = float((arm.max_accel[moving] / change[moving]).min())
    turned = np.abs(arm.motor_gain @ (end - start))
    if arm.motors and not undriven_joints(arm):
        turned = np.maximum(turned, np.abs(np.diff(pulses(arm, [start, end]), axis=0)[0]))
    if turned.any():
        accel = min(accel, float((motor_accel(arm)[turned > 0] / turned[turned > 0]).min()))
    accel *= share
    if jerk is None:
        return Straight(start, end, trapezoid(1.0, top, accel))
    return Straight(start, end, seven_phases(1.0, top, accel, float((jerk[moving] / change[moving]).min())))


def approach_move(
    arm: Arm, standing: Array, start: Array, speed: float = 1.0, share: float = 1.0, jerk: Array | None = None
) -> Trajectory | None:
    """The joint move from where an arm stands, (n,), to where a plan starts; None if it stands there.

    An arm whose motors have the same counts in both stands there. speed, share, jerk: as in `straight_move`.
    """
    near = np.abs(start - standing).max() <= 1e-12
    if near or (arm.motors and not undriven_joints(arm) and np.array_equal(pulses(arm, start), pulses(arm, standing))):
        return None
    return Trajectory(arm, standing, (straight_move(arm, standing, start, speed, share, jerk),))


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
    missing = {
        key: [name for name, value in zip(arm.joint_names, values, strict=True) if np.isnan(value)]
        for key, values in (("max_speed", arm.max_speed), ("max_accel", arm.max_accel))
    }
    return {key: names for key, names in missing.items() if names}


_EXAMPLES = {("deg", "max_speed"): 30, ("deg", "max_accel"): 60, ("mm", "max_speed"): 20, ("mm", "max_accel"): 50}


def rate_lines(arm: Arm) -> list[str]:
    """What `missing_rates` finds, as lines of a robot file to add."""
    unit = {name: "mm" if slides else "deg" for name, slides in zip(arm.joint_names, arm.prismatic, strict=True)}
    lines = []
    for key, names in missing_rates(arm).items():
        for size in ("deg", "mm"):
            lacking = [name for name in names if unit[name] == size]
            if lacking:
                per = "s" if key == "max_speed" else "s2"
                example = _EXAMPLES[size, key]
                to = f"to joint{'s' * (len(lacking) > 1)} {', '.join(lacking)}"
                lines.append(f"{key}: {example}   # {size}/{per}, for example; {to}")
    return lines


def check_rates(arm: Arm) -> None:
    """Raise UsageError, naming every joint, if a max_speed or max_accel is missing."""
    absent = missing_rates(arm)
    if absent:
        said_of = [f"joint{'s' * (len(n) > 1)} {', '.join(n)} ha{'ve' if len(n) > 1 else 's'} no {key}"
                   for key, n in absent.items()]  # fmt: skip
        lines = rate_lines(arm)
        raise UsageError(
            f"{', '.join(said_of)}: motion needs {'them' if len(lines) > 1 else 'one'}{_advice_to_add(arm, lines)}",
            robot_file=arm.path,
            lines_to_add=lines,
        )


def _advice_to_add(arm: Arm, lines: list[str]) -> str:
    """The lines to add, said of the robot file."""
    return "".join([f"; add to {arm.path or arm.name}:", *(f"\n  {line}" for line in lines)])
