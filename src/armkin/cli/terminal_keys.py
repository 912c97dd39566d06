"""Reads single keys of a terminal, and detects held keys, which a terminal repeats."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from armkin.cli.printing import output
from armkin.errors import UsageError

_FIRST_REPEAT_TIME = 0.8  # longest time [s] to the first repeat of a held key, on any system
_REPEAT_PERIOD = 0.25  # longest time [s] between two repeats
_POLL_TIME = 0.01  # time [s] of one poll
_ARROWS = {"[C": "+", "[A": "+", "[D": "-", "[B": "-", "OC": "+", "OA": "+", "OD": "-", "OB": "-"}
_ARROWS_WINDOWS = {"M": "+", "H": "+", "K": "-", "P": "-"}


class Keys:
    """The operator at a terminal."""

    def __init__(self, poll: Callable[[float], str]) -> None:
        """poll: the next key that comes within so many seconds, else an empty text."""
        self._poll = poll
        self._next_key = ""  # a key that was pressed while another one was held

    def say(self, text: str) -> None:
        """A line to read."""
        output.note(text)

    def key(self) -> str:
        """The next key: a character, ``+`` and ``-`` also for arrows, a line feed for Enter."""
        while not self._next_key:
            self._next_key = self._poll(0.5)
        pressed_key, self._next_key = self._next_key, ""
        return pressed_key

    def ask(self, question: str, answers: str) -> str:
        """One of some keys; what was pressed before the question is none."""
        self._wait_for_silence()
        output.note(f"{question} [{'/'.join(answers)}]")
        while (pressed_key := self.key().lower()) not in answers:
            pass
        return pressed_key

    def held(self, key: str) -> Callable[[], bool] | None:
        """Whether a key is still held, asked again and again; None if it was pressed and let go at once."""
        pressed_key = self._poll(_FIRST_REPEAT_TIME)
        if pressed_key != key:
            self._next_key = pressed_key
            return None
        last = time.monotonic()

        def is_held() -> bool:
            nonlocal last
            pressed_key = self._poll(_POLL_TIME)
            if pressed_key == key:
                last = time.monotonic()
            elif pressed_key:
                self._next_key = pressed_key
            return pressed_key in ("", key) and time.monotonic() - last < _REPEAT_PERIOD

        return is_held

    def _wait_for_silence(self) -> None:
        """Wait until no key comes: one that was held until now answers nothing."""
        self._next_key = ""
        while self._poll(_REPEAT_PERIOD):
            pass


@contextmanager
def keys() -> Iterator[Keys]:
    """The keys of the terminal, without Enter; Ctrl-C stays a signal. Raises UsageError if there is none."""
    if not (sys.stdin is not None and sys.stdin.isatty()):
        raise UsageError("begin asks at a terminal, and standard input is none: run it in one")
    if sys.platform == "win32":
        yield Keys(_poll_windows)
        return
    import termios
    import tty

    settings = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield Keys(_poll_posix)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSAFLUSH, settings)


def _poll_posix(seconds: float) -> str:
    """The key pressed within a time [s], "" for none."""
    import select

    if not select.select([sys.stdin], [], [], seconds)[0]:
        return ""
    read = os.read(sys.stdin.fileno(), 1).decode("ascii", "replace")
    if not read:
        raise UsageError("the terminal is gone: nothing was written")
    if read == "\x1b":
        follows = bool(select.select([sys.stdin], [], [], 0)[0])
        return _ARROWS.get(os.read(sys.stdin.fileno(), 2).decode("ascii", "replace") if follows else "", "\x1b")
    return {"\r": "\n", "=": "+", "_": "-"}.get(read, read)


def _poll_windows(seconds: float) -> str:
    """The key pressed within a time [s], "" for none."""
    if sys.platform != "win32":
        return ""
    import msvcrt

    deadline = time.monotonic() + seconds
    while not msvcrt.kbhit():
        if time.monotonic() >= deadline:
            return ""
        time.sleep(0.002)
    read = msvcrt.getwch()
    if read in "\0\xe0":
        return _ARROWS_WINDOWS.get(msvcrt.getwch(), "\x1b")
    if read == "\x03":
        raise KeyboardInterrupt
    return {"\r": "\n", "=": "+", "_": "-"}.get(read, read)
