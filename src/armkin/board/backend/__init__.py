"""What every kind of board can do for an arm. Our own firmware is one of several.

board.py            what a kind is: one class, with capabilities
motion_start.py     where a motion begins: what every trajectory that becomes counts is held to
sent_positions.py   a trajectory for a board that is sent positions, not segments
servo_arm.py        an arm of bus servos of any make
stepper_arm.py      an arm of steppers on a board that obeys every program
position_record.py  what armkin last left on a board that other programs write to
assumptions.py      motors and rates made up for a simulation, where the file has none
missing_keys.py     what a robot file lacks for its board

A backend is made for an arm and an open port. It speaks joints and counts of the arm's motors; how a trajectory
becomes bytes is its own business.
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
    """The operator asked to stop: the arm stands, `status` says where (None: it was not asked yet)."""

    def __init__(self, status: Any = None) -> None:
        super().__init__("stopped")
        self.status = status


class Planned(Protocol):
    """A trajectory as one kind of board carries it out."""

    @property
    def trajectory(self) -> Trajectory:
        """Joints and seconds."""

    @property
    def start(self) -> NDArray[np.int64]:
        """Counts where it begins: (motors,)."""

    @property
    def end(self) -> NDArray[np.int64]:
        """Counts where it ends: (motors,)."""

    @property
    def duration(self) -> float:
        """Seconds."""

    @property
    def segments(self) -> int:
        """Pieces that are sent to the board."""

    @property
    def top_rate(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""


class Backend(ABC):
    """An arm on its board."""

    differences: tuple[str, ...] = ()  # what this kind of board cannot promise, for people
    arm: Arm
    port: Port

    @abstractmethod
    def position(self) -> Position:
        """Whether the board knows where the arm stands."""

    @property
    @abstractmethod
    def loss_reason(self) -> str:
        """Why the position is lost, in words; empty while it is known."""

    @abstractmethod
    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""

    def joints(self) -> Array:
        """Joint values where it stands, as last read: (n,) [rad | mm]."""
        return joints(self.arm, self.counts())

    @abstractmethod
    def refresh(self) -> None:
        """Read again where the arm stands."""

    @abstractmethod
    def hold(self) -> None:
        """Stop along the path, and stay."""

    @abstractmethod
    def prepare(self, *, assume: Array | None = None) -> bool:
        """Get ready to move; True if the position was lost.

        assume: (n,) [rad | mm] where an arm whose position is lost stands, on the operator's word.
        """

    def plan(self, start: Sequence[int], targets: Array, *, speed: float = 1.0) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        return self.lay(*plan_targets(self.arm, start, targets, speed))

    @abstractmethod
    def lay(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,), refused if the board is too slow for it."""

    @abstractmethod
    def run(self, plans: Iterable[Any], progress: Progress = lambda elapsed, total: None) -> object:
        """Carry out plans, one after another; None in between: nothing to do yet."""

    @abstractmethod
    def standing_text(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""

    @abstractmethod
    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
