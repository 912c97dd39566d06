"""Trajectories for boards that take positions instead of segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.motion_start import StartedTrajectory
from armkin.motion.joint_moves import plan_joint_moves
from armkin.motion.timing.trajectory import Straight, brake_share
from armkin.motors import joints, pulses

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch, Trajectory


@dataclass(frozen=True)
class Job(StartedTrajectory):
    """A trajectory that starts at counts `start` (motors,); segments: number of lines or positions to send."""

    segments: int

    @property
    def end(self) -> NDArray[np.int64]:
        """Counts at the end: (motors,)."""
        stretches = self.trajectory.stretches
        return pulses(self.trajectory.arm, stretches[-1].end) if stretches else self.start

    @property
    def duration(self) -> float:
        """Seconds, as planned."""
        return self.trajectory.duration

    @property
    def top_rate(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""
        return np.asarray(np.abs(self.trajectory.arm.motor_gain) @ self.trajectory.top_speed)


def is_one_line(stretch: Stretch) -> TypeGuard[Straight]:
    """Whether a board that speeds up and slows down by itself makes a stretch of its end: a straight line without jerk.

    With jerk it is sent in pieces, as curves are: such a board would be ahead of its plan.
    """
    return isinstance(stretch, Straight) and not stretch.law.jerk.any()


def piece_times(stretch: Stretch, piece: float) -> Array:
    """Ends of the pieces [s], of `piece` seconds at most, in which a stretch is sent to such a board."""
    return np.array([stretch.duration]) if is_one_line(stretch) else equal_pieces(stretch.duration, piece)


def equal_pieces(duration: float, longest: float) -> Array:
    """Ends of the fewest equal pieces [s] of a duration, of which none is longer than `longest`; one at least."""
    return np.asarray(np.linspace(0.0, duration, max(int(np.ceil(duration / longest)), 1) + 1)[1:])


def plan_targets(arm: Arm, start: Sequence[int], targets: Array, speed: float) -> tuple[Trajectory, NDArray[np.int64]]:
    """Moves from counts through joint targets (w, n) [rad | mm], and the counts (motors,) where they start."""
    counts = np.asarray(start, dtype=np.int64)
    return plan_joint_moves(arm, joints(arm, counts), targets, speed=speed), counts


def braking_time(trajectory: Trajectory) -> float:
    """The time [s] to slow the motion down to a stop within the joints' max_accel, or BRAKE_SHARE of it on curves."""
    with np.errstate(invalid="ignore", divide="ignore"):
        seconds = trajectory.top_speed / trajectory.arm.max_accel
    return float(np.nanmax(seconds, initial=0.0)) / min(map(brake_share, trajectory.stretches), default=1.0)
