"""A port to a simulated board."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from armkin.board.ports import BAUD, SIM

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.board.sim.sim_board import SimBoard

_CATCH_UP_TIME = 0.02  # time [s] that a board in the clock's time makes up for at once, so that its queue is not dry


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
        deadline = self._now + timeout
        while not (received := self.board.take()) and self._now < deadline:
            self.board.advance(0.001)
            self._now += 0.001
        return received

    def now(self) -> float:
        """Seconds on the board's clock."""
        return self._now

    def close(self) -> None:
        """Nothing to give back."""


class Paced:
    """A simulated port in the clock's time; where the computer is late, its time waits."""

    simulated = True

    def __init__(self, port: Port) -> None:
        self.port, self.name, self.baud = port, port.name, port.baud
        self._clock = time.monotonic()
        self._due = port.now()  # what the board's clock shall say

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self.port.write(data)

    def read(self, timeout: float) -> bytes:
        """What the board has said, or says within `timeout` seconds of its time."""
        deadline = self.port.now() + timeout
        while True:
            clock = time.monotonic()
            self._due = min(self._due + clock - self._clock, self.port.now() + _CATCH_UP_TIME)
            self._clock = clock
            received = self.port.read(max(self._due - self.port.now(), 0.0))
            if received or self.port.now() >= deadline:
                return received
            time.sleep(0.001)

    def now(self) -> float:
        """Seconds on the board's clock."""
        return self.port.now()

    def close(self) -> None:
        """Give back what the port holds."""
        self.port.close()
