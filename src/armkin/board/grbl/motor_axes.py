"""Assigns an arm's motors to GRBL's axes; a degree or mm of a joint is a millimetre for GRBL."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.board.backend.stepper_arm import steppers
from armkin.board.grbl.replies import LETTERS
from armkin.board.grbl.settings import COARSE_STEPS, Axis
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def axes_of(arm: Arm) -> list[Axis]:
    """One axis a motor, in the arm's order.

    Raises UsageError, naming the motor, for what GRBL cannot drive: servos, more than six motors, an axis that is
    none of its letters or is used twice, a step too fine for the three decimals of its reports.
    """
    axes: list[Axis] = []
    for number, motor, name, steps, speed, accel in steppers(arm, "GRBL", LETTERS):
        if steps > COARSE_STEPS:
            raise UsageError(
                f"{arm.path or arm.name}: motor {name} makes {steps:.4g} steps a unit; GRBL reports positions with "
                f"three decimals, enough for {COARSE_STEPS:g} steps a unit at most"
            )
        axes.append(
            Axis(
                letter=motor.axis,
                name=name,
                steps=steps,
                invert=motor.invert,
                max_speed=speed,
                max_accel=accel,
                upward=_is_upward(arm, number),
            )
        )
    return axes


def _is_upward(arm: Arm, motor: int) -> bool | None:
    """Whether a motor's counts are greatest at its joint's switch; None: no switch, or it turns several joints."""
    joints = np.flatnonzero(arm.motor_gain[motor])
    homing = arm.homing[joints[0]] if len(joints) == 1 else None
    return None if homing is None else (homing.direction > 0) == bool(arm.motor_gain[motor, joints[0]] > 0)
