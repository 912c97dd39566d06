"""The configuration image: all that a board knows of its arm (firmware/PROTOCOL.md, section 4)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass


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
        return cls(tuple(axes), tuple(limits), bool(flags & 1), bool(flags & 2), high, low, setup, wake, meaning)

    def crc(self) -> int:
        """What INFO's `config` says while this image is in force."""
        return zlib.crc32(self.pack())
