"""Converts a straight line in counts to segments: ramps in pieces whose speed changes by a sixth, cruises in long ones.

The pieces are so few that the board's queue always holds the time to a stop, and so many that every step is on time to
60 us or 2 % of its period.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.segments.counts_to_segments import (
    CLOCK_RATE,
    MIN_INTERVAL,
    Counts,
    Cutter,
    Move,
    cycles_of,
    speed_change,
)
from armkin.board.firmware.wire.protocol import STEP, Segment
from armkin.motion.timing.profile import Profile, trapezoid

# All segments of a ramp have the same ratio of the speeds at their fast and slow ends. Their acceleration is right to
# 0.53 (ratio - 1)^2, which is 1.5 % at 1.17. A whole ramp fits into the board's queue of 32 segments.
_SPEED_RATIO = 1.14  # ratio of speeds of a segment in a ramp with fewer segments than `_RAMP_SEGMENTS`
_RAMP_SEGMENTS, _SHORT_RAMP_SEGMENTS, _ROUGH_RAMP_SEGMENTS = 27, 13, 12  # most segments of a ramp, see `Pieces`
_MAX_RATIO = 1.4  # largest ratio of speeds; the board allows 5/4 of the acceleration
_FIRST_TIME, _ROUGH_FIRST_TIME = 0.003, 0.03  # shortest first segment [s] of a ramp, fine and rough
_FIRST_MAX = 0.1  # longest first segment [s]: the board allows a jump of 5/4 of the acceleration in 50 ms
_BEFORE_STEP = 0.96  # share of the time to the first step, before which the timing does not matter
_NO_STEP = 0.49  # part of a step that rounding of rates may use
# A first segment without a step is shortened by this factor: its constant speed is that of 1.2 of the acceleration,
# within the board's bound of 5/4. All steps come earlier by the same time.
UNHEARD_SHARE = math.sqrt(1 / 2.4)  # share of its time
_MIN_CRUISE_SEGMENT, _MAX_CRUISE_SEGMENT = 0.2, 0.4  # shortest and longest cruise segment [s]
_JERK_TIME = 0.02  # longest segment [s] with a change of acceleration
_SPLIT_TIME = 0.08  # shortest cruise segment [s] of which the end becomes a segment of its own
_CRUISE_SHARE = 0.03  # shortest cruise as a share of a ramp; below it, and below _MIN_CRUISE, the ramps meet
_MIN_CRUISE = 0.0006  # [s]
_MAKE_UP_SHARE = 0.01  # share of its travel that a motor may correct: the board allows 1.05 of its rate
_SPARE_SHARE = 0.0005  # share of a piece's steps that is left for the next piece to correct
_EAGER_SEGMENTS = 2000  # up to so many segments are computed at once
_MAX_BOUNDS = 512  # segment bounds in memory, of a longer line


class Pieces(IntEnum):
    """How finely ramps are divided."""

    FINE = 0  # acceleration right to 2 %
    FEW = 1  # a short move fits into the queue, so a late host does no harm; right to 7 %
    ROUGH = 2  # few segments for a bad line; right to 10 %


def line_segments(
    start: Sequence[int],
    end: Sequence[int],
    law: Profile,
    *,
    clock: int = CLOCK_RATE,
    min_interval: int = MIN_INTERVAL,
    pieces: Pieces = Pieces.FINE,
) -> Move:
    """The move of a straight line in counts; law: the position along the line over time, from 0 to its length.

    A very long line computes its segments on iteration.
    """
    start_counts, end_counts = np.asarray(start, dtype=np.int64), np.asarray(end, dtype=np.int64)
    if not (end_counts - start_counts).any():
        return Move(start_counts, end_counts, (), 0)
    line = LineSegments(
        start=start_counts, end=end_counts, law=law, clock=clock, min_interval=min_interval, pieces=pieces
    )
    if len(line) > _EAGER_SEGMENTS:
        return Move(start_counts, end_counts, line, round(law.duration * clock))
    segments = tuple(line)
    return Move(start_counts, end_counts, segments, sum(map(cycles_of, segments)))


@dataclass(frozen=True)
class LineSegments:
    """The segments of a straight line, computed on each iteration in bounded memory."""

    start: Counts  # (motors,)
    end: Counts
    law: Profile
    clock: int
    min_interval: int
    pieces: Pieces

    def __iter__(self) -> Iterator[Segment]:
        """The segments in order."""
        law, span, steps = self.law, self.end - self.start, self._most_steps
        cutter = Cutter(self.start.tolist(), self.clock, self.min_interval)
        unheard = law.is_trapezoid
        for times, is_last_block in _on_steps(law, _segment_bounds(law, steps, self.pieces), steps):
            share, speed = law.evaluate(times) / law.length, law.evaluate(times, 1) / law.length
            if is_last_block:
                share[-1] = 1.0
            for i, (a, b) in enumerate(pairwise(times.tolist())):
                change = speed_change(float(speed[i]), float(speed[i + 1]))
                counts = (self.start + span * share[i + 1]).tolist()
                drift = _SPARE_SHARE * steps * float(share[i + 1] - share[i])
                is_last = is_last_block and i + 2 == len(times)
                unheard = unheard and float(share[i + 1]) * steps < _NO_STEP
                seconds = (b - a) * (UNHEARD_SHARE if unheard else 1.0)
                yield cutter.piece(seconds, counts, change, drift, None if is_last else _MAKE_UP_SHARE, unheard)
                unheard = False
        if [place // STEP for place in cutter.places] != self.end.tolist():
            raise AssertionError("a line's rates do not lead to its end")

    @property
    def _most_steps(self) -> int:
        return int(np.abs(self.end - self.start).max())

    def __len__(self) -> int:
        return segment_count(self.law, self._most_steps, self.pieces)


def segment_count(law: Profile, steps: int, pieces: Pieces = Pieces.FINE) -> int:
    """The number of segments of a line with this law; steps: of the motor that makes most."""
    phases = _law_phases(law, steps, pieces)
    return sum(parts if isinstance(parts, int) else len(parts) for _, _, parts in phases)


def straight_line(
    start: Sequence[int],
    end: Sequence[int],
    top: float,
    accel: float,
    *,
    clock: int = CLOCK_RATE,
    min_interval: int = MIN_INTERVAL,
) -> Move:
    """A straight line in counts from rest to rest: `top` [1/s] and `accel` [1/s^2] at most, both in lines."""
    return line_segments(start, end, trapezoid(1.0, top, accel), clock=clock, min_interval=min_interval)


def _most_ramp_segments(law: Profile, pieces: Pieces) -> int:
    """The most segments of a ramp; a move is short if its cruise is shorter than a ramp."""
    if pieces == Pieces.ROUGH:
        return _ROUGH_RAMP_SEGMENTS
    is_short = law.is_trapezoid and law.duration < 3 * law.peak / law.accel
    return _SHORT_RAMP_SEGMENTS if is_short and pieces == Pieces.FEW else _RAMP_SEGMENTS


def _to_first_step(law: Profile, accel: float, steps: int) -> float:
    """The time [s] from rest to just before the fastest motor's first step, which is half a step away."""
    return _BEFORE_STEP / math.sqrt(abs(accel) * steps / law.length)


