"""Frames and bytes of the wire protocol: firmware/PROTOCOL.md is the text, firmware/golden/ the vectors.

    payload  --wire()-->  COBS(payload + CRC-32) 00  --Splitter-->  payload

Host and simulated board share this module; it knows no port and no motion.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag

VERSION = 1
MAX_FRAME = 250  # payload + CRC: COBS then adds one byte


class Type(IntEnum):
    """First byte of a payload."""

    HELLO = 0x01
    STATUS_QUERY = 0x02
    HOLD = 0x03
    CONFIG = 0x10
    COMMIT = 0x11
    ENABLE = 0x12
    SET_POSITION = 0x13
    MOTION = 0x14
    HOME = 0x15
    JOG = 0x16
    ACK = 0x80
    INFO = 0x81
    STATUS = 0x82
    CREDIT = 0x83


class State(IntEnum):
    """What the board is doing."""

    IDLE = 0
    MOVING = 1
    HOLDING = 2
    HOMING = 3
    JOGGING = 4


class Error(IntEnum):
    """Why a session has ended (PROTOCOL.md, section 10)."""

    OK = 0
    NO_SESSION = 1
    VERSION = 2
    TYPE = 3
    LENGTH = 4
    VALUE = 5
    CONFIG_NONE = 6
    CONFIG_BAD = 7
    BUSY = 8
    LOST = 9
    KNOWN = 10
    DISABLED = 11
    START = 12
    END = 13
    INTERVAL = 14
    STEPS = 15
    RATE = 16
    LIMIT = 17
    LIMIT_JOINT = 18
    CREDIT = 19
    ABORT = 20
    HELD = 21
    SILENCE = 22
    DRY = 23
    OVERRUN = 24
    SWITCH = 25
    TRAVEL = 26
    TIME = 27


class Flag(IntFlag):
    """Flags of INFO and STATUS."""

    DRIVERS = 1
    SERVOS = 2
    CONFIGURED = 4
    RETAINED = 8
    ABORT = 16
    LATCH = 32


MOTION_END = 1
MOTION_WIDE = 2


@dataclass(frozen=True)
class Segment:
    """T ticks, the first after `interval` cycles, each next one add/256 cycles later; steps per axis."""

    ticks: int
    interval: int
    add: int
    steps: tuple[int, ...]

    @property
    def last_interval(self) -> int:
        """Cycles before the last tick."""
        return (256 * self.interval + (self.ticks - 1) * self.add) >> 8

    @property
    def narrow(self) -> bool:
        """True if it fits the short form: 8 bits for ticks and steps."""
        return self.ticks <= 255 and all(-128 <= s <= 127 for s in self.steps)

    def units(self) -> int:
        """Its length as the queue counts it, in units of 256 cycles."""
        return (self.ticks * ((self.interval + self.last_interval) // 2)) >> 8


@dataclass(frozen=True)
class Ack:
    """Answer to everything but HELLO and STATUS?."""

    next: int
    error: int
    detail: int
    state: int
    free: int
    queued: int  # [ms]


@dataclass(frozen=True)
class Credit(Ack):
    """An ACK that comes unasked, when slots have become free; nothing was lost because of it."""


@dataclass(frozen=True)
class Info:
    """Answer to HELLO: who the board is and what it can do."""

    tag: int
    version: int
    firmware: tuple[int, int]
    nonce: int
    board: int
    axes: int
    servos: int
    switches: int
    rows: int
    queue: int
    frame: int
    min_interval: int
    clock: int
    config: int
    known: int
    flags: int
    boots: int
    cause: int


@dataclass(frozen=True)
class Status:
    """Answer to STATUS?: where the board stands."""

    tag: int
    next: int
    error: int
    detail: int
    state: int
    flags: int
    free: int
    queued: int  # [ms]
    known: int
    switches: int
    overruns: int
    bad: int
    page: int
    counts: tuple[int, ...]


Reply = Ack | Info | Status

_ACK = struct.Struct("<6BH")
_INFO = struct.Struct("<5BIBBHBBBBHIIHBHB")
_STATUS = struct.Struct("<8BHH4B")


# Framing


def cobs_encode(data: bytes) -> bytes:
    """Consistent overhead byte stuffing (Cheshire & Baker 1999) of at most 254 bytes.

    >>> cobs_encode(bytes([1, 0, 2])).hex()
    '02010202'
    """
    if len(data) > 254:
        raise ValueError(f"{len(data)} bytes in a frame; 254 fit")
    return b"".join(bytes([len(block) + 1]) + block for block in data.split(b"\0"))


def cobs_decode(data: bytes) -> bytes | None:
    """The inverse of `cobs_encode`; None if the stuffing is broken."""
    blocks, at = [], 0
    while at < len(data):
        code = data[at]
        if code == 0 or at + code > len(data):
            return None
        blocks.append(data[at + 1 : at + code])
        at += code
    if not blocks or any(0 in block for block in blocks):
        return None
    return b"\0".join(blocks)


def wire(payload: bytes) -> bytes:
    """A payload as it goes over the line: with CRC, stuffed, ended by a zero.

    >>> wire(hold(9)).hex()
    '03030998f9281300'
    """
    if len(payload) + 4 > MAX_FRAME:
        raise ValueError(f"a payload of {len(payload)} bytes; {MAX_FRAME - 4} fit")
    return cobs_encode(payload + struct.pack("<I", zlib.crc32(payload))) + b"\0"


def unwire(frame: bytes) -> bytes | None:
    """The payload of a frame without its zero; None if it is damaged."""
    data = cobs_decode(frame)
    if data is None or not 6 <= len(data) <= MAX_FRAME:
        return None
    payload = data[:-4]
    return payload if struct.unpack("<I", data[-4:])[0] == zlib.crc32(payload) else None


class Splitter:
    """Cuts a stream of bytes into payloads; counts what was damaged in `bad`."""

    def __init__(self, largest: int = MAX_FRAME) -> None:
        self.bad = 0
        self._largest = largest + 1
        self._rest = bytearray()
        self._skip = False  # in a frame that is too long already

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The payloads that `data` completes."""
        *frames, rest = data.split(b"\0")
        for frame in frames:
            whole = bytes(self._rest) + frame
            self._rest.clear()
            if self._skip or len(whole) > self._largest:
                self._skip = False
                self.bad += 1
            elif whole:
                payload = unwire(whole)
                if payload is None:
                    self.bad += 1
                else:
                    yield payload
        self._rest += rest
        if len(self._rest) > self._largest:
            self._rest.clear()
            self._skip = True


