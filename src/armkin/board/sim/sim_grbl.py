"""A stand-in for a GRBL 1.1 board, in simulated time, written from GRBL's sources read for facts.

It keeps what armkin relies on, and what other programs may do to it: the receive buffer, a line that is put together
byte by byte, answers in order, planner blocks, status reports with three decimals, feed hold along the path, in which
no line is taken, soft reset, alarms with their locks, settings, modes and offsets (grbl_modes.py), overrides and
homing. It does not stop between two lines (grbl_blocks.py). `hal`: as grblHAL, which takes whole numbers alone
for whole-number settings, keeps G92 over a soft reset, and over a loss of power unless $384 is 1.
"""

import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from armkin.board.grbl.replies import RX_BUFFER
from armkin.board.sim.clock import SimulatedTime
from armkin.board.sim.grbl_blocks import JUNCTION_DEVIATION, Block, advance_first, block_to
from armkin.board.sim.grbl_modes import Modes, Words

MAX_BLOCKS = 15  # blocks of the planner
_MAX_LINE_BYTES = 80  # length [bytes], at most, of a line
_OFFSET_REPORT_PERIOD = 10  # reports between two that tell offset and overrides
_FEED_OVERRIDES = {0x90: 100, 0x91: 10, 0x92: -10, 0x93: 1, 0x94: -1}  # overrides [%] by byte; 0x90 takes them back
_INTEGER_SETTINGS = {1, 3, 10, 13, 20, 21, 22, 23, 32, 384}  # settings of whole numbers

_DEFAULTS = {
    1: 25,
    3: 0,
    10: 1,
    JUNCTION_DEVIATION: 0.01,
    13: 0,
    20: 0,
    21: 0,
    22: 0,
    23: 0,
    25: 20,
    27: 1,
    30: 1000,
    31: 0,
    32: 0,
}


@dataclass
class _Line:
    """A line as it is put together, in capitals, without blanks and comments."""

    text: str = ""
    comment: str = ""  # what it began with, inside of one

    def take(self, char: str) -> str | None:
        """One more character; the line, if that ends it."""
        if char in "\r\n":
            line = self.text if self.text or char == "\n" else None
            self.text = self.comment = ""
            return line
        if self.comment:
            self.comment = "" if char == ")" and self.comment == "(" else self.comment
        elif char in "(;":
            self.comment = char
        elif char > " " and char != "/":
            self.text += char.upper()
        return None


