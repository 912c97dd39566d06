"""The boot loader of the Uno (optiboot): STK500, version 1 (Atmel AVR061), as far as it understands it."""

import time

from armkin.board.ports import Port
from armkin.errors import LinkError

_SYNC, _LEAVE, _SIGNATURE = 0x30, 0x51, 0x75
_ADDRESS, _WRITE, _READ = 0x55, 0x64, 0x74
_END, _IN_SYNC, _OK = 0x20, 0x14, 0x10
_ANSWER_TIMEOUT = 1.0  # time [s] that an answer may take; a page takes 5 ms to be written


class Stk500v1:
    """A conversation with the boot loader behind a port that has just reset its board."""

    page = 128  # [bytes] of an ATmega328P
    bauds = (115200, 57600)  # the Uno's; of the Nano's older boot loader

    def __init__(self, port: Port) -> None:
        self._port = port

    def answers(self, deadline: float) -> bool:
        """Whether it answers before that moment of the monotonic clock."""
        while time.monotonic() < deadline:
            self._port.read(0.0)  # what an answer too late, or a program, has left there
            self._port.write(bytes([_SYNC, _END]))
            # It flashes a lamp for 0.4 s first, with room for two bytes: more would be heard in part, and end it.
            if self._take(2, 0.5) == bytes([_IN_SYNC, _OK]):
                return True
        return False

    def signature(self) -> bytes:
        """The chip's three bytes."""
        return self._ask(bytes([_SIGNATURE]), 3)

    def write(self, address: int, data: bytes) -> None:
        """A page (up to `page` bytes) at an address in bytes."""
        self._go_to(address)
        self._ask(bytes([_WRITE, *len(data).to_bytes(2, "big"), ord("F")]) + data)

    def read(self, address: int, count: int) -> bytes:
        """Bytes of the flash."""
        self._go_to(address)
        return self._ask(bytes([_READ, *count.to_bytes(2, "big"), ord("F")]), count)

    def leave(self) -> None:
        """Start the program."""
        self._ask(bytes([_LEAVE]))

    def _go_to(self, address: int) -> None:
        self._ask(bytes([_ADDRESS, *(address // 2).to_bytes(2, "little")]))

    def _ask(self, request: bytes, count: int = 0) -> bytes:
        self._port.write(request + bytes([_END]))
        answer = self._take(count + 2, _ANSWER_TIMEOUT)
        if len(answer) != count + 2 or answer[0] != _IN_SYNC or answer[-1] != _OK:
            raise LinkError(f"the boot loader answered {answer.hex(' ') or 'nothing'}")
        return answer[1:-1]

    def _take(self, count: int, timeout: float) -> bytes:
        deadline, received = time.monotonic() + timeout, b""
        while len(received) < count and (left := deadline - time.monotonic()) > 0:
            received += self._port.read(left)
        return received
