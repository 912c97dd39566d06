"""A segment of motion: its fields, and its two forms on the line (firmware/PROTOCOL.md, section 6)."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

STEP = 1 << 23  # units of a rate and of a place in one step
HALF = STEP // 2  # place of an axis at rest, above its count
COARSE_UNIT = 1 << 8  # unit of rates from 2^-8 step a tick on, in units of a rate
FINE_BOUND = 1 << 15  # rates below this bound are sent in units of 1
_MAX_RATE = STEP - 128  # greatest rate, 2^-16 below a step a tick
BLOCK = 16  # ticks with the same `add`, counted from the segment's end


def count_at(place: int) -> int:
    """The count of an axis at a place [2^-23 step]."""
    return place // STEP


@dataclass(frozen=True)
class Segment:
    """A segment of T ticks, the first after `interval` cycles, with a rate for each axis.

    rates: 2^-23 steps a tick, signed; from 2^-8 step on multiples of `COARSE_UNIT`, or STEP - 128. An axis at place P
    is at P + T x rate afterwards, and its count is P >> 23. The interval grows by `add` [2^-16 cycles] with each
    tick, and `add` by `bend`: 2^-22 cycles with every 16th, counted from the end, or quick: 2^-17 with each.
    """

    ticks: int
    interval: int
    add: int
    rates: tuple[int, ...]
    bend: int = 0
    quick: bool = False

    def for_axes(self, axes: Sequence[int]) -> Segment:
        """This segment for some of its axes."""
        return replace(self, rates=tuple(self.rates[k] for k in axes))

    def interval_after(self, ticks: int) -> int:
        """Cycles of the interval behind `ticks` ticks, without rounding from tick to tick."""
        if self.quick:
            return self.interval + (self.add * ticks >> 16) + (self.bend * (ticks * (ticks - 1) // 2) >> 17)
        blocks, ticks_left = divmod(max(0, ticks - (self.ticks - 1) % BLOCK - 1), BLOCK)
        bends = (BLOCK // 2 * blocks + ticks_left) * (blocks + 1)
        return self.interval + (self.add * ticks >> 16) + (self.bend * (bends >> 8) >> 14)

    @property
    def last_interval(self) -> int:
        """Cycles before the last tick."""
        return self.interval_after(self.ticks - 1)

    @property
    def last_add(self) -> int:
        """Change of the interval at its end, 2^-16 cycle a tick."""
        if self.quick:
            return self.add + (self.bend * (self.ticks - 1) >> 1)
        return self.add + (self.bend * ((self.ticks - 1) // BLOCK) >> 6)

    @property
    def growth(self) -> tuple[int, int]:
        """The growth of `add` [2^-24 cycle], and the number of ticks between two growths, counted from the end."""
        return (128 * self.bend, 1) if self.quick else (4 * self.bend, BLOCK)

    @property
    def narrow(self) -> bool:
        """Whether it fits the short form: 8 bits for ticks, 16 for `add`, coarse rates."""
        is_coarse = all(rate % COARSE_UNIT == 0 or abs(rate) == _MAX_RATE for rate in self.rates)
        return self.ticks <= 255 and self.bend == 0 and self.add % 256 == 0 and abs(self.add) < 1 << 23 and is_coarse

    @property
    def steps(self) -> tuple[int, ...]:
        """Steps of every axis if the segment begins in the middle between two steps, as at rest."""
        return tuple(count_at(HALF + self.ticks * rate) for rate in self.rates)

    def units(self) -> int:
        """The segment's length as the queue counts it, in units of 256 cycles."""
        return (self.ticks * ((self.interval + self.last_interval) // 2)) >> 8


def nearest_rate(exact: float) -> int:
    """The rate of a wide segment that is nearest to `exact` [2^-23 steps a tick]."""
    if abs(exact) < FINE_BOUND - 0.5:
        return round(exact)
    return _coarse_rate(exact)


def _coarse_rate(exact: float) -> int:
    rate = round(exact / COARSE_UNIT)
    return rate * COARSE_UNIT if abs(rate) < FINE_BOUND - 1 else int(math.copysign(_MAX_RATE, rate))


def _sent_rate(rate: int) -> int:
    """A coarse rate as it is sent."""
    return int(rate / COARSE_UNIT)


def _full_rate(sent_rate: int) -> int:
    """The rate [2^-23 steps a tick] of a coarse rate as it was sent."""
    return sent_rate * COARSE_UNIT if abs(sent_rate) != FINE_BOUND - 1 else int(math.copysign(_MAX_RATE, sent_rate))


def whole_steps(ticks: int, interval: int, add: int, steps: Sequence[int]) -> Segment:
    """A segment of whole steps, from the middle between two to the middle between two, as near as rates come.

    add: 1/256 cycle a tick.

    >>> whole_steps(100, 1600, 0, (50, -100)).steps
    (50, -100)
    """
    exact = (step * STEP / ticks for step in steps)
    is_short = ticks <= 255
    rates = (_coarse_rate(rate) if is_short else nearest_rate(rate) for rate in exact)
    return Segment(ticks, interval, add * 256, tuple(rates))


def pack_segment(segment: Segment, axes: Sequence[int], *, wide: bool) -> bytes:
    """A segment's bytes; bit i of the wide form's `fine` is axis i, bit 15 `quick`."""
    ticks, interval, rates = segment.ticks, segment.interval, segment.rates
    if not wide:
        return struct.pack(f"<BHh{len(rates)}h", ticks, interval, segment.add // 256, *map(_sent_rate, rates))
    fine = sum(1 << axis for axis, rate in zip(axes, rates, strict=True) if abs(rate) < FINE_BOUND)
    sent_rates = (rate if abs(rate) < FINE_BOUND else _sent_rate(rate) for rate in rates)
    head = struct.pack("<HH", ticks, interval) + segment.add.to_bytes(3, "little", signed=True)
    return head + struct.pack(f"<hH{len(rates)}h", segment.bend, fine | segment.quick << 15, *sent_rates)


def segment_size(axes: int, *, wide: bool) -> int:
    """Bytes of a segment."""
    return (11 if wide else 5) + 2 * axes


def read_segment(raw: bytes, axes: Sequence[int], *, wide: bool) -> Segment:
    """A segment of its bytes (for the simulated board)."""
    if not wide:
        ticks, interval, add, *sent_rates = struct.unpack(f"<BHh{len(axes)}h", raw)
        return Segment(ticks, interval, add * 256, tuple(map(_full_rate, sent_rates)))
    ticks, interval = struct.unpack_from("<HH", raw)
    bend, fine, *sent_rates = struct.unpack_from(f"<hH{len(axes)}h", raw, 7)
    is_fine = (fine >> axis & 1 and rate != -FINE_BOUND for axis, rate in zip(axes, sent_rates, strict=True))
    rates = tuple(
        rate if sent_whole else _full_rate(rate) for rate, sent_whole in zip(sent_rates, is_fine, strict=True)
    )
    add = int.from_bytes(raw[4:7], "little", signed=True)
    return Segment(ticks, interval, add, rates, bend, quick=bool(fine >> 15))
