"""A board in this process that speaks the firmware's bytes: port `sim`, and the tests without hardware.

It is written from firmware/PROTOCOL.md and held to the same golden conversations as the firmware. Time is
simulated: it passes in `advance`, so that a long move takes no longer than its arithmetic.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Error, Flag, Info, State, Status, Type
from armkin.board.sim.command_frames import Commands
from armkin.board.sim.digital_inputs import Inputs
from armkin.board.sim.frame_fields import RefusedError
from armkin.board.sim.host_settings import Setup
from armkin.board.sim.sim_motors import Motors
from armkin.board_catalogue import Board

_SILENCE_TIMEOUT = 0.5  # time [s] of silence after which the board holds


@dataclass(frozen=True)
class _RetainedState:
    """The state of an arm at rest that survives a reset."""

    image: bytes  # image of the configuration, empty if there was none
    drivers: bool
    known: int
    counts: list[int]


class SimBoard:
    """One simulated board, powered on.

    `switch`: level of a limit input, given its number and the net steps of all axes since power-on; none is pressed.
    """

    def __init__(self, board: Board, switch: Callable[[int, Sequence[int]], bool] | None = None) -> None:
        self.board = board
        self.hidden_cause = True
        self._boots = 0
        self._out = bytearray()
        self.setup = Setup(board)
        self.inputs = Inputs(self.setup, switch and (lambda number: switch(number, self.net)))
        self._power_up(0, [0] * len(board.axes), None)

    @property
    def net(self) -> list[int]:
        """Net steps of every axis since power-on."""
        return self.motors.net()

    def receive(self, received: bytes) -> None:
        """Bytes from the host."""
        for payload in self._splitter.feed(received):
            self._receive_frame(payload)

    def take(self) -> bytes:
        """Bytes for the host since the last call."""
        sent = bytes(self._out)
        self._out.clear()
        return sent

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        while seconds > 0:
            step = min(seconds, 0.001)
            seconds -= step
            self._silent += step
            if self.inputs.power_cut():
                self.motors.axes.known = 0
            if self.motors.state in (State.MOVING, State.HOMING) and self._silent >= _SILENCE_TIMEOUT:
                self._end_session(Error.SILENCE)
            if self.motors.state != State.IDLE:
                self._watch()
            self.motors.advance(step)

    def reset(self, power: bool = False) -> None:
        """Reset the board, or cut its power; positions survive a reset at rest and are lost in motion."""
        motors, setup = self.motors, self.setup
        at_rest = motors.state == State.IDLE
        motors.cut()
        known_axes, counts = motors.axes.known & ~self.board.servo_mask, motors.axes.base
        retained_state = (
            _RetainedState(setup.packed_image(), setup.drivers, known_axes, counts) if at_rest and not power else None
        )
        self._boots = 0 if power else self._boots
        cause = 1 if power else 2
        self._power_up(0 if self.hidden_cause else cause, motors.axes.net, retained_state)

    def _power_up(self, cause: int, net: list[int], retained_state: _RetainedState | None) -> None:
        """The board's state after a reset by a cause; what survives it is `retained`."""
        self._splitter = protocol.Splitter(self.board.frame)
        self._error, self._detail = Error.NO_SESSION, 0
        self._next, self._nonce = 0, -1
        self._digest = 0
        self._cause, self._boots, self._silent = cause, self._boots + 1, 0.0
        self.setup.reset()
        self.motors = Motors(self.setup, self.inputs.level, self._end_session)
        self.motors.axes.net = list(net)
        if retained_state is not None:
            self.setup.retain(retained_state.image, retained_state.drivers)
            self.motors.axes.known = retained_state.known
            self.motors.rest_at(retained_state.counts)
        self._commands = Commands(self.setup, self.inputs, self.motors)

    def _watch(self) -> None:
        """End the session if an input demands it."""
        if self.inputs.is_aborted():
            self._end_session(Error.ABORT)
        if self.inputs.power_cut():
            self._end_session(Error.POWER)
        if self.motors.state != State.HOMING:
            switch = self.inputs.switch_ahead(self.motors.velocity())
            if switch is not None:
                self._end_session(Error.LIMIT_SWITCH, switch)

    def _end_session(self, error: Error, detail: int = 0) -> None:
        """End the session; its first error is kept."""
        if not self._error:
            self._error, self._detail = error, detail
        self.motors.stop(wholly=error == Error.LIMIT_SWITCH)

    # Frames

    def _receive_frame(self, payload: bytes) -> None:
        kind, size = payload[0], len(payload)
        if 0x10 <= kind < 0x80:
            self._silent = 0.0
            self._in_sequence(payload)
        elif kind == Type.HELLO and size == 7:
            self._silent = 0.0
            self._answer_hello(*struct.unpack("<xBBI", payload))
        elif kind == Type.STATUS_QUERY and size == 3:
            self._silent = 0.0
            self._send_status(payload[1], payload[2])
        elif kind == Type.HOLD and size == 2:
            self._silent = 0.0
            self._end_session(Error.HELD)
            self._send_ack()

    def _in_sequence(self, payload: bytes) -> None:
        if not self._error and payload[1] == self._next:
            try:
                self._commands.execute(payload)
                self._next = (self._next + 1) & 255
            except RefusedError as refused:
                self._end_session(refused.error, refused.detail)
        self._send_ack()

    def _send(self, payload: bytes) -> None:
        self._out += protocol.encode_frame(payload)

    def _send_ack(self) -> None:
        queue = self.motors.queue
        ack = protocol.Ack(
            self._next, self._error, self._detail, self.motors.state, queue.free, queue.milliseconds(), self._digest
        )
        self._send(protocol.pack_ack(ack))

    def _answer_hello(self, tag: int, version: int, nonce: int) -> None:
        """Begin a session for a new nonce, and send what the board is."""
        if version != protocol.VERSION:
            self._end_session(Error.VERSION)
        elif nonce != self._nonce:
            self._end_session(Error.HELD)
            self._error, self._detail = Error.OK, 0
            self._next, self._nonce = 0, nonce
            self._digest = nonce & 0xFFFF
            self._splitter.bad = 0
        b = self.board
        info = Info(
            tag, protocol.VERSION, (2, 0), nonce, b.number, len(b.axes), b.servo_mask, len(b.switches),
            b.rows, b.queue, b.frame, b.receive, b.min_interval, b.clock, self.setup.crc,
            self.motors.axes.known, self._flags(), self._boots, self._cause,
        )  # fmt: skip
        self._send(protocol.pack_info(info))

    def _flags(self) -> int:
        pairs = (
            (Flag.DRIVERS, self.setup.drivers),
            (Flag.SERVOS, self.setup.pulses),
            (Flag.CONFIGURED, self.setup.crc),
            (Flag.RETAINED, self.setup.retained and self.motors.axes.known),
            (Flag.ABORT, self.inputs.is_aborted()),
            (Flag.LATCH, self.motors.homing.latched),
            (Flag.POWER_CUT, self.inputs.power_cut()),
        )
        return sum(flag for flag, is_set in pairs if is_set)

    def _send_status(self, tag: int, page: int) -> None:
        motors, queue = self.motors, self.motors.queue
        page = int(page == 1)
        switches = sum(self.inputs.level(i) << i for i in range(len(self.board.switches)))
        counts = tuple(motors.homing.latch if page else motors.counts())
        status = Status(
            tag, self._next, self._error, self._detail, motors.state, self._flags(), queue.free, queue.milliseconds(),
            motors.axes.known,
            switches, 0, min(self._splitter.bad, 255), page, self._digest, counts,
        )  # fmt: skip
        self._send(protocol.pack_status(status))
