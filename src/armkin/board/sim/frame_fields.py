"""Reads motion frames and configuration images for the simulated board, and checks every field."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import AxisImage, Error, Image, RowImage, Segment
from armkin.board_catalogue import Board


class RefusedError(Exception):
    """Raised for a frame that is not executed; it ends the session."""

    def __init__(self, error: Error, detail: int = 0) -> None:
        super().__init__(error.name)
        self.error, self.detail = error, detail


@dataclass(frozen=True)
class MotionFields:
    """A MOTION frame's fields."""

    axes: list[int]
    start: tuple[int, ...]
    end: tuple[int, ...]
    segments: list[Segment]
    at_rest: bool
    brake: float  # share of the accelerations that a hold uses


def read_batch(payload: bytes) -> MotionFields:
    """A MOTION frame's fields; its length must follow from them exactly."""
    if len(payload) < 6:
        raise RefusedError(Error.LENGTH)
    mask, flags, n = struct.unpack_from("<HBB", payload, 2)
    axes = axes_of(mask)
    k = len(axes)
    is_wide = bool(flags & protocol.MOTION_WIDE)
    size = protocol.segment_size(k, wide=is_wide)
    gentleness = flags >> protocol.MOTION_GENTLE
    if n == 0 or gentleness >= protocol.GENTLE_PARTS or len(payload) != 6 + 8 * k + n * size:
        raise RefusedError(Error.LENGTH)
    ends = struct.unpack_from(f"<{2 * k}i", payload, 6)
    pieces = (payload[offset : offset + size] for offset in range(6 + 8 * k, len(payload), size))
    segments = [protocol.read_segment(piece, axes, wide=is_wide) for piece in pieces]
    return MotionFields(
        axes, ends[:k], ends[k:], segments, bool(flags & protocol.MOTION_END), 1 - gentleness / protocol.GENTLE_PARTS
    )


def axes_of(mask: int) -> list[int]:
    """Axes of a mask, ascending."""
    return [i for i in range(16) if mask >> i & 1]


_MAX_COUNTS = 2**30  # greatest number [counts] in a field


def image_valid(image: Image, board: Board) -> bool:
    """Whether a board may take a configuration: every field in its range."""
    return (
        len(image.axes) == len(board.axes)
        and len(image.rows) <= board.rows
        and image.step_high <= 80
        and image.step_low <= 50
        and image.dir_setup <= 100
        and all(_axis_valid(axis, servo=board.servo_mask >> i & 1) for i, axis in enumerate(image.axes))
        and all(_weights_valid(guard.weight, image.axes) for guard in image.guards)
        and all(_weights_valid(row.weight, image.axes) and _row_valid(row, image.axes) for row in image.rows)
    )


def _weights_valid(weights: Sequence[int], axes: Sequence[AxisImage]) -> bool:
    """Whether all axes that count are used."""
    return all(axis.used for weight, axis in zip(weights, axes, strict=True) if weight)


def _row_valid(row: RowImage, axes: Sequence[AxisImage]) -> bool:
    """Whether the bounds of a coupled limit are in order, and its sum fits the board's integers."""
    reach = zip(row.weight, axes, strict=True)
    max_sum = sum(abs(weight) * max(abs(axis.lower), abs(axis.upper)) for weight, axis in reach)
    return row.lower <= row.upper and max_sum < _MAX_COUNTS


def _axis_valid(axis: AxisImage, *, servo: int) -> bool:
    """Whether an axis that is used has limits around its home, rates that it can keep, and a servo's pulses."""
    return not axis.used or (
        -_MAX_COUNTS <= axis.lower <= axis.home <= axis.upper <= _MAX_COUNTS
        and axis.max_rate > 0
        and 0 < axis.max_accel < 2**24
        and (not servo or 400 <= axis.lower <= axis.upper <= 2600)
    )
