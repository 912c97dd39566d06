"""The simulated board's checks of RATE and ACCEL in integers (firmware/PROTOCOL.md, section 6)."""

from __future__ import annotations

from typing import NamedTuple

from armkin.board.firmware.wire.protocol import Error, Image, Segment
from armkin.board.sim.frame_fields import RefusedError
from armkin.board_catalogue import Board

_MAX_UINT16 = 0xFFFF
_MAX_CHANGE = 1 << 23  # budget of a window from which on the acceleration is not checked


def times_valid(segment: Segment, min_interval: int) -> bool:
    """Whether all intervals of a segment, and the one after its end, are within `min_interval` and 65535 cycles.

    The least interval of a quick segment is 5/4 of `min_interval`.
    """
    min_interval += min_interval // 4 if segment.quick else 0
    max_ticks = 1 << (10 if segment.quick else 14)  # of a segment with a bend
    if segment.ticks == 0 or segment.interval < min_interval or (segment.bend and segment.ticks > max_ticks):
        return False
    turns = segment.add * segment.last_add < 0 if segment.add else segment.bend != 0
    return (
        not turns
        and abs(segment.last_add + 0.5) < 1 << 23
        and min_interval <= segment.last_interval <= 65535
        and segment.interval_after(segment.ticks) <= 65535
    )


class Pace(NamedTuple):
    """The timing of a segment, common to all axes; all 0: a rest as long as the segment beside it."""

    first: int = 0  # reciprocal of the interval
    last: int = 0
    time: int = 0  # 2^-16 of 50 ms, at most 50 ms
    windows: int = 0  # windows of a longer time: 2^-8 of 50 ms; else 0


def _quarter_velocity(start: int, end: int, windows: int) -> int:
    """A quarter of the velocity in a segment's middle; of a longer one than 50 ms, 25 ms from its end `start`."""
    half_start = start >> 1
    change = (end >> 1) - half_start
    if not windows:
        return (half_start + (change >> 1)) >> 1
    part = (1 << 23) // windows
    return (half_start + (change >> 16) * part + ((change & _MAX_UINT16) * part >> 16)) >> 1


class Velocity:
    """Every axis's velocities in the plan's last segment, and its use beyond the budget; at rest in the beginning."""

    def __init__(self, board: Board, image: Image) -> None:
        self.board, self.image = board, image
        self._bits = 23 if board.min_interval > 128 else 22  # velocities are in 2^-15 of 2^-bits steps a cycle
        self._last_pace, self._pace = Pace(), Pace()
        self._last_ends = [(0, 0, 0)] * len(image.axes)  # values at both ends of the last segment, and its rate
        self._excess = [(0, 0)] * len(image.axes)  # up, down; a quarter of a velocity

    def copy(self) -> Velocity:
        """A copy of these velocities, to go on from."""
        copied = Velocity(self.board, self.image)
        copied._last_ends, copied._excess = list(self._last_ends), list(self._excess)
        copied._last_pace, copied._pace = self._last_pace, self._pace
        return copied

    def begin(self, segment: Segment) -> None:
        """Begin a segment whose intervals have been checked."""
        part = self.board.clock // 20
        cycles, time, windows = segment.ticks * ((segment.interval + segment.last_interval) >> 1), _MAX_UINT16, 0
        if cycles < part:
            time = (cycles >> 4) * ((1 << 35) // part) >> 15
        else:
            window = (1 << 32) // part
            windows = min(((cycles >> 16) * window >> 8) + ((cycles >> 8 & 255) * window >> 16), _MAX_UINT16)
        pace = Pace((1 << self._bits) // segment.interval, (1 << self._bits) // segment.last_interval, time, windows)
        self._last_pace, self._pace = self._pace if self._pace.time else Pace(time=time), pace

    def check(self, axis: int, rate: int) -> None:
        """Raise RefusedError if an axis of the segment is too fast or changes its velocity too much."""
        image, size, sign = self.image.axes[axis], abs(rate) >> 8, 1 if rate >= 0 else -1
        first, last = sign * size * self._pace.first, sign * size * self._pace.last
        if max(abs(first), abs(last)) > min(int(image.max_rate * self._time_unit), 2**31 - 1):
            raise RefusedError(Error.RATE, axis)
        self._accelerate(axis, first, last, rate)
        self._last_ends[axis] = first, last, rate

    def check_rest(self, axis: int) -> None:
        """Raise RefusedError if an axis is too fast to rest now."""
        at_rest = self.copy()
        at_rest._last_pace, at_rest._pace = self._pace, Pace(time=self._pace.time)
        at_rest._accelerate(axis, 0, 0, 0)

    @property
    def _time_unit(self) -> float:
        return float((1 << 15 + self._bits) / self.board.clock)

    def _budget(self, axis: int, time: int) -> int:
        """The velocity change of 5/4 max_accel in a time; _MAX_CHANGE: not checked."""
        step = min(int(self.image.axes[axis].max_accel * 5 / 4 * 0.05 / 256 * self._time_unit), _MAX_CHANGE - 1) + 1
        low, high = step & _MAX_UINT16, step >> 16
        return (low * time >> 8) + (high * time << 8) if step < _MAX_CHANGE else _MAX_CHANGE << 16

    def _accelerate(self, axis: int, first: int, last: int, rate: int) -> None:
        """See firmware/src/core/batch.c."""
        (start, last_end, last_rate), last_pace, pace = self._last_ends[axis], self._last_pace, self._pace
        budget = self._budget(axis, (last_pace.time >> 1) + (pace.time >> 1))
        if budget == _MAX_CHANGE << 16 or not (last_rate or rate):
            self._excess[axis] = (0, 0)
            return
        four_intervals = 4 * ((1 << self._bits) // self.board.min_interval)
        slack = four_intervals + ((abs(last_end) + abs(last)) >> 2 * self._bits - 37)
        change = abs(last - first)
        if pace.windows:
            bends = pace.windows < _MAX_UINT16 and change >> 8 > self._budget(axis, pace.windows)
        else:
            bends = change > self._budget(axis, pace.time) + slack
        if bends or abs(first - last_end) > budget + slack:
            raise RefusedError(Error.ACCEL, axis)
        growth = _quarter_velocity(first, last, pace.windows) - _quarter_velocity(last_end, start, last_pace.windows)
        excess = (0, 0) if last_pace.windows else self._excess[axis]
        excess_up = max(0, excess[0] + growth - (budget >> 2))
        excess_down = max(0, excess[1] - growth - (budget >> 2))
        self._excess[axis] = excess_up, excess_down
        if max(excess_up, excess_down) > slack >> 2:
            raise RefusedError(Error.ACCEL, axis)
