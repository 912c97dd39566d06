"""Packets of the Feetech serial bus (SCServo protocol, the maker's "Communication Protocol User Manual").

    FF FF id length instruction parameters... checksum      from the host
    FF FF id length errors      parameters... checksum      from a servo

Length is the number of bytes behind it; the checksum is the complement of the sum from `id` on.
"""

from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

BROADCAST = 0xFE  # id of a broadcast, which no servo answers but with a sync read
MAX_BYTES = 250  # size [bytes] of the longest packet that a servo takes


class Instruction(IntEnum):
    """The instructions of the bus."""

    PING = 1
    READ = 2
    WRITE = 3
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


class Reply(NamedTuple):
    """A servo's answer: its error bits and the bytes that were read."""

    id: int
    errors: int
    data: bytes


def packet(servo: int, kind: int, parameters: bytes = b"") -> bytes:
    """The bytes of an instruction, or of a servo's answer with its error bits as `kind`.

    >>> packet(1, Instruction.PING).hex(" ")
    'ff ff 01 02 01 fb'
    """
    body = bytes([servo, len(parameters) + 2, kind]) + parameters
    if len(body) + 3 > MAX_BYTES:
        raise ValueError(f"a packet of {len(body) + 3} bytes; servos take {MAX_BYTES}")
    return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def read_registers(servo: int, address: int, size: int) -> bytes:
    """Ask one servo for registers."""
    return packet(servo, Instruction.READ, bytes([address, size]))


def write_registers(servo: int, address: int, values: bytes) -> bytes:
    """Write registers of one servo, which acknowledges it."""
    return packet(servo, Instruction.WRITE, bytes([address]) + values)


def sync_read(servos: Sequence[int], address: int, size: int) -> bytes:
    """Ask several servos for the same registers; they answer one after another, in this order."""
    return packet(BROADCAST, Instruction.SYNC_READ, bytes([address, size, *servos]))


def sync_write(address: int, values_of: Mapping[int, bytes]) -> bytes:
    """Write the same registers of several servos at once, without acknowledgement."""
    size = len(next(iter(values_of.values())))
    rows = b"".join(bytes([servo]) + values for servo, values in values_of.items())
    return packet(BROADCAST, Instruction.SYNC_WRITE, bytes([address, size]) + rows)


class Splitter:
    """Splits received bytes into packets, without damaged ones."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def feed(self, received: bytes) -> Iterator[Reply]:
        """Add bytes and yield every complete packet; `errors` of an instruction is its number."""
        self._bytes += received
        while (begin := self._bytes.find(b"\xff\xff")) >= 0:
            del self._bytes[:begin]
            if len(self._bytes) < 4:
                return
            servo, length = self._bytes[2], self._bytes[3]
            if servo == 0xFF or not 2 <= length <= MAX_BYTES - 4:
                del self._bytes[:1]  # this byte does not begin a packet
                continue
            if len(self._bytes) < length + 4:
                return
            body, check = bytes(self._bytes[2 : length + 3]), self._bytes[length + 3]
            if ~sum(body) & 0xFF != check:
                del self._bytes[:1]
                continue
            del self._bytes[: length + 4]
            yield Reply(servo, body[2], body[3:])
        del self._bytes[: max(len(self._bytes) - 1, 0)]

    def clear(self) -> None:
        """Drop the bytes of an incomplete packet."""
        self._bytes.clear()
