"""The messages of PROTOCOL.md as bytes, and segments to put in them: what `generate.py` writes files of.

Standalone on purpose: it shares no code with the firmware or with armkin, so that it can accuse both.
"""

import struct
import zlib
from typing import NamedTuple


class Board(NamedTuple):
    """What INFO says of a board, and which axis the gripper is in these conversations."""

    id: int
    axes: int
    servos: int
    switches: int
    rows: int
    queue: int
    frame: int
    receive: int
    clock: int
    gripper: int


BOARDS = {
    "uno_cnc_shield": Board(1, 5, 0x10, 3, 4, 32, 152, 167, 16_000_000, 4),  # X Y Z A and a servo
    "uno_servos": Board(3, 6, 0x3F, 0, 3, 32, 120, 127, 16_000_000, 0),
    "pico6": Board(4, 8, 0xC0, 6, 6, 128, 250, 2047, 25_000_000, 6),  # X Y Z A B C and two servos
}
board = BOARDS["uno_cnc_shield"]  # the one that the conversation is with
STEP = 1 << 23


def vector(x: int, y: int, z: int, gripper: int = 0) -> list[int]:
    """One number an axis; only X, Y, Z and the gripper have any."""
    out = [x, y, z] + [0] * (board.axes - 3)
    out[board.gripper] = gripper
    return out


def mask(*axes: int) -> int:
    """Bits of axes; -1 is the gripper."""
    return sum(1 << (board.gripper if axis < 0 else axis) for axis in axes)


def cobs(data: bytes) -> bytes:
    out = bytearray()
    for block in data.split(b"\0"):
        assert len(block) < 254
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def wire(payload: bytes) -> bytes:
    return cobs(payload + struct.pack("<I", zlib.crc32(payload))) + b"\0"


def hello(tag: int, nonce: int, version: int = 2) -> bytes:
    return struct.pack("<BBBI", 0x01, tag, version, nonce)


def status(tag: int, page: int = 0) -> bytes:
    return struct.pack("<BBB", 0x02, tag, page)


def hold(tag: int) -> bytes:
    return struct.pack("<BB", 0x03, tag)


def config(tag: int, offset: int, data: bytes) -> bytes:
    return struct.pack("<BBH", 0x10, tag, offset) + data


def commit(tag: int, image: bytes) -> bytes:
    return struct.pack("<BBHI", 0x11, tag, len(image), zlib.crc32(image))


def enable(tag: int, what: int) -> bytes:
    return struct.pack("<BBB", 0x12, tag, what)


def set_position(tag: int, which: int, counts: list[int]) -> bytes:
    return struct.pack(f"<BBH{len(counts)}i", 0x13, tag, which, *counts)


Segment = tuple[int, int, int, list[int]]  # ticks, interval, add in 1/256 cycle, rates in 2^-23 step a tick


def motion(tag: int, which: int, flags: int, start: list[int], end: list[int], segments: list[Segment]) -> bytes:
    k = len(start)
    body = struct.pack(f"<BBHBB{k}i{k}i", 0x14, tag, which, flags, len(segments), *start, *end)
    axes = [i for i in range(16) if which >> i & 1]
    for t, i, a, rates in segments:
        if flags & 2:
            fine = sum(1 << axis for axis, r in zip(axes, rates, strict=True) if abs(r) < 1 << 15)
            short = [r if abs(r) < 1 << 15 else int(r / 256) for r in rates]
            body += struct.pack("<HH", t, i) + (256 * a).to_bytes(3, "little", signed=True)
            body += struct.pack(f"<hH{k}h", 0, fine, *short)
        else:
            body += struct.pack(f"<BHh{k}h", t, i, a, *(int(r / 256) for r in rates))
    return body


def home(tag: int, switch: int, flags: int, slow: int, backoff: int, travel: int, time: int, rate: list[int]) -> bytes:
    return struct.pack(f"<BBBBBIIH{len(rate)}i", 0x15, tag, switch, flags, slow, backoff, travel, time, *rate)


def jog(tag: int, rate: list[int]) -> bytes:
    return struct.pack(f"<BB{len(rate)}i", 0x16, tag, *rate)


