"""Motion in counts as exact device segments (firmware/PROTOCOL.md, section 6).

    counts over time  --pieces of constant acceleration-->  segments {ticks, interval, add, bend, rates[]}

A segment is a straight line in counts. It may end at a fraction of a step, from which the next segment goes on;
`Cutter` tracks the motors as the device does, so that no step is early or late at the end of a segment. The interval
between ticks is a parabola in the number of ticks, which approximates 1 / (v + a t) to second order: with a change of
speed of 13 % over a segment, the acceleration is right to 2 %.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.wire.protocol import BLOCK, COARSE_UNIT, FINE_BOUND, HALF, STEP, Segment, nearest_rate

Counts = NDArray[np.int64]

CLOCK_RATE = 16_000_000  # clock rate [1/s] of every board so far
MIN_INTERVAL = 576  # shortest interval [cycles] between ticks that every board makes

_TICK_INTERVALS, _QUICK_TICK_INTERVALS = 1.12, 1.28  # shortest tick [board's intervals] at a segment's fast end
_TICK_S = 20e-6  # shortest tick [s], which bounds the timing error of a step, unless a motor steps faster
_MAX_TICK_S = 55e-6  # longest tick [s] that may be chosen because rates fit it better
_ACCEL_FACTOR = 1.014  # largest factor on the acceleration of a piece; above it the change of speed is reduced
_MIN_FACTOR = 0.975  # smallest such reduction: pieces then differ by a few cycles of interval
_STEADY_CHANGE = 0.004  # relative change of speed below which a piece has constant speed
_EVEN_SECONDS = 0.02  # shortest piece [s] of constant speed whose intervals may grow
_FINE_TICKS = 150  # most ticks per step of the fastest motor
_MAX_DRIFT = 0.02  # largest error [steps] left to the next piece
_WHOLE_TICKS = 8  # up to so many ticks a step, a ramp has the same number for each step
_LONG_STEP = 40  # with more ticks a step than this, ticks need not divide the steps
_MIN_TICKS = 32  # fewest ticks of a segment, if the board is fast enough
_MAX_INTERVAL = 50_000  # longest interval [cycles]; the device takes 65535
_BEND_TICKS, _MIN_BEND = 1000, 20  # most ticks of a segment whose `bend` counts at each tick; smallest such bend
_MAX_BEND = 32767  # greatest bend of a segment
_MONOTONE_RATIO = 1.98  # largest ratio of a parabola's ends, from the mean: it is monotone below 2
_CHOICE_TICKS, _MAX_CHOICES = 32, 12  # a ramp may lose one of so many ticks for whole cycles; at most so many
_MAX_TICKS = 16_000  # most ticks of a segment: rates are then exact to a quarter of a step


class Segments(Protocol):
    """Segments in order, which can be iterated more than once."""

    def __iter__(self) -> Iterator[Segment]: ...

    def __len__(self) -> int: ...


@dataclass(frozen=True)
class Move:
    """A motion from rest to rest."""

    start: Counts  # (motors,)
    end: Counts  # (motors,)
    segments: Segments
    cycles: int  # clock cycles of all segments
    curve: bool = False
    brake: float = 1.0  # share of the motors' accelerations that a hold uses

    @property
    def moving_motors(self) -> list[int]:
        """The motors that take part: on a line those that move, on a curve all."""
        return [motor for motor in range(len(self.start)) if self.curve or self.start[motor] != self.end[motor]]


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
    """Cuts a motion from rest into segments; tracks every motor to 2^-23 step, and the rounding error of time."""

    def __init__(self, start: Sequence[int], clock: int = CLOCK_RATE, min_interval: int = MIN_INTERVAL) -> None:
        self.clock, self.min_interval = clock, min_interval
        self.places = [int(count) * STEP + HALF for count in start]
        self._aims = list(self.places)  # where the motors should be without rounding
        self.late = 0.0  # [cycles] by which the segments so far are too short

    def piece(
        self,
        seconds: float,
        counts: Sequence[float],
        change: float = 0.0,
        drift: float = _MAX_DRIFT,
        make_up: float | None = None,
        unheard: bool = False,
    ) -> Segment:
        """The segment of a straight line to `counts` (motors,), which may be fractional, in the given time.

        change: the difference of the speeds at end and beginning, divided by the mean: -2 to 2; it is linear in time.
        drift: steps that a motor may be off at the end, which the next piece corrects. make_up: the most that a motor
        corrects of earlier pieces, as a share of its own travel; None: all. unheard: no motor makes a step in it, so
        that the short form is enough.
        """
        aims = [round(count * STEP) + HALF for count in counts]
        corrections = self._owed_errors(aims, seconds, make_up)
        travels = [aim - last_aim + x for aim, last_aim, x in zip(aims, self._aims, corrections, strict=True)]
        self._aims = aims
        steps = max(map(abs, travels), default=0) / STEP  # steps of the fastest motor
        cycles = seconds * self.clock + self.late
        if unheard:
            ticks = self._tick_count(cycles, steps)
            segment = Segment(
                ticks, round(cycles / ticks), 0, tuple(round(x / ticks / COARSE_UNIT) * COARSE_UNIT for x in travels)
            )
        elif abs(change) < _STEADY_CHANGE:
            segment = self._steady_segment(cycles, travels, steps, drift)
        else:
            segment = self._ramp_segment(cycles, travels, steps, change)
        segment = self._no_shorter(segment)
        self.places = [place + segment.ticks * rate for place, rate in zip(self.places, segment.rates, strict=True)]
        # Time lost to the shortest interval is not corrected later.
        self.late = min(cycles - cycles_of(segment), float(segment.ticks))
        return segment

    def _owed_errors(self, aims: list[int], seconds: float, make_up: float | None) -> list[int]:
        """The errors of earlier pieces that this one corrects, see `piece`: (motors,) [2^-23 step]."""
        errors = [last_aim - place for last_aim, place in zip(self._aims, self.places, strict=True)]
        if make_up is None:
            return errors
        unit = seconds * self.clock / self.min_interval  # one unit a tick is the resolution
        limits = [unit + make_up * abs(aim - last_aim) for aim, last_aim in zip(aims, self._aims, strict=True)]
        return [round(max(-limit, min(limit, x))) for x, limit in zip(errors, limits, strict=True)]

    def _no_shorter(self, segment: Segment) -> Segment:
        """The segment with all intervals at least as long as the board needs."""
        shortest = self.min_interval + (self.min_interval // 4 if segment.quick else 0)
        shortage = shortest - min(segment.interval, segment.last_interval)
        return replace(segment, interval=segment.interval + shortage) if shortage > 0 else segment

    def _steady_segment(self, cycles: float, remainders: Sequence[int], steps: float, drift: float) -> Segment:
        """A segment of one speed for `cycles`; remainders: (motors,) [2^-23 step]; steps: of the fastest motor."""
        ticks = self._tick_count(cycles, steps)
        if ticks > _LONG_STEP * steps or _rounding_drift(ticks, remainders) > drift:
            ticks = _exact_ticks(ticks, remainders)
        interval, add = round(cycles / ticks), 0
        if ticks > 1 and cycles > _EVEN_SECONDS * self.clock:
            interval, add = _evenly_spread(cycles, ticks)
        return Segment(ticks, interval, add, _rounded_rates(remainders, ticks))

    def _ramp_segment(self, cycles: float, remainders: Sequence[int], steps: float, change: float) -> Segment:
        """A segment whose speed changes linearly, see `piece`, with the most ticks that board and `bend` allow."""
        fastest_tick = (1 + abs(change) / 2) * self.min_interval
        # [cycles] of a tick, for the quick bend to have 16 bits
        shortest = cycles / (16 * change**2 * cycles) ** (1 / 3)
        ticks = int(cycles / max(_QUICK_TICK_INTERVALS * fastest_tick, min(_TICK_S * self.clock, shortest)))
        bend = abs(_fit_parabola(cycles, ticks, change, True)[2]) if ticks > 1 and steps <= ticks <= _BEND_TICKS else 0
        quick = bend >= _MIN_BEND
        if not quick:
            fine_ticks = ticks
            ticks = int(cycles / max(_TICK_INTERVALS * fastest_tick, _TICK_S * self.clock, cycles / _MAX_TICKS))
            is_few = ticks > 1 and steps <= _BEND_TICKS < fine_ticks
            if is_few and abs(_fit_parabola(cycles, ticks, change, False)[2]) == _MAX_BEND:
                quick, ticks = True, _BEND_TICKS  # else the segment would end before the board has loaded the next one
        ticks = max(1, ticks, math.ceil(steps), math.ceil(cycles / _MAX_INTERVAL))
        ratio = (2 + abs(change)) / (2 - abs(change))
        excess = 0.53 * (ratio - 1) ** 2 + (0 if quick else 1.5 * BLOCK / ticks * abs(change))
        change *= max(_MIN_FACTOR, min(1.0, _ACCEL_FACTOR / (1 + excess)))
        if steps >= 4 and (ticks_per_step := int(ticks / steps)) <= _WHOLE_TICKS:
            ticks = max(round(ticks_per_step * steps), math.ceil(steps))
        elif ticks > _CHOICE_TICKS:
            choices = range(ticks - min(ticks // _CHOICE_TICKS, _MAX_CHOICES), ticks + 1)
            ticks = min(choices, key=lambda t: _fit_parabola(cycles, t, change, quick)[3])
        interval, add, bend, _ = _fit_parabola(cycles, ticks, change, quick)
        segment = Segment(
            ticks=ticks,
            interval=interval,
            add=add,
            rates=_rounded_rates(remainders, ticks),
            bend=bend,
            quick=quick and bend != 0,
        )
        cycles_left = cycles - cycles_of(segment)  # intervals are truncated to whole cycles
        return replace(segment, interval=interval + round(cycles_left / ticks))

    def _tick_count(self, cycles: float, steps: float) -> int:
        """The number of ticks of a piece of one speed, a multiple of the fastest motor's steps if it makes many."""
        floor = max(_TICK_INTERVALS * self.min_interval, _TICK_S * self.clock)
        step_cycles = cycles / steps if steps > 1e-9 else math.inf  # cycles a step
        tick = max(floor, min(step_cycles / _FINE_TICKS, cycles / _MIN_TICKS, _MAX_INTERVAL / 2), cycles / _MAX_TICKS)
        ticks_per_step = int(step_cycles / tick) if step_cycles < math.inf else 0
        if 1 <= ticks_per_step <= _FINE_TICKS:
            # a power of two: a rate without rounding
            divisor = ticks_per_step if ticks_per_step > _LONG_STEP else 1 << ticks_per_step.bit_length() - 1
            tick = step_cycles / (divisor if step_cycles / divisor <= _MAX_TICK_S * self.clock else ticks_per_step)
        elif ticks_per_step == 0 and step_cycles < math.inf:
            tick = step_cycles
        return max(1, math.ceil(cycles / _MAX_INTERVAL), round(cycles / tick))


