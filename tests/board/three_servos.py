"""An arm of three bus servos, on a simulated bus."""

from __future__ import annotations

from collections.abc import Callable

import armkin
from armkin.board.feetech.feetech_machine import ServoMachine
from armkin.board.sim.sim_servo_bus import Noise, Servo, ServoBus
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file

TEXT = """
name: bus_arm
convention: standard
joints:
""" + "".join(
    f"  - {{name: j{k}, dh: {{alpha: {alpha}, a: {a}, d: {d}}}, limits: [-150, 150], max_speed: 90, max_accel: 300,\n"
    f"     drive: {{kind: bus, id: {k}, counts: 4096, zero: {2048 + 10 * k}, invert: {str(k == 2).lower()}}}}}\n"
    for k, alpha, a, d in ((1, 90, 0, 60), (2, 0, 110, 0), (3, 0, 100, 0))
)
ARM = arm_of_file(parse_robot_file(TEXT))
HOME = armkin.pulses(ARM, ARM.home).tolist()


def servo_bus(noise: Noise | None = None) -> ServoBus:
    return ServoBus((Servo(k + 1, position) for k, position in enumerate(HOME)), noise=noise)


def connect_servos(port: ServoBus, stop: Callable[[], bool] = lambda: False) -> ServoMachine:
    machine = ServoMachine(port, ARM, stop)
    machine.prepare()
    return machine
