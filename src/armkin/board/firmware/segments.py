"""Motion in counts as exact device segments (firmware/PROTOCOL.md, section 6).

    counts over time  --pieces of constant acceleration-->  segments {ticks, interval, add, bend, rates[]}

A segment is a straight line in counts. Its motors are wherever the motion is at its end, to a fraction of a step, and
go on from there: `Cutter` follows them as the device does, so that no step is early or late because a segment ends.
The interval between ticks is a parabola in the number of ticks, 1 / (v + a t) to second order: where the speed changes
by 13 % over a segment, the acceleration is right to 2 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.protocol import BLOCK, HALF, STEP, Segment, nearest_rate
from armkin.motion.profile import Profile, trapezoid

Counts = NDArray[np.int64]

CLOCK = 16_000_000  # [1/s] of every board so far
MIN_INTERVAL = 576  # [cycles] between ticks, that every board makes

# Speed at a segment's fast end over that at its slow end, from a ramp's top down: so few that the board's queue (32)
# holds nearly all of a short move, however late the host is.
_RATIOS = (1.13,) * 10 + (1.18, 1.22, 1.3, 1.4, 1.6, 1.9)
_ROUGH = (1.2,) * 12  # for a line that is too bad for so many
_FIRST = 0.002  # [s] a ramp's first segment at least
_CRUISE = (0.2, 0.4)  # [s] a cruise segment
_JERK = 0.02  # [s] a segment in which the acceleration changes
_TICK = 1.12  # shortest intervals that a tick lasts
_TICK_S = 20e-6  # [s] a tick lasts at least, unless a motor steps faster: no edge is farther off than that
_FINE = 150  # ticks in which the fastest motor makes a step: more would not be smoother
_FEWEST = 32  # ticks of a segment, where the board can make them
_LONGEST = 50_000  # [cycles] of an interval; the device takes 65535
_EAGER = 2000  # segments of a line that are made at once
_AT_ONCE = 512  # bounds of segments that are held, of a longer line
_MOST = 16_000  # ticks of a segment: as many as a rate is exact for to a quarter of a step


class Segments(Protocol):
    """Segments in order, as often as they are asked for."""

    def __iter__(self) -> Iterator[Segment]: ...

    def __len__(self) -> int: ...


@dataclass(frozen=True)
class Move:
    """A motion from rest to rest."""

    start: Counts  # (motors,)
    end: Counts  # (motors,)
    segments: Segments
    cycles: int  # of the clock, all segments together
    curve: bool = False

    @property
    def moving(self) -> list[int]:
        """Motors that take part: on a line those that end elsewhere, on a curve all."""
        return [k for k in range(len(self.start)) if self.curve or self.start[k] != self.end[k]]


def cycles_of(segment: Segment) -> int:
    """Clock cycles of a segment, exactly as the device counts them."""
    return segment.ticks * segment.interval + _added(segment.ticks, segment.add, segment.bend)


def _added(ticks: int, add: int, bend: int) -> int:
    """Cycles that `add` and `bend` give to all intervals together."""
    if add == 0:
        return 0
    blocks = (np.arange(ticks - 1) + BLOCK - 1 - (ticks - 1) % BLOCK) // BLOCK  # counted from the end
    adds = (add * 256 + 4 * bend * blocks) >> 8
    return int((np.cumsum(adds) >> 16).sum())


class Cutter:
    """Cuts a motion from rest: where every motor is, to 2^-23 step, and what rounding has done to the time."""

    def __init__(self, start: Sequence[int], clock: int = CLOCK, min_interval: int = MIN_INTERVAL) -> None:
        self.clock, self.min_interval = clock, min_interval
        self.places = [int(count) * STEP + HALF for count in start]
        self.late = 0.0  # [cycles] that the segments so far should have lasted longer

    def piece(self, seconds: float, counts: Sequence[float], change: float = 0.0) -> Segment:
        """A straight line to `counts` (motors,), fractions included, in so many seconds.

        change: speed at its end less that at its beginning, over the mean: -2 to 2. The speed changes evenly.
        """
        left = [round(c * STEP) + HALF - p for c, p in zip(counts, self.places, strict=True)]
        most = max(map(abs, left), default=0) / STEP  # steps of the fastest motor
        exact = seconds * self.clock + self.late
        ticks = self._ticks(exact, most)
        add, bend = _parabola(exact / ticks, ticks, change)
        interval = round((exact - _added(ticks, add, bend)) / ticks)
        if add == 0 and ticks > 1:
            interval, add = _even(exact, ticks)
        segment = Segment(ticks, interval, add, tuple(nearest_rate(x / ticks) for x in left), bend)
        short = self.min_interval - min(segment.interval, segment.last_interval)
        if short > 0:
            segment = Segment(ticks, interval + short, add, segment.rates, bend)
        self.places = [p + ticks * r for p, r in zip(self.places, segment.rates, strict=True)]
        self.late = min(exact - cycles_of(segment), float(ticks))  # what the shortest interval costs is not made up for
        return segment

    def _ticks(self, cycles: float, steps: float) -> int:
        """How many ticks a piece has: whole ones for each step of its fastest motor, if it makes many."""
        least = max(_TICK * self.min_interval, _TICK_S * self.clock)
        each = cycles / steps if steps > 1e-9 else math.inf  # cycles a step
        tick = max(least, min(each / _FINE, cycles / _FEWEST, _LONGEST / 2), cycles / _MOST)
        over = int(each / tick) if each < math.inf else 0
        if 1 <= over <= _FINE:
            tick = each / over
        elif over == 0 and each < math.inf:
            tick = each
        return max(1, math.ceil(cycles / _LONGEST), round(cycles / tick))


def _even(cycles: float, ticks: int) -> tuple[int, int]:
    """Interval and `add` of a segment of one speed that lasts so many cycles.

    A whole number of cycles an interval is up to half a cycle a tick off, which the next segment would have to make
    up for: a tenth of a short ramp. The device adds floor(k a), a = add / 65536: over A = a ticks cycles in all the
    mean of that is 1 - 1 / A up to A = 2, and 2 - 3 / A up to 3.
    """
    interval = int(cycles // ticks)
    part = cycles / ticks - interval  # of a cycle, that the mean interval is longer
    if part * ticks < 1:
        return interval, 0
    return interval, round((1 / (1 - part) if part < 0.5 else 3 / (2 - part)) * 65536 / ticks)


def _parabola(mean: float, ticks: int, change: float) -> tuple[int, int]:
    """`add` and `bend` of a segment whose speed changes evenly: mean interval [cycles], ticks, see `Cutter.piece`."""
    if abs(change) < 1e-9 or ticks < 2:
        return 0, 0
    slow, fast = 1 - change / 2, 1 + change / 2  # speeds at its ends, in means
    c = (fast / slow) ** 2 - 1  # interval(x) = I / sqrt(1 + c x), x from 0 to 1 over the ticks
    # Its slope is made linear: right at the two points where the error of a line is least (Chebyshev's).
    x = np.array([0.5 - math.sqrt(0.125), 0.5 + math.sqrt(0.125)])
    slope = -mean / slow * c / 2 * (1 + c * x) ** -1.5
    curve = (slope[1] - slope[0]) / (x[1] - x[0])
    bend = round(curve * BLOCK / ticks**2 * 2**22)
    blocks = (ticks - 1) // BLOCK
    if abs(bend) > 32767 or blocks < 2:
        return round(
            2 * math.copysign(mean - mean / max(slow, fast), -change) / ticks * 65536
        ), 0  # right at its fast end
    add = round((mean / fast - mean / slow) / ticks * 65536 - bend * blocks / 128)
    return (add, bend) if add * (add + (bend * blocks >> 6)) > 0 else _parabola(mean, ticks, change / 2)


def along(
    start: Sequence[int],
    end: Sequence[int],
    law: Profile,
    *,
    clock: int = CLOCK,
    min_interval: int = MIN_INTERVAL,
    rough: bool = False,
) -> Move:
    """The segments of a straight line in counts; law: how far along it is over time, from 0 to its length.

    rough: half as many, with an acceleration that is right to 10 %. A line of very many makes them as asked for.
    """
    first, last = np.asarray(start, dtype=np.int64), np.asarray(end, dtype=np.int64)
    if not (last - first).any():
        return Move(first, last, (), 0)
    line = LineSegments(first, last, law, clock, min_interval, rough)
    if len(line) > _EAGER:
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
    rough: bool

    def __iter__(self) -> Iterator[Segment]:
        """The segments in order."""
        law, span = self.law, self.end - self.start
        cutter = Cutter(self.start.tolist(), self.clock, self.min_interval)
        bounds = _on_steps(law, _bounds(law, _ROUGH if self.rough else _RATIOS), int(np.abs(span).max()))
        for times, ending in bounds:
            done, speed = law.at(times) / law.length, law.at(times, 1) / law.length
            if ending:
                done[-1] = 1.0
            for k, (a, b) in enumerate(pairwise(times.tolist())):
                change = changing(float(speed[k]), float(speed[k + 1]))
                yield cutter.piece(b - a, (self.start + span * done[k + 1]).tolist(), change)
        if [p // STEP for p in cutter.places] != self.end.tolist():
            raise AssertionError("a line's rates do not lead to its end")

    def __len__(self) -> int:
        return count(self.law, self.rough)


def count(law: Profile, rough: bool = False) -> int:
    """How many segments a line with this law has."""
    ratios = _ROUGH if rough else _RATIOS
    return sum(parts if isinstance(parts, int) else len(parts) for _, _, parts in _phases(law, ratios))


def changing(begin: float, end: float) -> float:
    """`Cutter.piece`'s change of speed, from `begin` to `end`; next to rest a piece has one speed."""
    if min(begin, end) <= (begin + end) / 8:
        return 0.0
    return max(-1.0, min(1.0, 2 * (end - begin) / (begin + end)))


