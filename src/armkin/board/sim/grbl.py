"""A stand-in for a GRBL 1.1 board, in simulated time, written from GRBL's public interface description.

It keeps what armkin relies on: the receive buffer, answers in order, planner blocks, status reports with three
decimals, feed hold along the path, soft reset, alarms with their locks, settings, work offsets and homing. Its
blocks start and end at rest; GRBL itself looks ahead.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from armkin.board.grbl.replies import LETTERS, RX_BUFFER
from armkin.board.sim.clock import SimulatedTime

BLOCKS = 15  # planner blocks

_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))")


@dataclass
class Block:
    """A straight line in steps."""

    start: tuple[int, ...]
    end: tuple[int, ...]
    length: float  # [units]
    speed: float  # [units/s]
    accel: float  # [units/s2]
    done: float = 0.0  # [units]
    rate: float = 0.0  # [units/s]
    line: bool = True  # False: a dwell, `done` counts seconds up to `length`


@dataclass
class Grbl(SimulatedTime):
    """The port of a simulated GRBL board."""

    axes: int = 3
    name: str = "sim"
    settings: dict[int, float] = field(default_factory=dict)
    ends: Mapping[int, int] = field(default_factory=dict)  # axis -> steps where its switch closes
    baud: int = 115_200

    def __post_init__(self) -> None:
        super().__init__()
        defaults = {1: 25, 3: 0, 10: 1, 13: 0, 20: 0, 21: 0, 22: 0, 23: 0, 25: 20, 27: 1, 30: 1000, 31: 0, 32: 0}
        for k in range(self.axes):
            defaults |= {100 + k: 250, 110 + k: 500, 120 + k: 10, 130 + k: 200}
        self.settings = {**defaults, **self.settings}
        self.steps = [0] * self.axes
        self.history: list[tuple[float, tuple[int, ...]]] = []  # every change of the steps
        self.dead = False  # unplugged
        self.boot()

    def boot(self, *, power: bool = True) -> None:
        """Start anew: a reset by DTR or the button (`power`), which forgets the position, or a soft one."""
        if power:
            self.steps = [0] * self.axes
        self.state = "Idle"
        self.g92 = [0.0] * self.axes
        self._rx, self._line = deque[str](), ""
        self._blocks = deque[Block]()
        self._holding = self._relative = False
        self.spindle: float | None = None  # the S word of M3
        self._say("\r\nGrbl 1.1h ['$' for help]")

    # The port

    def write(self, data: bytes) -> None:
        """Send bytes: single-byte commands act at once, lines wait their turn."""
        for byte in b"" if self.dead else data:
            self._receive(byte)

    def advance(self, seconds: float) -> None:
        """Let time pass: run blocks, take lines that have room."""
        self._now += seconds
        if self.dead:
            return
        self._run(seconds)
        while self._rx and self._ready(self._rx[0]):
            self._obey(self._rx.popleft())

    def alarm(self, number: int) -> None:
        """Go into an alarm: in motion the steps that were lost are not known."""
        self._blocks.clear()
        self._rx.clear()
        self.state = "Alarm"
        self._say(f"ALARM:{number}")

    def _say(self, text: str) -> None:
        self._out += text.encode() + b"\r\n"

    def _receive(self, byte: int) -> None:
        if byte == 0x18:
            moving = bool(self._blocks) and not self._standing()
            self.boot(power=False)
            if moving:
                self.alarm(3)
        elif byte == ord("?"):
            self._say(self._report())
        elif byte == ord("!"):
            self._holding = True
        elif byte == ord("~"):
            self._holding = False
        elif byte == 0x85:
            self._blocks.clear()
        elif byte in b"\r\n":
            if self._line or byte == ord("\n"):
                self._rx.append(self._line)
            self._line = ""
        elif sum(len(line) + 1 for line in self._rx) + len(self._line) < RX_BUFFER - 1:
            self._line += chr(byte).upper() if byte != 32 else ""

    # Motion

    def _standing(self) -> bool:
        return not self._blocks or (self._holding and self._blocks[0].rate == 0.0)

    def _run(self, seconds: float) -> None:
        if self._blocks and not self._blocks[0].line:
            self._blocks[0].done += seconds
            if self._blocks[0].done >= self._blocks[0].length:
                self._blocks.popleft()
                self._say("ok")
            return
        if not self._blocks:
            return
        block = self._blocks[0]
        left = block.length - block.done
        brake = self._holding or block.rate**2 / (2 * block.accel) >= left
        change = block.accel * seconds
        block.rate = (
            max(0.0 if self._holding else change, block.rate - change)
            if brake
            else min(block.speed, block.rate + change)
        )
        block.done = min(block.length, block.done + block.rate * seconds)
        share = block.done / block.length if block.length else 1.0
        here = [round(a + share * (b - a)) for a, b in zip(block.start, block.end, strict=True)]
        if here != self.steps:
            self.steps = here
            self.history.append((self._now, tuple(here)))
            for k, switch in self.ends.items():
                if self.settings[21] and here[k] == switch and self.state != "Home":
                    self.alarm(1)
                    return
        if block.done >= block.length:
            self.steps = list(block.end)
            self._blocks.popleft()

    def _planned(self) -> list[int]:
        return list(self._blocks[-1].end) if self._blocks else list(self.steps)

    # Lines

    def _ready(self, line: str) -> bool:
        if line.startswith("M") or (line.startswith("$") and not line.startswith("$J")):
            return not self._blocks  # a spindle's word waits for the motion before it
        if any(not block.line for block in self._blocks):
            return False
        return len(self._blocks) < BLOCKS

    def _obey(self, line: str) -> None:
        error = 0 if not line else self._system(line[1:]) if line.startswith("$") else self._code(line)
        if error >= 0:
            self._say("ok" if error == 0 else f"error:{error}")

    def _system(self, line: str) -> int:
        if match := re.fullmatch(r"(\d+)=(-?[\d.]+)", line):
            if int(match[1]) not in self.settings:
                return 3
            self.settings[int(match[1])] = float(match[2])
        elif line == "$":
            for number in sorted(self.settings):
                self._say(f"${number}={self.settings[number]:.3f}".rstrip("0").rstrip("."))
        elif line == "I":
            self._say("[VER:1.1h.20190825:]")
            self._say(f"[OPT:V,{BLOCKS},{RX_BUFFER}]")
        elif line == "G":
            on = "M5" if self.spindle is None else "M3"
            self._say(f"[GC:G1 G54 G17 G21 G90 G94 {on} M9 T0 F0 S{self.spindle or 0:g}]")
        elif line == "#":
            self._say(f"[G54:{','.join(['0.000'] * self.axes)}]")
            self._say(f"[G92:{','.join(f'{value:.3f}' for value in self.g92)}]")
        elif line == "X":
            self.state = "Idle"
        elif line == "H":
            return self._home()
        elif line.startswith("J="):
            return self._code(line[2:]) if self.state == "Idle" else 9
        else:
            return 3
        return 0

    def _home(self) -> int:
        if not self.settings[22]:
            return 5
        if len(self.ends) < self.axes:
            self.alarm(9)
            return -1
        for k in range(self.axes):
            upward = not int(self.settings[23]) >> k & 1
            away = self.settings[27] if upward else -self.settings[27]
            travel = 0.0 if upward else -self.settings[130 + k]
            self.steps[k] = round((travel - away) * self.settings[100 + k])
        self.state = "Idle"
        return 0

    def _code(self, line: str) -> int:
        if self.state == "Alarm":
            return 9
        words = _WORD.findall(line)
        if "".join(letter + value for letter, value in words) != line:
            return 2
        codes = {float(value) for letter, value in words if letter == "G"}
        values = {letter: float(value) for letter, value in words if letter != "G"}
        if "M" in values:
            self.spindle = min(values.get("S", 0.0), self.settings[30]) if values["M"] == 3 else None
        if 4.0 in codes:
            self._blocks.append(Block((), (), values.get("P", 0.0), 0, 0, line=False))
            return -1 if self._blocks else 0
        self._relative = 91.0 in codes or (self._relative and 90.0 not in codes)
        given = {k: values[letter] for k, letter in enumerate(LETTERS[: self.axes]) if letter in values}
        if 92.0 in codes:
            for k, value in given.items():
                self.g92[k] = self._planned()[k] / self.settings[100 + k] - value
            return 0
        if given:
            if "F" not in values:
                return 22
            self._plan(given, values["F"], 53.0 in codes)
        return 0

    def _plan(self, given: Mapping[int, float], feed: float, machine: bool) -> None:
        start = self._planned()
        per = [self.settings[100 + k] for k in range(self.axes)]
        end = list(start)
        for k, value in given.items():
            base = start[k] / per[k] if self._relative else 0.0 if machine else self.g92[k]
            end[k] = round((base + value) * per[k])
        change = [(b - a) / s for a, b, s in zip(start, end, per, strict=True)]
        length = math.hypot(*change)
        if length == 0.0:
            return
        share = [abs(c) / length for c in change]
        speed = min([feed / 60, *(self.settings[110 + k] / 60 / s for k, s in enumerate(share) if s)])
        accel = min(self.settings[120 + k] / s for k, s in enumerate(share) if s)
        self._blocks.append(Block(tuple(start), tuple(end), length, speed, accel))

    def _report(self) -> str:
        state = self.state
        if state == "Idle" and self._blocks:
            state = ("Hold:0" if self._standing() else "Hold:1") if self._holding else "Run"
        place = ",".join(f"{n / self.settings[100 + k]:.3f}" for k, n in enumerate(self.steps))
        used = sum(len(line) + 1 for line in self._rx) + len(self._line)
        text = f"<{state}|MPos:{place}"
        if int(self.settings[10]) & 2:
            text += f"|Bf:{BLOCKS - len(self._blocks)},{RX_BUFFER - used}"
        return f"{text}|FS:0,0>"