def _law_phases(law: Profile, steps: int, pieces: Pieces) -> Iterator[tuple[float, float, int | list[float]]]:
    """The phases of a law: begin, end, and the number of equal segments or the list of their ends.

    steps: of the motor that makes most.
    """
    ramp = law.peak / max(law.accel, 1e-12)
    times = law.times.tolist()
    if law.is_trapezoid and times[2] - times[1] < max(_CRUISE_SHARE * ramp, _MIN_CRUISE):
        times[1] = times[2] = (times[1] + times[2]) / 2
    for phase, (t0, t1) in enumerate(pairwise(times)):
        accel, jerk = float(law.states[phase, 2]), float(law.jerk[phase])
        if t1 - t0 < 1e-9:
            continue
        if jerk == 0.0 and accel != 0.0:
            yield t0, t1, _ramp_bounds(law, t0, t1, accel, steps, pieces)
            continue
        max_time = _JERK_TIME if jerk else min(max(ramp / 8, _MIN_CRUISE_SEGMENT), _MAX_CRUISE_SEGMENT)
        parts = math.ceil((t1 - t0) / max_time)
        part_time = (t1 - t0) / parts
        if jerk or part_time < _SPLIT_TIME:
            yield t0, t1, parts
            continue
        if parts > 1:
            yield t0, t1 - part_time, parts - 1
        # The ramp corrects the rounding errors of this last segment, so it is short.
        yield t1 - part_time, t1, [t1 - part_time / 4, t1]


