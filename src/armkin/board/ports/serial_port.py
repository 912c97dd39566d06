"""Serial ports: a device, a COM port, any pyserial URL. The only module that imports serial.

A port is held exclusively, so that no two programs talk to one arm (port_lock.py).
"""

import errno
import os
import re
import stat
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from armkin.board.ports.port import BAUD
from armkin.board.ports.port_lock import Lock
from armkin.errors import LinkError

_READ_TIMEOUT = 0.005  # longest wait [s] of a read
_MAX_READ = 4096  # largest read [bytes], so that a constant stream cannot block a timeout or a stop


class SerialPort:
    """A port that pyserial opens.

    reset: DTR resets an Arduino. False leaves DTR low where a program may choose: on Windows and with rfc2217://. Linux
    and macOS always raise it at the first opening after the board was plugged in; later it is kept high, so that no
    opening resets the board.
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
        """The bytes that have arrived, or arrive within `timeout` seconds."""
        deadline = time.monotonic() + timeout
        while True:
            received: bytes = self._guard(self._read_some)
            if received or time.monotonic() >= deadline:
                return received

    def _read_some(self) -> bytes:
        received: bytes = self._serial.read(1)
        while 0 < len(received) < _MAX_READ and (waiting_bytes := self._serial.in_waiting):
            chunk: bytes = self._serial.read(min(waiting_bytes, _MAX_READ))
            if not chunk:
                break
            received += chunk
        return received

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def restart(self) -> None:
        """Reset an Arduino that the opening did not reset; has no effect on ports without DTR."""
        with suppress(Exception):
            self._serial.dtr = self._serial.rts = False
            time.sleep(0.05)  # the board's capacitor needs this time to discharge
            self._serial.dtr = self._serial.rts = True

    def write_at(self, baud: int, data: bytes) -> None:
        """Send bytes at another baud rate, and restore the port's own."""

        def send() -> None:
            self._serial.baudrate = baud
            self._serial.write(data)
            self._serial.flush()
            self._serial.baudrate = self.baud

        self._guard(send)

    def close(self) -> None:
        """Close the port."""
        with suppress(Exception):
            self._serial.close()
        self._lock.release()

    def _guard(self, action: Callable[[], Any]) -> Any:
        import serial

        try:
            return action()
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: closed while reading
            raise LinkError(
                f"port {self.name} is gone ({_error_reason(error)}): is the cable plugged in?\n"
                "a board that takes its power from the cable has lost its position: armkin status tells"
            ) from None


def check_port(name: str) -> None:
    """Raise LinkError if there is no port of that name, without opening or resetting it."""
    import serial

    _check_address(name)
    try:
        if "://" in name:
            serial.serial_for_url(name, do_not_open=True)
        elif os.name == "posix":
            status = os.stat(name)
            memory = sys.platform == "linux" and os.major(status.st_rdev) == 1  # /dev/null and its kin
            if not stat.S_ISCHR(status.st_mode) or memory:
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
    """Raise LinkError for an empty name, and for a network address without host or port number."""
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
    settings: dict[str, Any] = {"baudrate": baud, "timeout": _READ_TIMEOUT, "write_timeout": 2.0, "do_not_open": True}
    if "://" not in name:
        settings["exclusive"] = True if os.name == "posix" else None
    try:
        port = serial.serial_for_url(name, **settings)
        if not reset and (sys.platform == "win32" or "://" in name):
            port.dtr = port.rts = False
        port.open()
    except (serial.SerialException, OSError, ValueError) as error:
        raise LinkError(_cannot_open(name, error)) from None
    except Exception as error:  # pyserial raises KeyError, re.error, AttributeError, ... for a malformed URL
        raise LinkError(_no_url(name, error)) from None
    _keep_dtr(port)
    return port


def _keep_dtr(port: Any) -> None:
    """Keep DTR when the port is closed, so that the next opening does not reset an Uno."""
    if sys.platform == "win32":
        return
    with suppress(Exception):
        import termios

        mode = termios.tcgetattr(port.fileno())
        mode[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, mode)


def _no_url(name: str, error: Exception) -> str:
    return f"port {name} cannot be opened: it is no URL that pyserial understands ({error})"


def _cannot_open(name: str, error: Exception) -> str:
    """Why a port cannot be opened, and what to do, in words."""
    reason = _error_reason(error)
    match = re.search(r"(?:Errno |\()(\d+)", reason)  # some numbers are only in pyserial's text
    number = getattr(error, "errno", None) or (int(match[1]) if match else None)
    if number == errno.ENOENT or "FileNotFound" in reason:
        ports_text = ", ".join(port.device for port in list_ports())
        return f"there is no port {name}; armkin ports lists them ({ports_text or 'none is plugged in'}), or use sim"
    if number == errno.EACCES or "PermissionError" in reason:
        return f"port {name}: permission denied; on Linux add yourself to the group dialout, then log in again"
    if "exclusively lock" in reason or number in (errno.EAGAIN, errno.EBUSY):
        return f"port {name} is in use by another program (a serial monitor, another armkin?): close it first"
    if number in (errno.ENOTTY, errno.EISDIR):
        return f"{name} is no serial port; armkin ports lists them"
    if number == errno.ECONNREFUSED:
        return f"port {name}: connection refused, nobody listens there"
    return f"port {name} cannot be opened: {reason}"


def _error_reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]


@dataclass(frozen=True)
class Found:
    """A serial port of this computer."""

    device: str
    description: str
    hardware: str
    board: str  # probable board, "" if unknown
    adapter: str = ""  # chip of other boards and servo buses, "" for none


_BOARD_NAMES = {
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
_ADAPTER_NAMES = {
    (0x1A86, 0x55D3): "CH343: a servo bus?",
    (0x1A86, 0x55D4): "CH9102: an ESP32 or a servo bus?",
    (0x10C4, 0xEA60): "CP210x: an ESP32 or a servo bus?",
    (0x303A, 0x1001): "ESP32-S3",
}


def list_ports() -> list[Found]:
    """The serial ports, probable Arduinos first."""
    from serial.tools import list_ports as tools

    ports = []
    for port in tools.comports():
        board = _BOARD_NAMES.get((port.vid or 0, port.pid or 0), "")
        if port.vid is None and board == "" and port.description in ("n/a", None, port.name):
            continue  # a mainboard's empty ttyS
        adapter = _ADAPTER_NAMES.get((port.vid or 0, port.pid or 0), "")
        ports.append(Found(port.device, port.description or "", port.hwid or "", board, adapter))
    return sorted(ports, key=lambda entry: (not entry.board, entry.device))
