"""A host for the emulated board in simulated time: it repeats to the cycle and knows no port and no planner.

Not the one that armkin ships (that is link.py): this one can be wrong on purpose, and can saturate the line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from emulator import EmulatedBoard

from armkin.board.firmware.wire import motion_frame, protocol
from armkin.board.firmware.wire.protocol import HALF, STEP, Ack, GuardImage, Info, Segment, State, Status, whole_steps

CLOCK = 16_000_000
R = TypeVar("R", Ack, Info, Status)
RAMP, LENGTH = 0.1, 0.01  # [s] of a ramp, and of a segment
CREDIT = 0x83  # an ACK that comes unasked
AXES = {"uno_cnc_shield": 5, "mega_ramps14": 9, "uno_servos": 6, "pico6": 8}
SWITCHES = {"uno_cnc_shield": 3, "mega_ramps14": 6, "uno_servos": 0, "pico6": 6}
RECEIVE = {"uno_cnc_shield": 167, "mega_ramps14": 255, "uno_servos": 127, "pico6": 2047}
STEPPERS = {"uno_cnc_shield": 4, "mega_ramps14": 5, "uno_servos": 0, "pico6": 6}
WIDE = protocol.AxisImage(True, False, -(1 << 30), 1 << 30, 0, 40_000, 400_000)
SERVO = protocol.AxisImage(True, False, 500, 2500, 1500, 2000, 40_000)


def image_for(board: str, stepper: protocol.AxisImage = WIDE, **times: Any) -> protocol.Image:
    """Every axis used, every stepper alike, no switch guards; A4988 timing."""
    steppers = STEPPERS[board]
    axes = (stepper,) * steppers + (SERVO,) * (AXES[board] - steppers)
    return protocol.Image(axes, guards=(GuardImage(),) * SWITCHES[board], **times)


@dataclass
class Batch:
    """What one MOTION frame carries, for `axes` from `start`; the end follows."""

    axes: tuple[int, ...]
    start: tuple[int, ...]
    segments: tuple[Segment, ...]
    at_rest: bool = False
    places: tuple[int, ...] = ()  # 2^-23 step; from rest unless given
    brake: float = 1.0
    end: tuple[int, ...] = field(init=False)
    end_places: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        begin = self.places or tuple(count * STEP + HALF for count in self.start)
        ways = [sum(s.ticks * s.rates[i] for s in self.segments) for i in range(len(self.axes))]
        self.end_places = tuple(p + way for p, way in zip(begin, ways, strict=True))
        self.end = tuple(p // STEP for p in self.end_places)

    def payload(self, tag: int) -> bytes:
        at_rest, brake = self.at_rest, self.brake
        return motion_frame.motion(tag, self.axes, self.start, self.end, self.segments, at_rest=at_rest, brake=brake)


def cut_batches(
    axes: Sequence[int],
    start: Sequence[int],
    segments: Sequence[Segment],
    size: int,
    at_rest: bool = True,
    brake: float = 1.0,
) -> list[Batch]:
    """One motion cut into batches of `size` segments, the last one with END."""
    made: list[Batch] = []
    counts: tuple[int, ...] = tuple(start)
    places: tuple[int, ...] = ()
    for i in range(0, len(segments), size):
        made.append(Batch(tuple(axes), counts, tuple(segments[i : i + size]), places=places, brake=brake))
        counts, places = made[-1].end, made[-1].end_places
    if at_rest:
        made[-1].at_rest = True
    return made


class BareHost:
    """Talks to a board that is in ``speed="step"``; every call takes simulated time.

    `sequence` is the next frame's number, `sent` counts bytes on the line, `resent` frames sent again.
    """

    def __init__(self, board: EmulatedBoard, baud: int = 250_000) -> None:
        self.board = board
        self.baud = baud
        self.sequence = 0
        self.time = 0.0  # [s] since this host began
        self.resent = 0
        self.acks: list[Ack] = []
        self._splitter = protocol.Splitter()
        self._line_free = 0.0
        self.credit_poll = 0.002  # [s] between questions while waiting for credit

    def run(self, seconds: float, data: bytes = b"", until: bytes = b"") -> list[protocol.Reply]:
        """Put `data` on the line, let time pass, return what came."""
        if data:
            self._line_free = max(self._line_free, self.time) + 10 * len(data) / self.baud
        received = self.board.run(seconds, data, until=until)
        self.time += seconds  # an upper bound if `until` ended it early
        replies = []
        for payload in self._splitter.feed(received):
            if payload[0] == CREDIT:
                payload = bytes([protocol.Type.ACK]) + payload[1:]
            if (reply := protocol.parse_reply(payload)) is not None:
                replies.append(reply)
        return replies

    def ask(self, payload: bytes, kind: type[R], tries: int = 1) -> R:
        """The answer to one frame; sent again if there is none within 20 ms."""
        for _ in range(tries):
            data = protocol.encode_frame(payload)
            replies = self.run(10 * len(data) / self.baud + 0.02, data)
            answers = [r for r in replies if isinstance(r, kind)]
            if answers:
                return answers[-1]
        raise AssertionError(f"no answer to {payload.hex()}")

    def status(self, page: int = 0) -> Status:
        return self.ask(protocol.status_query(0, page), Status, tries=100)

    def hello(self, nonce: int) -> Info:
        info = self.ask(protocol.hello(0, nonce), Info, tries=100)
        self.sequence = 0
        return info

    def order(self, payload_of: bytes) -> Ack:
        """Send a frame in sequence (its tag is filled in) and demand that it is done."""
        answer = self.ask(payload_of[:1] + bytes([self.sequence]) + payload_of[2:], Ack)
        assert (answer.error, answer.next) == (0, (self.sequence + 1) % 256), answer
        self.sequence = answer.next
        return answer

    def configure(self, image: protocol.Image, counts: dict[int, int], nonce: int = 1) -> None:
        """Session, configuration, position."""
        info = self.hello(nonce)
        data = image.pack()
        room = info.frame - 8
        for offset in range(0, len(data), room):
            self.order(protocol.config(0, offset, data[offset : offset + room]))
        self.order(protocol.commit(0, len(data), image.crc()))
        self.order(protocol.set_position(0, counts))

    def setup(self, image: protocol.Image, counts: dict[int, int], nonce: int = 1) -> None:
        """As `configure`, then drivers and pulses on."""
        self.configure(image, counts, nonce)
        self.order(protocol.enable(0, 3))
        self.run(0.01)

    def stream(
        self,
        work: Sequence[Batch],
        *,
        poll: float = 0.1,
        give_up: float = 60.0,
        slice_s: float = 0.5e-3,
        resend: float = 0.03,
        window: int = 100,
        bytes_ahead: int = 0,
    ) -> Status:
        """Go back N with credit until all is acknowledged and the board is at rest (or the session has ended).

        `poll`: [s] between STATUS?; `resend`: [s] without progress until all is sent again; `window`: frames;
        `bytes_ahead`: that may follow the oldest frame without an answer (what the board promises to keep).
        """
        first = self.sequence
        acknowledged = sent = 0  # batches

        def size(number: int) -> int:  # on the line
            return len(work[number].payload(0)) + 6

        free = self.status().free
        last_progress = last_poll = self.time
        deadline = self.time + give_up
        state = State.MOVING
        error = 0
        is_asked = False  # a STATUS is under way: a second one would only queue behind it
        while self.time < deadline:
            frames = b""
            waiting = sent < len(work) and sent == acknowledged  # for credit, which only answers bring
            pause = poll if is_asked or not waiting else self.credit_poll
            if self.time - last_poll >= pause:
                is_asked = True
                frames += protocol.encode_frame(protocol.status_query(1))
                last_poll = self.time
            if sent > acknowledged and self.time - last_progress > resend:
                self.resent += sent - acknowledged
                sent = acknowledged
                last_progress = self.time
            under_way = sum(len(b.segments) for b in work[acknowledged:sent])
            room = (bytes_ahead or RECEIVE[self.board.board] - 12) - sum(map(size, range(acknowledged + 1, sent)))
            while (
                sent < len(work)
                and sent - acknowledged < window
                and self._line_free + 10 * len(frames) / self.baud < self.time + 2 * slice_s
                and under_way + len(work[sent].segments) <= free
                and (sent == acknowledged or size(sent) <= room)
            ):
                frames += protocol.encode_frame(work[sent].payload((first + sent) % 256))
                under_way += len(work[sent].segments)
                if sent == acknowledged:
                    last_progress = self.time
                else:
                    room -= size(sent)
                sent += 1
            for reply in self.run(slice_s, frames):
                if isinstance(reply, Info):
                    continue
                if isinstance(reply, Ack):
                    self.acks.append(reply)
                else:
                    is_asked = False
                advance = (reply.next - (first + acknowledged)) % 256
                if 0 < advance <= 100:
                    acknowledged += advance
                    sent = max(sent, acknowledged)
                    last_progress = self.time
                if advance <= 100:
                    free = reply.free
                state, error = State(reply.state), reply.error
            if error or (acknowledged == len(work) and state == State.IDLE):
                break
        self.sequence = (first + acknowledged) % 256
        return self.rest()

    def rest(self) -> Status:
        """Ask until the board is at rest."""
        deadline = self.time + 30
        while (status := self.status()).state != State.IDLE:
            assert self.time < deadline, status
        return status


def cruise_segments(rate: float, seconds: float, share: Sequence[float]) -> list[Segment]:
    """Up to `rate` ticks/s and down again in RAMP each way; axis i makes `share[i]` steps a tick."""
    segments: list[Segment] = []
    time = 0.0
    while time < seconds:
        slope = min(1.0, time / RAMP + 0.02, (seconds - time) / RAMP + 0.02)
        interval = round(CLOCK / (rate * slope))
        ticks = max(10, round(LENGTH * CLOCK / interval))
        segments.append(whole_steps(ticks, interval, 0, tuple(round(s * ticks) for s in share)))
        time += ticks * interval / CLOCK
    return segments


def run_up(rate: float, seconds: float, share: Sequence[float]) -> list[Segment]:
    """From rest up to `rate` ticks/s in so many seconds; axis i makes `share[i]` steps a tick."""
    parts = round(seconds / LENGTH)
    speeds = [rate * (k + 0.5) / parts for k in range(parts)]
    counts = [(round(CLOCK / v), round(LENGTH * v)) for v in speeds]
    return [whole_steps(n, interval, 0, tuple(round(s * n) for s in share)) for interval, n in counts if n]
