"""Converts a trajectory to moves of exact segments for a board with our firmware, unless it is too fast for it.

Trajectory (joints, seconds)  --cut-->  Cut (counts, clock cycles)  --FirmwareMachine.run-->  frames
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from armkin.board.backend.motion_start import StartedTrajectory
from armkin.board.backend.servo_travel import check_servo_travel
from armkin.board.firmware.segments.counts_to_segments import CLOCK_RATE, MIN_INTERVAL, Counts, Move
from armkin.board.firmware.segments.curve_segments import CurveSegments, sampled_rates
from armkin.board.firmware.segments.straight_lines import Pieces, line_segments, segment_count
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model import units
from armkin.model.limits import check_limits
from armkin.motion.joint_moves import check_rates
from armkin.motion.joint_moves import plan_joint_moves as plan_joints
from armkin.motion.timing.trajectory import Straight, brake_share
from armkin.motors import joints as joints_of
from armkin.motors import motor_names, pulses

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch, Trajectory


TOLERANCE = 0.05  # largest distance [mm] between a segment's chord and its curve


MAX_COUNTS = 2**30  # largest position [counts]: half the range of a board's registers


class RateError(UsageError):
    """A motor needs a higher rate than the board makes; the field `share` has the possible fraction."""


@dataclass(frozen=True)
class Cut(StartedTrajectory):
    """A trajectory in counts and clock cycles of a board with our firmware."""

    ends: Counts  # (stretches, motors) counts at the end of each stretch
    top_rate: Array  # (motors,) [counts/s] greatest rate of every motor
    clock: int
    min_interval: int

    @property
    def end(self) -> Counts:
        """Counts at the end: (motors,)."""
        return np.asarray(self.ends[-1]) if len(self.ends) else self.start

    @property
    def duration(self) -> float:
        """Seconds from the first tick to the last."""
        return self.trajectory.duration

    @cached_property
    def segments(self) -> int:
        """Number of device segments."""
        number, begin = 0, self.start
        for stretch, end in zip(self.trajectory.stretches, self.ends, strict=True):
            if self._is_line(stretch, begin, end):
                number += segment_count(stretch.law, int(np.abs(end - begin).max()))
            else:
                number += len(self._move_of(stretch, begin, end, Pieces.FINE).segments)
            begin = end
        return number

    def moves(self, pieces: Callable[[], Pieces] = lambda: Pieces.FINE) -> Iterator[Move]:
        """The moves in order, one for each stretch; pieces: gives the division of ramps, called for each line."""
        begin = self.start
        for stretch, end in zip(self.trajectory.stretches, self.ends, strict=True):
            yield self._move_of(stretch, begin, end, pieces())
            begin = end

    @staticmethod
    def _is_line(stretch: Stretch, start: Counts, end: Counts) -> TypeGuard[Straight]:
        return isinstance(stretch, Straight) and stretch.law.is_trapezoid and bool((start != end).any())

    def _move_of(self, stretch: Stretch, start: Counts, end: Counts, pieces: Pieces) -> Move:
        """The segments of one stretch, straight or curved, between counts."""
        if self._is_line(stretch, start, end):
            a, b, interval = start.tolist(), end.tolist(), self.min_interval
            return line_segments(a, b, stretch.law, clock=self.clock, min_interval=interval, pieces=pieces)
        arm = self.trajectory.arm
        parts = CurveSegments(
            arm=arm,
            stretch=stretch,
            start=start,
            end=end,
            clock=self.clock,
            min_interval=self.min_interval,
            tolerance=TOLERANCE,
        )
        cycles = round(stretch.duration * self.clock)
        return Move(start, end, parts if stretch.duration else (), cycles, curve=True, brake=brake_share(stretch))


def cut_trajectory(
    trajectory: Trajectory, start: ArrayLike, *, clock: int = CLOCK_RATE, min_interval: int = MIN_INTERVAL
) -> Cut:
    """A trajectory that starts at counts `start` (motors,), for a board of this clock and shortest interval.

    Raises RateError, naming joint and motor, if the board cannot make steps that fast, and NoSolutionError, naming the
    servo, for a motion beyond its travel.
    """
    arm, first = trajectory.arm, np.asarray(start, dtype=np.int64)
    ends = [pulses(arm, stretch.end) for stretch in trajectory.stretches]
    for end in ends:
        if (k := int(np.abs(end).argmax())) >= 0 and abs(end[k]) > MAX_COUNTS:
            raise UsageError(
                f"motor {motor_names(arm)[k]} would stand at {end[k]:,} counts; a board counts to {MAX_COUNTS:,}"
            )
    check_servo_travel(trajectory, first)
    top = np.zeros(len(first))
    begin, allowed = first, clock / min_interval
    for stretch, end in zip(trajectory.stretches, ends, strict=True):
        rates = _greatest_rates(arm, stretch, begin, end)
        if rates.max(initial=0.0) > allowed:
            raise _too_fast(arm, stretch, rates, allowed)
        top, begin = np.maximum(top, rates), end
    return Cut(trajectory, first, np.array(ends, dtype=np.int64).reshape(-1, len(first)), top, clock, min_interval)


def plan_moves(
    arm: Arm,
    start: ArrayLike,
    targets: ArrayLike,
    *,
    speed: float = 1.0,
    clock: int = CLOCK_RATE,
    min_interval: int = MIN_INTERVAL,
) -> Cut:
    """Moves from counts through joint targets, stopping at each, where the motors' steps put them.

    start: (motors,) counts; targets: (n,) or (w, n) [rad | mm]; speed: fraction of each joint's max_speed.
    Raises as `armkin.motion.joint_moves.plan_joint_moves` and `cut_trajectory` do.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> p = plan_moves(arm, [0, 0, 0], np.deg2rad([-30, 5, -5]))
    >>> p.end.tolist(), round(p.duration, 2)
    ([-1067, -10144, 5667], 1.92)
    """
    check_rates(arm)
    goals = np.atleast_2d(np.asarray(targets, dtype=float))
    check_limits(arm, goals)
    # Rounding to whole steps may take a goal half a step outside the limits, which the board accepts.
    rounded_goals = np.clip(joints_of(arm, pulses(arm, goals)), arm.lower, arm.upper)
    trajectory = plan_joints(arm, joints_of(arm, np.asarray(start)), rounded_goals, speed=speed)
    try:
        return cut_trajectory(trajectory, start, clock=clock, min_interval=min_interval)
    except RateError as error:
        percent = math.floor(100 * speed * error.fields["share"])
        raise RateError(f"{error}\nlower its max_speed, or the speed to {percent} percent", **error.fields) from None


def _greatest_rates(arm: Arm, stretch: Stretch, start: Counts, end: Counts) -> Array:
    """Greatest rate of every motor: (motors,) [counts/s]."""
    if not isinstance(stretch, Straight):
        return sampled_rates(arm, stretch)
    return np.asarray(np.abs(end - start) * stretch.law.peak)


def _too_fast(arm: Arm, stretch: Stretch, rates: Array, allowed: float) -> RateError:
    """The error of rates (motors,) [counts/s] above what is allowed: which joint and motor ask for it."""
    k = int(rates.argmax())
    speeds = stretch.top_speed
    joint = int(np.argmax(np.abs(arm.motor_gain[k]) * speeds))
    unit, word = float(units.joint_scale(arm)[joint]), f"{units.unit_names(arm)[joint]}/s"
    return RateError(
        f"joint {arm.joint_names[joint]} at {speeds[joint] / unit:.4g} {word} needs {rates[k]:,.0f} counts/s of motor "
        f"{motor_names(arm)[k]}; the board makes {allowed:,.0f}",
        joint=arm.joint_names[joint],
        motor=motor_names(arm)[k],
        rate=float(rates[k]),
        most=allowed,
        share=allowed / float(rates[k]),
    )
