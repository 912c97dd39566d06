"""Limits of coupled joints and limit switches, as the simulated board checks them (firmware/PROTOCOL.md, 4 and 9)."""

from collections.abc import Sequence

from armkin.board.firmware.wire.protocol import Error, GuardImage, Image
from armkin.board.sim.axis_counts import row_value
from armkin.board.sim.frame_fields import RefusedError


class CoupledLimits:
    """The limits of a configuration's coupled joints during one motion."""

    def __init__(self, image: Image, counts: list[int]) -> None:
        self._image = image
        self._nearest = [row_value(row, counts) for row in image.rows] if counts else []

    def check(self, counts: list[int], known_axes: int) -> None:
        """Raise RefusedError if a segment that ends at `counts` takes a joint out of its limits."""
        for number, row in enumerate(self._image.rows):
            end_value, slack = row_value(row, counts), sum(map(abs, row.weight))
            low, high = min(row.lower, self._nearest[number] - slack), max(row.upper, self._nearest[number] + slack)
            is_outside = (end_value < row.lower and end_value < low) or (end_value > row.upper and end_value > high)
            if is_outside and all(known_axes >> i & 1 for i, weight in enumerate(row.weight) if weight):
                raise RefusedError(Error.LIMIT_JOINT, number)
            is_nearest = (
                end_value > self._nearest[number]
                if end_value < row.lower
                else end_value <= row.upper or end_value < self._nearest[number]
            )
            if is_nearest:
                self._nearest[number] = end_value


def leads_to_switch(guard: GuardImage, rates: Sequence[float]) -> bool:
    """Whether axes that move at these rates lead on into a switch."""
    parts = [weight * rate for weight, rate in zip(guard.weight, rates, strict=True)]
    return sum(parts) > max(map(abs, parts)) / 16
