"""A port to a simulated board."""

from __future__ import annotations

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
        """Simulated seconds."""
        return self._now

    def close(self) -> None:
        """Nothing to give back."""
