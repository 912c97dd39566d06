"""Checks that a motion takes no servo farther than it can turn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.board.backend.sent_positions import equal_pieces
from armkin.errors import NoSolutionError
from armkin.model import units
from armkin.motion.timing.trajectory import Straight
from armkin.motors import motor_names, pulse_range, pulse_units, pulses

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

_PERIOD = 0.02  # [s] between two samples of a curve


def first_beyond(trajectory: Trajectory, start: NDArray[np.int64], allowed: NDArray[Any]) -> tuple[int, int] | None:
    """The first motor that leaves its range `allowed` (motors, 2), and the pulse there; None: none does.

    A motor that starts outside, at counts (motors,), may stay there and come back, and go no farther out.
    """
    low, high = np.minimum(allowed[:, 0], start), np.maximum(allowed[:, 1], start)
    for stretch in trajectory.stretches:
        is_straight = isinstance(stretch, Straight)
        times = np.array([stretch.duration]) if is_straight else equal_pieces(stretch.duration, _PERIOD)
        goals = pulses(trajectory.arm, stretch.evaluate(times))
        for row, motor in np.argwhere((goals < low) | (goals > high))[:1]:
            return int(motor), int(goals[row, motor])
    return None


def check_servo_travel(trajectory: Trajectory, start: NDArray[np.int64]) -> None:
    """Raise NoSolutionError, naming the servo, for a motion from counts (motors,) beyond its travel."""
    arm = trajectory.arm
    allowed = pulse_range(arm)
    if not np.isfinite(allowed).any() or (found := first_beyond(trajectory, start, allowed)) is None:
        return
    motor, pulse = found
    (lowest, highest), name = allowed[motor], motor_names(arm)[motor]
    raise NoSolutionError(
        f"the servo of {name} cannot turn that far: {pulse} {pulse_units(arm)[motor]} is outside its travel, "
        f"{lowest:g} to {highest:g}{_joint_range(arm, motor, allowed[motor])}: nothing was moved",
        motor=name,
        pulse=pulse,
        lowest=float(lowest),
        highest=float(highest),
    )


def _joint_range(arm: Arm, motor: int, ends: Array) -> str:
    """In words, from where to where a motor's travel takes its joint; nothing where it moves several."""
    joints = np.flatnonzero(arm.motor_gain[motor])
    if len(joints) != 1:
        return ""
    joint = int(joints[0])
    values = arm.home[joint] + (ends - arm.motor_bias[motor]) / arm.motor_gain[motor, joint]
    low, high = sorted((values / units.joint_scale(arm)[joint]).tolist())
    return f" ({arm.joint_names[joint]} from {low:.5g} to {high:.5g} {units.unit_names(arm)[joint]})"
