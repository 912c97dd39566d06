"""What the simulated board thinks of speeds: RATE and ACCEL of firmware/PROTOCOL.md, section 6, in its integers."""

from __future__ import annotations

from armkin.board.firmware.protocol import Error, Image, Segment
from armkin.board.sim.frames import RefusedError
from armkin.board_kinds import Board

_UNCHECKED = 1 << 23  # change in a window from which on an acceleration is not checked


def times_valid(s: Segment, least: int) -> bool:
    """Whether all intervals of a segment, and the one after its end, are within `least` and 65535 cycles; a quick one's
    of 5/4 of `least`."""
    least += least // 4 if s.quick else 0
    if s.ticks == 0 or s.interval < least or (s.bend and s.ticks > 1 << (10 if s.quick else 14)):
        return False
    turns = s.last_add < 0 if s.add > 0 else s.last_add > 0 if s.add < 0 else s.bend != 0
    return (
        not turns
        and abs(s.last_add + 0.5) < 1 << 23
        and least <= s.last_interval <= 65535
        and s.interval_after(s.ticks) <= 65535
    )


class Velocity:
    """Every axis's velocity at the end of the plan; at rest when made."""

    def __init__(self, board: Board, image: Image) -> None:
        self.board, self.image = board, image
        self._bits = 23 if board.min_interval > 128 else 22  # velocities are in 2^-15 of 2^-bits steps a cycle
        self.at = [0] * len(image.axes)
        self.window = 0  # of the last segment: its time in 1/256 of 50 ms, rounded up, at most 255

    def copy(self) -> Velocity:
        """The same, to go on from."""
        other = Velocity(self.board, self.image)
        other.at, other.window = list(self.at), self.window
        return other

    def begin(self, s: Segment) -> None:
        """Take up a segment, whose intervals have been checked."""
        scale = (1 << 32) // (self.board.clock // 20)
        units = s.units()
        self._time = units * scale >> 16 if units < 65536 else ((units >> 8) * scale >> 16) << 8
        self._first, self._last = (1 << self._bits) // s.interval, (1 << self._bits) // s.last_interval
        self._add = s.add != 0
        self._before, self.window = self.window, min(self._time + 1, 255)

    def check(self, axis: int, rate: int) -> None:
        """Raise RefusedError if an axis of the segment is too fast or changes its velocity too much."""
        image, size, sign = self.image.axes[axis], abs(rate) >> 8, 1 if rate >= 0 else -1
        first, last = sign * size * self._first, sign * size * self._last
        if max(abs(first), abs(last)) > min(int(image.max_rate * self._second), 2**31 - 1):
            raise RefusedError(Error.RATE, axis)
        if self._jumps(axis, self.at[axis], first, max(self._before, self.window)):
            raise RefusedError(Error.ACCEL, axis)
        if self._add and self._bends(axis, first, last):
            raise RefusedError(Error.ACCEL, axis)
        self.at[axis] = last

    def check_rest(self, axis: int) -> None:
        """Raise RefusedError if an axis is too fast to rest now."""
        if self._jumps(axis, self.at[axis], 0, self.window):
            raise RefusedError(Error.ACCEL, axis)

    @property
    def _second(self) -> float:
        return float((1 << 15 + self._bits) / self.board.clock)

    def _step(self, axis: int) -> int:
        a = self.image.axes[axis].max_accel
        return min(int(a * 5 / 4 * 0.05 / 256 * self._second), _UNCHECKED - 1) + 1

    def _jumps(self, axis: int, before: int, after: int, window: int) -> bool:
        step, slack = self._step(axis), 4 * ((1 << self._bits) // self.board.min_interval)
        return step < _UNCHECKED and abs(after - before) > step * window + slack

    def _bends(self, axis: int, first: int, last: int) -> bool:
        if self._time < 255:
            return self._jumps(axis, first, last, self.window)
        windows, step = (self._time >> 8) + 1, self._step(axis)
        return windows <= 255 and step < _UNCHECKED and abs(last - first) >> 8 > step * windows
