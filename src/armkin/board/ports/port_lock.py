"""The right to a port, so that no two programs talk to one arm.

Who holds it can be found and asked to stop, so that `armkin stop` in another terminal stops the arm.
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

_POLL_S = 0.05  # time [s] between two looks at a port's lock
_signals = os.name == "posix"  # elsewhere a signal of another process ends this one on the spot: a file asks instead


class Lock:
    """The right to a port, held as long as this process lives; a file beside it says which process that is.

    rate: the port's, 0 for a socket; it is told by `holder_rate`.
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
            os.unlink(self._pid)  # whatever stands there, and be it a link to somewhere else
        with suppress(OSError), open(self._pid, "x", encoding="ascii") as file:
            file.write(f"{os.getpid()} {_start_ticks(os.getpid())} {rate}")
        if not _signals:
            self._request = _lock_path(name, "stop")
            with suppress(OSError):
                os.unlink(self._request)  # the request was meant for who had the port before
            threading.Thread(target=self._forward_stop, daemon=True).start()

    def _forward_stop(self) -> None:
        """Raise in this process the signal that others cannot send to it."""
        while self._lock is not None:
            with suppress(OSError):
                os.unlink(self._request)
                heard = signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
                _thread.interrupt_main(signal.SIGTERM if heard else signal.SIGINT)
            time.sleep(_POLL_S)

    def release(self) -> None:
        """Let others have the port."""
        if self._lock is not None:
            with suppress(OSError):
                os.unlink(self._pid)  # before the lock goes: no process is taken for the holder afterwards
            self._lock.release()
            self._lock = None


def holder_pid(name: str) -> int | None:
    """Process that holds a port for armkin; None if none does."""
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
    """Ask the process that holds a port to stop its arm and to give the port back. Raises OSError."""
    if sys.platform == "win32" or not _signals:
        with open(_lock_path(name, "stop"), "w", encoding="ascii"):
            return
    os.kill(process, signal.SIGTERM)
    os.kill(process, signal.SIGCONT)  # a suspended one hears it only when it goes on


def holder_rate(name: str) -> int | None:
    """The rate at which the process that holds a port speaks there; None if nobody says."""
    words = _pid_file(name)
    return int(words[2]) if len(words) == 3 and words[2].isdigit() else None


def note_path(name: str) -> str:
    """The file beside a port's lock that notes the motion under way."""
    return _lock_path(name, "motion")


def record_path(name: str) -> str:
    """The file beside a port's lock that records what was last left on the board behind it."""
    return _lock_path(name, "board")


def _try_lock(name: str) -> BaseFileLock | None:
    """The lock of a port, or None if another has it. (flock on POSIX, msvcrt.locking on Windows.)"""
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
    """The process that wrote the file beside a lock, if it still is that process: by its number and its birth."""
    number, born, _ = (*_pid_file(name), "", "", "")[:3]
    return int(number) if number.isdigit() and born == _start_ticks(int(number)) else None


def _pid_file(name: str) -> list[str]:
    """Words of the file beside a lock: a process, its birth, its rate; [] if there is none."""
    try:
        with open(_lock_path(name, "pid"), encoding="ascii") as file:
            return file.read(60).split(" ")
    except (OSError, ValueError):
        return []


def _start_ticks(process: int) -> str:
    """When a process was started, in ticks since this boot (Linux); elsewhere the lock alone is asked."""
    try:
        with open(f"/proc/{process}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[19].decode()  # proc(5): field 22, and 3 follows the name
    except (OSError, IndexError):
        return ""
