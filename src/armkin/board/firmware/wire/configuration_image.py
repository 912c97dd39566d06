"""The configuration image, which has all data that a board needs of its arm (firmware/PROTOCOL.md, section 4)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

_LAYOUT_VERSION = 2  # version of the image's layout
_AXIS_BYTES = 21  # size [bytes] of an axis


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
class GuardImage:
    """A limit switch, which forbids motion with a positive sum of weight x rate while it is pressed."""

    closed: bool = False  # normally closed
    weight: tuple[int, ...] = ()  # a byte each; all 0: the switch guards nothing

    def pack(self, axes: int) -> bytes:
        """The switch's bytes in the configuration of a board of so many axes."""
        weight = self.weight or (0,) * axes
        is_used = any(weight)
        return struct.pack(f"<B{axes}b", is_used | (is_used and self.closed) << 1, *weight)


@dataclass(frozen=True)
class RowImage:
    """The limit lower <= sum of weight x count <= upper."""

    lower: int
    upper: int
    weight: tuple[int, ...]


@dataclass(frozen=True)
class Image:
    """The data that a board needs of its arm; times in 0.1 us, `wake` in ms."""

    axes: tuple[AxisImage, ...]
    rows: tuple[RowImage, ...] = ()
    guards: tuple[GuardImage, ...] = ()  # one for every switch input of the board
    abort_closed: bool = False
    enable_high: bool = False
    power_sensed: bool = False
    step_high: int = 10
    step_low: int = 10
    dir_setup: int = 2
    wake: int = 1
    meaning: int = 0

    def pack(self) -> bytes:
        """The image's bytes."""
        n = len(self.axes)
        flags = self.abort_closed | self.enable_high << 1 | self.power_sensed << 2
        times = (self.step_high, self.step_low, self.dir_setup, self.wake)
        packed = struct.pack("<8BI", _LAYOUT_VERSION, n, len(self.rows), flags, *times, self.meaning)
        for a in self.axes:
            marks = a.used | a.invert << 1
            packed += struct.pack("<BiiiII", marks, a.lower, a.upper, a.home, a.max_rate, a.max_accel)
        packed += b"".join(guard.pack(n) for guard in self.guards)
        for row in self.rows:
            packed += struct.pack(f"<ii{n}h", row.lower, row.upper, *row.weight)
        return packed

    @classmethod
    def unpack(cls, raw: bytes, switches: int) -> Image | None:
        """The image in some bytes; None if layout or length are wrong. The board checks the ranges."""
        if len(raw) < 12:
            return None
        layout, n, rows, flags, high, low, setup, wake, meaning = struct.unpack_from("<8BI", raw)
        axes_end = 12 + _AXIS_BYTES * n
        guards_end = axes_end + (1 + n) * switches
        if layout != _LAYOUT_VERSION or flags > 7 or len(raw) != guards_end + (8 + 2 * n) * rows:
            return None
        axes, guards = _unpack_axes(raw[12:axes_end]), _unpack_guards(raw[axes_end:guards_end], n)
        if axes is None or guards is None:
            return None
        rows_of_limits = struct.iter_unpack(f"<ii{n}h", raw[guards_end:])
        limits = tuple(RowImage(lower, upper, tuple(weight)) for lower, upper, *weight in rows_of_limits)
        bits = bool(flags & 1), bool(flags & 2), bool(flags & 4)
        return cls(axes, limits, guards, *bits, high, low, setup, wake, meaning)

    def crc(self) -> int:
        """The value of INFO's `config` while this image is active."""
        return zlib.crc32(self.pack())


def _unpack_axes(raw: bytes) -> tuple[AxisImage, ...] | None:
    """The axes in some bytes; None if one has unknown marks."""
    axes = []
    for marks, *fields in struct.iter_unpack("<BiiiII", raw):
        if marks > 3:
            return None
        axes.append(AxisImage(bool(marks & 1), bool(marks & 2), *fields))
    return tuple(axes)


def _unpack_guards(raw: bytes, n: int) -> tuple[GuardImage, ...] | None:
    """The switches' guards in some bytes, of a board of n axes; None if one has unknown marks, or weights unmarked."""
    guards = []
    for marks, *weight in struct.iter_unpack(f"<B{n}b", raw):
        if marks > 3 or any(weight) != bool(marks & 1):
            return None
        guards.append(GuardImage(bool(marks & 2), tuple(weight)))
    return tuple(guards)
