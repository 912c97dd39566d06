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
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.wire.protocol import BLOCK, COARSE_UNIT, FINE_BOUND, HALF, STEP, Segment, nearest_rate

Counts = NDArray[np.int64]

CLOCK_RATE = 16_000_000  # clock rate [1/s] of every board so far
MIN_INTERVAL = 576  # interval [cycles] between ticks that every board makes

_TICK_INTERVALS, _QUICK_TICK_INTERVALS = 1.12, 1.28  # least tick [board's intervals] at a segment's fast end
_TICK_S = 20e-6  # length [s] of a tick, at least, unless a motor steps faster: no edge is farther off than that
_MAX_TICK_S = 55e-6  # length [s] of a tick where a finer one would not fit the rates as well
_ACCEL_FACTOR = 1.014  # factor on its acceleration that a piece has at most; above it its ends' speeds come nearer
_MIN_FACTOR = 0.975  # factor, at least, on that difference of speeds: a few cycles of the interval between pieces
_STEADY_CHANGE = 0.004  # relative change of speed that counts as none
_EVEN_SECONDS = 0.02  # length [s] of a piece of one speed whose intervals grow bit by bit: less changes too fast
_FINE_TICKS = 150  # ticks in which the fastest motor makes a step: more would not be smoother
_MAX_DRIFT = 0.02  # error [steps], at most, that adds up
_WHOLE_TICKS = 8  # ticks a step, up to which a ramp's are as many for each step: a tick is felt
_LONG_STEP = 40  # ticks a step, from where on the ticks need not fit the steps
_MIN_TICKS = 32  # ticks of a segment, at least, where the board can make them
_MAX_INTERVAL = 50_000  # interval [cycles], at most, of a tick; the device takes 65535
_BEND_TICKS, _MIN_BEND = 1000, 20  # ticks, at most, of a segment whose `bend` counts with each; least such bend
_MAX_BEND = 32767  # greatest bend of a segment
_MONOTONE_RATIO = 1.98  # ratio of a parabola's slow end to its fast one, in distances from the mean: from 2 on it turns
_CHOICE_TICKS, _MAX_CHOICES = 32, 12  # ticks of a ramp of which one may go, for whole cycles; at most
_MAX_TICKS = 16_000  # ticks, at most, of a segment: as many as a rate is exact for to a quarter of a step


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
    cycles: int  # cycles of the clock, all segments together
    curve: bool = False
    brake: float = 1.0  # share of the motors' accelerations that a hold takes

    @property
    def moving(self) -> list[int]:
        """Motors that take part: on a line those that end elsewhere, on a curve all."""
        return [k for k in range(len(self.start)) if self.curve or self.start[k] != self.end[k]]


def cycles_of(segment: Segment) -> int:
    """Clock cycles of a segment, exactly as the device counts them."""
    ticks = segment.ticks
    if segment.add == 0:
        return ticks * segment.interval
    grow, block = segment.growth
    blocks = (np.arange(ticks - 1) + block - 1 - (ticks - 1) % block) // block  # counted from the end
    adds = (segment.add * 256 + grow * blocks) >> 8
    return ticks * segment.interval + int((np.cumsum(adds) >> 16).sum())