# Frames to the board


def hello(tag: int, nonce: int, version: int = VERSION) -> bytes:
    """Opens a session."""
    return struct.pack("<BBBI", Type.HELLO, tag, version, nonce)


def status_query(tag: int, page: int = 0) -> bytes:
    """Asks where the board stands."""
    return struct.pack("<BBB", Type.STATUS_QUERY, tag, page)


def hold(tag: int) -> bytes:
    """Stops the arm along its path."""
    return struct.pack("<BB", Type.HOLD, tag)


def config(tag: int, offset: int, data: bytes) -> bytes:
    """Writes a piece of the configuration image."""
    return struct.pack("<BBH", Type.CONFIG, tag, offset) + data


def commit(tag: int, length: int, crc: int) -> bytes:
    """Brings the image into force."""
    return struct.pack("<BBHI", Type.COMMIT, tag, length, crc)


def enable(tag: int, what: int) -> bytes:
    """Drivers on (bit 0), servo pulses on (bit 1)."""
    return struct.pack("<BBB", Type.ENABLE, tag, what)


def set_position(tag: int, counts: dict[int, int]) -> bytes:
    """Says what the counts are: {axis: count}."""
    axes = sorted(counts)
    return struct.pack(f"<BBH{len(axes)}i", Type.SET_POSITION, tag, _mask(axes), *(counts[i] for i in axes))


def motion(
    tag: int,
    axes: Sequence[int],
    start: Sequence[int],
    end: Sequence[int],
    segments: Sequence[Segment],
    *,
    at_rest: bool,
    wide: bool = False,
) -> bytes:
    """A batch of motion for `axes` (ascending), from absolute counts to absolute counts.

    The short form if all segments fit it, unless `wide`.
    """
    k = len(axes)
    wide = wide or not all(segment.narrow for segment in segments)
    flags = (MOTION_END if at_rest else 0) | (MOTION_WIDE if wide else 0)
    head = struct.pack(f"<BBHBB{k}i{k}i", Type.MOTION, tag, _mask(axes), flags, len(segments), *start, *end)
    form = struct.Struct(f"<HHh{k}h" if wide else f"<BHh{k}b")
    return head + b"".join(form.pack(s.ticks, s.interval, s.add, *s.steps) for s in segments)


def motion_size(axes: int, segments: Sequence[Segment]) -> int:
    """Length of a batch's payload in bytes."""
    narrow = all(segment.narrow for segment in segments)
    return 6 + 8 * axes + len(segments) * (5 + axes if narrow else 6 + 2 * axes)


def home(
    tag: int,
    *,
    switch: int,
    closed: bool,
    slow: int,
    backoff: int,
    travel: int,
    time: int,
    rate: Sequence[int],
) -> bytes:
    """Moves until a switch says so; `time` in 0.1 s, the rest in counts."""
    form = f"<BBBBBHIH{len(rate)}h"
    return struct.pack(form, Type.HOME, tag, switch, int(closed), slow, backoff, travel, time, *rate)


def jog(tag: int, rate: Sequence[int]) -> bytes:
    """Moves with `rate` [counts/s] per axis for the next 250 ms."""
    return struct.pack(f"<BB{len(rate)}h", Type.JOG, tag, *rate)


def _mask(axes: Sequence[int]) -> int:
    return sum(1 << axis for axis in axes)


# Frames from the board


