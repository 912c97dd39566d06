"""The interface of every kind of board, of which our own firmware is one.

board.py            a kind of board: one class, with capabilities
motion_start.py     checks on the start of every trajectory that becomes counts
sent_positions.py   trajectories for boards that take positions instead of segments
servo_arm.py        an arm of bus servos of any make
servo_travel.py     checks that a motion takes no servo farther than it can turn
stepper_arm.py      an arm of steppers on a board that obeys every program
position_record.py  the position that armkin last left on a board that other programs use, too
assumptions.py      assumed motors and rates for a simulation
missing_keys.py     keys that a robot file lacks for its board

A backend belongs to an arm and an open port. Its interface has joint values and counts of the arm's motors, and hides
how a trajectory becomes bytes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

from armkin.board.backend.sent_positions import plan_targets
from armkin.motors import joints

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

Position = Literal["known", "retained", "lost"]
Progress = Callable[[float, float], None]  # seconds done, seconds in all


class StoppedError(Exception):
    """Raised with the arm at rest when the operator asks to stop; `status` has its position, or None if not read."""

    def __init__(self, status: Any = None) -> None:
        super().__init__("stopped")
        self.status = status


class Planned(Protocol):
    """A trajectory in the form that one kind of board carries out."""

    @property
    def trajectory(self) -> Trajectory:
        """The trajectory, in joint values and seconds."""

    @property
    def start(self) -> NDArray[np.int64]:
        """Counts at the beginning: (motors,)."""

    @property
    def end(self) -> NDArray[np.int64]:
        """Counts at the end: (motors,)."""

    @property
    def duration(self) -> float:
        """Seconds."""

    @property
    def segments(self) -> int:
        """The number of pieces that are sent to the board."""

    @property
    def top_rate(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""


class Backend(ABC):
    """An arm on its board."""

    differences: tuple[str, ...] = ()  # sentences on what this kind of board cannot guarantee
    arm: Arm
    port: Port

    @abstractmethod
    def position(self) -> Position:
        """Whether the board knows the arm's position."""

    @property
    @abstractmethod
    def loss_reason(self) -> str:
        """Why the position is lost, in words; empty while it is known."""

    @abstractmethod
    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""

    def joints(self) -> Array:
        """Joint values of the arm, as last read: (n,) [rad | mm]."""
        return joints(self.arm, self.counts())

    @abstractmethod
    def refresh(self) -> None:
        """Read the arm's position again."""

    @abstractmethod
    def hold(self) -> None:
        """Stop along the path, and stay there."""

    @abstractmethod
    def prepare(self, *, assume: Array | None = None) -> bool:
        """Get ready to move; True if the position was lost.

        assume: (n,) [rad | mm] joint values of an arm whose position is lost, as the operator states them.
        """

    def plan(self, start: Sequence[int], targets: Array, *, speed: float = 1.0) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        return self.plan_trajectory(*plan_targets(self.arm, start, targets, speed))

    @abstractmethod
    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,), refused if the board is too slow for it."""

    @abstractmethod
    def run(self, plans: Iterable[Any], progress: Progress = lambda elapsed, total: None) -> object:
        """Carry out plans in order; a None among them means that the next plan is not there yet."""

    @abstractmethod
    def standing_text(self) -> str:
        """A sentence on where the arm has come to rest, and what the next command needs."""

    @abstractmethod
    def report(self) -> dict[str, Any]:
        """The fields of `armkin status` besides the position."""