class Cutter:
    """Cuts a motion from rest: where every motor is, to 2^-23 step, and what rounding has done to the time."""

    def __init__(self, start: Sequence[int], clock: int = CLOCK_RATE, min_interval: int = MIN_INTERVAL) -> None:
        self.clock, self.min_interval = clock, min_interval
        self.places = [int(count) * STEP + HALF for count in start]
        self._aims = list(self.places)  # where the motors should be
        self.late = 0.0  # [cycles] that the segments so far should have lasted longer

    def piece(
        self,
        seconds: float,
        counts: Sequence[float],
        change: float = 0.0,
        drift: float = _MAX_DRIFT,
        make_up: float | None = None,
        unheard: bool = False,
    ) -> Segment:
        """A straight line to `counts` (motors,), fractions included, in so many seconds.

        change: speed at its end less that at its beginning, over the mean: -2 to 2. The speed changes evenly.
        drift: steps that a motor may be off at its end, for the next piece to make up for. make_up: the share of its
        own way by which a motor makes up for the pieces before, at most; None: all. unheard: no motor makes a step in
        it, so that the short form will do.
        """
        aims = [round(c * STEP) + HALF for c in counts]
        owed = self._owed(aims, seconds, make_up)
        ways = [aim - before + x for aim, before, x in zip(aims, self._aims, owed, strict=True)]
        self._aims = aims
        steps = max(map(abs, ways), default=0) / STEP  # steps of the fastest motor
        exact = seconds * self.clock + self.late
        if unheard:
            ticks = self._tick_count(exact, steps)
            segment = Segment(
                ticks, round(exact / ticks), 0, tuple(round(x / ticks / COARSE_UNIT) * COARSE_UNIT for x in ways)
            )
        elif abs(change) < _STEADY_CHANGE:
            segment = self._steady_segment(exact, ways, steps, drift)
        else:
            segment = self._ramp_segment(exact, ways, steps, change)
        segment = self._no_shorter(segment)
        self.places = [p + segment.ticks * r for p, r in zip(self.places, segment.rates, strict=True)]
        # What the shortest interval costs is not made up for.
        self.late = min(exact - cycles_of(segment), float(segment.ticks))
        return segment

    def _owed(self, aims: list[int], seconds: float, make_up: float | None) -> list[int]:
        """How far the motors are behind the pieces before, as much as this one makes up for: see `piece`."""
        owed = [before - place for before, place in zip(self._aims, self.places, strict=True)]
        if make_up is None:
            return owed
        finest = seconds * self.clock / self.min_interval  # one unit a tick: less cannot be said
        most = [finest + make_up * abs(aim - before) for aim, before in zip(aims, self._aims, strict=True)]
        return [round(max(-limit, min(limit, x))) for x, limit in zip(owed, most, strict=True)]

    def _no_shorter(self, segment: Segment) -> Segment:
        """The segment with no interval shorter than the board makes."""
        shortest = self.min_interval + (self.min_interval // 4 if segment.quick else 0)
        lacking = shortest - min(segment.interval, segment.last_interval)
        return replace(segment, interval=segment.interval + lacking) if lacking > 0 else segment

    def _steady_segment(self, exact: float, remainders: Sequence[int], steps: float, drift: float) -> Segment:
        """One speed for `exact` cycles; remainders: (motors,) 2^-23 step, steps: of the fastest."""
        ticks = self._tick_count(exact, steps)
        if ticks > _LONG_STEP * steps or _rounding_drift(ticks, remainders) > drift:
            ticks = _exact_ticks(ticks, remainders)
        interval, add = round(exact / ticks), 0
        if ticks > 1 and exact > _EVEN_SECONDS * self.clock:
            interval, add = _evenly_spread(exact, ticks)
        return Segment(ticks, interval, add, _rounded_rates(remainders, ticks))

    def _ramp_segment(self, exact: float, remainders: Sequence[int], steps: float, change: float) -> Segment:
        """A piece whose speed changes evenly, see `piece`: as many ticks as the board makes, as `bend` has 16 bits."""
        fast = (1 + abs(change) / 2) * self.min_interval
        shortest = exact / (16 * change**2 * exact) ** (1 / 3)  # [cycles] of a tick, for the quick bend to have 16 bits
        ticks = int(exact / max(_QUICK_TICK_INTERVALS * fast, min(_TICK_S * self.clock, shortest)))
        bend = abs(_fit_parabola(exact, ticks, change, True)[2]) if ticks > 1 and steps <= ticks <= _BEND_TICKS else 0
        quick = bend >= _MIN_BEND
        if not quick:
            fewer, ticks = ticks, int(exact / max(_TICK_INTERVALS * fast, _TICK_S * self.clock, exact / _MAX_TICKS))
            is_few = ticks > 1 and steps <= _BEND_TICKS < fewer
            if is_few and abs(_fit_parabola(exact, ticks, change, False)[2]) == _MAX_BEND:
                quick, ticks = True, _BEND_TICKS  # else it would end faster than the board loads the next one
        ticks = max(1, ticks, math.ceil(steps), math.ceil(exact / _MAX_INTERVAL))
        ratio = (2 + abs(change)) / (2 - abs(change))
        above = 0.53 * (ratio - 1) ** 2 + (0 if quick else 1.5 * BLOCK / ticks * abs(change))
        change *= max(_MIN_FACTOR, min(1.0, _ACCEL_FACTOR / (1 + above)))
        if steps >= 4 and (over := int(ticks / steps)) <= _WHOLE_TICKS:
            ticks = max(round(over * steps), math.ceil(steps))
        elif ticks > _CHOICE_TICKS:
            spread = range(ticks - min(ticks // _CHOICE_TICKS, _MAX_CHOICES), ticks + 1)
            ticks = min(spread, key=lambda t: _fit_parabola(exact, t, change, quick)[3])
        interval, add, bend, _ = _fit_parabola(exact, ticks, change, quick)
        segment = Segment(
            ticks=ticks,
            interval=interval,
            add=add,
            rates=_rounded_rates(remainders, ticks),
            bend=bend,
            quick=quick and bend != 0,
        )
        cycles_left = exact - cycles_of(segment)  # every interval is cut to whole cycles
        return replace(segment, interval=interval + round(cycles_left / ticks))

    def _tick_count(self, cycles: float, steps: float) -> int:
        """How many ticks a piece of one speed has: whole ones for each step of its fastest motor, if it makes many."""
        least = max(_TICK_INTERVALS * self.min_interval, _TICK_S * self.clock)
        step_cycles = cycles / steps if steps > 1e-9 else math.inf  # cycles a step
        tick = max(least, min(step_cycles / _FINE_TICKS, cycles / _MIN_TICKS, _MAX_INTERVAL / 2), cycles / _MAX_TICKS)
        over = int(step_cycles / tick) if step_cycles < math.inf else 0
        if 1 <= over <= _FINE_TICKS:
            exact = over if over > _LONG_STEP else 1 << over.bit_length() - 1  # a power of two: a rate without rounding
            tick = step_cycles / (exact if step_cycles / exact <= _MAX_TICK_S * self.clock else over)
        elif over == 0 and step_cycles < math.inf:
            tick = step_cycles
        return max(1, math.ceil(cycles / _MAX_INTERVAL), round(cycles / tick))


def _rounded_rates(remainders: Sequence[int], ticks: int) -> tuple[int, ...]:
    return tuple(nearest_rate(x / ticks) for x in remainders)


def _rounding_drift(ticks: int, remainders: Sequence[int]) -> float:
    """How far the rounding of rates leaves the motors from their places [steps]."""
    return max(abs(x - ticks * nearest_rate(x / ticks)) for x in remainders) / STEP


def _exact_ticks(ticks: int, remainders: Sequence[int]) -> int:
    """The number of ticks, within 3 % of `ticks`, whose rates come nearest to what is left (motors,).

    A rate has 2^-15 step a tick: over thousands of ticks that is up to a tenth of a step, which a short ramp behind a
    slow cruise would have to make up for.
    """
    near = np.arange(ticks - ticks // 32, ticks + ticks // 32 + 1)
    exact = np.abs(np.array(remainders, dtype=float))[:, None] / near
    rates = np.where(exact < FINE_BOUND - 0.5, np.rint(exact), np.rint(exact / COARSE_UNIT) * COARSE_UNIT)
    drift = np.abs(exact - rates) * near
    return int(near[drift.max(axis=0).argmin()])


def _evenly_spread(cycles: float, ticks: int) -> tuple[int, int]:
    """Interval and `add` of a segment of one speed that lasts so many cycles.

    A whole number of cycles an interval is up to half a cycle a tick off, which the next segment would have to make
    up for: a tenth of a short ramp. The device adds floor(k a), a = add / 65536: over A = a ticks cycles in all the
    mean of that is 1 - 1 / A up to A = 2, and 2 - 3 / A up to 3.
    """
    interval = int(cycles // ticks)
    part = cycles / ticks - interval  # the mean interval is longer by this part of a cycle
    if part * ticks < 1:
        return interval, 0
    return interval, round((1 / (1 - part) if part < 0.5 else 3 / (2 - part)) * 65536 / ticks)


def _fit_parabola(exact: float, ticks: int, change: float, quick: bool) -> tuple[int, int, int, float]:
    """Interval, `add` and `bend` of a segment whose speed changes evenly, see `Cutter.piece`.

    The interval is 1 / v(t). The parabola over the ticks that has its ends and its integral has its slope, too, to
    0.53 (r - 1)^2 of it, r being the ratio of the speeds: to 2 % up to 1.2. Fourth: what rounding has cost, in quarters
    of a cycle and percents of the bend.
    """
    mean = exact / ticks
    fast, slow = mean / (1 + abs(change) / 2), mean / (1 - abs(change) / 2)  # intervals at its ends
    slow = min(slow, mean + _MONOTONE_RATIO * (mean - fast))
    a, b = (slow, fast) if change > 0 else (fast, slow)
    curve = 3 * (a + b) - 6 * mean
    span = (b - a) * (ticks - 1) / ticks  # span from the first interval's middle to the last one's
    unit, block = (17, 1) if quick else (22, BLOCK)
    exact_bend = 2 * curve / ticks**2 * block * 2**unit
    bend = max(-_MAX_BEND, min(_MAX_BEND, round(exact_bend)))
    add = (span - bend * _bend_count(ticks, quick) / 2**unit) / max(ticks - 1, 1) * 65536
    if (bend and add * (add + bend * ((ticks - 1) // block) / 2 ** (unit - 16)) <= 0) or abs(add) < 0.5:
        bend, add = 0, span / max(ticks - 1, 1) * 65536
    second = bend / 2**unit / block
    first = mean - (ticks - 1) * (add / 131072 + second * (ticks - 2) / 6) + 0.5  # each is cut to whole cycles
    cost = abs(first - round(first)) * 4 + abs(bend / exact_bend - 1) * 100
    return round(first), round(add), bend, cost


def _bend_count(ticks: int, quick: bool) -> int:
    """How often `bend` counts in a segment's last interval."""
    if quick:
        return (ticks - 1) * (ticks - 2) // 2
    blocks, ticks_left = divmod(max(0, ticks - 2 - (ticks - 1) % BLOCK), BLOCK)
    return (BLOCK // 2 * blocks + ticks_left) * (blocks + 1)


def speed_change(begin: float, end: float) -> float:
    """`Cutter.piece`'s change of speed, from `begin` to `end`; next to rest a piece has one speed."""
    if min(begin, end) <= (begin + end) / 8:
        return 0.0
    return max(-1.0, min(1.0, 2 * (end - begin) / (begin + end)))
