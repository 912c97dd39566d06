"""Frames of the wire protocol: firmware/PROTOCOL.md is the text, firmware/golden/ the vectors.

    fields  --hello(), home(), ...-->  payload  --framing-->  bytes on the line  --framing, parse()-->  fields

Host and simulated board share this module; it knows no port and no motion.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from armkin.board.firmware.wire.configuration_image import AxisImage as AxisImage
from armkin.board.firmware.wire.configuration_image import GuardImage as GuardImage
from armkin.board.firmware.wire.configuration_image import Image as Image
from armkin.board.firmware.wire.configuration_image import RowImage as RowImage
from armkin.board.firmware.wire.framing import MAX_FRAME as MAX_FRAME
from armkin.board.firmware.wire.framing import Splitter as Splitter
from armkin.board.firmware.wire.framing import cobs_decode as cobs_decode
from armkin.board.firmware.wire.framing import cobs_encode as cobs_encode
from armkin.board.firmware.wire.framing import decode_frame as decode_frame
from armkin.board.firmware.wire.framing import encode_frame as encode_frame
from armkin.board.firmware.wire.segment_format import BLOCK as BLOCK
from armkin.board.firmware.wire.segment_format import COARSE_UNIT as COARSE_UNIT
from armkin.board.firmware.wire.segment_format import FINE_BOUND as FINE_BOUND
from armkin.board.firmware.wire.segment_format import HALF as HALF
from armkin.board.firmware.wire.segment_format import STEP as STEP
from armkin.board.firmware.wire.segment_format import Segment as Segment
from armkin.board.firmware.wire.segment_format import count_at as count_at
from armkin.board.firmware.wire.segment_format import nearest_rate as nearest_rate
from armkin.board.firmware.wire.segment_format import read_segment as read_segment
from armkin.board.firmware.wire.segment_format import segment_size as segment_size
from armkin.board.firmware.wire.segment_format import whole_steps as whole_steps

VERSION = 2  # version of the protocol


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
    """The state of the board."""

    IDLE = 0
    MOVING = 1
    HOLDING = 2
    HOMING = 3
    JOGGING = 4


class Error(IntEnum):
    """Why a session has ended (PROTOCOL.md, section 11)."""

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
    SPILL = 28
    ACCEL = 29
    POWER = 30
    LIMIT_SWITCH = 31


class Flag(IntFlag):
    """Flags of INFO and STATUS."""

    DRIVERS = 1
    SERVOS = 2
    CONFIGURED = 4
    RETAINED = 8
    ABORT = 16
    LATCH = 32
    POWER_CUT = 64


MOTION_END = 1
MOTION_WIDE = 2
MOTION_GENTLE, GENTLE_PARTS = 2, 8  # lowest bit of the share of the accelerations; parts that it counts in


@dataclass(frozen=True)
class Ack:
    """The answer to every frame except HELLO and STATUS?."""

    next: int
    error: int
    detail: int
    state: int
    free: int
    queued: int  # [ms]
    session: int = 0  # digest of the nonce


@dataclass(frozen=True)
class Credit(Ack):
    """An ACK that the board sends on its own when slots become free; it shows no loss."""


@dataclass(frozen=True)
class Info:
    """The answer to HELLO: the identity and the abilities of the board."""

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
    receive: int
    min_interval: int
    clock: int
    config: int
    known: int
    flags: int
    boots: int
    cause: int


@dataclass(frozen=True)
class Status:
    """The answer to STATUS?: state, position and queue of the board."""

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
    session: int
    counts: tuple[int, ...]
    late_servos: int = 0  # late frames of servo pulses; 0 from old firmware


Reply = Ack | Info | Status

_ACK = struct.Struct("<6BHH")
_INFO = struct.Struct("<5BIBBHBBBBHHIIHBHB")
_STATUS = struct.Struct("<8BHH4BH")


# Frames to the board


def hello(tag: int, nonce: int, version: int = VERSION) -> bytes:
    """The HELLO frame, which opens a session."""
    return struct.pack("<BBBI", Type.HELLO, tag, version, nonce)


def status_query(tag: int, page: int = 0) -> bytes:
    """The STATUS? frame, which requests a page of the status."""
    return struct.pack("<BBB", Type.STATUS_QUERY, tag, page)


def hold(tag: int) -> bytes:
    """The HOLD frame, which stops the arm along its path."""
    return struct.pack("<BB", Type.HOLD, tag)


def config(tag: int, offset: int, piece: bytes) -> bytes:
    """The CONFIG frame, which writes a piece of the configuration image."""
    return struct.pack("<BBH", Type.CONFIG, tag, offset) + piece


def commit(tag: int, length: int, crc: int) -> bytes:
    """The COMMIT frame, which activates the image."""
    return struct.pack("<BBHI", Type.COMMIT, tag, length, crc)


def enable(tag: int, switches: int) -> bytes:
    """The ENABLE frame, which switches drivers (bit 0) and servo pulses (bit 1) on."""
    return struct.pack("<BBB", Type.ENABLE, tag, switches)


def set_position(tag: int, counts: dict[int, int]) -> bytes:
    """The SET_POSITION frame, which sets counts: {axis: count}."""
    axes = sorted(counts)
    return struct.pack(f"<BBH{len(axes)}i", Type.SET_POSITION, tag, mask_of(axes), *(counts[i] for i in axes))


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
    """The HOME frame, which moves until a switch closes; `time` in 0.1 s, other values in counts."""
    form = f"<BBBBBIIH{len(rate)}i"
    return struct.pack(form, Type.HOME, tag, switch, int(closed), slow, backoff, travel, time, *rate)


def jog(tag: int, rate: Sequence[int]) -> bytes:
    """The JOG frame, which moves at `rate` [counts/s] per axis for the next 250 ms."""
    return struct.pack(f"<BB{len(rate)}i", Type.JOG, tag, *rate)


def mask_of(axes: Iterable[int]) -> int:
    """Axes as bits."""
    return sum(1 << axis for axis in axes)


# Frames from the board


def parse_reply(payload: bytes) -> Reply | None:
    """The reply in a payload; None for payloads that no board of this version sends."""
    kind, size = payload[0], len(payload)
    if kind == Type.ACK and size == _ACK.size:
        return Ack(*_ACK.unpack(payload)[1:])
    if kind == Type.CREDIT and size == _ACK.size:
        return Credit(*_ACK.unpack(payload)[1:])
    if kind == Type.INFO and size == _INFO.size:
        _, tag, version, major, minor, *fields = _INFO.unpack(payload)
        return Info(tag, version, (major, minor), *fields)
    if kind == Type.STATUS and size >= _STATUS.size + 4 and (size - _STATUS.size) % 4 <= 1:
        n, tail_size = divmod(size - _STATUS.size, 4)
        counts = struct.unpack_from(f"<{n}i", payload, _STATUS.size)
        return Status(*(*_STATUS.unpack_from(payload)[1:], counts, payload[-1] if tail_size else 0))
    return None


def info_version(payload: bytes) -> int | None:
    """The protocol version in an INFO of any version, whose first three bytes never change."""
    return payload[2] if payload[0] == Type.INFO and len(payload) > 2 else None


def pack_ack(ack: Ack) -> bytes:
    """An ACK's or CREDIT's payload (for the simulated board)."""
    kind = Type.CREDIT if isinstance(ack, Credit) else Type.ACK
    return _ACK.pack(kind, ack.next, ack.error, ack.detail, ack.state, ack.free, ack.queued, ack.session)


def pack_info(info: Info) -> bytes:
    """An INFO's payload (for the simulated board)."""
    return _INFO.pack(
        Type.INFO, info.tag, info.version, *info.firmware, info.nonce, info.board, info.axes, info.servos,
        info.switches, info.rows, info.queue, info.frame, info.receive, info.min_interval, info.clock, info.config,
        info.known, info.flags, info.boots, info.cause,
    )  # fmt: skip


def pack_status(status: Status) -> bytes:
    """A STATUS's payload (for the simulated board)."""
    head = _STATUS.pack(
        Type.STATUS, status.tag, status.next, status.error, status.detail, status.state, status.flags,
        status.free, status.queued, status.known, status.switches, status.overruns, status.bad, status.page,
        status.session,
    )  # fmt: skip
    return head + struct.pack(f"<{len(status.counts)}iB", *status.counts, status.late_servos)
