"""A straight line in counts as segments: ramps in pieces whose speed changes by an eighth, cruises in long ones.

Which pieces: so few that the board's queue always holds the time to a stop, and so many that every step comes when the
time law says, to 60 us or 2 % of its period, from the first to the last.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from armkin.board.firmware.protocol import STEP, Segment
from armkin.board.firmware.segments import CLOCK, MIN_INTERVAL, Counts, Cutter, Move, changing, cycles_of
from armkin.motion.profile import Profile, trapezoid

Ratios = tuple[float, int, float, int]

# Speed at a segment's fast end over that at its slow end: so many with the first ratio from a ramp's top down, then the
# second, wider where there are more than so many of those. All of a ramp fits into the board's queue (32).
_RATIOS = (1.13, 10, 1.2, 17)
_ROUGH = (1.2, 12, 2.0, 0)  # for a line that is too bad for so many
_SHORT = 13  # segments of a ramp of a move that is short
_FIRST = 0.003  # [s] a ramp's first segment at least, and twice what any other lasts at least
_BEFORE_STEP = 0.9  # of the time to its first step: until then no motor tells how it got there
_CRUISE = (0.2, 0.4)  # [s] a cruise segment
_JERK = 0.02  # [s] a segment in which the acceleration changes
_SPLIT = 0.08  # [s] a cruise segment whose end is one of its own
_MOST = (1.02, 1.04)  # of its top rate, that the motor with the most steps makes, and any other; the board takes 1.05
_SPARE = 0.0005  # of a piece's steps, that are left for the next one to make up for
_EAGER = 2000  # segments of a line that are made at once
_AT_ONCE = 512  # bounds of segments that are held, of a longer line


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
        law, span, steps = self.law, self.end - self.start, self._steps
        cutter = Cutter(self.start.tolist(), self.clock, self.min_interval)
        shares = np.where(np.abs(span) == steps, *_MOST) * np.abs(span)
        most = [float(m) for m in shares * law.peak / law.length]  # [counts/s] of every motor
        for times, ending in _on_steps(law, _bounds(law, _ratios(law, steps, self.rough), steps), steps):
            done, speed = law.at(times) / law.length, law.at(times, 1) / law.length
            if ending:
                done[-1] = 1.0
            for k, (a, b) in enumerate(pairwise(times.tolist())):
                change = changing(float(speed[k]), float(speed[k + 1]))
                counts = (self.start + span * done[k + 1]).tolist()
                drift = _SPARE * steps * float(done[k + 1] - done[k])
                yield _slow_enough(cutter, b - a, counts, change, drift, most)
        if [p // STEP for p in cutter.places] != self.end.tolist():
            raise AssertionError("a line's rates do not lead to its end")

    @property
    def _steps(self) -> int:
        return int(np.abs(self.end - self.start).max())

    def __len__(self) -> int:
        return count(self.law, self._steps, self.rough)


def count(law: Profile, steps: int, rough: bool = False) -> int:
    """How many segments a line with this law has; steps: of the motor that makes most."""
    phases = _phases(law, _ratios(law, steps, rough), steps)
    return sum(parts if isinstance(parts, int) else len(parts) for _, _, parts in phases)


def _slow_enough(
    cutter: Cutter, seconds: float, counts: Sequence[float], change: float, drift: float, most: Sequence[float]
) -> Segment:
    """A piece in which no motor exceeds its `most` [counts/s]: where rounding asks for it, it lasts longer.

    A piece of a third of a step has a hundredth of one to make up for; the board checks every motor by itself.
    """
    places = list(cutter.places)
    for _ in range(4):
        one = cutter.piece(seconds, counts, change, drift)
        ticks = cutter.clock / min(one.interval, one.last_interval) / STEP  # a second, over a step
        over = max((abs(r) * ticks / m for r, m in zip(one.rates, most, strict=True) if r), default=0.0)
        if over <= 1.0:
            break
        cutter.places, cutter.late = list(places), 0.0
        seconds *= 1.001 * over
    return one


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


def _ratios(law: Profile, steps: int, rough: bool) -> Ratios:
    """Of a move with a long cruise, whose few segments keep the queue full of time, the fine ones.

    A short move has so few segments that the queue holds all of it, however late the host is.
    """
    if rough:
        return _ROUGH
    if not law.is_trapezoid:
        return _RATIOS
    ramp = law.peak / law.accel
    if law.duration - 2 * ramp >= ramp:
        return _RATIOS
    ratio = (ramp / max(_FIRST, _to_first_step(law, law.accel, steps))) ** (1 / _SHORT)
    return (ratio, _SHORT, ratio, 1) if ratio > _RATIOS[0] else _RATIOS


def _to_first_step(law: Profile, accel: float, steps: int) -> float:
    """Seconds from rest almost to the fastest motor's first step, half of one away."""
    return _BEFORE_STEP / math.sqrt(abs(accel) * steps / law.length)


