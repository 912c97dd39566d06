"""Straight lines in counts, from rest to rest, as exact device segments.

All motors follow one trapezoid (speed up, cruise, slow down) over the line's parameter, so they start and
stop together. The motor with the most steps, the *leader*, sets the ticks:

    trapezoid t(n), n = leader steps  --cut-->  segments {ticks, interval, add, steps[]}

Segments end on whole leader steps, and their steps are differences of one rounded line: their sums are
exact by construction. A segment's ticks are evenly spaced up to a linear change of the interval, which the
device adds up (firmware/PROTOCOL.md, section 6). Within a ramp a segment spans 12 % of the time since (or
until) standstill: so few that a 32-segment queue always holds the way to a stop, so many that no step is
farther than a count or so from the trapezoid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.protocol import Segment
from armkin.errors import UsageError
from armkin.formula.arrays import Array

Counts = NDArray[np.int64]

CLOCK = 16_000_000  # [1/s] of every board so far
MIN_INTERVAL = 400  # [cycles] between ticks

_GROWTH = 1.12  # the least: time at a ramp segment's end over time at its start, seen from standstill
_SHORTEST = (0.002, 0.02)  # [s] a ramp segment's time at least: as long as its steps stay where they belong
_RAMP = 24  # segments that a ramp has, about, at most
_AHEAD = 26  # segments that the board's queue surely holds (32, but for those under way)
_CRUISE = 0.05  # [s] a cruise segment's time at least
_TICK = 1300  # [cycles] slower segments are oversampled down to about this
_LONGEST = 60_000  # [cycles] of an interval; the device takes 65535


class Segments(Protocol):
    """Segments in order, as often as they are asked for."""

    def __iter__(self) -> Iterator[Segment]: ...

    def __len__(self) -> int: ...


@dataclass(frozen=True)
class Move:
    """One straight line from rest to rest."""

    start: Counts  # (motors,)
    end: Counts  # (motors,)
    segments: Segments
    cycles: int  # of the clock, all segments together
    peak: float  # [1/s] greatest speed, in lines per second; 0: not a line

    @property
    def moving(self) -> list[int]:
        """Motors that take part: on a line those that end elsewhere, on a curve all."""
        return [k for k in range(len(self.start)) if self.peak == 0 or self.start[k] != self.end[k]]

    @property
    def leader(self) -> int:
        """Steps of the motor with the most steps."""
        return int(np.abs(self.end - self.start).max(initial=0))


def line(
    start: Sequence[int],
    end: Sequence[int],
    top: float,
    accel: float,
    *,
    brakes: Array | None = None,
    clock: int = CLOCK,
    min_interval: int = MIN_INTERVAL,
) -> Move:
    """The segments of a straight line in counts, from rest to rest.

    top: [1/s] greatest speed, accel: [1/s^2] greatest acceleration, both in lines. brakes: [counts/s^2] of
    every motor's hold, see `_holds`. The leader's rate must be within the device's: `clock` / `min_interval`.
    """
    first, last = np.asarray(start, dtype=np.int64), np.asarray(end, dtype=np.int64)
    n = int(np.abs(last - first).max(initial=0))
    if n == 0:
        return Move(first, last, (), 0, 0.0)
    low, high = _SHORTEST
    shortest = min(max(low, math.sqrt(4 / (accel * n))), high)
    for coarse in (1, 2, 4, 8):
        ramp = _Trapezoid(n, top * n, accel * n, shortest * coarse)
        segments, total = _cut(ramp, last - first, clock, min_interval)
        if brakes is None or _holds(segments, brakes, clock):
            break
    return Move(first, last, tuple(segments), total, ramp.peak / n)


def cycles_of(segment: Segment) -> int:
    """Clock cycles of a segment, exactly as the device counts them."""
    if segment.add == 0:
        return segment.ticks * segment.interval
    return segment.ticks * segment.interval + int(((np.arange(segment.ticks) * segment.add) >> 8).sum())


def progress(move: Move, cycles: Array) -> Array:
    """How far along its line a move is (0 to 1) after so many clock cycles: (T,) -> (T,)."""
    if not move.segments:
        return np.ones_like(cycles)
    ends = np.cumsum([cycles_of(s) for s in move.segments])
    steps = np.array([max(abs(x) for x in s.steps) for s in move.segments])
    which = np.minimum(np.searchsorted(ends, cycles, side="left"), len(ends) - 1)
    first = np.array([s.interval for s in move.segments], dtype=float)[which]
    slope = np.array([s.add for s in move.segments], dtype=float)[which] / 256
    ticks = np.array([s.ticks for s in move.segments], dtype=float)[which]
    # time of tick j: j first + j (j - 1) / 2 slope; its inverse in the form that slope 0 allows
    b = first - slope / 2
    begin = np.concatenate([[0], ends[:-1]])[which]
    whole = ticks * (b + ticks * slope / 2)  # the device's is up to a cycle a tick shorter
    t = (cycles - begin) * whole / (ends[which] - begin)
    j = 2 * t / (b + np.sqrt(np.maximum(b * b + 2 * slope * t, 0.0)))
    before = np.concatenate([[0], np.cumsum(steps)[:-1]])[which]
    done = before + steps[which] * np.minimum(j / ticks, 1.0)
    return np.asarray(np.minimum(done / steps.sum(), 1.0))


def _holds(segments: list[Segment], brakes: Array, clock: int) -> bool:
    """Whether the queue always holds the way to a stop, as the board sees it.

    To the board a motor with one step in a short segment is fast, however seldom its steps are; so its
    time to a stop, u, may be far above the plan's. It holds when the queued time falls to
    u^2 / (u + e) + u / 32 + 2 ms, e being u at the queue's end (firmware/PROTOCOL.md, section 7).
    """
    if len(segments) <= _AHEAD:
        return True
    ends = np.cumsum([cycles_of(s) for s in segments]) / clock
    steps = np.abs([s.steps for s in segments]) / (brakes / clock)
    ticks = np.array([s.ticks for s in segments])[:, None]
    first, last = (np.array(x)[:, None] for x in zip(*((s.interval, s.last_interval) for s in segments), strict=True))
    begins = np.concatenate([[0.0], ends[:-1]])
    u = (steps / (ticks * first)).max(axis=1)[:-_AHEAD]
    e = (steps / (ticks * last)).max(axis=1)[_AHEAD - 1 : -1]
    queued = ends[_AHEAD - 1 : -1] - begins[:-_AHEAD]
    return bool(np.all(queued > u * u / np.maximum(u + e, 1e-9) + u / 32 + 0.004))


def _cut(ramp: _Trapezoid, span: Counts, clock: int, min_interval: int) -> tuple[list[Segment], int]:
    """A trapezoid's segments and their cycles."""
    n = ramp.n
    segments: list[Segment] = []
    total, carry = 0, 0.0
    bounds = list(ramp.bounds())
    for a, b in pairwise(bounds):
        steps = _rounded(span, b, n) - _rounded(span, a, n)
        exact = (ramp.time(b) - ramp.time(a)) * clock
        ticks, interval, add = _spacing(ramp, a, b, exact + carry, clock, min_interval)
        segments.append(Segment(ticks, interval, add, tuple(int(s) for s in steps)))
        cycles = cycles_of(segments[-1])
        # What rounding took or gave is made up for by the next segment; time lost to a speed limit is not.
        carry = min(exact + carry - cycles, 0.0) if cycles > exact + carry + ticks else exact + carry - cycles
        if ramp.cruising(a, b):
            carry = 0.0
        total += cycles
    return segments, total


