"""What a G-code line means to the GRBL stand-in: words and their errors, modes, offsets.

Source: GRBL's own `protocol.c`, `gcode.c` and `report.c` (1.1h) and grblHAL's, read for facts: which words there are,
which go together, what a reset clears and what outlives it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from armkin.board.grbl.replies import LETTERS

SYSTEMS = "G54", "G55", "G56", "G57", "G58", "G59"
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_MOTION_CODES = {0.0, 1.0, 80.0}
_OTHER_CODES = {4.0, 10.0, 28.0, 53.0, 92.0, 92.1}
_GROUPS = (  # modal groups: one word of each in a line
    _MOTION_CODES,
    {17.0, 18.0, 19.0},
    {20.0, 21.0},
    {90.0, 91.0},
    {93.0, 94.0},
    {43.1, 49.0},
    {54.0, 55.0, 56.0, 57.0, 58.0, 59.0},
    {4.0, 10.0, 28.0, 92.0, 92.1},
    {40.0},
)
_OFFSET_CODES = frozenset({10.0, 43.1, 92.0, 92.1})
_USES_AXES = {10.0, 28.0, 43.1, 92.0}  # codes whose axis words are no move
_KNOWN_CODES = set().union(_OTHER_CODES, *_GROUPS)
INCH = 25.4  # inch [mm]


@dataclass(frozen=True)
class Words:
    """A line: its G codes, its M code, and the other letters' values."""

    codes: frozenset[float]
    spindle: float | None
    values: dict[str, float]

    def waits(self) -> bool:
        """Whether GRBL carries out all motion before it obeys this line."""
        waiting_codes = (4, 10, 28, 43.1, 49, 92, 92.1, *range(54, 60))
        return self.spindle is not None or any(code in self.codes for code in waiting_codes)


