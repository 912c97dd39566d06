"""Counts of the simulated board's axes, and the rule for their limits."""

from collections.abc import Sequence

from armkin.board.firmware.wire.protocol import Image, RowImage
from armkin.board.sim.host_settings import Setup


def limit_rule_holds(lower: int, upper: int, old_count: int, new_count: int) -> bool:
    """Whether the limits [steps, or weighted steps of a row] let an axis or row go from its old count to the new one.

    Returns True where the new count is within them, or no farther outside on that side than the old one.
    """
    if new_count < lower:
        return new_count >= old_count
    return new_count <= upper or new_count <= old_count


def row_value(row: RowImage, counts: list[int]) -> int:
    """The sum of weight x count [steps] over the axes, which the row's limits bound."""
    return sum(weight * count for weight, count in zip(row.weight, counts, strict=True))


class Axes:
    """The counts of the axes, and which of them are known."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self.known = 0
        self.base = [0] * len(setup.board.axes)  # counts at the running segment's start
        self.net = [0] * len(setup.board.axes)  # steps since power-on: the arm's true motion

    @property
    def image(self) -> Image:
        """The active configuration."""
        return self._setup.image

    def add_steps(self, steps: list[int]) -> None:
        """Add completed steps."""
        self.base = [count + step for count, step in zip(self.base, steps, strict=True)]
        self.net = [count + step for count, step in zip(self.net, steps, strict=True)]

    def lose(self, rates: Sequence[int]) -> None:
        """Forget the counts of the axes that move at these rates."""
        self.known &= ~sum(1 << i for i, rate in enumerate(rates) if rate)
