"""Where an arm stands on a plan, and what is left of the plan from there."""

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
    from armkin.formula.arrays import Array

_PLAN_DISTANCE = 1.5  # distance [steps] of a plan that every motor of an arm on it keeps within


@dataclass(frozen=True)
class Place:
    """Where an arm stands on its plan."""

    part: int
    stretch: int  # index among the part's stretches
    seconds: float  # since the stretch began
    elapsed: float  # seconds since the plan began


def remaining_trajectory(part: Cut, place: Place, standing: Array) -> Trajectory:
    """What is left of a part of a plan, from rest at joint values (n,) [rad | mm] that lie on it."""
    stretches, arm = part.trajectory.stretches, part.trajectory.arm
    first = remainder(arm, stretches[place.stretch], place.seconds, standing)
    return Trajectory(arm, standing, (first, *stretches[place.stretch + 1 :]))


def left_of(
    plans: Sequence[Cut], move: int, counts: Sequence[int], lay: Callable[[Trajectory, np.ndarray], Cut]
) -> tuple[Sequence[Cut], Place] | None:
    """What is left of plans for an arm at rest on a move of the first, and where on that it stands.

    counts: where it stands; lay: a trajectory from there as a plan for its board. None: it does not stand on that move.
    """
    first, standing = plans[0], np.array(counts, dtype=np.int64)
    if move == 0 and (standing == first.start).all():
        return plans, Place(0, 0, 0.0, 0.0)
    place = next((p for p in places_on([first], standing) if p.stretch == move), None)
    if place is None:
        return None
    left = remaining_trajectory(first, place, joints(first.trajectory.arm, standing))
    return [lay(left, standing), *plans[1:]], place


def places_on(parts: Sequence[Cut], counts: np.ndarray) -> Iterator[Place]:
    """All places on a plan where the counts lie, in order: one a segment that passes them."""
    before = 0.0
    for p, part in enumerate(parts):
        for k, move in enumerate(part.moves()):
            segments = list(move.segments)
            stretch = part.trajectory.stretches[k]
            begin = before + float(part.trajectory.begins[k])
            if not segments:
                if np.abs(move.start - counts).max(initial=0) <= _PLAN_DISTANCE:
                    yield Place(p, k, 0.0, begin)
                continue
            steps = np.array([[s.ticks * rate for rate in s.rates] for s in segments]) / STEP
            ends = move.start + np.vstack([np.zeros(len(counts)), np.cumsum(steps, axis=0)])
            ticks = np.cumsum([0.0, *(s.ticks * (s.interval + s.last_interval) / 2 for s in segments)])
            times = ticks / ticks[-1] * stretch.duration
            for (a, b), (t0, t1) in zip(pairwise(ends), pairwise(times.tolist()), strict=True):
                way = b - a
                share = float(np.clip((counts - a) @ way / max(way @ way, 1e-12), 0.0, 1.0))
                if np.abs(a + share * way - counts).max(initial=0) <= _PLAN_DISTANCE:
                    time = _refine_time(part, k, t0 + share * (t1 - t0), counts)
                    yield Place(p, k, time, begin + time)
        before += part.duration


def _refine_time(part: Cut, number: int, guess: float, counts: np.ndarray) -> float:
    """The time within a stretch when its motors are nearest to the counts (Gauss-Newton from a guess)."""
    arm, stretch = part.trajectory.arm, part.trajectory.stretches[number]
    t = guess
    for _ in range(8):
        when = np.array([t])
        distance = counts - exact_pulses(arm, stretch.evaluate(when))[0]
        speed = stretch.evaluate(when, 1)[0] @ arm.motor_gain.T
        if speed @ speed < 1.0:  # slower than a step a second: at rest, or all but
            break
        t = float(np.clip(t + np.clip(distance @ speed / (speed @ speed), -0.02, 0.02), 0.0, stretch.duration))
    return t
