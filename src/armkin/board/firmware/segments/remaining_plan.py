"""Finds an arm's place on its plan from its counts, and the remainder of the plan from there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.firmware.wire.protocol import STEP
from armkin.motion.remaining_stretch import remainder
from armkin.motion.timing.trajectory import Trajectory
from armkin.motors import exact_pulses, joints

if TYPE_CHECKING:
    from armkin.board.firmware.segments.trajectory_to_counts import Cut
    from armkin.board.firmware.wire.protocol import Segment
    from armkin.formula.arrays import Array

_PLAN_DISTANCE = 1.5  # largest distance [steps] of each motor from a plan that the arm is on


@dataclass(frozen=True)
class PlanPlace:
    """A place on a plan."""

    part: int
    stretch: int  # index among the part's stretches
    seconds: float  # since the stretch began
    elapsed: float  # seconds since the plan began


def remaining_trajectory(part: Cut, place: PlanPlace, present: Array) -> Trajectory:
    """The remainder of a part of a plan, from rest at joint values (n,) [rad | mm] that lie on it."""
    stretches, arm = part.trajectory.stretches, part.trajectory.arm
    first_remainder = remainder(arm, stretches[place.stretch], place.seconds, present)
    return Trajectory(arm, present, (first_remainder, *stretches[place.stretch + 1 :]))


def remaining_plans(
    plans: Sequence[Cut], move: int, counts: Sequence[int], plan_trajectory: Callable[[Trajectory, np.ndarray], Cut]
) -> tuple[Sequence[Cut], PlanPlace] | None:
    """The remainder of plans for an arm at rest on a move of the first one, and its place on that move.

    counts: the arm's position; plan_trajectory: makes a plan for its board. None: the arm is not on that move.
    """
    first, present = plans[0], np.array(counts, dtype=np.int64)
    if move == 0 and (present == first.start).all():
        return plans, PlanPlace(0, 0, 0.0, 0.0)
    place = next((candidate for candidate in places_on([first], present) if candidate.stretch == move), None)
    if place is None:
        return None
    remaining = remaining_trajectory(first, place, joints(first.trajectory.arm, present))
    return [plan_trajectory(remaining, present), *plans[1:]], place


def places_on(parts: Sequence[Cut], counts: np.ndarray) -> Iterator[PlanPlace]:
    """All places of a plan at the counts in order, one for each segment that passes them."""
    seconds_before = 0.0
    for part_number, part in enumerate(parts):
        for number, move in enumerate(part.moves()):
            segments = list(move.segments)
            stretch = part.trajectory.stretches[number]
            begin = seconds_before + float(part.trajectory.begins[number])
            if not segments:
                if np.abs(move.start - counts).max(initial=0) <= _PLAN_DISTANCE:
                    yield PlanPlace(part_number, number, 0.0, begin)
                continue
            for guess in _times_on_segments(move.start, segments, stretch.duration, counts):
                time = _refine_time(part, number, guess, counts)
                yield PlanPlace(part_number, number, time, begin + time)
        seconds_before += part.duration


def _times_on_segments(
    start: np.ndarray, segments: Sequence[Segment], duration: float, counts: np.ndarray
) -> Iterator[float]:
    """The time [s] of each segment that passes the counts, where it is nearest to them; duration: of all segments."""
    steps = np.array([[segment.ticks * rate for rate in segment.rates] for segment in segments]) / STEP
    ends = start + np.vstack([np.zeros(len(counts)), np.cumsum(steps, axis=0)])
    ticks = np.cumsum([0.0, *(segment.ticks * (segment.interval + segment.last_interval) / 2 for segment in segments)])
    times = ticks / ticks[-1] * duration
    for (a, b), (t0, t1) in zip(pairwise(ends), pairwise(times.tolist()), strict=True):
        travel = b - a
        share = float(np.clip((counts - a) @ travel / max(travel @ travel, 1e-12), 0.0, 1.0))
        if np.abs(a + share * travel - counts).max(initial=0) <= _PLAN_DISTANCE:
            yield t0 + share * (t1 - t0)


def _refine_time(part: Cut, number: int, guess: float, counts: np.ndarray) -> float:
    """The time in a stretch at which its motors are nearest to the counts, by Gauss-Newton steps from a guess."""
    arm, stretch = part.trajectory.arm, part.trajectory.stretches[number]
    t = guess
    for _ in range(8):
        times = np.array([t])
        distance = counts - exact_pulses(arm, stretch.evaluate(times))[0]
        speed = stretch.evaluate(times, 1)[0] @ arm.motor_gain.T
        if speed @ speed < 1.0:  # slower than a step a second counts as rest
            break
        # A step of at most 0.02 s: twice the first one, 9.8 ms, of the 79 guesses that the tests of a held motion make.
        t = float(np.clip(t + np.clip(distance @ speed / (speed @ speed), -0.02, 0.02), 0.0, stretch.duration))
    return t
