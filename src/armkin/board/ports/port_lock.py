"""The lock of a port, which keeps two programs from using the same arm.

The process that holds the lock can be found and asked to stop, so `armkin stop` in another terminal stops the arm.
"""

from __future__ import annotations

import _thread
import hashlib
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from armkin.board.ports.port import SIM
from armkin.errors import PortInUseError
from armkin.user_folders import port_file_stem

if TYPE_CHECKING:
    from filelock import BaseFileLock

_POLL_S = 0.05  # time [s] between two checks for a stop request
_signals = os.name == "posix"  # elsewhere a signal ends a process at once, so a file makes the request


class Lock:
    """The lock of a port, held until release or the end of this process, whose number is in a file beside it.

    rate: the port's baud rate, 0 for a socket, for `holder_rate`.
    """

    def __init__(self, name: str, rate: int = 0) -> None:
        self._lock: BaseFileLock | None = None
        if "://" in name:
            return
        lock = _try_lock(name)
        if lock is None:
            holder = _read_pid(name)
            message = f"port {name} is in use by armkin (process {holder})"
            raise PortInUseError(message, advice="wait for it", port=name, process=holder)
        self._lock = lock
        self._pid = _lock_path(name, "pid")
        with suppress(OSError):
            os.unlink(self._pid)  # also removes a link to another place
        with suppress(OSError), open(self._pid, "x", encoding="ascii") as file:
            file.write(f"{os.getpid()} {_start_ticks(os.getpid())} {rate}")
        if not _signals:
            self._request = _lock_path(name, "stop")
            with suppress(OSError):
                os.unlink(self._request)  # an old request for the last holder
            threading.Thread(target=self._forward_stop, daemon=True).start()

    def _forward_stop(self) -> None:
        """Raise the signal in this process that other processes cannot send to it."""
        while self._lock is not None:
            with suppress(OSError):
                os.unlink(self._request)
                is_handled = signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
                _thread.interrupt_main(signal.SIGTERM if is_handled else signal.SIGINT)
            time.sleep(_POLL_S)

    def release(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            with suppress(OSError):
                os.unlink(self._pid)  # before the lock, so that no process is mistaken for the holder
            self._lock.release()
            self._lock = None


def holder_pid(name: str) -> int | None:
    """The process that holds a port for armkin; None: no process does."""
    if "://" in name or name == SIM:
        return None
    try:
        lock = _try_lock(name)
    except OSError:
        return None
    if lock is None:
        return _read_pid(name)
    lock.release()
    return None


def ask_to_stop(name: str, process: int) -> None:
    """Ask the process that holds a port to stop its arm and to close the port. Raises OSError."""
    if sys.platform == "win32" or not _signals:
        with open(_lock_path(name, "stop"), "w", encoding="ascii"):
            return
    os.kill(process, signal.SIGTERM)
    os.kill(process, signal.SIGCONT)  # a suspended process handles signals only after SIGCONT


def holder_rate(name: str) -> int | None:
    """The baud rate of the process that holds a port; None: unknown."""
    words = _pid_file(name)
    return int(words[2]) if len(words) == 3 and words[2].isdigit() else None


def note_path(name: str) -> str:
    """The file beside a port's lock with the note of the motion in progress."""
    return _lock_path(name, "motion")


def record_path(name: str) -> str:
    """The file beside a port's lock with the state in which its board was left."""
    return _lock_path(name, "board")


def _try_lock(name: str) -> BaseFileLock | None:
    """The lock of a port, or None if another process has it (flock on POSIX, msvcrt.locking on Windows)."""
    from filelock import FileLock, Timeout

    lock = FileLock(_lock_path(name, "lock"))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return None
    return lock


def _lock_path(name: str, end: str) -> str:
    real = name if "://" in name else os.path.realpath(name)
    key = hashlib.sha256(real.encode("utf-8", "surrogateescape")).hexdigest()[:16]
    return f"{port_file_stem(key)}.{end}"


def _read_pid(name: str) -> int | None:
    """The process that wrote the file beside a lock, if it still runs: checked by its number and start time."""
    number, born, _ = (*_pid_file(name), "", "", "")[:3]
    return int(number) if number.isdigit() and born == _start_ticks(int(number)) else None


def _pid_file(name: str) -> list[str]:
    """Words of the file beside a lock: process, start time, baud rate; [] without a file."""
    try:
        with open(_lock_path(name, "pid"), encoding="ascii") as file:
            return file.read(60).split(" ")
    except (OSError, ValueError):
        return []


def _start_ticks(process: int) -> str:
    """The start time of a process in ticks since boot (Linux); empty on other systems."""
    try:
        with open(f"/proc/{process}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[19].decode()  # proc(5): field 22, and 3 follows the name
    except (OSError, IndexError):
        return ""
