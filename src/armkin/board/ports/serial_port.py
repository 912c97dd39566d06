"""Serial ports: a device, a COM port, any pyserial URL. The only module that imports serial.

A port is held exclusively, so that no two programs talk to one arm; who holds it can be found, so that
`armkin stop` in another terminal stops the arm.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from armkin.board.ports.port import BAUD, SIM
from armkin.errors import LinkError, PortInUseError

if TYPE_CHECKING:
    from filelock import BaseFileLock

_READ = 0.005  # [s] a read waits at most
_MOST = 4096  # bytes of one read: what never falls silent must not keep it from the clock and from a stop


class SerialPort:
    """A port that pyserial opens.

    reset: an Arduino's reset follows DTR. False leaves it low where the system lets a program choose: Windows, and
    rfc2217://. Linux and macOS raise it with the first opening after the board was plugged in, whatever a program
    wants; from then on it is held, and no opening resets.
    """

    simulated = False

    def __init__(self, name: str, baud: int = BAUD, *, reset: bool = True) -> None:
        self.name, self.baud = name, baud
        self._lock = Lock(name, baud)
        try:
            self._serial = _open_serial(name, baud, reset)
        except BaseException:
            self._lock.release()
            raise

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._guard(lambda: self._serial.write(data))

    def read(self, timeout: float) -> bytes:
        """What has come, or comes within `timeout` seconds."""
        end = time.monotonic() + timeout
        while True:
            data: bytes = self._guard(self._read_some)
            if data or time.monotonic() >= end:
                return data

    def _read_some(self) -> bytes:
        data: bytes = self._serial.read(1)
        while 0 < len(data) < _MOST and (waiting := self._serial.in_waiting):
            more: bytes = self._serial.read(min(waiting, _MOST))
            if not more:
                break
            data += more
        return data

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Give the port back."""
        with suppress(Exception):
            self._serial.close()
        self._lock.release()

    def _guard(self, action: Callable[[], Any]) -> Any:
        import serial

        try:
            return action()
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: closed while reading
            raise LinkError(
                f"port {self.name} is gone ({_reason(error)}): is the cable plugged in?\n"
                "a board that takes its power from the cable has lost its position: armkin status tells"
            ) from None


def check(name: str) -> None:
    """Raise LinkError if there is no port of that name; one that is there is not opened, and not reset."""
    import serial

    _check_address(name)
    try:
        if "://" in name:
            serial.serial_for_url(name, do_not_open=True)
        elif os.name == "posix":
            found = os.stat(name)
            memory = sys.platform == "linux" and os.major(found.st_rdev) == 1  # /dev/null and its kin
            if not stat.S_ISCHR(found.st_mode) or memory:
                raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
            if not os.access(name, os.R_OK | os.W_OK):
                raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        elif name.upper() not in {port.device.upper() for port in list_ports()}:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
    except (serial.SerialException, OSError, ValueError) as error:
        raise LinkError(_cannot_open(name, error)) from None
    except Exception as error:
        raise LinkError(_no_url(name, error)) from None


def _check_address(name: str) -> None:
    """Raise LinkError for no name at all, and for an address in a network without a host or a port number."""
    if not name.strip():
        raise LinkError(
            "the port's name is empty: name a device, socket://HOST:NUMBER, or sim (armkin ports lists them)"
        )
    scheme = name.partition("://")[0].lower()
    if scheme not in ("socket", "rfc2217") or "://" not in name:
        return
    try:
        url = urlsplit(name)
        number = url.port
    except ValueError:  # a number beyond 65535, or none
        number = None
    if not number or not url.hostname:
        raise LinkError(
            f"port {name}: write {scheme}://HOST:NUMBER, for example {scheme}://localhost:4000 (1 to 65535)"
        )


def _open_serial(name: str, baud: int, reset: bool) -> Any:
    import serial

    _check_address(name)
    settings: dict[str, Any] = {"baudrate": baud, "timeout": _READ, "write_timeout": 2.0, "do_not_open": True}
    if "://" not in name:
        settings["exclusive"] = True if os.name == "posix" else None
    try:
        port = serial.serial_for_url(name, **settings)
        if not reset and (sys.platform == "win32" or "://" in name):
            port.dtr = port.rts = False
        port.open()
    except (serial.SerialException, OSError, ValueError) as error:
        raise LinkError(_cannot_open(name, error)) from None
    except Exception as error:  # what pyserial makes of a malformed URL: KeyError, re.error, AttributeError, ...
        raise LinkError(_no_url(name, error)) from None
    _keep_dtr(port)
    return port


def _keep_dtr(port: Any) -> None:
    """Do not let closing the port drop DTR: the next opening then does not reset an Uno."""
    with suppress(Exception):
        import termios

        mode = termios.tcgetattr(port.fileno())
        mode[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, mode)


def _no_url(name: str, error: Exception) -> str:
    return f"port {name} cannot be opened: it is no URL that pyserial understands ({error})"


def _cannot_open(name: str, error: Exception) -> str:
    reason = _reason(error)
    stated = re.search(r"(?:Errno |\()(\d+)", reason)  # pyserial keeps some numbers in its text alone
    number = getattr(error, "errno", None) or (int(stated[1]) if stated else None)
    if number == errno.ENOENT or "FileNotFound" in reason:
        found = ", ".join(port.device for port in list_ports())
        return f"there is no port {name}; armkin ports lists them ({found or 'none is plugged in'}), or use sim"
    if number == errno.EACCES or "PermissionError" in reason:
        return f"port {name}: permission denied; on Linux add yourself to the group dialout, then log in again"
    if "exclusively lock" in reason or number in (errno.EAGAIN, errno.EBUSY):
        return f"port {name} is in use by another program (a serial monitor, another armkin?): close it first"
    if number in (errno.ENOTTY, errno.EISDIR):
        return f"{name} is no serial port; armkin ports lists them"
    if number == errno.ECONNREFUSED:
        return f"port {name}: connection refused, nobody listens there"
    return f"port {name} cannot be opened: {reason}"


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]


