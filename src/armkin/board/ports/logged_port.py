"""A port whose bytes are logged: `armkin.board` at DEBUG. Nobody pays for it who does not listen."""

from __future__ import annotations

import logging

from armkin.board.ports.port import Port

LOG = logging.getLogger("armkin.board")  # logger of bytes at DEBUG and states at INFO


class Traced:
    """A port that logs what is written to it and read from it."""

    def __init__(self, port: Port) -> None:
        self.inner = port
        self.name, self.simulated, self.baud = port.name, port.simulated, port.baud

    def write(self, data: bytes) -> None:
        """Send bytes."""
        LOG.debug("%.6f %s > %r", self.inner.now(), self.name, data)
        self.inner.write(data)

    def read(self, timeout: float) -> bytes:
        """What has come, or comes within `timeout` seconds."""
        received = self.inner.read(timeout)
        if received:
            LOG.debug("%.6f %s < %r", self.inner.now(), self.name, received)
        return received

    def now(self) -> float:
        """Seconds on the clock."""
        return self.inner.now()

    def close(self) -> None:
        """Give the port back."""
        self.inner.close()


def with_log(port: Port) -> Port:
    """The port, with its bytes logged where somebody listens."""
    return Traced(port) if LOG.isEnabledFor(logging.DEBUG) else port
