"""A straight line in counts as segments: ramps in pieces whose speed changes by a sixth, cruises in long ones.

Which pieces: so few that the board's queue always holds the time to a stop, and so many that every step comes when the
time law says, to 60 us or 2 % of its period, from the first to the last.
"""

from __future__ import annotations

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

# A ramp's segments have one ratio of speeds, their fast end's over their slow end's: the acceleration within is right
# to 0.53 (ratio - 1)^2, 1.5 % at 1.17. All of a ramp fits into the board's queue (32).
_SPEED_RATIO = 1.14  # ratio of speeds of a segment in a ramp with fewer segments than `_RAMP_SEGMENTS`
_RAMP_SEGMENTS, _SHORT_RAMP_SEGMENTS, _ROUGH_RAMP_SEGMENTS = 27, 13, 12  # segments of a ramp at most, see `Pieces`
_MAX_RATIO = 1.4  # ratio of speeds from which the first segment gets longer: the board takes 5/4 of the acceleration
_FIRST_TIME, _ROUGH_FIRST_TIME = 0.003, 0.03  # least length [s] of a ramp's first segment; in rough, 4 times any other
_FIRST_MAX = 0.1  # length [s], at most, of a ramp's first segment: a board's jump is 5/4 of the acceleration in 50 ms
_BEFORE_STEP = 0.96  # share of the time to a motor's first step: until then no motor tells how it got there
_NO_STEP = 0.49  # part of a step that is left for the rounding of rates
# Of its time, that such a first segment takes, at once at the speed that 1.2 of the acceleration makes in it; the
# board's bound is 5/4. All edges come so much sooner, as far from one another as in the time law.
UNHEARD_SHARE = math.sqrt(1 / 2.4)  # share of its time
_CRUISE_TIMES = (0.2, 0.4)  # length [s] of a cruise segment, least and greatest
_JERK_TIME = 0.02  # length [s] of a segment in which the acceleration changes
_SPLIT_TIME = 0.08  # length [s] of a cruise segment whose end is one of its own
_MIN_CRUISE = (0.03, 0.0006)  # length of a cruise, as a share of a ramp or in [s], below which it belongs to the ramps
_MAKE_UP_SHARE = 0.01  # share of its way in a piece that a motor makes up for: the board takes 1.05 of its rate
_SPARE_SHARE = 0.0005  # share of a piece's steps that is left for the next one to make up for
_EAGER_SEGMENTS = 2000  # segments of a line that are made at once
_MAX_BOUNDS = 512  # bounds of segments that are held, of a longer line


class Pieces(IntEnum):
    """How many segments a ramp has."""

    FINE = 0  # pieces so many that the acceleration is right to 2 %
    FEW = 1  # a short move so few that the queue holds all of it, however late the host is; right to 7 %
    ROUGH = 2  # pieces so few that a bad line brings them in time; right to 10 %


def line_segments(
    start: Sequence[int],
    end: Sequence[int],
    law: Profile,
    *,
    clock: int = CLOCK_RATE,
    min_interval: int = MIN_INTERVAL,
    pieces: Pieces = Pieces.FINE,
) -> Move:
    """The segments of a straight line in counts; law: how far along it is over time, from 0 to its length.

    A line of very many makes them as asked for.
    """
    first, last = np.asarray(start, dtype=np.int64), np.asarray(end, dtype=np.int64)
    if not (last - first).any():
        return Move(first, last, (), 0)
    line = LineSegments(start=first, end=last, law=law, clock=clock, min_interval=min_interval, pieces=pieces)
    if len(line) > _EAGER_SEGMENTS:
        return Move(first, last, line, round(law.duration * clock))
    made = tuple(line)
    return Move(first, last, made, sum(map(cycles_of, made)))


