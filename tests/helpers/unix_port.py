"""A simulated port behind a real Unix socket, in real time: what other programs can open."""

from __future__ import annotations

import socket
from pathlib import Path

from pty_port import Served, Simulated


class UnixPort(Served):
    """A simulated port behind a Unix socket."""

    def __init__(self, board: Simulated, path: Path) -> None:
        super().__init__()
        self.board, self.name = board, str(path)

    def _open(self) -> None:
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(self.name)
        self._listener.listen(1)
        self._listener.settimeout(0.05)

    def _close(self) -> None:
        self._listener.close()

    def _serve(self) -> None:
        while not self._end.is_set():
            try:
                link, _ = self._listener.accept()
            except TimeoutError:
                continue
            with link:
                link.setblocking(False)
                self._talk(self.board, link.fileno(), lambda link=link: link.recv(65_536), link.sendall)  # type: ignore[misc]
