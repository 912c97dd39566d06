"""A port to a simulated board."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from armkin.board.ports import BAUD, SIM

if TYPE_CHECKING:
    from armkin.board.sim.board import SimBoard

_LATE = (
    0.02  # [s] that a board in the clock's time makes up for at once: its queue must not run dry for a busy computer
)


class SimPort:
    """A simulated board in this process, in simulated time."""

    simulated = True
    baud = BAUD

    def __init__(self, board: SimBoard, name: str = SIM) -> None:
        self.name, self.board = name, board
        self._now = 0.0

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self.board.receive(data)

    def read(self, timeout: float) -> bytes:
        """What the board has said, or says within `timeout` seconds of its time."""
        end = self._now + timeout
        while not (data := self.board.take()) and self._now < end:
            self.board.advance(0.001)
            self._now += 0.001
        return data

    def now(self) -> float:
        """Seconds on the board's clock."""
        return self._now

    def close(self) -> None:
        """Nothing to give back."""


class PacedSimPort(SimPort):
    """A simulated board in this process, in the clock's time; where the computer is late, its time waits."""

    def __init__(self, board: SimBoard, name: str = SIM) -> None:
        super().__init__(board, name)
        self._clock = time.monotonic()

    def read(self, timeout: float) -> bytes:
        """What the board has said, or says within `timeout` seconds of its time."""
        end = self._now + timeout
        while True:
            clock = time.monotonic()
            step = min(clock - self._clock, _LATE)
            self._clock, self._now = clock, self._now + step
            self.board.advance(step)
            data = self.board.take()
            if data or self._now >= end:
                return data
            time.sleep(0.001)