def _rounded_rates(remainders: Sequence[int], ticks: int) -> tuple[int, ...]:
    return tuple(nearest_rate(x / ticks) for x in remainders)


def _rounding_drift(ticks: int, remainders: Sequence[int]) -> float:
    """The largest position error of a motor from rounded rates [steps]."""
    return max(abs(x - ticks * nearest_rate(x / ticks)) for x in remainders) / STEP


def _exact_ticks(ticks: int, remainders: Sequence[int]) -> int:
    """The number of ticks, within 3 % of `ticks`, at which the rounded rates come nearest to the remainders (motors,).

    A rate has a resolution of 2^-15 step a tick. Over thousands of ticks that makes up to a tenth of a step, which a
    short ramp behind a slow cruise would have to correct.
    """
    candidates = np.arange(ticks - ticks // 32, ticks + ticks // 32 + 1)
    exact = np.abs(np.array(remainders, dtype=float))[:, None] / candidates
    rates = np.where(exact < FINE_BOUND - 0.5, np.rint(exact), np.rint(exact / COARSE_UNIT) * COARSE_UNIT)
    drift = np.abs(exact - rates) * candidates
    return int(candidates[drift.max(axis=0).argmin()])


def _evenly_spread(cycles: float, ticks: int) -> tuple[int, int]:
    """Interval and `add` of a segment of one speed that lasts `cycles`.

    An interval of whole cycles is wrong by up to half a cycle a tick, which the next segment would have to correct: a
    tenth of a short ramp. The device adds floor(k a) to interval k, with a = add / 65536. For A = a ticks the mean of
    that is 1 - 1 / A up to A = 2, and 2 - 3 / A up to A = 3.
    """
    interval = int(cycles // ticks)
    part = cycles / ticks - interval  # the mean interval is longer by this part of a cycle
    if part * ticks < 1:
        return interval, 0
    return interval, round((1 / (1 - part) if part < 0.5 else 3 / (2 - part)) * 65536 / ticks)


def _fit_parabola(cycles: float, ticks: int, change: float, quick: bool) -> tuple[int, int, int, float]:
    """Interval, `add` and `bend` of a segment whose speed changes linearly, see `Cutter.piece`, and the rounding cost.

    The interval is 1 / v(t). A parabola over the ticks with the same ends and integral has nearly the same slope, with
    an error of 0.53 (r - 1)^2 for a ratio r of the speeds: 2 % at r = 1.2. The cost of rounding is the sum of quarters
    of a cycle and percents of the bend.
    """
    mean = cycles / ticks
    fast_interval, slow_interval = mean / (1 + abs(change) / 2), mean / (1 - abs(change) / 2)  # intervals at its ends
    slow_interval = min(slow_interval, mean + _MONOTONE_RATIO * (mean - fast_interval))
    a, b = (slow_interval, fast_interval) if change > 0 else (fast_interval, slow_interval)
    curve = 3 * (a + b) - 6 * mean
    span = (b - a) * (ticks - 1) / ticks  # span from the first interval's middle to the last one's
    unit, block = (17, 1) if quick else (22, BLOCK)
    exact_bend = 2 * curve / ticks**2 * block * 2**unit
    bend = max(-_MAX_BEND, min(_MAX_BEND, round(exact_bend)))
    add = (span - bend * _bend_count(ticks, quick) / 2**unit) / max(ticks - 1, 1) * 65536
    if (bend and add * (add + bend * ((ticks - 1) // block) / 2 ** (unit - 16)) <= 0) or abs(add) < 0.5:
        bend, add = 0, span / max(ticks - 1, 1) * 65536
    second = bend / 2**unit / block
    first = mean - (ticks - 1) * (add / 131072 + second * (ticks - 2) / 6) + 0.5  # the device truncates to whole cycles
    cost = abs(first - round(first)) * 4 + abs(bend / exact_bend - 1) * 100
    return round(first), round(add), bend, cost


def _bend_count(ticks: int, quick: bool) -> int:
    """How many times `bend` is added up to a segment's last interval."""
    if quick:
        return (ticks - 1) * (ticks - 2) // 2
    blocks, ticks_left = divmod(max(0, ticks - 2 - (ticks - 1) % BLOCK), BLOCK)
    return (BLOCK // 2 * blocks + ticks_left) * (blocks + 1)


def speed_change(begin: float, end: float) -> float:
    """The relative change of speed for `Cutter.piece` from `begin` to `end`; 0 next to rest, for constant speed."""
    if min(begin, end) <= (begin + end) / 8:
        return 0.0
    return max(-1.0, min(1.0, 2 * (end - begin) / (begin + end)))
