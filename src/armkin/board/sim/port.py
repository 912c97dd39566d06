"""A port to a simulated board."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from armkin.board.ports import BAUD, SIM

if TYPE_CHECKING:
    from armkin.board.sim.board import SimBoard


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
    """A simulated board in this process, in the clock's time."""

    def __init__(self, board: SimBoard, name: str = SIM) -> None:
        super().__init__(board, name)
        self._now = time.monotonic()

    def read(self, timeout: float) -> bytes:
        """What the board has said, or says within `timeout` seconds."""
        end = time.monotonic() + timeout
        while True:
            now = time.monotonic()
            # Of a longer pause, as of a machine that slept, a second is enough for the board to notice.
            self.board.advance(min(now - self._now, 1.0))
            self._now = now
            data = self.board.take()
            if data or now >= end:
                return data
            time.sleep(0.001)