@dataclass(frozen=True)
class _Trapezoid:
    """Speed up, cruise, slow down over n leader steps; speeds in steps/s."""

    n: int
    top: float
    accel: float
    shortest: float  # [s] a ramp's segment

    @property
    def peak(self) -> float:
        """Greatest speed that is reached."""
        return min(self.top, math.sqrt(self.accel * self.n))

    @property
    def way(self) -> float:
        """Steps of one ramp."""
        return float(self.peak**2 / (2 * self.accel))

    def time(self, at: float) -> float:
        """Seconds from standstill to step `at`."""
        rise = self.peak / self.accel
        if at <= self.way:
            return math.sqrt(2 * at / self.accel)
        if at < self.n - self.way:
            return rise + (at - self.way) / self.peak
        whole = 2 * rise + (self.n - 2 * self.way) / self.peak
        return whole - math.sqrt(2 * (self.n - at) / self.accel)

    def speed(self, at: float) -> float:
        """Speed [steps/s] at step `at`."""
        return min(self.peak, math.sqrt(2 * self.accel * max(min(at, self.n - at), 0.0)))

    def cruising(self, a: int, b: int) -> bool:
        """Whether a segment has no part of a ramp."""
        return a >= self.way and b <= self.n - self.way

    @property
    def growth(self) -> float:
        """Time at a ramp segment's end over time at its start: the whole ramp is in the queue before it begins."""
        ramp = self.peak / self.accel
        for growth in (_GROWTH, 1.14, 1.17, 1.2, 1.25, 1.3, 1.4):
            geometric = max(ramp * (growth - 1) / self.shortest, 1.0)
            if 1 / (growth - 1) + math.log(geometric) / math.log(growth) <= _RAMP:
                return growth
        return 1.5

    def bounds(self) -> Iterator[int]:
        """Leader steps where segments end: geometric in the ramps, even between them."""
        rise, growth = [0], self.growth
        whole = min(int(self.way), self.n // 2)
        while rise[-1] < whole:
            t = self.time(rise[-1])
            t = max(t * growth, t + self.shortest)
            at = max(int(self.accel * t * t / 2), rise[-1] + 1)
            rise.append(whole if at + (at - rise[-1]) // 2 > whole else at)
        middle = self.n - 2 * whole
        if len(rise) > 1 and 2 * middle < rise[-1] - rise[-2]:
            # Too short for a segment of its own: the way up takes it along.
            yield from (*rise[:-1], whole + middle)
            rise.pop()
        else:
            yield from rise
            longest = max(_CRUISE, (growth - 1) * self.peak / self.accel)
            parts = min(max(1, math.ceil(middle / (self.peak * longest))), middle)
            parts = max(parts, math.ceil(middle / 30_000))
            yield from (whole + middle * i // parts for i in range(1, parts))
            if middle == 0:
                rise.pop()
        yield from (self.n - at for at in reversed(rise))


def _spacing(ramp: _Trapezoid, a: int, b: int, cycles: float, clock: int, min_interval: int) -> tuple[int, int, int]:
    """Ticks, interval and add that take a segment from leader step a to b in about `cycles`."""
    steps = b - a
    over = max(1, int(cycles / (_TICK * steps)))
    if steps <= 127:
        over = min(over, 255 // steps)  # as the short form has it
    over = max(over, math.ceil(1.6 * cycles / (_LONGEST * steps)))
    ticks = over * steps
    if ticks > 65535:
        raise UsageError("this motion is slower than the device can time; choose a higher speed")
    mean = cycles / ticks
    # Intervals at the two ends: right at the faster one, and at the other such that the time is right.
    fast = mean
    inner = (b - a) * 0.2  # a corner of the trapezoid nearer than that to an end changes nothing
    corner = any(a + inner < at < b - inner for at in (ramp.way, ramp.n - ramp.way))
    if not corner and ramp.speed(a) != ramp.speed(b):
        fast = min(clock / (over * max(ramp.speed(a), ramp.speed(b))), mean)
    slow = 2 * mean - fast
    change = fast - slow if ramp.speed(b) > ramp.speed(a) else slow - fast
    add = round(256 * change / ticks)
    interval = round(mean - add * (ticks - 1) / 512 + (0.5 if add else 0.0))
    # Rounding must not make any tick faster than the plan's top speed, nor than the device.
    floor = max(min_interval, math.ceil(clock / (over * ramp.peak) - 1e-9))
    last = (256 * interval + (ticks - 1) * add) >> 8
    interval += max(0, floor - min(interval, last))
    return ticks, interval, add


def _rounded(span: Counts, at: int, n: int) -> Counts:
    """span * at / n rounded half away from zero, in whole numbers."""
    return np.asarray(np.sign(span) * ((2 * np.abs(span) * at + n) // (2 * n)))
