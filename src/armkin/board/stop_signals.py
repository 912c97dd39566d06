"""Turns signals into a request to stop the arm before the program ends."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from armkin.board.backend import StoppedError
from armkin.signals import put_off


class Stop:
    """Whether a signal has asked to stop: Ctrl-C, SIGTERM, a closed terminal."""

    def __init__(self) -> None:
        self.signal = 0
        self.at_once = False  # whether the arm is at rest, so that a signal ends the program at once

    def __call__(self) -> bool:
        return self.signal != 0

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """The signal handler; a second Ctrl-C does not wait for the board."""
        if (self.signal or self.at_once) and put_off(number, frame):
            return
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        if self.at_once:
            raise StoppedError


_active: list[Stop] = []  # one list for the process, as signal handlers are


@contextmanager
def planning() -> Iterator[None]:
    """Work before the arm moves, which a signal ends at once within an outer `stoppable`."""
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
    codes = (getattr(signal, name, None) for name in names)
    old_handlers = {code: signal.signal(code, stop.on_signal) for code in codes if code}
    _active.append(stop)
    try:
        yield stop
    except StoppedError:
        raise SystemExit(128 + stop.signal) from None
    finally:
        _active.remove(stop)
        for number, handler in old_handlers.items():
            signal.signal(number, handler)
