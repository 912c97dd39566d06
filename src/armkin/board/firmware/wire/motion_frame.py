"""A MOTION frame: segments of some axes from counts to counts, and their bytes."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from armkin.board.firmware.wire.protocol import (
    GENTLE_PARTS,
    MOTION_END,
    MOTION_GENTLE,
    MOTION_WIDE,
    Type,
    mask_of,
)
from armkin.board.firmware.wire.segment_format import Segment, pack_segment, segment_size


def motion(
    tag: int,
    axes: Sequence[int],
    start: Sequence[int],
    end: Sequence[int],
    segments: Sequence[Segment],
    *,
    at_rest: bool,
    wide: bool = False,
    brake: float = 1.0,
) -> bytes:
    """A batch of motion for `axes` (ascending), from absolute counts to absolute counts.

    The short form if all segments fit it, unless `wide`. brake: share of the accelerations that a hold takes, in
    eighths.
    """
    k = len(axes)
    wide = wide or not all(segment.narrow for segment in segments)
    gentle_parts = round((1.0 - brake) * GENTLE_PARTS)
    flags = (MOTION_END if at_rest else 0) | (MOTION_WIDE if wide else 0) | gentle_parts << MOTION_GENTLE
    head = struct.pack(f"<BBHBB{k}i{k}i", Type.MOTION, tag, mask_of(axes), flags, len(segments), *start, *end)
    return head + b"".join(pack_segment(segment, axes, wide=wide) for segment in segments)


def motion_size(axes: int, segments: Sequence[Segment]) -> int:
    """Length of a batch's payload in bytes."""
    narrow = all(segment.narrow for segment in segments)
    return 6 + 8 * axes + len(segments) * segment_size(axes, wide=not narrow)


@dataclass(frozen=True)
class MotionFrame:
    """Segments of some axes, from counts to counts."""

    axes: list[int]
    start: list[int]
    end: list[int]
    segments: list[Segment]
    at_rest: bool
    clock: int
    brake: float = 1.0  # share of the accelerations that a hold takes

    @property
    def seconds(self) -> float:
        """The approximate duration."""
        return sum(segment.units() for segment in self.segments) * 256 / self.clock

    def payload(self, tag: int) -> bytes:
        """The payload of this motion's frame."""
        at_rest, brake = self.at_rest, self.brake
        return motion(tag, self.axes, self.start, self.end, self.segments, at_rest=at_rest, brake=brake)
