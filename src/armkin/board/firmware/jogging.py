"""Jogs one joint at a constant speed, which is possible for setting up while the position is lost."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.backend.motion_start import check_jog
from armkin.board.firmware import resets_and_stops
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import State
from armkin.board.firmware.wire.session import DeviceError
from armkin.errors import NoSolutionError, PositionLostError, UsageError
from armkin.model import units
from armkin.motion.plan.trajectory_proof import free_way

if TYPE_CHECKING:
    from armkin.board.firmware.firmware_machine import FirmwareMachine

HANDLE_TIME = 0.25  # time [s] that a board moves after its last JOG frame, see firmware/PROTOCOL.md
_MAX_SECONDS = 60.0  # longest jog [s] that is tested for hits
SLOW_DIVISOR = 8  # divisor of max_speed while the position is lost


def prepare_jog(machine: FirmwareMachine) -> None:
    """Configure the board and switch the motors on. Raises LinkError if it knows the position of another arm."""
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


def count_rates(machine: FirmwareMachine, joint: int, speed: float) -> dict[int, int]:
    """Counts per second of a joint's motors, by axis; speed: [deg/s | mm/s], signed.

    Raises NoSolutionError if the joint would go farther outside its limits.
    """
    if machine.position() != "lost":
        check_jog(machine.arm, machine.joints(), joint, speed)
    vector = [0.0] * machine.arm.n
    vector[joint] = speed
    exact = machine.arm.motor_gain @ units.joints_in(machine.arm, vector)
    # Round towards zero, so that no rate exceeds what the board allows.
    rate_of_axis = {axis: int(value) for axis, value in zip(machine.configuration.axes, exact, strict=True)}
    if not any(rate_of_axis.values()):
        raise UsageError(f"SPEED: {speed:g} is less than one count a second")
    return rate_of_axis


def free_seconds(machine: FirmwareMachine, joint: int, rates: dict[int, int]) -> float:
    """The time [s] that a joint's motors may jog at rates (see `count_rates`) so that the arm stops before a hit.

    Rounded rates move the other joints of coupled motors a little, which is taken into account. inf if nothing is in
    the way, or the position is lost. Raises NoSolutionError if the arm could not stop before a hit.
    """
    arm = machine.arm
    if not arm.keep_out or machine.position() == "lost":
        return math.inf
    q = machine.joints()
    axis_rates = [rates[axis] for axis in machine.configuration.axes]
    joint_rates = np.linalg.pinv(arm.motor_gain) @ axis_rates  # [rad/s | mm/s]
    rate = float(joint_rates[joint])
    room = max(float((arm.lower, arm.upper)[rate > 0][joint] - q[joint]) / rate, 0.0)
    goal = q + min(room, _MAX_SECONDS) * joint_rates
    free_share, hit_error = free_way(arm, q, goal)
    if hit_error is None:
        return math.inf
    distance = free_share * abs(float(goal[joint] - q[joint])) - rate**2 / (2.0 * float(arm.max_accel[joint]))
    seconds = distance / abs(rate) - HANDLE_TIME
    if seconds <= 0.0:
        raise NoSolutionError(f"{hit_error.message} (at this speed it would not stand before it)", **hit_error.fields)
    return seconds


def jog_motors(
    machine: FirmwareMachine, rate: dict[int, int], seconds: float, goes_on: Callable[[], bool] = lambda: True
) -> None:
    """Move axes at constant rates [counts/s] for a time, then stop; shorter if limits come first.

    Sets the machine's status to that at rest. goes_on: called every 10 ms; the motion ends when it returns False.
    """
    vector = [rate.get(axis, 0) for axis in range(len(machine.configuration.board.axes))]
    port, session = machine.port, machine.session
    begin = port.now()
    try:
        while (time_left := seconds - (port.now() - begin)) > 0 and goes_on():
            session.call(lambda tag: protocol.jog(tag, vector))
            if session.state != State.JOGGING:
                break  # the joint stands at a limit
            pause = port.now() + min(0.08, time_left)
            while port.now() < pause and goes_on():
                session.pump(max(0.001, min(0.01, pause - port.now())))
        session.call(lambda tag: protocol.jog(tag, [0] * len(vector)))
        for _ in session.arrivals():
            pass
    except DeviceError as error:
        raise resets_and_stops.explain_error(machine, error) from None
    machine.status = session.status()
    machine.check_late_ticks()
