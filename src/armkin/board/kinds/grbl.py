"""GRBL 1.1, grblHAL, FluidNC: G-code through their own planner."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.grbl.axes import axes_of
from armkin.board.grbl.gcode import job
from armkin.board.grbl.machine import GrblMachine
from armkin.board.grbl.session import Session
from armkin.board.grbl.settings import wanted
from armkin.board.kinds.foreign import Foreign
from armkin.errors import UsageError
from armkin.model import units
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.ports import Port
    from armkin.motion.trajectory import Trajectory


class GrblBoard(Foreign):
    """A GRBL board that drives an arm's steppers."""

    gripper_taken = "it takes gripper: {kind: spindle, open: 0, closed: 200}, S words of M3"

    def check(self) -> None:
        """Raise UsageError if the arm's motors cannot be GRBL's axes."""
        axes_of(self.arm)

    def lay(self, trajectory: Trajectory, counts: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, counts)

    def simulated(self) -> Port:
        """GRBL in this process, set up for the arm, which stands at home."""
        from armkin.board.sim.grbl import Grbl

        axes = axes_of(self.arm)
        settings = {number: value for number, (_, value) in wanted(axes).items()}
        count = max(axis.index for axis in axes) + 1
        return Grbl(axes=count, settings=settings, ends=dict.fromkeys(range(count), 0))

    def machine(self, port: Port, stop: Callable[[], bool]) -> GrblMachine:
        """The arm on GRBL behind an open port."""
        return GrblMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether GRBL answers a question for its status. Raises LinkError if it does not."""
        Session(link).wake()
        return True

    def home(self, machine: Backend) -> None:
        """Home all axes by GRBL's cycle, $H.

        Raises UsageError, before anything moves, for joints without `homing` or whose switch is that of no single
        motor.
        """
        assert isinstance(machine, GrblMachine)
        arm = self.arm
        lacks = [name for name, homing in zip(arm.joint_names, arm.homing, strict=True) if homing is None]
        if lacks:
            raise UsageError(f"joints without homing: {', '.join(lacks)}; GRBL homes all axes or none")
        if np.count_nonzero(arm.motor_gain) != arm.n:
            raise UsageError("GRBL homes motors, not joints: this arm's motors turn several joints at once")
        at = units.joints_in(arm, [homing.at for homing in arm.homing if homing is not None])
        machine.home(pulses(arm, at).tolist())

    def grip(self, machine: Backend, value: str | float) -> float:
        """Move the gripper, and return what was sent: GRBL measures nothing."""
        assert isinstance(machine, GrblMachine)
        return machine.grip(self.gripper(), self.grip_value(value))
