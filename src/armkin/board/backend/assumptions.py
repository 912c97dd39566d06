"""Assumes motors and rates where a robot file has none, for simulated boards only.

A robot file made from a paper or a URDF has no drives. With assumed ones it can be simulated; a real arm never moves on
assumed figures.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from armkin.model.units import DEGREE
from armkin.motion.joint_moves import missing_rates
from armkin.motors import undriven_joints
from armkin.robot_file import Motor

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_STEPPER = {"full_steps": 200, "microsteps": 16}
_GEAR = 20.0  # gear ratio of a turning joint: 0.006 degrees a step
_LEAD = 8.0  # lead [mm a turn] of a sliding joint
_RATES = {"max_speed": (30.0, 50.0), "max_accel": (60.0, 100.0)}  # rates of a turning and of a sliding joint [deg, mm]


def arm_with_assumptions(arm: Arm) -> tuple[Arm, list[str]]:
    """The arm with assumed motors and rates where it lacks them, and the list of assumptions in words.

    >>> import armkin
    >>> arm_with_assumptions(armkin.load("puma560"))[1][1]
    'max_speed of q1, q2, q3, q4, q5, q6: 30 deg/s'
    """
    assumptions = []
    if names := undriven_joints(arm):
        arm = _with_steppers(arm, names)
        assumptions.append(f"motors of {', '.join(names)}: steppers of 200 full steps, 16 microsteps, gear {_GEAR:g}")
        if any(arm.prismatic[arm.joint_names.index(name)] for name in names):
            assumptions[-1] += f" (slides: {_LEAD:g} mm a turn)"
    arm, rate_assumptions = with_rates(arm)
    return arm, assumptions + rate_assumptions


def with_rates(arm: Arm) -> tuple[Arm, list[str]]:
    """The arm with assumed max_speed and max_accel where it lacks them, and these in words, for mere plans."""
    assumptions = []
    for key, names in missing_rates(arm).items():
        values = getattr(arm, key).copy()
        for name in names:
            joint = arm.joint_names.index(name)
            values[joint] = _RATES[key][1] if arm.prismatic[joint] else _RATES[key][0] * DEGREE
        rotary, prismatic = (
            [n for n in names if arm.prismatic[arm.joint_names.index(n)] == slides] for slides in (False, True)
        )
        time = "s" if key == "max_speed" else "s2"
        for group, value, unit in ((rotary, _RATES[key][0], "deg"), (prismatic, _RATES[key][1], "mm")):
            if group:
                assumptions.append(f"{key} of {', '.join(group)}: {value:g} {unit}/{time}")
        arm = replace(arm, **{key: values})
    return arm, assumptions


def _with_steppers(arm: Arm, joints: list[str]) -> Arm:
    """The arm with a stepper for each of these joints."""
    motors, gain = list(arm.motors), [*arm.motor_gain]
    for name in joints:
        joint = arm.joint_names.index(name)
        slides = bool(arm.prismatic[joint])
        chain = {"lead": _LEAD} if slides else {"gear": _GEAR}
        motors.append(Motor.model_validate({"name": name, "joints": {name: 1.0}, **_STEPPER, **chain}))
        row = np.zeros(arm.n)
        row[joint] = motors[-1].pulses_per_unit() / (1.0 if slides else DEGREE)
        gain.append(row)
    bias = np.concatenate([arm.motor_bias, np.zeros(len(joints))])
    return replace(arm, motors=tuple(motors), motor_gain=np.array(gain), motor_bias=bias)
