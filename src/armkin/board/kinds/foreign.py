"""What every board with somebody else's firmware does: plan, find its port, jog, home, grip."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.job import planned
from armkin.board.backend.starting import check_jog
from armkin.board_kinds import ForeignBoard
from armkin.errors import LinkError, UsageError
from armkin.motion.plan import straight
from armkin.motion.trajectory import Trajectory
from armkin.motors import settled

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.robot_file.model import Gripper


@dataclass(frozen=True)
class Foreign(ABC):
    """An arm's board, of a kind that does not run armkin's firmware."""

    arm: Arm
    board: ForeignBoard
    gripper_taken: ClassVar[str] = "it moves none"  # which gripper this kind moves, for an error

    # What each kind does in its own way

    @abstractmethod
    def check(self) -> None:
        """Raise UsageError if the arm's drives are not for this kind of board."""

    @abstractmethod
    def lay(self, trajectory: Trajectory, counts: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""

    @abstractmethod
    def simulated(self) -> Port:
        """A board of this kind in this process, set up for the arm, which stands at home."""

    @abstractmethod
    def machine(self, port: Port, stop: Callable[[], bool]) -> Backend:
        """The arm on the board behind an open port."""

    @abstractmethod
    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether such a board replies behind an open port. Raises LinkError, too, if none does."""

    @abstractmethod
    def home(self, machine: Backend) -> None:
        """Find the limit switches by the board's own cycle.

        Raises UsageError, before anything moves, for what does not home, or not this arm.
        """

    def grip(self, machine: Backend, value: str | float) -> float:
        """Move the gripper, and return where it comes to rest; of GRBL, which measures nothing, what was sent."""
        raise self._no_gripper()

    def likely(self) -> list[str]:
        """Names of the ports where such a board may be."""
        from armkin.board.firmware.find_boards import others

        return list(others())

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The port of that name; `sim`: a board of this kind in this process."""
        from armkin.board.ports import SIM, SerialPort

        return self.simulated() if name == SIM else SerialPort(name, baud or self.board.baud, reset=reset)

    # What is the same for all

    def plan(self, start: Sequence[int], targets: Array, speed: float) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        return self.lay(*planned(self.arm, start, targets, speed))

    def go_home(self, machine: Backend) -> None:
        """Move to the home pose from where the arm stands."""
        machine.prepare()
        machine.run([self.plan(machine.counts(), self.arm.home[None], 1.0)])

    def jog(self, machine: Backend, joint: int, rate: float, seconds: float) -> None:
        """Move one joint [rad/s | mm/s] for a time, from where it stands to its limit at most."""
        machine.prepare()
        arm, q = self.arm, settled(self.arm, machine.joints())
        check_jog(arm, q, joint, rate)
        goal = q.copy()
        goal[joint] = np.clip(q[joint] + rate * seconds, *sorted((q[joint], (arm.lower, arm.upper)[rate > 0][joint])))
        share = float(abs(rate) / arm.max_speed[joint])
        way = Trajectory(arm, machine.joints(), (straight(arm, machine.joints(), goal, min(share, 1.0)),))
        machine.run([self.lay(way, np.array(machine.counts()))])

    def gripper(self) -> Gripper:
        """The arm's gripper. Raises UsageError if it has none that this kind of board moves."""
        gripper = self.arm.gripper
        if gripper is None or gripper.kind != self.board.gripper:
            raise self._no_gripper()
        return gripper

    def grip_value(self, value: str | float) -> float:
        """Where the gripper is to go: open, closed, or a value between them. Raises UsageError for others."""
        gripper = self.gripper()
        low, high = sorted((gripper.open, gripper.closed))
        wanted = {"open": gripper.open, "closed": gripper.closed}[value] if isinstance(value, str) else value
        if not low <= wanted <= high:
            raise UsageError(f"grip: {wanted:g} is outside of the gripper's {low:g} to {high:g}")
        return wanted

    def _no_gripper(self) -> UsageError:
        return UsageError(
            f"{self.arm.name} has no gripper that a board of kind {self.board.kind} moves; {self.gripper_taken}"
        )

    def answers(
        self, name: str, baud: int | None = None, stop: Callable[[], bool] = lambda: False, *, reset: bool = True
    ) -> bool:
        """Whether such a board answers at a port."""
        try:
            link = self.open(name, baud, reset=reset)
        except LinkError:
            return False
        try:
            return self.replies(link, stop)
        except LinkError:
            return False
        finally:
            link.close()
