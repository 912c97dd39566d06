"""The simulated board's jogging: the arm moves while the host repeats its vector of rates."""

from collections.abc import Iterator

from armkin.board.sim.cruise import Cruise

_DEAD_MAN = 0.250  # time [s] that a jog goes on after the last JOG


class Jogging:
    """The vector of rates, and its deadline."""

    def __init__(self, cruise: Cruise) -> None:
        self._cruise = cruise
        self._target_rates: list[int] = []
        self._until = 0.0

    def set_rates(self, rate: list[int]) -> None:
        """Move with this vector for another 250 ms."""
        self._target_rates, self._until = rate, self._cruise.now + _DEAD_MAN

    def run(self) -> Iterator[None]:
        """The motion; each item is a millisecond."""
        cruise = self._cruise
        while True:
            cruise.aim(self._target_rates)
            if not any(cruise.rate):
                return
            while not self._is_over() and self._target_rates == cruise.rate:
                if not cruise.clear():
                    self._until = 0.0
                    break
                cruise.glide(1.0)
                yield
            while cruise.share > 0:
                cruise.glide(0.0)
                yield
            if self._is_over():
                return

    def _is_over(self) -> bool:
        return self._cruise.stopped or self._cruise.now >= self._until