@dataclass(frozen=True)
class LineSegments:
    """The segments of a straight line; iterating makes them anew, in bounded memory."""

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
        for times, ending in _on_steps(law, _segment_bounds(law, steps, self.pieces), steps):
            share, speed = law.evaluate(times) / law.length, law.evaluate(times, 1) / law.length
            if ending:
                share[-1] = 1.0
            for k, (a, b) in enumerate(pairwise(times.tolist())):
                change = speed_change(float(speed[k]), float(speed[k + 1]))
                counts = (self.start + span * share[k + 1]).tolist()
                drift = _SPARE_SHARE * steps * float(share[k + 1] - share[k])
                last = ending and k + 2 == len(times)
                unheard = unheard and float(share[k + 1]) * steps < _NO_STEP
                seconds = (b - a) * (UNHEARD_SHARE if unheard else 1.0)
                yield cutter.piece(seconds, counts, change, drift, None if last else _MAKE_UP_SHARE, unheard)
                unheard = False
        if [p // STEP for p in cutter.places] != self.end.tolist():
            raise AssertionError("a line's rates do not lead to its end")

    @property
    def _most_steps(self) -> int:
        return int(np.abs(self.end - self.start).max())

    def __len__(self) -> int:
        return segment_count(self.law, self._most_steps, self.pieces)


def segment_count(law: Profile, steps: int, pieces: Pieces = Pieces.FINE) -> int:
    """How many segments a line with this law has; steps: of the motor that makes most."""
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
    """Segments of a ramp at most; a move is short if its cruise is shorter than a ramp."""
    if pieces == Pieces.ROUGH:
        return _ROUGH_RAMP_SEGMENTS
    short = law.is_trapezoid and law.duration < 3 * law.peak / law.accel
    return _SHORT_RAMP_SEGMENTS if short and pieces == Pieces.FEW else _RAMP_SEGMENTS


def _to_first_step(law: Profile, accel: float, steps: int) -> float:
    """Seconds from rest almost to the fastest motor's first step, half of one away."""
    return _BEFORE_STEP / math.sqrt(abs(accel) * steps / law.length)


def _law_phases(law: Profile, steps: int, pieces: Pieces) -> Iterator[tuple[float, float, int | list[float]]]:
    """A law's phases: begin, end, and into how many segments they are cut evenly, or where else.

    steps: of the motor that makes most.
    """
    ramp = law.peak / max(law.accel, 1e-12)
    times = law.times.tolist()
    if law.is_trapezoid and times[2] - times[1] < max(_MIN_CRUISE[0] * ramp, _MIN_CRUISE[1]):
        times[1] = times[2] = (times[1] + times[2]) / 2
    for k, (t0, t1) in enumerate(pairwise(times)):
        accel, jerk = float(law.states[k, 2]), float(law.jerk[k])
        if t1 - t0 < 1e-9:
            continue
        if jerk == 0.0 and accel != 0.0:
            yield t0, t1, _ramp_bounds(law, t0, t1, accel, steps, pieces)
            continue
        longest = _JERK_TIME if jerk else min(max(ramp / 8, _CRUISE_TIMES[0]), _CRUISE_TIMES[1])
        parts = math.ceil((t1 - t0) / longest)
        part_time = (t1 - t0) / parts
        if jerk or part_time < _SPLIT_TIME:
            yield t0, t1, parts
            continue
        if parts > 1:
            yield t0, t1 - part_time, parts - 1
        # A short end: the ramp makes up for what the rounding of its rates leaves.
        yield t1 - part_time, t1, [t1 - part_time / 4, t1]


def _segment_bounds(law: Profile, steps: int, pieces: Pieces) -> Iterator[float]:
    """When segments end, from 0 on."""
    yield 0.0
    for t0, t1, parts in _law_phases(law, steps, pieces):
        yield from (t0 + (t1 - t0) * i / parts for i in range(1, parts + 1)) if isinstance(parts, int) else parts


def _ramp_bounds(law: Profile, t0: float, t1: float, accel: float, steps: int, pieces: Pieces) -> list[float]:
    """Ends of segments of a phase of constant acceleration: speeds in geometric steps from the slow end."""
    v0, v1 = (float(v) for v in law.evaluate(np.array([t0, t1]), 1))
    if accel < 0:
        v1 = max(0.0, v0 + accel * (t1 - t0))
    most, shortest = _most_ramp_segments(law, pieces), _ROUGH_FIRST_TIME if pieces == Pieces.ROUGH else _FIRST_TIME
    top = max(v0, v1) / abs(accel)  # [s] from rest at each speed
    first = max(min(v0, v1) / abs(accel), shortest, _to_first_step(law, accel, steps))
    first = min(max(first, top / _MAX_RATIO**most), _FIRST_MAX)
    to_rest = [top]
    if top > first:
        number = min(most, math.ceil(math.log(top / first) / math.log(_SPEED_RATIO)))
        ratio = (top / first) ** (1 / number)
        while (slower := min(to_rest[-1] / ratio, to_rest[-1] - shortest / 4)) > first * 1.02:
            to_rest.append(slower)
        if len(to_rest) > 1:
            to_rest[-1] = math.sqrt(to_rest[-2] * first) if to_rest[-1] - first < shortest / 8 else to_rest[-1]
            to_rest.append(first)
        elif top - first > shortest / 8:
            to_rest.append(first)
    if accel > 0:
        times = [t0 - v0 / accel + t for t in reversed(to_rest[1:])]
    else:
        times = [t1 - v1 / accel - t for t in to_rest[1:]]
    return [t for t in times if t0 + 1e-6 < t < t1 - 1e-6] + [t1]


def _on_steps(law: Profile, bounds: Iterable[float], steps: int) -> Iterator[tuple[NDArray[np.float64], bool]]:
    """Bounds moved to where the motor with the most steps has made whole ones, where it makes several between them.

    In blocks, each of which begins with the last bound of the one before; the last one is told.
    """
    bounds_left = iter(bounds)
    pending: list[float] = []
    begin = 0.0
    while True:
        more = list(islice(bounds_left, _MAX_BOUNDS))
        pending += more
        times = np.array(pending)
        if len(times) > 2:
            position, speed = law.evaluate(times) / law.length * steps, law.evaluate(times, 1) / law.length * steps
            near = np.minimum(np.diff(position)[:-1], np.diff(position)[1:])
            shift = (np.rint(position) - position)[1:-1] / np.maximum(speed[1:-1], 1e-9)
            times[1:-1] += np.where((near > 4) & (speed[1:-1] > 0), shift, 0.0)
        times[0] = begin
        if len(more) < _MAX_BOUNDS:
            yield times, True
            return
        yield times[:-1], False  # what the last one is moved to depends on the next
        begin = float(times[-2])
        pending = pending[-2:]
