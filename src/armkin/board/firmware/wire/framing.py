"""Converts payloads to bytes on the line and back (firmware/PROTOCOL.md, section 1).

payload  --encode_frame-->  COBS(payload + CRC-32) 00  --Splitter-->  payload
"""

import struct
import zlib
from collections.abc import Iterator

MAX_FRAME = 250  # size [bytes] of payload and CRC: COBS then adds one byte


def cobs_encode(raw: bytes) -> bytes:
    """Consistent overhead byte stuffing (Cheshire & Baker 1999) of at most 254 bytes.

    >>> cobs_encode(bytes([1, 0, 2])).hex()
    '02010202'
    """
    if len(raw) > 254:
        raise ValueError(f"{len(raw)} bytes in a frame; 254 fit")
    return b"".join(bytes([len(block) + 1]) + block for block in raw.split(b"\0"))


def cobs_decode(stuffed: bytes) -> bytes | None:
    """The inverse of `cobs_encode`; None if the stuffing is broken."""
    blocks, offset = [], 0
    while offset < len(stuffed):
        code = stuffed[offset]
        if code == 0 or offset + code > len(stuffed):
            return None
        blocks.append(stuffed[offset + 1 : offset + code])
        offset += code
    if not blocks or any(0 in block for block in blocks):
        return None
    return b"\0".join(blocks)


def encode_frame(payload: bytes) -> bytes:
    """A payload as it goes over the line: with CRC, stuffed, ended by a zero.

    >>> encode_frame(bytes([3, 9])).hex()
    '07030998f9281300'
    """
    if len(payload) + 4 > MAX_FRAME:
        raise ValueError(f"a payload of {len(payload)} bytes; {MAX_FRAME - 4} fit")
    return cobs_encode(payload + struct.pack("<I", zlib.crc32(payload))) + b"\0"


def decode_frame(frame: bytes) -> bytes | None:
    """The payload of a frame without its zero; None if it is damaged."""
    unstuffed = cobs_decode(frame)
    if unstuffed is None or not 6 <= len(unstuffed) <= MAX_FRAME:
        return None
    payload = unstuffed[:-4]
    return payload if struct.unpack("<I", unstuffed[-4:])[0] == zlib.crc32(payload) else None


class Splitter:
    """Splits a stream of bytes into payloads, and counts damaged frames in `bad`."""

    def __init__(self, largest: int = MAX_FRAME) -> None:
        self.bad = 0
        self._largest = largest + 1
        self._incomplete = bytearray()
        self._skip = False  # whether the present frame is too long

    def feed(self, received: bytes) -> Iterator[bytes]:
        """The payloads that `received` completes."""
        *frames, incomplete = received.split(b"\0")
        for frame in frames:
            stuffed = bytes(self._incomplete) + frame
            self._incomplete.clear()
            if self._skip or len(stuffed) > self._largest:
                self._skip = False
                self.bad += 1
            elif stuffed:
                payload = decode_frame(stuffed)
                if payload is None:
                    self.bad += 1
                else:
                    yield payload
        self._incomplete += incomplete
        if len(self._incomplete) > self._largest:
            self._incomplete.clear()
            self._skip = True
