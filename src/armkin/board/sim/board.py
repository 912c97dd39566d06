"""A board in this process that speaks the firmware's bytes: port `sim`, and the tests without hardware.

It is written from firmware/PROTOCOL.md and held to the same golden conversations as the firmware. Time is
simulated: it passes in `advance`, so that a long move takes no longer than its arithmetic.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence

from armkin.board.firmware import protocol
from armkin.board.firmware.protocol import AxisImage, Error, Flag, Image, Info, Segment, State, Status, Type
from armkin.board.sim.frames import RefusedError, axes_of, image_valid
from armkin.board.sim.frames import batch as read_batch
from armkin.board.sim.motors import Motors, within
from armkin.board.sim.rows import Rows, toward
from armkin.board.sim.velocity import Velocity, times_valid
from armkin.hardware import Board

_SILENCE = 0.5  # [s]
_RUNNING = (State.IDLE, State.MOVING)


class SimBoard:
    """One simulated board, powered on.

    `switch`: level of a limit input, given its number and the net steps of all axes since power-on; none is pressed.
    """

    def __init__(self, board: Board, switch: Callable[[int, Sequence[int]], bool] | None = None) -> None:
        self.board = board
        self.abort_level = True  # of the abort input, pulled up
        self.power_level = True  # of the motors' supply
        self.hidden_cause = True
        self._switch = switch or (lambda number, net: not self._guards_closed(number))
        self._boots = 0
        self._retained: tuple[bytes, int, list[int], bool] | None = None
        self._net = [0] * len(board.axes)
        self._out = bytearray()
        self._power_up(cause=0)

    @property
    def net(self) -> list[int]:
        """Net steps of every axis since power-on."""
        moving = [c - b for c, b in zip(self.motors.counts(), self.motors.base, strict=True)]
        return [a + b for a, b in zip(self.motors.net, moving, strict=True)]

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""
        for payload in self._splitter.feed(data):
            self._frame(payload)

    def take(self) -> bytes:
        """Bytes for the host since the last call."""
        out = bytes(self._out)
        self._out.clear()
        return out

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        while seconds > 0:
            step = min(seconds, 0.001)
            seconds -= step
            self._silent += step
            self._sense()
            if self.motors.state in (State.MOVING, State.HOMING) and self._silent >= _SILENCE:
                self._end(Error.SILENCE)
            if self.motors.state != State.IDLE:
                self._watch()
            self.motors.advance(step)

    def reset(self, power: bool = False) -> None:
        """An external reset, or the plug pulled: what stood still is retained, what moved is lost."""
        motors = self.motors
        still = motors.state == State.IDLE
        motors.cut()
        self._net = motors.net
        keep = still and not power
        image = self._image.pack() if self._config else b""
        self._retained = (image, motors.known & ~self.board.servo_mask, motors.base, self._drivers) if keep else None
        self._boots = 0 if power else self._boots
        self._power_up(cause=0 if self.hidden_cause else 1 if power else 2)

    def _power_up(self, cause: int) -> None:
        board = self.board
        self._splitter = protocol.Splitter(board.frame)
        self._error, self._detail, self._next, self._nonce = Error.NO_SESSION, 0, 0, -1
        self._digest = 0
        self._cause, self._boots = cause, self._boots + 1
        n = len(board.axes)
        self._image_bytes = bytearray(12 + 21 * n + (1 + n) * len(board.switches) + (8 + 2 * n) * board.rows)
        self._image = Image(tuple(AxisImage() for _ in board.axes))
        self._config, self._drivers, self._pulses, self._silent = 0, False, False, 0.0
        self._was_retained = False
        self._velocity = Velocity(board, self._image)
        self._rows = Rows(self._image, [])
        self.motors = Motors(len(board.axes), board.clock, board.queue, self._level)
        self.motors.fault = self._end
        self.motors.net = list(self._net)
        if self._retained is not None:
            image, known, counts, self._drivers = self._retained
            if image:
                self._image_bytes[: len(image)] = image
                self._image = self.motors.image = Image.unpack(image, len(board.switches)) or self._image
                self._config = zlib.crc32(image)
            self.motors.known = known
            self.motors.rest_at(counts)
            self._was_retained = True

    def _level(self, number: int) -> bool:
        return self._switch(number, self.net)

    def _sense(self) -> None:
        if self._power_cut():
            self.motors.known = 0

    def _power_cut(self) -> bool:
        return bool(self._config) and self._image.power_sensed and not self.power_level

    def _pressed(self) -> list[int]:
        """Switches that guard and are pressed."""
        if not self._config:
            return []
        guards = enumerate(self._image.guards)
        return [n for n, guard in guards if any(guard.weight) and self._level(n) == guard.closed]

    def _watch(self) -> None:
        """End the session if an input says so."""
        if self._aborted():
            self._end(Error.ABORT)
        if self._power_cut():
            self._end(Error.POWER)
        for n in self._pressed():
            if self.motors.state != State.HOMING and toward(self._image.guards[n], self.motors.velocity()):
                self._end(Error.LIMIT_SWITCH, n)

    def _guards_closed(self, number: int) -> bool:
        """Whether a switch is configured as normally closed: then it is low while nobody presses it."""
        guards = self._image.guards
        return bool(self._config) and number < len(guards) and guards[number].closed

    def _aborted(self) -> bool:
        return bool(self._config) and self.abort_level == self._image.abort_closed

    def _end(self, error: Error, detail: int = 0) -> None:
        """End the session; the first cause stays."""
        if not self._error:
            self._error, self._detail = error, detail
        self.motors.stop()

    # Frames

    def _frame(self, payload: bytes) -> None:
        kind, size = payload[0], len(payload)
        if 0x10 <= kind < 0x80:
            self._silent = 0.0
            self._in_sequence(payload)
        elif kind == Type.HELLO and size == 7:
            self._silent = 0.0
            self._hello(*struct.unpack("<xBBI", payload))
        elif kind == Type.STATUS_QUERY and size == 3:
            self._silent = 0.0
            self._status(payload[1], payload[2])
        elif kind == Type.HOLD and size == 2:
            self._silent = 0.0
            self._end(Error.HELD)
            self._ack()

    def _in_sequence(self, payload: bytes) -> None:
        if not self._error and payload[1] == self._next:
            try:
                self._execute(payload)
                self._next = (self._next + 1) & 255
            except RefusedError as refused:
                self._end(refused.error, refused.detail)
        self._ack()

    def _send(self, payload: bytes) -> None:
        self._out += protocol.wire(payload)

    def _ack(self) -> None:
        m = self.motors
        ack = protocol.Ack(self._next, self._error, self._detail, m.state, m.free, m.queued(), self._digest)
        self._send(protocol.pack_ack(ack))

    def _hello(self, tag: int, version: int, nonce: int) -> None:
        if version != protocol.VERSION:
            self._end(Error.VERSION)
        elif nonce != self._nonce:
            self._end(Error.HELD)
            self._error, self._detail, self._next, self._nonce = Error.OK, 0, 0, nonce
            self._digest = nonce & 0xFFFF
            self._splitter.bad = 0
        b = self.board
        info = Info(
            tag, protocol.VERSION, (2, 0), nonce, b.number, len(b.axes), b.servo_mask, len(b.switches),
            b.rows, b.queue, b.frame, b.receive, b.min_interval, b.clock, self._config,
            self.motors.known, self._flags(), self._boots, self._cause,
        )  # fmt: skip
        self._send(protocol.pack_info(info))

    def _flags(self) -> int:
        pairs = (
            (Flag.DRIVERS, self._drivers),
            (Flag.SERVOS, self._pulses),
            (Flag.CONFIGURED, self._config),
            (Flag.RETAINED, self._was_retained and self.motors.known),
            (Flag.ABORT, self._aborted()),
            (Flag.LATCH, self.motors.latched),
            (Flag.POWER_CUT, self._power_cut()),
        )
        return sum(flag for flag, on in pairs if on)

    def _status(self, tag: int, page: int) -> None:
        m = self.motors
        page = int(page == 1)
        switches = sum(self._level(i) << i for i in range(len(self.board.switches)))
        counts = tuple(m.latch if page else m.counts())
        status = Status(
            tag, self._next, self._error, self._detail, m.state, self._flags(), m.free, m.queued(), m.known,
            switches, 0, min(self._splitter.bad, 255), page, self._digest, counts,
        )  # fmt: skip
        self._send(protocol.pack_status(status))

    def _execute(self, payload: bytes) -> None:
        handlers = {
            Type.CONFIG: self._configure,
            Type.COMMIT: self._commit,
            Type.ENABLE: self._enable,
            Type.SET_POSITION: self._set_position,
            Type.MOTION: self._motion,
            Type.HOME: self._home,
            Type.JOG: self._jog,
        }
        if payload[0] not in handlers:
            raise RefusedError(Error.TYPE)
        handlers[Type(payload[0])](payload)

    def _needs(self, *states: State, config: bool = True, abort: bool = False) -> None:
        if config and not self._config:
            raise RefusedError(Error.CONFIG_NONE)
        if abort and self._aborted():
            raise RefusedError(Error.ABORT)
        if abort and self._power_cut():
            raise RefusedError(Error.POWER)
        if self.motors.state not in states:
            raise RefusedError(Error.BUSY)

    def _configure(self, payload: bytes) -> None:
        if len(payload) < 5:
            raise RefusedError(Error.LENGTH)
        self._needs(State.IDLE, config=False)
        offset, data = struct.unpack_from("<H", payload, 2)[0], payload[4:]
        if offset + len(data) > len(self._image_bytes):
            raise RefusedError(Error.VALUE)
        self._image_bytes[offset : offset + len(data)] = data
        self._config = self.motors.known = 0
        self._drivers = self._pulses = self._was_retained = False

    def _commit(self, payload: bytes) -> None:
        if len(payload) != 8:
            raise RefusedError(Error.LENGTH)
        self._needs(State.IDLE, config=False)
        length, crc = struct.unpack_from("<HI", payload, 2)
        data = bytes(self._image_bytes[:length])
        image = Image.unpack(data, len(self.board.switches))
        if image is None or len(data) != length or zlib.crc32(data) != crc or not image_valid(image, self.board):
            raise RefusedError(Error.CONFIG_BAD)
        self._image = self.motors.image = image
        self._config = crc

    def _enable(self, payload: bytes) -> None:
        if len(payload) != 3:
            raise RefusedError(Error.LENGTH)
        if payload[2] > 3:
            raise RefusedError(Error.VALUE)
        self._needs(State.IDLE)
        self._drivers, self._pulses = bool(payload[2] & 1), bool(payload[2] & 2)
        if not self._drivers:
            self.motors.known &= self.board.servo_mask
        if not self._pulses:
            self.motors.known &= ~self.board.servo_mask

    def _set_position(self, payload: bytes) -> None:
        if len(payload) < 4:
            raise RefusedError(Error.LENGTH)
        axes = axes_of(struct.unpack_from("<H", payload, 2)[0])
        if len(payload) != 4 + 4 * len(axes):
            raise RefusedError(Error.LENGTH)
        if self._config and self._power_cut():
            raise RefusedError(Error.POWER)
        self._needs(State.IDLE)
        counts = dict(zip(axes, struct.unpack_from(f"<{len(axes)}i", payload, 4), strict=True))
        for i, count in counts.items():
            if not self._used(i) or abs(count) > 2**30:
                raise RefusedError(Error.VALUE, i)
            axis = self._image.axes[i]
            if self.board.servo_mask >> i & 1 and not axis.lower <= count <= axis.upper:
                raise RefusedError(Error.VALUE, i)
            if self.motors.known >> i & 1:
                raise RefusedError(Error.KNOWN, i)
        self.motors.place(counts)
        self._was_retained = False

    def _used(self, axis: int) -> bool:
        return axis < len(self._image.axes) and self._image.axes[axis].used

    def _ready(self, axis: int) -> None:
        """Raise unless an axis is used, known and has its drivers or pulses on."""
        if not self._used(axis):
            raise RefusedError(Error.VALUE, axis)
        if not self.motors.known >> axis & 1:
            raise RefusedError(Error.LOST, axis)
        if not (self._pulses if self.board.servo_mask >> axis & 1 else self._drivers):
            raise RefusedError(Error.DISABLED, axis)

    def _motion(self, payload: bytes) -> None:
        batch = read_batch(payload)
        self._needs(*_RUNNING, abort=True)
        plan = list(self.motors.plan)
        for axis, start in zip(batch.axes, batch.start, strict=True):
            self._ready(axis)
            if plan[axis] >> 23 != start:
                raise RefusedError(Error.START, axis)
        if len(batch.segments) > self.motors.free:
            raise RefusedError(Error.CREDIT)
        idle = self.motors.state == State.IDLE
        if idle:
            self._rows = Rows(self._image, self.motors.plan_counts())
        speed = Velocity(self.board, self._image) if idle else self._velocity.copy()
        segments = [self._checked(i, s, batch.axes, plan, speed) for i, s in enumerate(batch.segments)]
        ends = dict(zip(batch.axes, batch.end, strict=True))
        for axis in range(len(plan)):
            if batch.at_rest:
                speed.check_rest(axis)
            if axis in ends and plan[axis] >> 23 != ends[axis]:
                raise RefusedError(Error.END, axis)
        for n in self._pressed() if idle else ():
            if toward(self._image.guards[n], segments[0].rates):
                raise RefusedError(Error.LIMIT_SWITCH, n)
        self._velocity = Velocity(self.board, self._image) if batch.at_rest else speed
        self.motors.append(segments, batch.at_rest)

    def _checked(self, number: int, s: Segment, axes: list[int], plan: list[int], speed: Velocity) -> Segment:
        """A batch's segment with a rate for every axis; moves `plan` to its end."""
        if not times_valid(s, self.board.min_interval):
            raise RefusedError(Error.INTERVAL, number)
        rates, before = [0] * len(plan), [p >> 23 for p in plan]
        given = dict(zip(axes, s.rates, strict=True))
        speed.begin(s)
        for axis in range(len(plan)):
            rate = given.get(axis, 0)
            if rate == -protocol.STEP:
                raise RefusedError(Error.STEPS, axis)
            speed.check(axis, rate)
            rates[axis] = rate
            plan[axis] += s.ticks * rate
            image, after = self._image.axes[axis], plan[axis] >> 23
            if axis in given and not within(image.lower, image.upper, before[axis], after):
                raise RefusedError(Error.LIMIT, axis)
        self._rows.check([p >> 23 for p in plan], self.motors.known)
        return Segment(s.ticks, s.interval, s.add, tuple(rates), s.bend)

    def _rates(self, rate: tuple[int, ...], *, jogging: bool) -> None:
        moving = [i for i, r in enumerate(rate) if r]
        slow = jogging and any(not self.motors.known >> i & 1 for i in moving)
        for i in moving:
            servo = self.board.servo_mask >> i & 1
            if not self._used(i) or (servo and not jogging):
                raise RefusedError(Error.VALUE, i)
            if servo and not self.motors.known >> i & 1:
                raise RefusedError(Error.LOST, i)
            if not (self._pulses if servo else self._drivers):
                raise RefusedError(Error.DISABLED, i)
            most = self._image.axes[i].max_rate
            if abs(rate[i]) > (max(most // 8, 1) if slow else most):
                raise RefusedError(Error.RATE, i)

    def _home(self, payload: bytes) -> None:
        n = len(self.board.axes)
        if len(payload) != 15 + 4 * n:
            raise RefusedError(Error.LENGTH)
        self._needs(State.IDLE, abort=True)
        switch, flags, slow, backoff, travel, time, *rate = struct.unpack_from(f"<BBBIIH{n}i", payload, 2)
        far = backoff > 2**30 or travel > 2**30
        if not any(rate) or switch >= len(self.board.switches) or flags > 1 or not slow or not backoff or far:
            raise RefusedError(Error.VALUE)
        self._rates(tuple(rate), jogging=False)
        self.motors.home(switch, bool(flags), slow / 256, backoff, travel, time / 10, rate)

    def _jog(self, payload: bytes) -> None:
        n = len(self.board.axes)
        if len(payload) != 2 + 4 * n:
            raise RefusedError(Error.LENGTH)
        self._needs(State.IDLE, State.JOGGING, abort=True)
        rate = struct.unpack_from(f"<{n}i", payload, 2)
        self._rates(rate, jogging=True)
        self.motors.jog(list(rate))
