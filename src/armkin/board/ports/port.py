"""The interface of every port: bytes in both directions, and a clock."""

from typing import Protocol

BAUD = 250_000  # rate [bit/s] of the firmware's port
SIM = "sim"  # name of a port to a board in this process


class Port(Protocol):
    """Bytes to and from a board, and the clock for its timeouts."""

    name: str
    simulated: bool
    baud: int

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def read(self, timeout: float) -> bytes:
        """The bytes that have arrived, or arrive within `timeout` seconds; empty for none."""

    def now(self) -> float:
        """Seconds on the clock."""

    def close(self) -> None:
        """Close the port; the board keeps its position, and its motors stay on."""