def line(
    start: Sequence[int],
    end: Sequence[int],
    top: float,
    accel: float,
    *,
    clock: int = CLOCK,
    min_interval: int = MIN_INTERVAL,
) -> Move:
    """A straight line in counts from rest to rest: `top` [1/s] and `accel` [1/s^2] at most, both in lines."""
    return along(start, end, trapezoid(1.0, top, accel), clock=clock, min_interval=min_interval)


def _phases(law: Profile, ratios: Sequence[float]) -> Iterator[tuple[float, float, int | list[float]]]:
    """A law's phases: begin, end, and into how many segments they are cut evenly, or where else.

    The speed changes by 12 % in each; cruises have long ones.
    """
    ramp = law.peak / max(law.accel, 1e-12)
    for k, (t0, t1) in enumerate(pairwise(law.times.tolist())):
        accel, jerk = float(law.states[k, 2]), float(law.jerk[k])
        if t1 - t0 < 1e-9:
            continue
        if jerk == 0.0 and accel != 0.0:
            yield t0, t1, _ramp(law, t0, t1, accel, ratios)
            continue
        longest = _JERK if jerk else min(max(ramp / 8, _CRUISE[0]), _CRUISE[1])
        yield t0, t1, math.ceil((t1 - t0) / longest)


def _bounds(law: Profile, ratios: Sequence[float]) -> Iterator[float]:
    """When segments end, from 0 on."""
    yield 0.0
    for t0, t1, parts in _phases(law, ratios):
        yield from (t0 + (t1 - t0) * i / parts for i in range(1, parts + 1)) if isinstance(parts, int) else parts


