"""A simulated port behind a real pseudo-terminal, in real time: what other programs can open."""

from __future__ import annotations

import math
import os
import select
import threading
import time
import tty
from collections.abc import Callable
from typing import Protocol, Self

from armkin.board.sim.clock import SimulatedTime


class Simulated(Protocol):
    """A port in simulated time."""

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def read(self, timeout: float) -> bytes:
        """What has been answered."""

    def now(self) -> float:
        """Simulated seconds."""


class Patient:
    """The time that passes for a board: the clock's, which waits for a host that has fallen silent.

    A busy machine may give the host no time for longer than the board waits for it. `patience`: [s] of the board's
    time after which it waits, sooner if no silence was a third as long lately; a host asks ten times a second, and
    much oftener while it fills a queue. Infinite: it never waits.
    """

    def __init__(self, patience: float = 0.12) -> None:
        self.patience = patience
        self._silent = 0.0  # [s] of the board's time since the host was heard
        self._last = self._heard = time.monotonic()
        self._gaps = (patience, patience)  # [s] between words, lately

    def passed(self, *, heard: bool, is_open: bool = True) -> float:
        """Seconds since this was asked last, for a board; heard: the host was; is_open: it has the port open.

        At most 20 ms: a machine that was busy is not made up for, while the host has had no chance to answer.
        """
        present = time.monotonic()
        seconds, self._last = min(present - self._last, 0.02), present
        if heard or not is_open:
            if present - self._heard > 0.002:  # else it belongs to what came before
                self._gaps = (present - self._heard, self._gaps[0])
            self._silent, self._heard = 0.0, present
        elif self._silent >= self._waits() and present - self._heard < 20:  # whoever says nothing for 20 s means it
            return 0.0
        self._silent += seconds
        return seconds

    def _waits(self) -> float:
        return self.patience if math.isinf(self.patience) else min(self.patience, max(0.02, 3 * min(self._gaps)))


class Served:
    """What serves a name that other programs open, from `with` to the end of its block, in a thread."""

    name: str

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._end = threading.Event()

    def __enter__(self) -> Self:
        self._open()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._thread.join()
        self._close()

    def _open(self) -> None:
        raise NotImplementedError

    def _close(self) -> None:
        raise NotImplementedError

    def _serve(self) -> None:
        raise NotImplementedError

    def _talk(self, board: Simulated, line: int, receive: Callable[[], bytes], send: Callable[[bytes], object]) -> None:
        """Let the board and a program talk, the board's seconds being real ones, until the program closes its end."""
        began = time.monotonic() - board.now()
        while not self._end.is_set():
            try:
                heard = receive()
                if not heard:
                    return
            except BlockingIOError:
                heard = b""
            with self.lock:
                if heard:
                    board.write(heard)
                late = max(0.0, time.monotonic() - began - board.now())
                answer = board.read(min(late, 0.02))  # what it is late by it makes up for, and listens all the same
            if answer:
                send(answer)
            elif not heard and late < 0.02:
                select.select([line], [], [], 0.004)


class Pty(Served):
    """A pseudo-terminal."""

    def _open(self) -> None:
        self._master, self._slave = os.openpty()  # the slave stays open: else the master fails between programs
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)

    def _close(self) -> None:
        os.close(self._slave)
        os.close(self._master)


class PtyPort(Pty):
    """A simulated port behind a pseudo-terminal."""

    def __init__(self, board: Simulated) -> None:
        super().__init__()
        self.board = board
        if isinstance(board, SimulatedTime):
            board.step = max(board.step, 0.004)  # a finer one takes a busy machine longer than the time that it is

    def _serve(self) -> None:
        self._talk(
            self.board, self._master, lambda: os.read(self._master, 4096), lambda said: os.write(self._master, said)
        )
