"""What a robot file does not say of motors and rates, made up: for a board in this process alone.

A table from a paper or a URDF has no drives. A simulated arm moves all the same; a real one never does on such figures.
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
    """The arm with motors and rates where it has none, and in words what was made up; nothing: the same arm.

    >>> import armkin
    >>> arm_with_assumptions(armkin.load("puma560"))[1][1]
    'max_speed of q1, q2, q3, q4, q5, q6: 30 deg/s'
    """
    assumptions = []
    if bare := undriven_joints(arm):
        arm = _with_steppers(arm, bare)
        assumptions.append(f"motors of {', '.join(bare)}: steppers of 200 full steps, 16 microsteps, gear {_GEAR:g}")
        if any(arm.prismatic[arm.joint_names.index(name)] for name in bare):
            assumptions[-1] += f" (slides: {_LEAD:g} mm a turn)"
    arm, rates_said = with_rates(arm)
    return arm, assumptions + rates_said


def with_rates(arm: Arm) -> tuple[Arm, list[str]]:
    """The arm with a max_speed and a max_accel where it has none, and in words which: for plans that move nothing."""
    assumptions = []
    for key, names in missing_rates(arm).items():
        values = getattr(arm, key).copy()
        for name in names:
            j = arm.joint_names.index(name)
            values[j] = _RATES[key][1] if arm.prismatic[j] else _RATES[key][0] * DEGREE
        turning, sliding = (
            [n for n in names if arm.prismatic[arm.joint_names.index(n)] == slides] for slides in (False, True)
        )
        per = "s" if key == "max_speed" else "s2"
        for group, value, unit in ((turning, _RATES[key][0], "deg"), (sliding, _RATES[key][1], "mm")):
            if group:
                assumptions.append(f"{key} of {', '.join(group)}: {value:g} {unit}/{per}")
        arm = replace(arm, **{key: values})
    return arm, assumptions


def _with_steppers(arm: Arm, joints: list[str]) -> Arm:
    """The arm with a stepper for each of these joints."""
    motors, gain = list(arm.motors), [*arm.motor_gain]
    for name in joints:
        j = arm.joint_names.index(name)
        slides = bool(arm.prismatic[j])
        chain = {"lead": _LEAD} if slides else {"gear": _GEAR}
        motors.append(Motor.model_validate({"name": name, "joints": {name: 1.0}, **_STEPPER, **chain}))
        row = np.zeros(arm.n)
        row[j] = motors[-1].pulses_per_unit() / (1.0 if slides else DEGREE)
        gain.append(row)
    bias = np.concatenate([arm.motor_bias, np.zeros(len(joints))])
    return replace(arm, motors=tuple(motors), motor_gain=np.array(gain), motor_bias=bias)