def _ramp(law: Profile, t0: float, t1: float, accel: float, ratios: Sequence[float]) -> list[float]:
    """Ends of segments of a phase of constant acceleration: speeds in geometric steps from the slow end."""
    v0, v1 = (float(v) for v in law.at(np.array([t0, t1]), 1))
    if accel < 0:
        v1 = max(0.0, v0 + accel * (t1 - t0))
    low, high = min(v0, v1), max(v0, v1)
    least, speeds = max(low, abs(accel) * (_FIRST if ratios is _RATIOS else 5 * _FIRST)), [high]
    for ratio in ratios:
        if speeds[-1] / ratio < least * 1.05:
            break
        speeds.append(speeds[-1] / ratio)
    speeds = speeds[1:]
    times = sorted(t0 + (v - v0) / accel for v in speeds)
    return [t for t in times if t0 + 1e-6 < t < t1 - 1e-6] + [t1]


def _on_steps(law: Profile, bounds: Iterable[float], steps: int) -> Iterator[tuple[NDArray[np.float64], bool]]:
    """Bounds moved to where the motor with the most steps has made whole ones, where it makes several between them.

    In blocks, each of which begins with the last bound of the one before; the last one is told.
    """
    rest = iter(bounds)
    known: list[float] = []
    begin = 0.0
    while True:
        more = list(islice(rest, _AT_ONCE))
        known += more
        times = np.array(known)
        if len(times) > 2:
            at, speed = law.at(times) / law.length * steps, law.at(times, 1) / law.length * steps
            near = np.minimum(np.diff(at)[:-1], np.diff(at)[1:])
            whole = (np.rint(at) - at)[1:-1] / np.maximum(speed[1:-1], 1e-9)
            times[1:-1] += np.where((near > 4) & (speed[1:-1] > 0), whole, 0.0)
        times[0] = begin
        if len(more) < _AT_ONCE:
            yield times, True
            return
        yield times[:-1], False  # what the last one is moved to depends on the next
        begin = float(times[-2])
        known = known[-2:]