@dataclass
class Grbl(SimulatedTime):
    """The port of a simulated GRBL board."""

    axes: int = 3
    name: str = "sim"
    settings: dict[int, float] = field(default_factory=dict)
    ends: Mapping[int, int] = field(default_factory=dict)  # axis -> steps where its switch closes
    baud: int = 115_200
    hal: bool = False

    def __post_init__(self) -> None:
        super().__init__()
        defaults = dict(_DEFAULTS)
        for k in range(self.axes):
            defaults |= {100 + k: 250, 110 + k: 500, 120 + k: 10, 130 + k: 200}
        self.settings = {**defaults, **({384: 0} if self.hal else {}), **self.settings}
        self.steps = [0] * self.axes
        self.modes = Modes(self.axes, self.hal)
        self.history: list[tuple[float, tuple[int, ...]]] = []  # every change of the steps
        self.dead = False  # unplugged
        self.boot()

    def boot(self, *, power: bool = True) -> None:
        """Start anew: a reset by DTR or the button (`power`), which forgets the position, or a soft one."""
        if power:
            self.steps = [0] * self.axes
        self.modes.reset(power=power, keep_offsets=self.hal and not self.settings[384])
        self.state = "Idle"
        self._rx, self._begun = deque[int](), _Line()
        self._whole: str | None = None  # a line that waits to be carried out
        self._blocks, self._holding = deque[Block](), False
        self.override, self._reports = 100, 0
        self.spindle: float | None = None  # the S word of M3
        self._send("\r\nGrbl 1.1f ['$' or '$HELP' for help]" if self.hal else "\r\nGrbl 1.1h ['$' for help]")

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
        self._run_blocks(seconds)
        while not self._holding and self._take_line():
            pass

    def alarm(self, number: int) -> None:
        """Go into an alarm: in motion the steps that were lost are not known."""
        self._blocks.clear()
        self._rx.clear()
        self._whole, self._begun.text, self.state = None, "", "Alarm"
        self._send(f"ALARM:{number}")

    def _send(self, text: str) -> None:
        self._out += text.encode() + b"\r\n"

    def _receive(self, byte: int) -> None:
        if (act := _REALTIME.get(byte)) is not None:
            act(self)
        elif byte < 0x80 and len(self._rx) < RX_BUFFER - 1:
            self._rx.append(byte)

    def _soft_reset(self) -> None:
        if in_motion := not self._is_standing():
            self.alarm(3)
        self.boot(power=False)
        self.state = "Alarm" if in_motion else "Idle"

    def _tell_state(self) -> None:
        self._send(self._report_line())

    def _hold(self) -> None:
        self._holding = self._holding or self.state != "Alarm"

    def _resume(self) -> None:
        self._holding = False

    def _cancel_jog(self) -> None:
        self._blocks = deque(block for block in self._blocks if not block.jog)
        if self.hal:
            self._rx.clear()
            self._begun = _Line()

    def _change_feed(self, byte: int) -> None:
        self.override = 100 if byte == 0x90 else min(max(self.override + _FEED_OVERRIDES[byte], 10), 200)
        self._reports = 0

    # Motion

    def _is_standing(self) -> bool:
        return not self._blocks or (self._holding and self._blocks[0].rate == 0.0)

    def _run_blocks(self, seconds: float) -> None:
        if not self._blocks or (self._holding and not self._blocks[0].line):
            return
        block = self._blocks[0]
        if not block.line:
            block.distance_done += seconds
            if block.distance_done >= block.length:
                self._blocks.popleft()
                self._send("ok")
            return
        share = advance_first(self._blocks, self.settings, seconds, self.override, self._holding)
        steps = [round(a + share * (b - a)) for a, b in zip(block.start, block.end, strict=True)]
        if steps != self.steps:
            self.steps = steps
            self.history.append((self._now, tuple(steps)))
            for k, switch in self.ends.items():
                if self.settings[21] and steps[k] == switch and self.state != "Home":
                    self.alarm(1)
                    return
        if block.distance_done >= block.length:
            self.steps = list(block.end)
            self._blocks.popleft()

    def _state_text(self) -> str:
        if self.state != "Idle" or not (self._holding or any(block.line for block in self._blocks)):
            return self.state
        if self._holding:
            return "Hold:0" if self._is_standing() else "Hold:1"
        return "Jog" if self._blocks[0].jog else "Run"

    def _report_line(self) -> str:
        place, shift, bits = _machine_position(self.settings, self.steps), self.modes.work(), int(self.settings[10])
        if not bits & 1:
            place = [a - b for a, b in zip(place, shift, strict=True)]
        text = f"<{self._state_text()}|{'MPos' if bits & 1 else 'WPos'}:{_three_decimals(place)}"
        text += f"|Bf:{MAX_BLOCKS - len(self._blocks)},{RX_BUFFER - len(self._rx)}" if bits & 2 else ""
        turn, self._reports = self._reports % _OFFSET_REPORT_PERIOD, self._reports + 1
        in_turn = {0: f"|Ov:{self.override},100,100", 1: f"|WCO:{_three_decimals(shift)}"}
        return f"{text}|FS:0,0{in_turn.get(turn, '')}>"

    # Lines

    def _take_line(self) -> bool:
        """Go on with the line that is being put together, or carry out a whole one; False: nothing to do now."""
        if self._whole is not None:
            return self._carry_out(self._whole)
        if not self._rx:
            return False
        self._whole = self._begun.take(chr(self._rx.popleft()))
        return True

    def _carry_out(self, line: str) -> bool:
        """Obey a whole line; False while it has to wait for the blocks before it."""
        words = self.modes.read(line)
        waits = isinstance(words, Words) and self._blocks and (words.waits() or len(self._blocks) >= MAX_BLOCKS)
        if waits or any(not block.line for block in self._blocks):
            return False
        self._whole = None
        self._obey(line)
        return True

    def _obey(self, line: str) -> None:
        if len(line) >= _MAX_LINE_BYTES and not self.hal:
            error = 11
        elif line.startswith("$"):
            error = self._run_system_command(line[1:])
        else:
            error = 9 if line and self.state == "Alarm" else self._run_gcode(line)
        if error >= 0:
            self._send("ok" if error == 0 else f"error:{error}")

    def _run_system_command(self, line: str) -> int:
        """Carry out what follows a $; the number of its error, 0 for none, -1 where an alarm was the answer."""
        if line == "X":
            self.state = "Idle"
            return 0
        if line.startswith("J="):
            return 9 if self.state != "Idle" else self._run_gcode(line[2:], jog=True)
        if self._blocks and line != "G":
            return 8  # the rest is for a machine at rest
        if match := re.fullmatch(r"(\d+)=(-?\d+\.?\d*)", line):
            return self._set_setting(int(match[1]), match[2])
        if line == "H":
            return self._home()
        answers = {
            "G": [self.modes.parser_state(self.spindle)],
            "$": [f"${n}={value:.3f}".rstrip("0").rstrip(".") for n, value in sorted(self.settings.items())],
            "I": _version_lines(self.hal),
            "#": self.modes.parameters(),
        }
        if line not in answers:
            return 3
        self._send("\r\n".join(answers[line]))
        return 0

    def _set_setting(self, number: int, text: str) -> int:
        if number not in self.settings:
            return 3
        if self.hal and number in _INTEGER_SETTINGS and not text.lstrip("-").isdigit():
            return 52
        self.settings[number] = float(text)
        return 0

    def _home(self) -> int:
        if not self.settings[22]:
            return 5
        if len(self.ends) < self.axes:
            self.alarm(9)
            return -1
        for k in range(self.axes):
            upward = not int(self.settings[23]) >> k & 1
            place = -self.settings[27] if upward else self.settings[27] - self.settings[130 + k]
            self.steps[k] = round(place * self.settings[100 + k])
        self.state = "Idle"
        return 0

    def _run_gcode(self, line: str, *, jog: bool = False) -> int:
        words = self.modes.read(line)
        if isinstance(words, int):
            return words
        position = next((list(block.end) for block in reversed(self._blocks) if block.line), list(self.steps))
        if jog:
            return self._jog(words, position)
        goal = self.modes.obey(words, _machine_position(self.settings, position))
        if words.spindle is not None:
            speed = min(words.values.get("S", 0.0), self.settings[30])
            self.spindle = speed if words.spindle in (3.0, 4.0) else None
        if 4.0 in words.codes:
            self._blocks.append(Block((), (), words.values["P"], 0, 0, 0, line=False))
            return -1
        if goal is not None:
            self._plan_block(position, goal)
        return 0

    def _jog(self, words: Words, position: list[int]) -> int:
        if "F" not in words.values:
            return 22
        modes = self.modes
        saved_modes = modes.unit, modes.relative, modes.motion, modes.feed, modes.inverse
        line_words = Words(words.codes | {1.0, 94.0}, None, words.values)
        goal = modes.obey(line_words, _machine_position(self.settings, position))
        feed = modes.feed
        modes.unit, modes.relative, modes.motion, modes.feed, modes.inverse = saved_modes
        if goal is not None:
            self._plan_block(position, goal, feed)
        return 0

    def _plan_block(self, start: Sequence[int], goal: Sequence[float], jog: float | None = None) -> None:
        rapid = jog is None and self.modes.motion == 0.0
        feed = self.modes.feed if jog is None else jog
        if block := block_to(self.settings, start, goal, math.inf if rapid else feed / 60, jog is not None):
            block.feed *= block.length if self.modes.inverse and not rapid else 1.0
            self._blocks.append(block)


def _version_lines(hal: bool) -> list[str]:
    """The answer to ``$I``."""
    version = "[VER:1.1f.20260817:]" if hal else "[VER:1.1h.20190825:]"
    return [version, f"[OPT:V,{MAX_BLOCKS},{RX_BUFFER}]", *["[FIRMWARE:grblHAL]"] * hal]


def _machine_position(settings: Mapping[int, float], steps: Sequence[int]) -> list[float]:
    return [n / settings[100 + k] for k, n in enumerate(steps)]


def _three_decimals(values: Sequence[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)


_REALTIME: dict[int, Callable[[Grbl], None]] = {  # commands of one byte, which act at once
    0x18: Grbl._soft_reset,
    ord("?"): Grbl._tell_state,
    ord("!"): Grbl._hold,
    ord("~"): Grbl._resume,
    0x85: Grbl._cancel_jog,
    **{byte: partial(Grbl._change_feed, byte=byte) for byte in _FEED_OVERRIDES},
}