@dataclass
class Modes:
    """The parser's state: what stays from line to line, and what stays through a reset."""

    axes: int
    hal: bool = False  # grblHAL: G92 and the tool length outlive a soft reset
    offsets: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.offsets = {name: [0.0] * self.axes for name in (*SYSTEMS, "G28", "G30")}
        self.g92, self.tool = [0.0] * self.axes, [0.0] * self.axes
        self.reset(power=True)

    def reset(self, *, power: bool, keep_offsets: bool = False) -> None:
        """What a reset leaves; keep_offsets: G92 is kept without power, too."""
        if power or not self.hal:
            self.tool = [0.0] * self.axes
            if not keep_offsets:
                self.g92 = [0.0] * self.axes
        self.unit, self.feed = 1.0, 0.0
        self.relative = self.inverse = False
        self.system, self.motion, self.plane = "G54", 0.0, 17.0

    def work(self) -> list[float]:
        """What is taken from a machine position to give a work position."""
        parts = self.offsets[self.system], self.g92, self.tool
        return [sum(values) for values in zip(*parts, strict=True)]

    def parser_state(self, spindle: float | None) -> str:
        """The answer to ``$G``."""
        words = [f"G{self.motion:g}", self.system, f"G{self.plane:g}", "G21" if self.unit == 1.0 else "G20"]
        words += ["G91" if self.relative else "G90", "G93" if self.inverse else "G94"]
        if self.hal:
            words += ["G92"] if any(self.g92) else []
            words += ["G40", "G43.1" if any(self.tool) else "G49", "G98", "G50"]
        words += ["M5" if spindle is None else "M3", "M9", "T0", f"F{self.feed:.0f}", f"S{spindle or 0:g}"]
        return f"[GC:{' '.join(words)}]"

    def parameters(self) -> list[str]:
        """The answer to ``$#``."""
        rows = [f"[{name}:{_join_values(values)}]" for name, values in self.offsets.items()]
        length_axis = -1 if self.axes < 3 else 2
        tool = _join_values(self.tool) if self.hal else f"{self.tool[length_axis]:.3f}"
        return [*rows, f"[G92:{_join_values(self.g92)}]", f"[TLO:{tool}]", f"[PRB:{_join_values([0.0] * self.axes)}:0]"]

    # Lines

    def read(self, line: str) -> Words | int:
        """A line's words, or the number of its error."""
        codes, values = list[float](), dict[str, float]()
        spindle, index = None, 0
        while index < len(line):
            letter, match = line[index], _NUMBER.match(line, index + 1)
            if not "A" <= letter <= "Z":
                return 1
            if match is None:
                return 2
            value, index = float(match[0]), match.end()
            if letter == "G":
                codes.append(value)
            elif letter == "M":
                if value not in (3.0, 4.0, 5.0, 9.0):
                    return 20
                spindle = value
            elif letter in values:
                return 25
            else:
                values[letter] = value
        return self._fit_error(codes, values) or Words(frozenset(codes), spindle, values)

    def _fit_error(self, codes: Sequence[float], values: dict[str, float]) -> int:
        """The error of words that do not fit together, 0 if they do."""
        codes_given = set(codes)
        if codes_given - _KNOWN_CODES:
            return 20
        if any(sum(code in group for code in codes) > 1 for group in _GROUPS):
            return 21
        moves_axes = any(letter in values for letter in LETTERS[: self.axes])
        if {92.0, 43.1} & codes_given and not moves_axes:
            return 26
        if ({4.0, 10.0} & codes_given and "P" not in values) or (
            10.0 in codes_given and not (moves_axes and values.get("L") in (2.0, 20.0))
        ):
            return 28
        return self._move_error(codes_given, values) if moves_axes and not codes_given & _USES_AXES else 0

    def _move_error(self, codes: set[float], values: dict[str, float]) -> int:
        """The error of axis words that are a move, 0 if it can be made."""
        motion = next(iter(codes & _MOTION_CODES), self.motion)
        if motion == 80.0:
            return 31
        feed = values.get("F", 0.0 if (93.0 in codes or self.inverse) and 94.0 not in codes else self.feed)
        return 22 if motion == 1.0 and feed == 0.0 else 0

    def obey(self, words: Words, position: Sequence[float]) -> list[float] | None:
        """Take over a line's modes and offsets; where it moves to, in machine units, from `position`; None: nowhere."""
        for code in sorted(words.codes):
            self._set_mode(code)
        values, unit = words.values, self.unit
        if "F" in values or self.inverse:
            self.feed = values.get("F", 0.0) * (1.0 if self.inverse else unit)
        axis_values = {k: values[letter] * unit for k, letter in enumerate(LETTERS[: self.axes]) if letter in values}
        if words.codes & _OFFSET_CODES:
            self._set_offset(words, axis_values, position)
        elif 28.0 in words.codes:
            return list(self.offsets["G28"])
        elif axis_values and self.motion != 80.0:
            return self._goal(axis_values, position, absolute=53.0 in words.codes)
        return None

    def _goal(self, axes: dict[int, float], position: Sequence[float], *, absolute: bool) -> list[float]:
        """Where the given axes go, in machine units; absolute: they are in these."""
        zero = position if self.relative else self.work()
        if absolute:
            zero = [0.0] * self.axes
        return [axes[k] + zero[k] if k in axes else position[k] for k in range(self.axes)]

    def _set_offset(self, words: Words, axes: dict[int, float], position: Sequence[float]) -> None:
        """G92, G92.1, G10 and G43.1."""
        if 92.1 in words.codes:
            self.g92 = [0.0] * self.axes
        elif 92.0 in words.codes:
            base = [a + b for a, b in zip(self.offsets[self.system], self.tool, strict=True)]
            self.g92 = [position[k] - base[k] - axes[k] if k in axes else old for k, old in enumerate(self.g92)]
        elif 10.0 in words.codes:
            self._store_offset(words.values, axes, position)
        else:
            self.tool = [axes.get(k, old) for k, old in enumerate(self.tool)]

    def _set_mode(self, code: float) -> None:
        """Take over one modal G code."""
        if code in _MOTION_CODES:
            self.motion = code
        elif code in (17.0, 18.0, 19.0):
            self.plane = code
        elif code in (20.0, 21.0):
            self.unit = INCH if code == 20.0 else 1.0
        elif code in (90.0, 91.0):
            self.relative = code == 91.0
        elif code in (93.0, 94.0):
            self.inverse = code == 93.0
        elif 54.0 <= code <= 59.0:
            self.system = f"G{code:g}"
        elif code == 49.0:
            self.tool = [0.0] * self.axes

    def _store_offset(self, values: dict[str, float], axes: dict[int, float], position: Sequence[float]) -> None:
        """G10: an offset that outlives resets and power."""
        number = int(values["P"])
        rows = self.offsets[self.system if number == 0 else SYSTEMS[number - 1]]
        for k, value in axes.items():
            rows[k] = value if values["L"] == 2.0 else position[k] - self.g92[k] - self.tool[k] - value


def _join_values(values: Sequence[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
