"""A simulated board behind a real pseudo-terminal, in real time, with a line that may be noisy or cut."""

from __future__ import annotations

import os
import random
import select
import time
from collections.abc import Callable

from armkin.board.firmware.wire.protocol import State
from armkin.board.sim.sim_board import SimBoard
from armkin.board_catalogue import BOARDS
from pty_port import Patient, Pty


class PtyBoard(Pty):
    """A simulated board with armkin's firmware behind it."""

    def __init__(self, kind: str = "uno_cnc_shield", *, noise: float = 0.0, seed: int = 1) -> None:
        super().__init__()
        self.board = SimBoard(BOARDS[kind])
        self.noise = noise  # probability that a byte is flipped, and that it is dropped
        self.cut = False
        self.time = Patient()
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

    def wait(self, state: State) -> None:
        """Until the board is in a state."""
        self.until(lambda: self.state == state, state.name)

    def until(self, is_reached: Callable[[], bool], state_name: str) -> None:
        """Until something has happened."""
        end = time.monotonic() + 60
        while not is_reached():
            assert time.monotonic() < end, f"not {state_name} within a minute: {self.state.name} at {self.net}"
            time.sleep(0.005)

    def _open(self) -> None:
        super()._open()
        os.close(self._slave)  # from here on a hang-up says: no program has it open

    def _close(self) -> None:
        os.close(self._master)

    def _serve(self) -> None:
        line = select.poll()
        line.register(self._master, select.POLLIN)
        while not self._end.is_set():
            events = dict(line.poll(2)).get(self._master, 0)
            is_open = not events & select.POLLHUP
            data = os.read(self._master, 4096) if events & select.POLLIN else b""
            with self.lock:
                self.board.advance(self.time.passed(heard=bool(data), is_open=is_open))
                if data:
                    self.board.receive(self._line(data))
                sent = self._line(self.board.take())
            if not is_open:
                time.sleep(0.002)  # a hang-up does not wait
                continue  # nobody listens: what the board says is gone
            while sent and not self._end.is_set():
                try:
                    sent = sent[os.write(self._master, sent) :]
                except BlockingIOError:
                    break  # nobody reads: what the board says is gone

    def _line(self, data: bytes) -> bytes:
        if self.cut:
            return b""
        if not self.noise:
            return data
        damaged = bytearray()
        for byte in data:
            if self._random.random() < self.noise:
                byte ^= 1 << self._random.randrange(8)
            if self._random.random() >= self.noise:
                damaged.append(byte)
        return bytes(damaged)