def _segment_bounds(law: Profile, steps: int, pieces: Pieces) -> Iterator[float]:
    """The times between segments, from 0 on."""
    yield 0.0
    for t0, t1, parts in _law_phases(law, steps, pieces):
        yield from (t0 + (t1 - t0) * i / parts for i in range(1, parts + 1)) if isinstance(parts, int) else parts


def _ramp_bounds(law: Profile, t0: float, t1: float, accel: float, steps: int, pieces: Pieces) -> list[float]:
    """Ends of segments in a phase of constant acceleration, with speeds in a geometric series from the slow end."""
    v0, v1 = (float(v) for v in law.evaluate(np.array([t0, t1]), 1))
    if accel < 0:
        v1 = max(0.0, v0 + accel * (t1 - t0))
    max_count, shortest = _most_ramp_segments(law, pieces), _ROUGH_FIRST_TIME if pieces == Pieces.ROUGH else _FIRST_TIME
    fast_time = max(v0, v1) / abs(accel)  # [s] from rest to the fast end
    slow_time = max(min(v0, v1) / abs(accel), shortest, _to_first_step(law, accel, steps))
    slow_time = min(max(slow_time, fast_time / _MAX_RATIO**max_count), _FIRST_MAX)
    to_rest = [fast_time]
    if fast_time > slow_time:
        number = min(max_count, math.ceil(math.log(fast_time / slow_time) / math.log(_SPEED_RATIO)))
        ratio = (fast_time / slow_time) ** (1 / number)
        while (next_time := min(to_rest[-1] / ratio, to_rest[-1] - shortest / 4)) > slow_time * 1.02:
            to_rest.append(next_time)
        if len(to_rest) > 1:
            to_rest[-1] = math.sqrt(to_rest[-2] * slow_time) if to_rest[-1] - slow_time < shortest / 8 else to_rest[-1]
            to_rest.append(slow_time)
        elif fast_time - slow_time > shortest / 8:
            to_rest.append(slow_time)
    if accel > 0:
        times = [t0 - v0 / accel + t for t in reversed(to_rest[1:])]
    else:
        times = [t1 - v1 / accel - t for t in to_rest[1:]]
    return [t for t in times if t0 + 1e-6 < t < t1 - 1e-6] + [t1]


def _on_steps(law: Profile, bounds: Iterable[float], steps: int) -> Iterator[tuple[NDArray[np.float64], bool]]:
    """Bounds moved to whole steps of the motor with the most steps, if it makes several between two of them.

    They come in blocks, each beginning with the last bound of the one before, with a flag for the last block.
    """
    bounds_left = iter(bounds)
    pending_times: list[float] = []
    begin = 0.0
    while True:
        block = list(islice(bounds_left, _MAX_BOUNDS))
        pending_times += block
        times = np.array(pending_times)
        if len(times) > 2:
            position, speed = law.evaluate(times) / law.length * steps, law.evaluate(times, 1) / law.length * steps
            steps_beside = np.minimum(np.diff(position)[:-1], np.diff(position)[1:])
            shift = (np.rint(position) - position)[1:-1] / np.maximum(speed[1:-1], 1e-9)
            times[1:-1] += np.where((steps_beside > 4) & (speed[1:-1] > 0), shift, 0.0)
        times[0] = begin
        if len(block) < _MAX_BOUNDS:
            yield times, True
            return
        yield times[:-1], False  # moving the last bound needs the next one
        begin = float(times[-2])
        pending_times = pending_times[-2:]
