"""GRBL 1.1, grblHAL, FluidNC: G-code through their own planner."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.board import Board, Gripped
from armkin.board.grbl.grbl_machine import GrblMachine
from armkin.board.grbl.grbl_session import Session
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.grbl.trajectory_to_gcode import job
from armkin.board_catalogue import ForeignBoard
from armkin.errors import UsageError
from armkin.model import units
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.backend import Planned
    from armkin.board.ports import Port
    from armkin.motion.timing.trajectory import Trajectory

KIND = ForeignBoard("grbl", "stepper", "spindle", ("X", "Y", "Z", "A", "B", "C"))


class GrblBoard(Board):
    """A GRBL board that drives an arm's steppers."""

    baud = 115_200
    gripper_drive = KIND.gripper
    gripper_taken = "it takes gripper: {kind: spindle, open: 0, closed: 200}, S words of M3"
    machine: GrblMachine

    def check(self) -> None:
        """Raise UsageError if the arm's motors cannot be GRBL's axes."""
        axes_of(self.arm)

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, start)

    def simulated(self) -> Port:
        """GRBL in this process, set up for the arm, which stands at home."""
        from armkin.board.sim.sim_grbl import Grbl

        axes = axes_of(self.arm)
        settings = {number: value for number, (_, value) in expected_settings(axes).items()}
        count = max(axis.index for axis in axes) + 1
        return Grbl(axes=count, settings=settings, ends=dict.fromkeys(range(count), 0))

    def attach(self, port: Port, stop: Callable[[], bool]) -> GrblMachine:
        """The arm on GRBL behind an open port."""
        return GrblMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether GRBL answers a question for its status. Raises LinkError if it does not."""
        Session(link).wake()
        return True

    def check_home(self, joints: Sequence[str] = (), *, rest_at_home: bool = False) -> None:
        """Raise UsageError for joints without `homing`, or whose switch is that of no single motor."""
        super().check_home(joints, rest_at_home=rest_at_home)
        arm = self.arm
        lacks = [name for name, homing in zip(arm.joint_names, arm.homing, strict=True) if homing is None]
        if lacks:
            raise UsageError(f"joints without homing: {', '.join(lacks)}; GRBL homes all axes or none")
        if np.count_nonzero(arm.motor_gain) != arm.n:
            raise UsageError("GRBL homes motors, not joints: this arm's motors turn several joints at once")

    def home(
        self,
        joints: Sequence[str] = (),
        announce: Callable[[str], None] = lambda name: None,
        *,
        rest_at_home: bool = False,
    ) -> None:
        """Home all axes by GRBL's cycle, $H."""
        self.check_home(joints, rest_at_home=rest_at_home)
        switch_values = units.joints_in(self.arm, [homing.at for homing in self.arm.homing if homing is not None])
        self.machine.home(pulses(self.arm, switch_values).tolist())

    def grip(self, value: str | float, assume: str | float | None = None) -> Gripped:
        """Move the gripper, and tell what was sent: GRBL measures nothing."""
        target = self.grip_value(value)
        return Gripped(self.machine.grip(self.gripper(), target), target, "S")

    def settings(self) -> list[dict[str, Any]]:
        """Settings that are not as the robot file wants them."""
        return [
            {
                "setting": difference.number,
                "what": difference.meaning,
                "found": difference.actual,
                "wanted": difference.expected,
                "serious": difference.serious,
            }
            for difference in self.machine.setting_differences()
        ]

    def write_settings(self) -> None:
        """Write the settings that differ, and read them back; the position is lost with it."""
        self.machine.setup()


BOARD = GrblBoard