@dataclass(frozen=True)
class Found:
    """A serial port of this computer."""

    device: str
    description: str
    hardware: str
    board: str  # what it looks like, "" if unknown
    adapter: str = ""  # a chip that other boards and servo buses have, "" if none


_LOOKS = {
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0001): "Arduino Uno",
    (0x2341, 0x0243): "Arduino Uno",
    (0x2A03, 0x0043): "Arduino Uno",
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x0242): "Arduino Mega 2560",
    (0x2A03, 0x0042): "Arduino Mega 2560",
    (0x1A86, 0x7523): "CH340: a Uno or Mega clone?",
    (0x1A86, 0x5523): "CH341: a Uno or Mega clone?",
    (0x0403, 0x6001): "FTDI: an older Arduino?",
    (0x1209, 0x0001): "pico6?",  # pid.codes' number for tests, which armkin's Pico has
}


# Chips of ESP32 boards (FluidNC, grblHAL) and servo bus adapters; no Arduino has them.
_ADAPTERS = {
    (0x1A86, 0x55D3): "CH343: a servo bus?",
    (0x1A86, 0x55D4): "CH9102: an ESP32 or a servo bus?",
    (0x10C4, 0xEA60): "CP210x: an ESP32 or a servo bus?",
    (0x303A, 0x1001): "ESP32-S3",
}


def list_ports() -> list[Found]:
    """Serial ports, those that look like an Arduino first."""
    from serial.tools import list_ports as tools

    found = []
    for port in tools.comports():
        looks = _LOOKS.get((port.vid or 0, port.pid or 0), "")
        if port.vid is None and looks == "" and port.description in ("n/a", None, port.name):
            continue  # a mainboard's empty ttyS
        adapter = _ADAPTERS.get((port.vid or 0, port.pid or 0), "")
        found.append(Found(port.device, port.description or "", port.hwid or "", looks, adapter))
    return sorted(found, key=lambda f: (not f.board, f.device))


class Lock:
    """The right to a port, held as long as this process lives; a file beside it says which process that is.

    rate: the port's, 0 for a socket; it is told by `holder_rate`.
    """

    def __init__(self, name: str, rate: int = 0) -> None:
        self._lock: BaseFileLock | None = None
        if "://" in name:
            return
        lock = _acquired(name)
        if lock is None:
            holder = _read_pid(name)
            message = f"port {name} is in use by armkin (process {holder})"
            raise PortInUseError(message, advice="wait for it", port=name, process=holder)
        self._lock = lock
        self._pid = _path(name, "pid")
        with suppress(OSError):
            os.unlink(self._pid)  # whatever stands there, and be it a link to somewhere else
        with suppress(OSError), open(self._pid, "x", encoding="ascii") as file:
            file.write(f"{os.getpid()} {_born(os.getpid())} {rate}")

    def release(self) -> None:
        """Let others have the port."""
        if self._lock is not None:
            with suppress(OSError):
                os.unlink(self._pid)  # before the lock goes: no process is taken for the holder afterwards
            self._lock.release()
            self._lock = None


def holder(name: str) -> int | None:
    """Process that holds a port for armkin; None if none does."""
    if "://" in name or name == SIM:
        return None
    try:
        lock = _acquired(name)
    except OSError:
        return None
    if lock is None:
        return _read_pid(name)
    lock.release()
    return None


def holder_rate(name: str) -> int | None:
    """The rate at which the process that holds a port speaks there; None if nobody says."""
    words = _pid_file(name)
    return int(words[2]) if len(words) == 3 and words[2].isdigit() else None


def note_path(name: str) -> str:
    """The file beside a port's lock that notes the motion under way."""
    return _path(name, "motion")


def _acquired(name: str) -> BaseFileLock | None:
    """The lock of a port, or None if another has it. (flock on POSIX, msvcrt.locking on Windows.)"""
    from filelock import FileLock, Timeout

    lock = FileLock(_path(name, "lock"))
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return None
    return lock


def _path(name: str, end: str) -> str:
    key = hashlib.sha256(os.path.realpath(name).encode("utf-8", "surrogateescape")).hexdigest()[:16]
    user = os.getuid() if sys.platform != "win32" else "user"  # on Windows the folder is the user's own
    return os.path.join(tempfile.gettempdir(), f"armkin-{user}-{key}.{end}")


def _read_pid(name: str) -> int | None:
    """The process that wrote the file beside a lock, if it still is that process: by its number and its birth."""
    number, born, _ = (*_pid_file(name), "", "", "")[:3]
    return int(number) if number.isdigit() and born == _born(int(number)) else None


def _pid_file(name: str) -> list[str]:
    """Words of the file beside a lock: a process, its birth, its rate; [] if there is none."""
    try:
        with open(_path(name, "pid"), encoding="ascii") as file:
            return file.read(60).split(" ")
    except (OSError, ValueError):
        return []


def _born(process: int) -> str:
    """When a process was started, in ticks since this boot (Linux); elsewhere the lock alone is asked."""
    try:
        with open(f"/proc/{process}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[19].decode()  # proc(5): field 22, and 3 follows the name
    except (OSError, IndexError):
        return ""
