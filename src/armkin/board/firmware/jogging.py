"""One joint at a constant speed: for setting up, also while the position is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.errors import PositionLostError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.firmware.machine import Machine

SLOW = 8  # a lost position: at most an eighth of max_speed


def prepare(machine: Machine) -> None:
    """Have the motors configured and on; LinkError if the board knows the position of another arm."""
    if machine.session.port.simulated:
        machine.prepare()
        return
    if not machine.configured:
        if machine.info.known:
            raise PositionLostError(
                f"the board knows the position of another arm, or {machine.arm.path} has changed",
                robot_file=machine.arm.path,
                port=machine.port.name,
                homing=all(machine.arm.homing),
            )
        machine.configure()
    machine.enable(machine.configuration.axes)


def rates(machine: Machine, joint: int, speed: float) -> dict[int, int]:
    """Counts per second of a joint's motors, by axis; speed: [deg/s | mm/s], signed."""
    vector = [0.0] * machine.arm.n
    vector[joint] = speed
    exact = machine.arm.motor_gain @ units.joints_in(machine.arm, vector)
    # Towards zero: rounding must not exceed what the board allows.
    found = {axis: int(value) for axis, value in zip(machine.configuration.axes, exact, strict=True)}
    if not any(found.values()):
        raise UsageError(f"SPEED: {speed:g} is less than one count a second")
    return found
