"""What every port can do: carry bytes both ways and tell the time."""

from __future__ import annotations

from typing import Protocol

BAUD = 250_000  # rate [bit/s] of the firmware's port
SIM = "sim"  # name of a port to a board in this process


class Port(Protocol):
    """Bytes to and from a board, and the clock that its answers are timed with."""

    name: str
    simulated: bool
    baud: int

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def read(self, timeout: float) -> bytes:
        """What has come, or comes within `timeout` seconds; empty if nothing does."""

    def now(self) -> float:
        """Seconds on the clock."""

    def close(self) -> None:
        """Give the port back. The board keeps its position, its motors stay on."""