def parse(payload: bytes) -> Reply | None:
    """A reply; None for anything that no board of this version sends."""
    kind, size = payload[0], len(payload)
    if kind == Type.ACK and size == _ACK.size:
        return Ack(*_ACK.unpack(payload)[1:])
    if kind == Type.CREDIT and size == _ACK.size:
        return Credit(*_ACK.unpack(payload)[1:])
    if kind == Type.INFO and size == _INFO.size:
        _, tag, version, major, minor, *rest = _INFO.unpack(payload)
        return Info(tag, version, (major, minor), *rest)
    if kind == Type.STATUS and size >= _STATUS.size and (size - _STATUS.size) % 4 == 0:
        n = (size - _STATUS.size) // 4
        counts = struct.unpack_from(f"<{n}i", payload, _STATUS.size)
        return Status(*(*_STATUS.unpack_from(payload)[1:], counts))
    return None


def info_version(payload: bytes) -> int | None:
    """The protocol version in any version's INFO: offsets 0 to 2 stay."""
    return payload[2] if payload[0] == Type.INFO and len(payload) > 2 else None


def pack_ack(ack: Ack) -> bytes:
    """An ACK's or CREDIT's payload (for the simulated board)."""
    kind = Type.CREDIT if isinstance(ack, Credit) else Type.ACK
    return _ACK.pack(kind, ack.next, ack.error, ack.detail, ack.state, ack.free, ack.queued)


def pack_info(info: Info) -> bytes:
    """An INFO's payload (for the simulated board)."""
    return _INFO.pack(
        Type.INFO, info.tag, info.version, *info.firmware, info.nonce, info.board, info.axes, info.servos,
        info.switches, info.rows, info.queue, info.frame, info.min_interval, info.clock, info.config,
        info.known, info.flags, info.boots, info.cause,
    )  # fmt: skip


def pack_status(status: Status) -> bytes:
    """A STATUS's payload (for the simulated board)."""
    head = _STATUS.pack(
        Type.STATUS, status.tag, status.next, status.error, status.detail, status.state, status.flags,
        status.free, status.queued, status.known, status.switches, status.overruns, status.bad, status.page,
    )  # fmt: skip
    return head + struct.pack(f"<{len(status.counts)}i", *status.counts)


# The configuration image (PROTOCOL.md, section 4)


@dataclass(frozen=True)
class AxisImage:
    """One axis of the configuration image; an unused one is all zero."""

    used: bool = False
    invert: bool = False
    lower: int = 0
    upper: int = 0
    home: int = 0
    max_rate: int = 0
    max_accel: int = 0


@dataclass(frozen=True)
class RowImage:
    """lower <= sum of weight x count <= upper."""

    lower: int
    upper: int
    weight: tuple[int, ...]


@dataclass(frozen=True)
class Image:
    """All that a board knows of the arm; times in 0.1 us, `wake` in ms."""

    axes: tuple[AxisImage, ...]
    rows: tuple[RowImage, ...] = ()
    abort_closed: bool = False
    enable_high: bool = False
    step_high: int = 10
    step_low: int = 10
    dir_setup: int = 2
    wake: int = 1
    meaning: int = 0

    def pack(self) -> bytes:
        """The image's bytes."""
        n = len(self.axes)
        flags = self.abort_closed | self.enable_high << 1
        times = (self.step_high, self.step_low, self.dir_setup, self.wake)
        out = struct.pack("<8BI", 1, n, len(self.rows), flags, *times, self.meaning)
        for a in self.axes:
            marks = a.used | a.invert << 1
            out += struct.pack("<BiiiHI", marks, a.lower, a.upper, a.home, a.max_rate, a.max_accel)
        for r in self.rows:
            out += struct.pack(f"<ii{n}h", r.lower, r.upper, *r.weight)
        return out

    @classmethod
    def unpack(cls, data: bytes) -> Image | None:
        """The image of its bytes; None if layout or length are wrong (ranges are the board's to check)."""
        if len(data) < 12:
            return None
        layout, n, rows, flags, high, low, setup, wake, meaning = struct.unpack_from("<8BI", data)
        if layout != 1 or flags > 3 or len(data) != 12 + 19 * n + (8 + 2 * n) * rows:
            return None
        axes = []
        for i in range(n):
            marks, *fields = struct.unpack_from("<BiiiHI", data, 12 + 19 * i)
            if marks > 3:
                return None
            axes.append(AxisImage(bool(marks & 1), bool(marks & 2), *fields))
        limits = []
        for i in range(rows):
            lower, upper, *weight = struct.unpack_from(f"<ii{n}h", data, 12 + 19 * n + (8 + 2 * n) * i)
            limits.append(RowImage(lower, upper, tuple(weight)))
        return cls(
            tuple(axes), tuple(limits), bool(flags & 1), bool(flags & 2), high, low, setup, wake, meaning
        )

    def crc(self) -> int:
        """What INFO's `config` says while this image is in force."""
        return zlib.crc32(self.pack())
