"""A bus of Feetech servos, which know where they stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.board import Board, Gripped
from armkin.board.backend.servo_arm import job, servo_ids
from armkin.board.feetech import registers, servo_gripper
from armkin.board.feetech.bus import Bus
from armkin.board.feetech.feetech_machine import ServoMachine
from armkin.board.feetech.lerobot import ServoCalibration, calibration_edits
from armkin.board_catalogue import ForeignBoard
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.backend import Planned
    from armkin.board.backend.servo_arm import ServoArm
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.motion.timing.trajectory import Trajectory

KIND = ForeignBoard("feetech", "bus", "bus", ())


class ServoBusBoard(Board):
    """The bus of an arm's servos."""

    baud = 1_000_000
    gripper_drive = KIND.gripper
    gripper_taken = "it takes gripper: {kind: bus, id: 6, ...}"
    lacks: ClassVar = {"home": "bus servos know their position: there is nothing to home"}
    machine: ServoArm

    def check(self) -> None:
        """Raise UsageError if the arm's motors are no servos of one bus."""
        servo_ids(self.arm)

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, start)

    def simulated(self) -> Port:
        """A bus in this process, with the arm's servos at its home pose and its gripper's."""
        from armkin.board.sim.sim_servo_bus import Servo, ServoBus

        home = pulses(self.arm, self.arm.home).tolist()
        servos = [Servo(number, count) for number, count in zip(servo_ids(self.arm), home, strict=True)]
        gripper = self.arm.gripper
        if gripper is not None and gripper.id is not None:
            servos.append(Servo(gripper.id))
        return ServoBus(servos)

    def attach(self, port: Port, stop: Callable[[], bool]) -> ServoArm:
        """The arm on the bus behind an open port."""
        return ServoMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether every servo of the arm answers to its id. Raises LinkError if one does not."""
        bus = Bus(link)
        for number in servo_ids(self.arm):
            bus.read(number, registers.MODEL)  # asks until it is answered, LinkError if it is not
        return not stop()

    def grip(self, value: str | float, assume: str | float | None = None) -> Gripped:
        """Move the gripper, and tell where it comes to rest."""
        target = self.grip_value(value)
        position = servo_gripper.move_gripper(self.machine.bus, self.gripper(), target, self.stop)
        return Gripped(position, target, "deg", measured=True)

    def relax(self) -> None:
        """Switch the servos off."""
        self.machine.relax()

    def zero(self, gripper: float | None) -> tuple[list[int], tuple[int, int] | None]:
        """The servos' counts; and the gripper's, and its `zero` if it stands at a value."""
        jaw = None if gripper is None else servo_gripper.gripper_zero(self.machine.bus, self.gripper(), gripper)
        return list(self.machine.counts()), jaw

    def calibration(self, path: str, pose: Array | None) -> ServoCalibration:
        """What a LeRobot calibration file says of the arm."""
        return calibration_edits(self.arm, path, pose)


BOARD = ServoBusBoard
