"""G-code of slicers, CAM programs and senders as a path: a subset of RS-274, its modal state kept true.

Source of the meanings: Kramer, Proctor and Messina, The NIST RS274NGC Interpreter, 2000, section 3.
"""

from collections import Counter
from collections.abc import Iterable

from armkin.errors import PathFileError
from armkin.path_file import gcode_arcs
from armkin.path_file.drawing import MAX_COORDINATE, DrawingOptions, Pen, Placing, Point
from armkin.path_file.gcode_words import PLAIN, Words, line_error, lines, words_of
from armkin.path_file.path_keys import MAX_POINTS, PathFile

AXES = "XYZ"
INCH = 25.4  # inch [mm]
_UNITS = {20.0: INCH, 21.0: 1.0}  # [mm]
_MOTION = {0.0: "G0", 1.0: "G1", 2.0: "G2", 3.0: "G3"}
_PLANES = {17.0: (0, 1, 2), 18.0: (2, 0, 1), 19.0: (1, 2, 0)}  # two axes of the plane, and the one across
_SYSTEMS = {54.0: 1, 55.0: 2, 56.0: 3, 57.0: 4, 58.0: 5, 59.0: 6}
_IGNORED_G = {11.0: "G11", 29.0: "G29", 40.0: "G40", 49.0: "G49", 61.0: "G61", 64.0: "G64", 80.0: "G80",
              91.1: "G91.1", 94.0: "G94"}  # fmt: skip
_GROUPS: dict[str, tuple[float, ...]] = {
    "motion": (0.0, 1.0, 2.0, 3.0),
    "plane": (17.0, 18.0, 19.0),
    "units": tuple(_UNITS),
    "distance": (90.0, 91.0),
    "coordinate system": tuple(_SYSTEMS),
    "one-line": (4.0, 10.0, 28.0, 52.0, 92.0, 29.0, 11.0),
}
_GROUP = {code: group for group, codes in _GROUPS.items() for code in codes}
_PLACES = frozenset("XYZIJKR")
_ZERO: Point = (0.0, 0.0, 0.0)
_NO_AXES = [None] * 3
_KNOWN_G = {*_GROUP, *_IGNORED_G, 53.0}
_PAUSES, _ENDS = (0.0, 1.0), (2.0, 30.0)  # M codes that pause or end a program


def parse_gcode(raw: bytes, name: str, placing: Placing, options: DrawingOptions) -> PathFile:
    """The path of a program. Raises PathFileError with line and word for what is refused."""
    if b"\0" in raw:
        line = raw.partition(b"\0")[0].count(b"\n") + 1
        raise PathFileError(f"{name}:{line}: is no text; binary G-code must be written as text", file=name, line=line)
    program = _Program(name, Pen(placing), options)
    program.run(lines(raw.decode("utf-8-sig", "replace"), name))
    notes = [
        f"{word} is ignored (line {program.first[word]}{f', and {n - 1} more' if n > 1 else ''})"
        for word, n in program.ignored.items()
    ]
    return program.pen.file(name, notes, raw, "it needs two places of G0 to G3, and begins at the first")


