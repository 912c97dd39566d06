"""Signals while an arm moves: a request to stop it first."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from armkin.board.backend import StoppedError
from armkin.signals import put_off


class Stop:
    """Whether somebody asked to stop: Ctrl-C, SIGTERM, a closed terminal."""

    def __init__(self) -> None:
        self.signal = 0
        self.at_once = False  # nothing moves: there is nothing to wait for

    def __call__(self) -> bool:
        return self.signal != 0

    def caught(self, number: int, frame: FrameType | None) -> None:
        """The signal handler; a second Ctrl-C does not wait for the board."""
        if (self.signal or self.at_once) and put_off(number, frame):
            return
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        if self.at_once:
            raise StoppedError


_active: list[Stop] = []  # signal handlers belong to the process, and so does who listens to them


@contextmanager
def planning() -> Iterator[None]:
    """Work before anything moves: a signal ends it at once, within whatever `stoppable` it is done."""
    if not _active:
        yield
        return
    stop = _active[-1]
    stop.at_once = True
    try:
        if stop():
            raise StoppedError
        yield
    finally:
        stop.at_once = False


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Turn signals into a request that the arm be stopped first; then exit with 128 + signal."""
    stop = Stop()
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
    before = {n: signal.signal(n, stop.caught) for n in (getattr(signal, s, None) for s in names) if n}
    _active.append(stop)
    try:
        yield stop
    except StoppedError:
        raise SystemExit(128 + stop.signal) from None
    finally:
        _active.remove(stop)
        for number, handler in before.items():
            signal.signal(number, handler)
