"""A Unix socket as a port, for Klipper's API server on this computer."""

import os
import select
import socket
import stat
import time
from contextlib import suppress

from armkin.board.ports.port_lock import Lock
from armkin.errors import LinkError


def is_socket(name: str) -> bool:
    """Whether a name is that of a Unix socket."""
    with suppress(OSError):
        return stat.S_ISSOCK(os.stat(name).st_mode)
    return False


class SocketPort:
    """A Unix socket, held exclusively among armkin's programs."""

    simulated = False

    def __init__(self, name: str) -> None:
        self.name, self.baud = name, 0
        if not hasattr(socket, "AF_UNIX"):
            raise LinkError(f"port {name}: this system has no Unix sockets; use socket://HOST:NUMBER")
        self._lock = Lock(name)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(2.0)
            self._socket.connect(name)
        except OSError as error:
            self.close()
            raise LinkError(_open_error(name, error)) from None

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"{self.name} is gone ({error}): does Klipper still run?") from None

    def read(self, timeout: float) -> bytes:
        """The bytes that have arrived, or arrive within `timeout` seconds."""
        try:
            readable, _, _ = select.select([self._socket], [], [], max(timeout, 0.0))
            if not readable:
                return b""
            received = self._socket.recv(65_536)
        except (OSError, ValueError) as error:
            raise LinkError(f"{self.name} is gone ({error}): does Klipper still run?") from None
        if not received:
            raise LinkError(f"{self.name} was closed at the other end: does Klipper still run?")
        return received

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Close the port."""
        self._socket.close()
        self._lock.release()


def _open_error(name: str, error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return f"there is no socket {name}: klippy.py is started with -a {name}"
    if isinstance(error, ConnectionRefusedError):
        cause = "nobody listens there: does Klipper run?" if is_socket(name) else "it is no socket"
        return f"port {name}: {cause}"
    return f"port {name} cannot be opened: {error.strerror or error}"
