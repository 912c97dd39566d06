"""The boot loader of the Mega 2560: STK500, version 2 (Atmel AVR068), as far as it understands it."""

import time
from functools import reduce
from operator import xor

from armkin.board.ports import Port
from armkin.errors import LinkError

_START, _TOKEN = 0x1B, 0x0E
_SIGN_ON, _ENTER, _LEAVE = 0x01, 0x10, 0x11
_ADDRESS, _WRITE, _READ = 0x06, 0x13, 0x14
_SIGNATURE = 0x1B
_BEYOND_64K = 1 << 31
_ANSWER_TIMEOUT = 1.0  # time [s] that an answer may take


class Stk500v2:
    """A conversation with the boot loader behind a port that has just reset its board."""

    page = 256  # [bytes] of an ATmega2560
    bauds = (115200,)

    def __init__(self, port: Port) -> None:
        self._port = port
        self._number = 0

    def answers(self, deadline: float) -> bool:
        """Whether it answers before that moment of the monotonic clock."""
        while time.monotonic() < deadline:
            try:
                self._ask(bytes([_SIGN_ON]), 0.2)
            except LinkError:
                continue
            self._ask(bytes([_ENTER, 200, 100, 25, 32, 0, 0x53, 3, 0xAC, 0x53, 0, 0]))
            return True
        return False

    def signature(self) -> bytes:
        """The chip's three bytes."""
        return b"".join(self._ask(bytes([_SIGNATURE, 4, 0x30, 0, i, 0]))[:1] for i in range(3))

    def write(self, address: int, data: bytes) -> None:
        """A page (up to `page` bytes) at an address in bytes."""
        self._go_to(address)
        self._ask(bytes([_WRITE, *len(data).to_bytes(2, "big"), 0xC1, 10, 0x40, 0x4C, 0x20, 0, 0]) + data)

    def read(self, address: int, count: int) -> bytes:
        """Bytes of the flash."""
        self._go_to(address)
        return self._ask(bytes([_READ, *count.to_bytes(2, "big"), 0x20]))[:count]

    def leave(self) -> None:
        """Start the program."""
        self._ask(bytes([_LEAVE, 1, 1]))

    def _go_to(self, address: int) -> None:
        words = address // 2 | (_BEYOND_64K if address >= 1 << 16 else 0)
        self._ask(bytes([_ADDRESS, *words.to_bytes(4, "big")]))

    def _ask(self, body: bytes, timeout: float = _ANSWER_TIMEOUT) -> bytes:
        """The answer's bytes after the command and its status."""
        self._number = (self._number + 1) & 255
        message = bytes([_START, self._number, *len(body).to_bytes(2, "big"), _TOKEN]) + body
        self._port.write(message + bytes([reduce(xor, message)]))
        deadline, reply = time.monotonic() + timeout, b""
        while (left := deadline - time.monotonic()) > 0:
            reply += self._port.read(left)
            reply = reply[max(reply.find(bytes([_START, self._number])), 0) :]  # what a program has said before
            size = 6 + int.from_bytes(reply[2:4], "big")
            if len(reply) >= size and reply[:2] == bytes([_START, self._number]):
                break
        else:
            raise LinkError(f"the boot loader answered {reply[:40].hex(' ') or 'nothing'}")
        if reduce(xor, reply[:size]) or reply[5] != body[0] or reply[6]:
            raise LinkError(f"the boot loader answered {reply[:40].hex(' ')}")
        return reply[7 : size - 1]
