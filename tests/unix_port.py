"""A simulated port behind a real Unix socket, in real time: what other programs can open."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path
from typing import Self

from pty_port import Simulated


class UnixPort:
    """A Unix socket from `with` to the end of its block, served by a thread; `name` is what a program opens."""

    def __init__(self, board: Simulated, path: Path) -> None:
        self.board, self.name = board, str(path)
        self._end = threading.Event()

    def __enter__(self) -> Self:
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(self.name)
        self._listener.listen(1)
        self._listener.settimeout(0.05)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while not self._end.is_set():
            try:
                link, _ = self._listener.accept()
            except TimeoutError:
                continue
            with link:
                self._talk(link)

    def _talk(self, link: socket.socket) -> None:
        link.settimeout(0.001)
        began = time.monotonic() - self.board.now()
        while not self._end.is_set():
            try:
                heard = link.recv(65_536)
                if not heard:
                    return
                self.board.write(heard)
            except TimeoutError:
                pass
            said = self.board.read(max(0.0, time.monotonic() - began - self.board.now()))
            if said:
                link.sendall(said)
