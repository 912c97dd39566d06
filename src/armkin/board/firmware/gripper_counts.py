"""The gripper as an axis of the board: counts of its drive's degrees or mm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armkin.robot_file import Gripper


@dataclass(frozen=True)
class Grip:
    """The gripper as an axis."""

    axis: int
    drive: Gripper  # of the robot file
    open: int  # counts
    closed: int
    top: float | None  # counts/s, None if the file has no max_speed
    accel: float | None  # counts/s^2
    per_unit: float  # counts per degree | mm
    at_zero: float  # counts where the drive's value is 0

    def count(self, value: float) -> int:
        """Counts of a value in the drive's degrees (or mm)."""
        exact = self.at_zero + value * self.per_unit
        return int(math.copysign(math.floor(abs(exact) + 0.5 + 1e-9), exact))

    def value(self, count: int) -> float:
        """The drive's degrees (or mm) at a count."""
        return (count - self.at_zero) / self.per_unit


def as_axis(axis: int, gripper: Gripper) -> Grip:
    """The gripper on an axis."""
    per_unit, zero = gripper.pulses_per_unit(), 0.0
    if gripper.kind == "servo" and gripper.travel is not None and gripper.pulse_us is not None:
        zero = gripper.pulse_us[0] + (gripper.zero - gripper.travel[0]) * per_unit
        per_unit = -per_unit if gripper.invert else per_unit
    else:
        zero = -gripper.open * per_unit  # steps are counted from the open gripper
    top, accel = gripper.max_speed, gripper.max_accel
    base = Grip(
        axis=axis,
        drive=gripper,
        open=0,
        closed=0,
        top=None if top is None else top * abs(per_unit),
        accel=None if accel is None else accel * abs(per_unit),
        per_unit=per_unit,
        at_zero=zero,
    )
    return replace(base, open=base.count(gripper.open), closed=base.count(gripper.closed))