class _Program:
    """The modal state of a machine that reads a program."""

    def __init__(self, name: str, pen: Pen, options: DrawingOptions) -> None:
        self.name, self.pen, self.options = name, pen, options
        self.position = _ZERO  # [mm] in the machine's coordinates
        self.drawn = False  # whether the pen is at the file's point
        self.motion: float | None = None
        self.plane, self.unit, self.absolute = 17.0, 1.0, True
        self.feed: float | None = None  # [mm/min]
        self.system = 1
        self.systems = {number: [0.0, 0.0, 0.0] for number in range(1, 7)}
        self.local, self.shift = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]  # G52, G92
        self.held: bool | None = None
        self.ignored: Counter[str] = Counter()
        self.first: dict[str, int] = {}
        self.line, self.words = 0, Words()

    def run(self, program: Iterable[tuple[int, str]]) -> None:
        """Read lines until the program's end."""
        for self.line, text in program:
            if self.pen.points > MAX_POINTS:
                raise self._error(f"is behind {MAX_POINTS} points, and a path has no more: give the program in parts")
            plain_match = PLAIN.fullmatch(text)
            if plain_match is not None and self._plain_line(*plain_match.groups()):
                continue
            self.words = words_of(text, self.name, self.line)
            if self._do_line():
                return

    def _plain_line(self, g_word: str | None, early_f: str | None, *words: str | None) -> bool:
        """Do a line of G0 or G1, F, X, Y, Z, E alone as `_do_line` does, sooner; False: `_do_line` has to."""
        *axes, e_word, late_f = words
        motion = self.motion if g_word is None else float(g_word)
        if motion is None or motion > 1 or not (early_f is None or late_f is None):
            return False
        self.motion = motion
        if (feed := early_f or late_f) is not None:
            self.feed = float(feed) * self.unit
        if e_word is not None:
            self._ignore("E")
        if axes != _NO_AXES:
            goal = self._goal([number if number is None else float(number) for number in axes], machine=False)
            self._move_straight(goal, _MOTION[motion])
        return True

    def _error(self, text: str) -> PathFileError:
        return line_error(self.name, self.line, text)

    def _ignore(self, word: str) -> None:
        self.ignored[word] += 1
        self.first.setdefault(word, self.line)

    def _do_line(self) -> bool:
        """One line, in RS-274's order of execution; True: the program ends."""
        codes, m_codes, values = self._sort_words()
        self._take_feed(codes, values)
        s_value = values.pop("S", None)
        for switch in (code for code in m_codes if code not in _PAUSES + _ENDS):
            self._switch(switch, s_value)
        waits = 4.0 in codes and "P" not in values
        if s_value is not None and not waits and not (self.options.grip_by == "M106" and 106.0 in m_codes):
            self._ignore("S")
        if 4.0 in codes:
            self._dwell(values, s_value)
        self._set_modes(codes)
        self._pass_over(codes, values)
        self._offsets_and_motion(codes, values)
        if values:
            letter = next(iter(values))
            raise self._error(f"{letter} belongs to no word of this line")
        for _ in (code for code in m_codes if code in _PAUSES):
            self.pen.pause(self.line)
        return not set(m_codes).isdisjoint(_ENDS)

    def _take_feed(self, codes: list[float], values: dict[str, float]) -> None:
        if "F" in values:
            self.feed = values.pop("F") * self._unit_after(codes)
            if self.feed < 0:
                raise self._error("F below 0 is no feed")

    def _pass_over(self, codes: list[float], values: dict[str, float]) -> None:
        """G codes without a meaning for an arm, and the words that belong to them."""
        for code in codes:
            if code in _IGNORED_G:
                self._ignore(_IGNORED_G[code])
                if code in (29.0, 11.0):
                    values.clear()
                if code == 64.0:
                    values.pop("P", None)

    def _sort_words(self) -> tuple[list[float], list[float], dict[str, float]]:
        """The line's G and M codes, and its other words."""
        codes, m_codes = list[float](), list[float]()
        values: dict[str, float] = {}
        groups: dict[str, str] = {}
        for letter, number, word in self.words:
            if letter == "G":
                code = round(number, 2)
                if code not in _KNOWN_G:
                    raise self._error(f"{word} is not known")
                group = _GROUP.get(code, word)
                if group in groups and code in _GROUP:
                    raise self._error(f"{groups[group]} and {word} stand on one line")
                groups[group] = word
                codes.append(code)
            elif letter == "M":
                m_codes.append(number)
            elif letter in "TEO":  # O: the number that a CAM program has on its first line
                self._ignore(letter)
            elif letter in values:
                raise self._error(f"{letter} stands twice on one line")
            else:
                values[letter] = number
        return codes, m_codes, values

    def _unit_after(self, codes: list[float]) -> float:
        return next((_UNITS[code] for code in codes if code in _UNITS), self.unit)

    def _switch(self, code: float, speed: float | None) -> None:
        """An M word: the gripper's, or ignored."""
        grip_word, closes = self.options.grip_by, None
        if grip_word == "M3" and code in (3.0, 4.0, 5.0):
            closes = code != 5.0
        elif grip_word == "M106" and code in (106.0, 107.0):
            closes = code == 106.0 and speed != 0
        if closes is None:
            self._ignore(f"M{code:g}")
        elif closes != self.held:
            self.held = closes
            self.pen.grip("closed" if closes else "open", self.line)

    def _dwell(self, values: dict[str, float], seconds: float | None) -> None:
        """G4 with P or S, both in seconds."""
        time = values.pop("P", seconds) or 0.0
        if not 0 <= time <= 86400:
            raise self._error(f"G4 waits 0 to 86400 seconds, not {time:g}")
        if time > 0:
            self.pen.wait(time, self.line)

    def _set_modes(self, codes: list[float]) -> None:
        """Plane, unit, absolute or relative numbers, coordinate system and kind of motion, until others are set."""
        for code in codes:
            if code in _PLANES:
                self.plane = code
            elif code in _UNITS:
                self.unit = _UNITS[code]
            elif code in (90.0, 91.0):
                self.absolute = code == 90.0
            elif code in _SYSTEMS:
                self.system = _SYSTEMS[code]
            elif code in _MOTION:
                self.motion = code

    def _offsets_and_motion(self, codes: list[float], values: dict[str, float]) -> None:
        """What a line does with its axes' words: home, set a zero, or move; takes them out of `values`."""
        if 28.0 in codes:
            for letter in AXES:
                values.pop(letter, None)
            self.pen.home(self.line)
            self.position, self.drawn = _ZERO, False
        elif 10.0 in codes:
            self._set_system(values)
        elif 52.0 in codes or 92.0 in codes:
            self._set_shift(values, 52.0 in codes)
        elif not _PLACES.isdisjoint(values):
            if 4.0 in codes or 29.0 in codes:
                raise self._error("an axis' word beside G4")
            self._move(values, machine=53.0 in codes)

    def _set_system(self, values: dict[str, float]) -> None:
        """G10: L2 sets a system's zero, L20 so that the present point has these values; without L a retraction."""
        kind = values.pop("L", None)
        if kind is None:
            self._ignore("G10")
            values.clear()
            return
        if kind not in (2.0, 20.0):
            raise self._error(f"G10 L{kind:g} is not known; L2 and L20 are")
        number = int(values.pop("P", 0.0)) or self.system
        if number not in self.systems:
            raise self._error(f"G10 P{number} is no coordinate system; 1 to 6 are")
        zero = self.systems[number]
        for k, letter in enumerate(AXES):
            if letter in values:
                value = values.pop(letter) * self.unit
                zero[k] = value if kind == 2.0 else self.position[k] - self.local[k] - self.shift[k] - value

    def _set_shift(self, values: dict[str, float], local: bool) -> None:
        """G52 sets a local zero, G92 one so that the present point has these values."""
        word = "G52" if local else "G92"
        values_by_axis = [(k, values.pop(letter) * self.unit) for k, letter in enumerate(AXES) if letter in values]
        if not values_by_axis and not any(letter == "E" for letter, *_ in self.words):
            raise self._error(f"{word} needs X, Y or Z")
        zero = self.systems[self.system]
        for k, value in values_by_axis:
            if local:
                self.local[k] = value
            else:
                self.shift[k] = self.position[k] - zero[k] - self.local[k] - value

    def _goal(self, axes: list[float | None], machine: bool) -> Point:
        """Where the numbers of X, Y and Z lead to, in the machine's coordinates [mm]."""
        zero, goal = self.systems[self.system], list(self.position)
        for k, number in enumerate(axes):
            if number is not None:
                value = number * self.unit
                start = zero[k] + self.local[k] + self.shift[k] if self.absolute else goal[k]
                goal[k] = value if machine else start + value
                if not abs(goal[k]) <= MAX_COORDINATE:
                    raise self._error(f"{AXES[k]}{value:g} is farther away than {MAX_COORDINATE:g} mm")
        return goal[0], goal[1], goal[2]

    def _move(self, values: dict[str, float], machine: bool) -> None:
        """A line or an arc to where the words lead, which are taken out of `values`; machine: its coordinates."""
        if self.motion is None:
            raise self._error("axes' words, and neither G0, G1, G2 nor G3 before them")
        word = _MOTION[self.motion]
        if machine and self.motion > 1:
            raise self._error(f"G53 goes with G0 and G1, not with {word}")
        goal = self._goal([values.pop(letter, None) for letter in AXES], machine)
        if self.motion <= 1:
            self._move_straight(goal, word)
            return
        try:
            centre, normal, angle = gcode_arcs.arc(word, _PLANES[self.plane], values, self.unit, self.position, goal)
        except gcode_arcs.ArcError as error:
            raise self._error(str(error)) from None
        speed = self._speed(word)
        if not self.drawn:
            self.pen.jump(self.position, self.line)
        self.pen.arc(self.position, centre, goal, normal, angle, speed, self.line)
        self.position, self.drawn = goal, True

    def _move_straight(self, goal: Point, word: str) -> None:
        """A line by G0 or G1; to the first point, a joint move."""
        speed = None if word == "G0" else self._speed(word)
        if not self.drawn:
            self.pen.jump(goal, self.line)
        elif goal != self.position:
            self.pen.line(goal, speed, self.line)
        self.position, self.drawn = goal, True

    def _speed(self, word: str) -> float | None:
        """The tool's speed [mm/s]; None: as fast as the joints go."""
        if self.feed is None:
            return self.options.feed
        if self.feed == 0:
            raise self._error(f"{word} with F0 never arrives")
        return self.feed / 60
