"""A port whose bytes are logged by the logger `armkin.board` at DEBUG, and only then."""

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
        """The bytes that have arrived, or arrive within `timeout` seconds."""
        received = self.inner.read(timeout)
        if received:
            LOG.debug("%.6f %s < %r", self.inner.now(), self.name, received)
        return received

    def now(self) -> float:
        """Seconds on the clock."""
        return self.inner.now()

    def close(self) -> None:
        """Close the port."""
        self.inner.close()


def with_log(port: Port) -> Port:
    """The port, with its bytes logged if the logger is at DEBUG."""
    return Traced(port) if LOG.isEnabledFor(logging.DEBUG) else port
