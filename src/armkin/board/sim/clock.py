"""Simulated time, which passes while a host waits for an answer."""

from __future__ import annotations

from abc import ABC, abstractmethod


class SimulatedTime(ABC):
    """What ports to stand-ins of foreign boards share: the clock, and what was answered since the last reading."""

    step = 0.004  # [s] of simulated time
    simulated = True

    def __init__(self) -> None:
        self._now = 0.0
        self._out = bytearray()

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Let time pass."""

    def read(self, timeout: float) -> bytes:
        """What has been answered; simulated time passes while nothing has."""
        end = self._now + timeout
        while not self._out and self._now < end:
            self.advance(self.step)
        answered, self._out = bytes(self._out), bytearray()
        return answered

    def now(self) -> float:
        """Simulated seconds."""
        return self._now

    def close(self) -> None:
        """What was not read is gone."""
        self._out.clear()
