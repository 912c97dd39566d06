"""A simulated board behind a real pseudo-terminal, in real time, with a line that may be noisy or cut."""

from __future__ import annotations

import os
import random
import select
import time

from armkin.board.firmware.protocol import State
from armkin.board.sim.board import SimBoard
from armkin.board_kinds import BOARDS
from pty_port import Pty


class PtyBoard(Pty):
    """A simulated board with armkin's firmware behind it."""

    def __init__(self, kind: str = "uno_cnc_shield", *, noise: float = 0.0, seed: int = 1) -> None:
        super().__init__()
        self.board = SimBoard(BOARDS[kind])
        self.noise = noise  # probability that a byte is flipped, and that it is dropped
        self.cut = False
        self._random = random.Random(seed)

    @property
    def port(self) -> str:
        """What armkin opens."""
        return self.name

    @property
    def net(self) -> list[int]:
        """Net steps of every axis."""
        with self.lock:
            return self.board.net

    @property
    def state(self) -> State:
        """What the board is doing."""
        with self.lock:
            return self.board.motors.state

    def wait(self, state: State, timeout: float = 10.0) -> None:
        """Until the board is in a state."""
        end = time.monotonic() + timeout
        while self.state != state:
            assert time.monotonic() < end, f"not {state.name} within {timeout} s"
            time.sleep(0.005)

    def _serve(self) -> None:
        last = time.monotonic()
        while not self._end.is_set():
            ready, _, _ = select.select([self._master], [], [], 0.002)
            data = os.read(self._master, 4096) if ready else b""
            with self.lock:
                now = time.monotonic()
                self.board.advance(min(now - last, 0.2))  # a busy machine lets the board's time slip
                last = now
                if data:
                    self.board.receive(self._line(data))
                out = self._line(self.board.take())
            while out and not self._end.is_set():
                try:
                    out = out[os.write(self._master, out) :]
                except BlockingIOError:
                    break  # nobody reads: what the board says is gone

    def _line(self, data: bytes) -> bytes:
        if self.cut:
            return b""
        if not self.noise:
            return data
        out = bytearray()
        for byte in data:
            if self._random.random() < self.noise:
                byte ^= 1 << self._random.randrange(8)
            if self._random.random() >= self.noise:
                out.append(byte)
        return bytes(out)
