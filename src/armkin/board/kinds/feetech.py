"""A bus of Feetech servos, which know where they stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.feetech import registers
from armkin.board.feetech.bus import Bus
from armkin.board.feetech.machine import ServoMachine, job, servo_ids
from armkin.board.kinds.foreign import Foreign
from armkin.errors import UsageError
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.ports import Port
    from armkin.motion.trajectory import Trajectory


class ServoBusBoard(Foreign):
    """The bus of an arm's servos."""

    gripper_taken = "it takes gripper: {kind: bus, id: 6, ...}"

    def check(self) -> None:
        """Raise UsageError if the arm's motors are no servos of one bus."""
        servo_ids(self.arm)

    def lay(self, trajectory: Trajectory, counts: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, counts)

    def simulated(self) -> Port:
        """A bus in this process, with the arm's servos at its home pose and its gripper's."""
        from armkin.board.sim.servo_bus import Servo, ServoBus

        home = pulses(self.arm, self.arm.home).tolist()
        servos = [Servo(number, at) for number, at in zip(servo_ids(self.arm), home, strict=True)]
        gripper = self.arm.gripper
        if gripper is not None and gripper.id is not None:
            servos.append(Servo(gripper.id))
        return ServoBus(servos)

    def machine(self, port: Port, stop: Callable[[], bool]) -> ServoMachine:
        """The arm on the bus behind an open port."""
        return ServoMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether every servo of the arm answers to its id. Raises LinkError if one does not."""
        bus = Bus(link)
        for number in servo_ids(self.arm):
            bus.read(number, registers.MODEL)  # asks until it is answered, LinkError if it is not
        return not stop()

    def home(self, machine: Backend) -> None:
        """Raise UsageError: servos need no homing."""
        raise UsageError("bus servos know their position: there is nothing to home")

    def grip(self, machine: Backend, value: str | float) -> float:
        """Move the gripper, and return where it comes to rest."""
        assert isinstance(machine, ServoMachine)
        return machine.grip(self.gripper(), self.grip_value(value))
