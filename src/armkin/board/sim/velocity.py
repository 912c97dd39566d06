"""What the simulated board thinks of speeds: RATE and ACCEL of firmware/PROTOCOL.md, section 6, in its integers."""

from __future__ import annotations

from armkin.board.firmware.protocol import Error, Image, Segment
from armkin.board.sim.frames import RefusedError
from armkin.board_kinds import Board

_ALL = 0xFFFF
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
    """Every axis's velocity at the end of the plan, and what it has taken of its accelerations; at rest when made."""

    def __init__(self, board: Board, image: Image) -> None:
        self.board, self.image = board, image
        self._bits = 23 if board.min_interval > 128 else 22  # velocities are in 2^-15 of 2^-bits steps a cycle
        self.at = [0] * len(image.axes)
        self._taken: list[tuple[int, int] | None] = [None] * len(image.axes)  # up and down; None: it stands
        self._before = 0  # the last segment's time, 2^-16 of 50 ms

    def copy(self) -> Velocity:
        """The same, to go on from."""
        other = Velocity(self.board, self.image)
        other.at, other._taken, other._before = list(self.at), list(self._taken), self._before
        return other

    def begin(self, s: Segment) -> None:
        """Take up a segment, whose intervals have been checked."""
        part = self.board.clock // 20
        cycles = s.ticks * ((s.interval + s.last_interval) >> 1)
        self._windows = 0
        self._time = (cycles >> 5) * ((1 << 35) // part) >> 14
        if cycles >= part:
            window = (1 << 32) // part
            self._time = _ALL
            self._windows = min(((cycles >> 16) * window >> 8) + ((cycles >> 8 & 255) * window >> 16), _ALL)
        self._first, self._last = (1 << self._bits) // s.interval, (1 << self._bits) // s.last_interval
        self._before = self._before or self._time

    def check(self, axis: int, rate: int) -> None:
        """Raise RefusedError if an axis of the segment is too fast or changes its velocity too much."""
        image, size, sign = self.image.axes[axis], abs(rate) >> 8, 1 if rate >= 0 else -1
        first, last = sign * size * self._first, sign * size * self._last
        if max(abs(first), abs(last)) > min(int(image.max_rate * self._second), 2**31 - 1):
            raise RefusedError(Error.RATE, axis)
        if self._step(axis) < _UNCHECKED:
            self._accelerate(axis, first, last)
        self.at[axis] = last

    def stand(self, axis: int) -> None:
        """An axis that the batch does not name; raise RefusedError if it was too fast for that."""
        if self.at[axis]:
            self.check(axis, 0)
        else:
            self._taken[axis] = None

    def end(self) -> None:
        """Go on behind a segment, all of whose axes were checked."""
        self._before = self._time

    def check_rest(self, axis: int) -> None:
        """Raise RefusedError if an axis is too fast to rest now."""
        if self.at[axis] and self._step(axis) < _UNCHECKED:
            room = self._budget(axis, self._before) >> 3
            self._jump(axis, 0, (room, room), self._before, self._slack(self.at[axis], 0))

    @property
    def _second(self) -> float:
        return float((1 << 15 + self._bits) / self.board.clock)

    def _slack(self, before: int, after: int) -> int:
        """What rounding may make of two velocities."""
        return 4 * ((1 << self._bits) // self.board.min_interval) + ((abs(before) + abs(after)) >> 2 * self._bits - 37)

    def _step(self, axis: int) -> int:
        a = self.image.axes[axis].max_accel
        return min(int(a * 5 / 4 * 0.05 / 256 * self._second), _UNCHECKED - 1) + 1

    def _budget(self, axis: int, time: int) -> int:
        step = self._step(axis)
        return step * (time >> 8) + (step * (time & 255) >> 8)

    def _accelerate(self, axis: int, first: int, last: int) -> None:
        slack, whole, bend = self._slack(self.at[axis], last), self._budget(axis, self._time), last - first
        if self._windows and bend:
            left = self._left_of_long(axis, abs(bend))
            up, down = (left, whole) if bend > 0 else (whole, left)
            room = up >> 3, down >> 3
        else:
            left = whole + slack - abs(bend)
            room = (whole >> 3) - (bend >> 3), (whole >> 3) + (bend >> 3)
        if left < 0:
            raise RefusedError(Error.ACCEL, axis)
        self._jump(axis, first, room, (self._before >> 1) + (self._time >> 1), slack)

    def _left_of_long(self, axis: int, change: int) -> int:
        """What a change within a segment of more than 50 ms leaves of the budget of 50 ms."""
        if self._windows == _ALL:
            return 0
        left = self._budget(axis, self._windows) - (change >> 8)
        return left * 256 if left < self._step(axis) else self._budget(axis, _ALL)

    def _jump(self, axis: int, to: int, room: tuple[int, int], between: int, slack: int) -> None:
        """A jump to a segment with this room, up and down; see firmware/src/core/batch.c."""
        if abs(to - self.at[axis]) > min(self._budget(axis, between) + slack, 2**31 - 1):
            raise RefusedError(Error.ACCEL, axis)
        rest = -(self._budget(axis, self._before) >> 3)
        change = to - self.at[axis] >> 2
        up, down = self._taken[axis] or (rest, rest)
        up, down = up - room[0] + change, down - room[1] - change
        if max(up, down) > slack >> 2:
            raise RefusedError(Error.ACCEL, axis)
        self._taken[axis] = (max(up, 0) - room[0], max(down, 0) - room[1])
