"""The simulated board's inputs: limit switches, the abort input, the motors' supply."""

from collections.abc import Callable, Sequence

from armkin.board.sim.coupled_limits import leads_to_switch
from armkin.board.sim.host_settings import Setup


class Inputs:
    """Levels of the inputs, and their meaning in the active configuration."""

    def __init__(self, setup: Setup, switch: Callable[[int], bool] | None = None) -> None:
        self._setup = setup
        self._switch = switch or self._released_level
        self.abort_level = True  # pulled up
        self.power_level = True

    def level(self, number: int) -> bool:
        """Level of a limit input."""
        return self._switch(number)

    def is_aborted(self) -> bool:
        """Whether the abort input is active."""
        return bool(self._setup.crc) and self.abort_level == self._setup.image.abort_closed

    def power_cut(self) -> bool:
        """Whether the motors' supply is sensed and off."""
        return bool(self._setup.crc) and self._setup.image.power_sensed and not self.power_level

    def switch_ahead(self, rates: Sequence[float]) -> int | None:
        """The first pressed guarding switch in the direction of these rates."""
        if not self._setup.crc:
            return None
        for n, guard in enumerate(self._setup.image.guards):
            if any(guard.weight) and self.level(n) == guard.closed and leads_to_switch(guard, rates):
                return n
        return None

    def _released_level(self, number: int) -> bool:
        """Level of a released switch: low if it is normally closed."""
        guards = self._setup.image.guards
        return not (self._setup.crc and number < len(guards) and guards[number].closed)
