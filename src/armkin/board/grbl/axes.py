"""An arm's motors as GRBL's axes: degrees or mm of what each motor turns, as GRBL's millimetres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.grbl.replies import LETTERS
from armkin.board.grbl.settings import COARSE, Axis
from armkin.errors import UsageError
from armkin.motors import motor_accel, motor_names

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def axes_of(arm: Arm) -> list[Axis]:
    """One axis a motor, in the arm's order.

    Raises UsageError, naming the motor, for what GRBL cannot drive: servos, more than six motors, an axis that is
    none of its letters or is used twice, a step too fine for the three decimals of its reports.
    """
    where = arm.path or arm.name
    if not arm.motors:
        raise UsageError(f"{where}: no joint has a drive")
    speed = np.abs(arm.motor_gain) @ np.nan_to_num(arm.max_speed)  # [counts/s] all joints at once
    accel = motor_accel(arm)
    found: list[Axis] = []
    for k, (motor, name) in enumerate(zip(arm.motors, motor_names(arm), strict=True)):
        if motor.kind != "stepper":
            raise UsageError(f"{where}: motor {name} is a {motor.kind}; GRBL drives steppers alone")
        if motor.axis is None or motor.axis not in LETTERS or motor.axis in (axis.letter for axis in found):
            raise UsageError(
                f"{where}: motor {name} is on axis {motor.axis}; GRBL has {', '.join(LETTERS)}, one motor on each"
            )
        steps = motor.pulses_per_unit()
        if steps > COARSE:
            raise UsageError(
                f"{where}: motor {name} makes {steps:.4g} steps a unit; GRBL reports positions with three decimals, "
                f"which tell up to {COARSE:g} apart"
            )
        rates = _finite(speed[k] / steps), _finite(accel[k] / steps)
        found.append(Axis(motor.axis, name, steps, motor.invert, *rates, _upward(arm, k)))
    return found


def _upward(arm: Arm, motor: int) -> bool | None:
    """Whether a motor's counts are greatest at its joint's switch; None: no switch, or it turns several joints."""
    turned = np.flatnonzero(arm.motor_gain[motor])
    homing = arm.homing[turned[0]] if len(turned) == 1 else None
    return None if homing is None else (homing.direction > 0) == bool(arm.motor_gain[motor, turned[0]] > 0)


def _finite(value: float) -> float:
    return float(value) if math.isfinite(value) else 0.0
