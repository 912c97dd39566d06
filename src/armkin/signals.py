"""Signals raise no exception in an import, nor in pydantic: both make other errors of it, or swallow it.

A class half made wraps it in a RuntimeError (Python 3.11), a validator half built in a SchemaError, and a weak
reference's callback drops it.
"""

from __future__ import annotations

import _thread
import sys
import time

TYPE_CHECKING = False  # as in the package: this is imported before signals are taken

if TYPE_CHECKING:
    from types import FrameType

_AGAIN_S = 0.01  # time [s] between two looks
_waiting: set[int] = set()  # signals that come again
_NOT_IN = ("_frozen_importlib", "importlib._bootstrap", "pydantic.")  # no exception may be raised in these


def handle_interrupt(number: int, frame: FrameType | None) -> None:
    """The handler of Ctrl-C; while modules are imported or robot files checked, it waits."""
    if not put_off(number, frame):
        raise KeyboardInterrupt


def put_off(number: int, frame: FrameType | None) -> bool:
    """Whether `frame` is where no exception may be raised; the signal comes again then."""
    while frame is not None and not str(frame.f_globals.get("__name__")).startswith(_NOT_IN):
        frame = frame.f_back
    if frame is None:
        _waiting.discard(number)
        return False
    if number not in _waiting:
        _waiting.add(number)
        _thread.start_new_thread(_repeat_signal, (number, _thread.get_ident()))
    return True


def _repeat_signal(number: int, main: int) -> None:
    """Send the signal until it is taken.

    Once would not do: this thread runs as soon as the other one lets go of the interpreter, which is just before
    it waits in a read, and a signal that comes before the read ends none.
    """
    import signal

    while True:
        time.sleep(_AGAIN_S)
        if number not in _waiting:
            return
        if sys.platform == "win32":
            _thread.interrupt_main(signal.Signals(number))
        else:
            signal.pthread_kill(main, number)