def _phases(law: Profile, ratios: Ratios, steps: int) -> Iterator[tuple[float, float, int | list[float]]]:
    """A law's phases: begin, end, and into how many segments they are cut evenly, or where else.

    The speed changes by an eighth in each; cruises have long ones. steps: of the motor that makes most.
    """
    ramp = law.peak / max(law.accel, 1e-12)
    for k, (t0, t1) in enumerate(pairwise(law.times.tolist())):
        accel, jerk = float(law.states[k, 2]), float(law.jerk[k])
        if t1 - t0 < 1e-9:
            continue
        if jerk == 0.0 and accel != 0.0:
            yield t0, t1, _ramp(law, t0, t1, accel, ratios, steps)
            continue
        longest = _JERK if jerk else min(max(ramp / 8, _CRUISE[0]), _CRUISE[1])
        parts = math.ceil((t1 - t0) / longest)
        each = (t1 - t0) / parts
        if jerk or each < _SPLIT:
            yield t0, t1, parts
            continue
        if parts > 1:
            yield t0, t1 - each, parts - 1
        yield t1 - each, t1, [t1 - each / 4, t1]  # a short end: what its rates' rounding leaves, the ramp makes up for


def _bounds(law: Profile, ratios: Ratios, steps: int) -> Iterator[float]:
    """When segments end, from 0 on."""
    yield 0.0
    for t0, t1, parts in _phases(law, ratios, steps):
        yield from (t0 + (t1 - t0) * i / parts for i in range(1, parts + 1)) if isinstance(parts, int) else parts


def _ramp(law: Profile, t0: float, t1: float, accel: float, ratios: Ratios, steps: int) -> list[float]:
    """Ends of segments of a phase of constant acceleration: speeds in geometric steps from the slow end."""
    v0, v1 = (float(v) for v in law.at(np.array([t0, t1]), 1))
    if accel < 0:
        v1 = max(0.0, v0 + accel * (t1 - t0))
    low, high = min(v0, v1), max(v0, v1)
    first, many, second, more = ratios
    shortest = _FIRST if more else 5 * _FIRST
    least = max(low, abs(accel) * max(shortest, _to_first_step(law, accel, steps)))
    to_rest = [high / abs(accel)]  # [s] at each speed
    shortest /= 2
    for number in range(many + more):
        slower = min(to_rest[-1] / (first if number < many else second), to_rest[-1] - shortest)
        if slower < least / abs(accel) * 1.02:
            if to_rest[-1] - least / abs(accel) > shortest / 2:
                to_rest.append(least / abs(accel))
            break
        to_rest.append(slower)
    else:
        if more and to_rest[-1] > 2 * least / abs(accel):  # a long ramp: what is left goes into as many, wider ones
            wider = (to_rest[many] * abs(accel) / least) ** (1 / more)
            to_rest[many:] = [to_rest[many] / wider**k for k in range(more + 1)]
    times = sorted(t0 + (t * abs(accel) - v0) / accel for t in to_rest[1:])
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
