"""Ends the boot loader that the opening of a port has started.

Optiboot (Uno) starts the program by itself 1.4 s after the reset. The Mega's stk500v2 does so after 0.84 s without a
byte; once it has received one, only 5 s of silence or its own command end it.
"""

from armkin.board.ports.logged_port import Traced
from armkin.board.ports.port import Port
from armkin.board.ports.serial_port import SerialPort

_BAUD = 115200  # rate [bit/s] of the boot loaders
# STK500 version 2 (Atmel AVR068): start, number, size, token, CMD_LEAVE_PROGMODE_ISP, checksum
_LEAVE_MESSAGE = bytes([0x1B, 1, 0, 1, 0x0E, 0x11, 0x1B ^ 1 ^ 1 ^ 0x0E ^ 0x11])
_HEAD_BYTES = 4  # header bytes after a start: so many zeros end any message begun by chance


def leave_boot_loader(port: Port) -> None:
    """Tell a Mega's boot loader to start the program; a running program receives eleven bytes of noise."""
    inner = port.inner if isinstance(port, Traced) else port
    if isinstance(inner, SerialPort):
        inner.write_at(_BAUD, bytes(_HEAD_BYTES) + _LEAVE_MESSAGE)
