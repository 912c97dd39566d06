"""Simulated time, which passes while a host waits for an answer."""

from abc import ABC, abstractmethod


class SimulatedTime(ABC):
    """The base class of ports to simulated boards of other makes: the clock, and unread answers."""

    step = 0.004  # [s] of simulated time
    simulated = True

    def __init__(self) -> None:
        self._now = 0.0
        self._out = bytearray()

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Let time pass."""

    def read(self, timeout: float) -> bytes:
        """The answers since the last call; simulated time passes while there are none."""
        deadline = self._now + timeout
        while not self._out and self._now < deadline:
            self.advance(self.step)
        answers, self._out = bytes(self._out), bytearray()
        return answers

    def now(self) -> float:
        """Simulated seconds."""
        return self._now

    def close(self) -> None:
        """Do nothing; unread answers are lost."""
        self._out.clear()
