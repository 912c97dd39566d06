"""armkin's own sender before the emulated board, all in simulated time: it repeats to the cycle on any computer."""

from __future__ import annotations

from collections import deque

from emulator import EmulatedBoard

_LOOK = 0.0005  # [s] that simulated time goes on at once, while nothing arrives


class SteppedPort:
    """A port to a board in ``speed="step"``: time passes only while somebody reads.

    latency: [s] one way, between the program and the line; each way keeps its order, as a USB chip's buffers do.
    `busy`: whether the computer behind it is said to be busy, as `streaming` would find out by its load.
    """

    simulated = False

    def __init__(self, board: EmulatedBoard, latency: float = 0.0, baud: int = 250_000) -> None:
        self.name, self.baud, self.board = "stepped", baud, board
        self._latency = round(latency * board.clock_hz)
        self._now = int(board.control("cycles")["cycle"])
        self._there: deque[tuple[int, bytes]] = deque()  # on the way to the line
        self._here: deque[tuple[int, bytes]] = deque()  # on the way to the program

    def now(self) -> float:
        """Seconds on the board's clock."""
        return self._now / self.board.clock_hz

    def write(self, data: bytes) -> None:
        """Send bytes: they are on the line after the latency."""
        self._there.append((self._now + self._latency, data))

    def read(self, timeout: float) -> bytes:
        """What has come, or comes within `timeout` seconds."""
        end = self._now + round(timeout * self.board.clock_hz)
        while not (data := self._take()) and self._now < end:
            self._run(end)
        return data

    def wait(self, seconds: float) -> None:
        """Let time pass; what comes is kept."""
        end = self._now + round(seconds * self.board.clock_hz)
        while self._now < end:
            self._run(end)

    def close(self) -> None:
        """Nothing to give back."""

    def _take(self) -> bytes:
        received = b""
        while self._here and self._here[0][0] <= self._now:
            received += self._here.popleft()[1]
        return received

    def _run(self, end: int) -> None:
        """To the next thing that happens, `end` at the latest."""
        data = b""
        while self._there and self._there[0][0] <= self._now:
            data += self._there.popleft()[1]
        for way in (self._there, self._here):
            end = min(end, way[0][0]) if way else end
        end = min(end, self._now + round(_LOOK * self.board.clock_hz))
        command = f"run {max(end - self._now, 1)} until 00" + (f" {data.hex()}" if data else "")
        answer = self.board.control(command)
        self._now = int(answer["cycle"])
        if answer["out"]:
            self._here.append((self._now + self._latency, bytes.fromhex(answer["out"])))
