"""Moves a gripper's servo on a bus, which may close on an object before its goal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from armkin.board.backend import StoppedError
from armkin.board.feetech import registers
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.feetech.bus import Bus
    from armkin.robot_file.robot_keys import Gripper

DEFAULT_SPEED = 500.0  # speed [counts/s] of a gripper without max_speed, 44 deg/s
ARRIVAL_COUNTS = 12  # distance [counts] from the goal, 1 degree, that counts as arrived
HOLD_S = 1.0  # time [s] without motion after which the jaw holds an object
ARRIVAL_S = 0.1  # time [s] without motion after which a jaw at its goal has arrived
READ_PERIOD = 0.02  # time [s] between readings


def move_gripper(bus: Bus, gripper: Gripper, value: float, stop: Callable[[], bool]) -> float:
    """Move the gripper and return where it comes to rest, both in its drive's degrees.

    Raises LinkError if its servo does not answer, and StoppedError, with the jaw held, if `stop` returns True.
    """
    port, number, counts_per_degree = bus.port, _servo_number(bus, gripper), _per_unit(gripper)
    goal = round(gripper.zero + counts_per_degree * value)
    position = bus.read(number, registers.POSITION)
    if not bus.read(number, registers.TORQUE):
        bus.write(number, registers.GOAL_POSITION, position)  # the jaw must not jump to an old goal
        bus.write(number, registers.TORQUE, 1)
    speed = abs(counts_per_degree) * gripper.max_speed if gripper.max_speed is not None else DEFAULT_SPEED
    bus.write(number, registers.GOAL_SPEED, round(min(speed, 32767)))
    bus.write(number, registers.GOAL_POSITION, goal)
    last_motion = port.now()
    while position != goal and port.now() - last_motion < (
        ARRIVAL_S if abs(position - goal) <= ARRIVAL_COUNTS else HOLD_S
    ):
        port.read(READ_PERIOD)
        if stop():
            bus.write(number, registers.GOAL_POSITION, bus.read(number, registers.POSITION))
            raise StoppedError
        last_position, position = position, bus.read(number, registers.POSITION)
        if position != last_position:
            last_motion = port.now()
    return (position - gripper.zero) / counts_per_degree


def gripper_zero(bus: Bus, gripper: Gripper, value: float) -> tuple[int, int]:
    """The gripper's count now, and its `zero` if it stands at a value of its drive's degrees."""
    count = bus.read(_servo_number(bus, gripper), registers.POSITION)
    return count, round(count - _per_unit(gripper) * value)


def _servo_number(bus: Bus, gripper: Gripper) -> int:
    if gripper.id is None or not bus.ping(gripper.id):
        raise LinkError(f"the gripper's servo {gripper.id} does not answer on {bus.port.name}")
    return gripper.id


def _per_unit(gripper: Gripper) -> float:
    """Counts a degree, signed."""
    return gripper.pulses_per_unit() * (-1 if gripper.invert else 1)
