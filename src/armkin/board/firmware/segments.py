"""Motion in counts as exact device segments (firmware/PROTOCOL.md, section 6).

    counts over time  --pieces of constant acceleration-->  segments {ticks, interval, add, bend, rates[]}

A segment is a straight line in counts. Its motors are wherever the motion is at its end, to a fraction of a step, and
go on from there: `Cutter` follows them as the device does, so that no step is early or late because a segment ends.
The interval between ticks is a parabola in the number of ticks, 1 / (v + a t) to second order: where the speed changes
by 13 % over a segment, the acceleration is right to 2 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.protocol import BLOCK, COARSE, FINE, HALF, STEP, Segment, nearest_rate

Counts = NDArray[np.int64]

CLOCK = 16_000_000  # [1/s] of every board so far
MIN_INTERVAL = 576  # [cycles] between ticks, that every board makes

_TICK = 1.12  # shortest intervals that a tick lasts at a segment's fast end
_TICK_S = 20e-6  # [s] a tick lasts at least, unless a motor steps faster: no edge is farther off than that
_COARSEST = 55e-6  # [s] of a tick, where a finer one would not fit the rates as well
_STEADY = 0.004  # change of speed that is none
_EVEN = 0.02  # [s] that a piece of one speed lasts whose intervals grow bit by bit: in less that is too great a change
_FINE = 150  # ticks in which the fastest motor makes a step: more would not be smoother
_DRIFT = 0.02  # steps
_SLOW = 40  # ticks a step, from where the ticks need not fit the steps
_FEWEST = 32  # ticks of a segment, where the board can make them
_LONGEST = 50_000  # [cycles] of an interval; the device takes 65535
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

    def piece(self, seconds: float, counts: Sequence[float], change: float = 0.0, drift: float = _DRIFT) -> Segment:
        """A straight line to `counts` (motors,), fractions included, in so many seconds.

        change: speed at its end less that at its beginning, over the mean: -2 to 2. The speed changes evenly.
        drift: steps that a motor may be off at its end, for the next piece to make up for.
        """
        left = [round(c * STEP) + HALF - p for c, p in zip(counts, self.places, strict=True)]
        most = max(map(abs, left), default=0) / STEP  # steps of the fastest motor
        exact = seconds * self.clock + self.late
        if abs(change) < _STEADY:
            change = 0.0
        ticks = self._ticks(exact, most, _TICK * (1 + abs(change) / 2))
        if change == 0.0 and (ticks > _SLOW * most or _drift(ticks, left) > drift):
            ticks = _exact_ticks(ticks, left)
        add, bend = _parabola(exact / ticks, ticks, change)
        interval = round((exact - _added(ticks, add, bend)) / ticks)
        if add == 0 and ticks > 1 and exact > _EVEN * self.clock:
            interval, add = _even(exact, ticks)
        elif rest := exact - ticks * interval - _added(ticks, add, bend):  # what whole cycles an interval leave
            more = add + round(rest * 2 * 65536 / ticks**2)
            add = more if more * add > 0 and (more + (bend * ((ticks - 1) // BLOCK) >> 6)) * more > 0 else add
        segment = Segment(ticks, interval, add, tuple(nearest_rate(x / ticks) for x in left), bend)
        short = self.min_interval - min(segment.interval, segment.last_interval)
        if short > 0:
            segment = Segment(ticks, interval + short, add, segment.rates, bend)
        self.places = [p + ticks * r for p, r in zip(self.places, segment.rates, strict=True)]
        self.late = min(exact - cycles_of(segment), float(ticks))  # what the shortest interval costs is not made up for
        return segment

    def _ticks(self, cycles: float, steps: float, spare: float) -> int:
        """How many ticks a piece has: whole ones for each step of its fastest motor, if it makes many."""
        least = max(spare * self.min_interval, _TICK_S * self.clock)
        each = cycles / steps if steps > 1e-9 else math.inf  # cycles a step
        tick = max(least, min(each / _FINE, cycles / _FEWEST, _LONGEST / 2), cycles / _MOST)
        over = int(each / tick) if each < math.inf else 0
        if 1 <= over <= _FINE:
            exact = over if over > _SLOW else 1 << over.bit_length() - 1  # a power of two: a rate without rounding
            tick = each / (exact if each / exact <= _COARSEST * self.clock else over)
        elif over == 0 and each < math.inf:
            tick = each
        return max(1, math.ceil(cycles / _LONGEST), round(cycles / tick))


def _drift(ticks: int, left: Sequence[int]) -> float:
    """How far the rounding of rates leaves the motors from their places [steps]."""
    return max(abs(x - ticks * nearest_rate(x / ticks)) for x in left) / STEP


def _exact_ticks(ticks: int, left: Sequence[int]) -> int:
    """The number of ticks, within 3 % of `ticks`, whose rates come nearest to what is left (motors,).

    A rate has 2^-15 step a tick: over thousands of ticks that is up to a tenth of a step, which a short ramp behind a
    slow cruise would have to make up for.
    """
    near = np.arange(ticks - ticks // 32, ticks + ticks // 32 + 1)
    exact = np.abs(np.array(left, dtype=float))[:, None] / near
    rates = np.where(exact < FINE - 0.5, np.rint(exact), np.rint(exact / COARSE) * COARSE)
    off = np.abs(exact - rates) * near
    return int(near[off.max(axis=0).argmin()])


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


def changing(begin: float, end: float) -> float:
    """`Cutter.piece`'s change of speed, from `begin` to `end`; next to rest a piece has one speed."""
    if min(begin, end) <= (begin + end) / 8:
        return 0.0
    return max(-1.0, min(1.0, 2 * (end - begin) / (begin + end)))