def image(
    rows: list[tuple[int, int, list[int]]] | None = None,
    flags: int = 0,
    guards: list[tuple[int, list[int]]] | None = None,
) -> bytes:
    """The three-joint arm on X Y Z, a gripper on the first servo, nothing on other axes. A4988 timing."""
    rows = rows or []
    out = struct.pack("<8BI", 2, board.axes, len(rows), flags, 10, 10, 2, 1, 0x1234ABCD)
    out += struct.pack("<BiiiII", 1, -4267, 4267, 0, 3000, 9000)
    out += struct.pack("<BiiiII", 1, -13127, 3580, 0, 8000, 24000)
    out += struct.pack("<BiiiII", 3, -2000, 14000, 0, 6000, 18000)
    for axis in range(3, board.axes):
        gripper = (1, 900, 2100, 1500, 1000, 4000)
        out += struct.pack("<BiiiII", *(gripper if axis == board.gripper else (0,) * 6))
    for flag, weight in guards or [(0, [0] * board.axes)] * board.switches:
        out += struct.pack(f"<B{board.axes}b", flag, *weight)
    for lower, upper, weight in rows:
        out += struct.pack(f"<ii{board.axes}h", lower, upper, *weight)
    return out


digest = 0  # of the session that the conversation is in


def ack(next_: int, error: int = 0, detail: int = 0, state: int = 0, free: int | None = None, queued: int = 0) -> bytes:
    slots = board.queue if free is None else free
    return struct.pack("<6BHH", 0x80, next_, error, detail, state, slots, queued, digest)


def info(tag: int, nonce: int, config_crc: int, known: int, flags: int) -> str:
    head = struct.pack("<BBB", 0x81, tag, 2).hex() + "????" + struct.pack("<IBBHBBBBH", nonce, *board[:8]).hex()
    return head + "????" + struct.pack("<IIHB", board.clock, config_crc, known, flags).hex() + "??????"


def report(
    tag: int,
    next_: int,
    error: int,
    detail: int,
    state: int,
    flags: int,
    known: int,
    counts: list[int],
    free: int | None = None,
    queued: int = 0,
    page: int = 0,
    bad: str = "00",
) -> str:
    free = board.queue if free is None else free
    head = struct.pack("<8BHH", 0x82, tag, next_, error, detail, state, flags, free, queued, known).hex()
    return head + "??00" + bad + struct.pack(f"<BH{len(counts)}iB", page, digest, *counts, 0).hex()


def rates(ticks: int, steps: list[int], unit: int = 1) -> list[int]:
    """Rates that make so many steps in so many ticks, in whole units (256: as the narrow form has them)."""
    out = []
    for s in steps:
        exact = s * STEP / ticks
        small = unit == 1 and abs(exact) < (1 << 15) - 0.5
        coarse = round(exact / 256) * 256
        full = STEP - 128 if coarse > 0 else 128 - STEP  # the greatest rate is a step a tick, but for 2^-16
        out.append(round(exact) if small else coarse if abs(coarse) < 32767 * 256 else full)
    return out


def whole(ticks: int, interval: int, add: int, steps: list[int], unit: int = 256) -> Segment:
    """A segment of whole steps; `interval` and `add` for 16 MHz, so that it lasts as long on every board."""
    pace = board.clock / 16_000_000
    return ticks, min(65535, round(interval * pace)), round(add * pace), rates(ticks, steps, unit)


def steps_of(segments: list[Segment]) -> list[int]:
    """Steps that segments make from rest: places are followed to 2^-23 step."""
    places = [STEP // 2] * len(segments[0][3])
    for t, _, _, r in segments:
        places = [p + t * x for p, x in zip(places, r, strict=True)]
    return [p >> 23 for p in places]


def ramp() -> list[Segment]:
    """Three narrow segments for X Y Z."""
    return [
        whole(100, 8000, -2000, [-10, -50, 28]),
        whole(200, 7200, 0, [-20, -117, 65]),
        whole(100, 7200, 2000, [-10, -50, 29]),
    ]


def back() -> list[Segment]:
    """One wide segment, the same way back."""
    return [whole(400, 6000, 0, [40, 217, -122], 1)]


def grip() -> list[Segment]:
    """The gripper moves."""
    return [whole(300, 20000, 0, [90], 1)]


assert [steps_of(ramp()), steps_of(back()), steps_of(grip())] == [[-40, -217, 122], [40, 217, -122], [90]]


def units(segments: list[Segment]) -> int:
    total = 0
    for t, i, a, _ in segments:
        total += (t * ((i + ((256 * i + (t - 1) * a) >> 8)) // 2)) >> 8
    return total * 256_000 // board.clock
