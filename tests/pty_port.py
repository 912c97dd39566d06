"""A simulated port behind a real pseudo-terminal, in real time: what other programs can open."""

from __future__ import annotations

import os
import threading
import time
import tty
from typing import Protocol, Self


class Simulated(Protocol):
    """A port in simulated time."""

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def read(self, timeout: float) -> bytes:
        """What has been answered."""

    def now(self) -> float:
        """Simulated seconds."""


class Pty:
    """A pseudo-terminal from `with` to the end of its block, served by a thread; `name` is what a program opens."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._end = threading.Event()

    def __enter__(self) -> Self:
        self._master, self._slave = os.openpty()  # the slave stays open: else the master fails between programs
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)

    def _serve(self) -> None:
        raise NotImplementedError


class PtyPort(Pty):
    """A simulated port behind it."""

    def __init__(self, board: Simulated) -> None:
        super().__init__()
        self.board = board

    def _serve(self) -> None:
        began = time.monotonic() - self.board.now()
        while not self._end.is_set():
            try:
                heard = os.read(self._master, 4096)
            except BlockingIOError:
                heard = b""
            with self.lock:
                if heard:
                    self.board.write(heard)
                said = self.board.read(max(0.0, time.monotonic() - began - self.board.now()))
            if said:
                os.write(self._master, said)
            elif not heard:
                time.sleep(0.0005)
