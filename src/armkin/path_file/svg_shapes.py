"""Outlines of SVG's shapes and path data, as points close enough to every curve."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

Point = tuple[float, float]
Matrix = tuple[float, float, float, float, float, float]  # x' = a x + c y + e, y' = b x + d y + f
CHORD_DISTANCE = 0.002  # distance [mm] of a chord from its curve
_CHORD_ANGLE = math.radians(8.0)  # turn [rad] of a curve from chord to chord, at most
_MAX_CHORDS = 20_000  # chords of one curve, at most
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GAP = re.compile(r"[ \t\r\n]*,?[ \t\r\n]*")
_MAX_NUMBER = 1e9  # size of a number, at most
_NO_RADIUS = 1e-9  # radius below which an arc is a line
_COMMANDS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_UNITS = {"": 1.0, "px": 1.0, "in": 96.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "pt": 4 / 3, "pc": 16.0, "q": 96 / 101.6}
_TRANSFORM = re.compile(r"\s*,?\s*(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^()]*)\)")


class ShapeError(ValueError):
    """What is wrong with a shape, in words."""


def parse_length(text: str | None, default: float = 0.0) -> float:
    """A length in px."""
    if text is None:
        return default
    number = _NUMBER.match(text.strip())
    unit = text.strip()[number.end() :].strip().lower() if number else ""
    if number is None or unit not in _UNITS:
        raise ShapeError(f"'{text[:20]}' is no length: a number, or one with {', '.join(u for u in _UNITS if u)}")
    return _check_bound(float(number[0])) * _UNITS[unit]


def above_zero(attributes: Mapping[str, str], *keys: str) -> list[float | None]:
    """Sizes of an element [px], which are not below 0; None where one is not there."""
    sizes: list[float | None] = []
    for key in keys:
        text = attributes.get(key)
        sizes.append(None if text is None else parse_length(text))
        if (sizes[-1] or 0.0) < 0:
            raise ShapeError(f"{key} {text} is below 0")
    return sizes


def _check_bound(value: float) -> float:
    """The number, if it is finite and not too large."""
    if not abs(value) <= _MAX_NUMBER:
        raise ShapeError(f"the number {value:g} is larger than {_MAX_NUMBER:g}")
    return value


def parse_numbers(text: str) -> list[float]:
    """Numbers between spaces and commas."""
    words = _NUMBER.findall(text)
    if _NUMBER.sub("", text).strip(" ,\t\r\n"):
        raise ShapeError(f"'{text.strip()[:20]}' has what is no number")
    return [_check_bound(float(x)) for x in words]


def multiply(m: Matrix, n: Matrix) -> Matrix:
    """First n, then m."""
    a, b, c, d, e, f = m
    A, B, C, D, E, F = n
    return a * A + c * B, b * A + d * B, a * C + c * D, b * C + d * D, a * E + c * F + e, b * E + d * F + f


def parse_transform(text: str) -> Matrix:
    """The matrix of a transform attribute."""
    matrix: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    index = 0
    while step := _TRANSFORM.match(text, index):
        index = step.end()
        matrix = multiply(matrix, _one_transform(step[1], parse_numbers(step[2])))
    if text[index:].strip(" ,\t\r\n"):
        raise ShapeError(f"transform '{text[index:].strip()[:30]}' is not known")
    return matrix


def _one_transform(kind: str, v: list[float]) -> Matrix:
    """The matrix of one function of a transform attribute (SVG 1.1, section 7.6)."""
    n = len(v)
    if kind == "matrix" and n == 6:
        return v[0], v[1], v[2], v[3], v[4], v[5]
    if kind == "translate" and n in (1, 2):
        return 1.0, 0.0, 0.0, 1.0, v[0], v[1] if n == 2 else 0.0
    if kind == "scale" and n in (1, 2):
        return v[0], 0.0, 0.0, v[-1], 0.0, 0.0
    if kind == "rotate" and n in (1, 3):
        c, s = math.cos(math.radians(v[0])), math.sin(math.radians(v[0]))
        x, y = (v[1], v[2]) if n == 3 else (0.0, 0.0)
        return c, s, -s, c, x - c * x + s * y, y - s * x - c * y
    if kind in ("skewX", "skewY") and n == 1:
        t = math.tan(math.radians(v[0]))
        return (1.0, 0.0, t, 1.0, 0.0, 0.0) if kind == "skewX" else (1.0, t, 0.0, 1.0, 0.0, 0.0)
    raise ShapeError(f"{kind} has {n} numbers")


def outlines(tag: str, attributes: Mapping[str, str], m: Matrix) -> list[list[Point]]:
    """The strokes of one of `SHAPES`, transformed to millimetres: points."""
    pen = _Outline(m)
    SHAPES[tag](pen, attributes)
    return [stroke for stroke in pen.strokes if len(stroke) > 1]


def _draw_line(pen: _Outline, attributes: Mapping[str, str]) -> None:
    x1, y1, x2, y2 = (parse_length(attributes.get(key)) for key in ("x1", "y1", "x2", "y2"))
    pen.move((x1, y1))
    pen.line((x2, y2))


def _draw_polyline(pen: _Outline, attributes: Mapping[str, str]) -> None:
    values = parse_numbers(attributes.get("points", ""))
    if len(values) % 2:
        raise ShapeError("points has an odd count of numbers")
    for k in range(0, len(values), 2):
        (pen.line if k else pen.move)((values[k], values[k + 1]))


def _draw_polygon(pen: _Outline, attributes: Mapping[str, str]) -> None:
    _draw_polyline(pen, attributes)
    pen.close()


def _draw_circle(pen: _Outline, attributes: Mapping[str, str]) -> None:
    (radius,) = above_zero(attributes, "r")
    _draw_round(pen, attributes, radius, radius)


def _draw_ellipse(pen: _Outline, attributes: Mapping[str, str]) -> None:
    rx, ry = above_zero(attributes, "rx", "ry")
    _draw_round(pen, attributes, ry if rx is None else rx, rx if ry is None else ry)


def _draw_round(pen: _Outline, attributes: Mapping[str, str], rx: float | None, ry: float | None) -> None:
    x, y = parse_length(attributes.get("cx")), parse_length(attributes.get("cy"))
    if rx and ry:
        pen.move((x + rx, y))
        pen.ellipse((x, y), rx, ry, 0.0, 0.0, 2 * math.pi)
        pen.close()


def _draw_rectangle(pen: _Outline, attributes: Mapping[str, str]) -> None:
    """A rectangle with round corners where rx or ry is above 0."""
    x, y = parse_length(attributes.get("x")), parse_length(attributes.get("y"))
    wide, high, round_x, round_y = above_zero(attributes, "width", "height", "rx", "ry")
    w, h = wide or 0.0, high or 0.0
    if w == 0 or h == 0:
        return
    rx = min((round_y if round_x is None else round_x) or 0.0, w / 2)
    ry = min((round_x if round_y is None else round_y) or 0.0, h / 2)
    pen.move((x + rx, y))
    corners = ((x + w - rx, y + ry, -90), (x + w - rx, y + h - ry, 0), (x + rx, y + h - ry, 90), (x + rx, y + ry, 180))
    for cx, cy, begin in corners:
        t = math.radians(begin)
        pen.line((cx + rx * math.cos(t), cy + ry * math.sin(t)))
        if rx > 0 and ry > 0:
            pen.ellipse((cx, cy), rx, ry, 0.0, t, math.pi / 2)
    pen.close()


class _Outline:
    """Strokes in the element's coordinates, kept transformed."""

    def __init__(self, m: Matrix) -> None:
        self.m = m
        self.strokes: list[list[Point]] = []
        self.position: Point = (0.0, 0.0)
        self.begun: Point = (0.0, 0.0)
        self.scale = max(math.hypot(m[0], m[1]), math.hypot(m[2], m[3]), 1e-12)
        self.open = False

    def move(self, p: Point) -> None:
        """Lift the pen and go to p."""
        self.position = self.begun = p
        self.open = False

    def line(self, p: Point) -> None:
        """A straight line to p; a stroke begins with its first."""
        if not self.open:
            self.strokes.append([self._place(self.position)])
            self.open = True
        self.strokes[-1].append(self._place(p))
        self.position = p

    def close(self) -> None:
        """A line back to where the outline began."""
        if self.open:
            self.line(self.begun)
        self.position, self.open = self.begun, False

    def bezier(self, a: Point, b: Point, p: Point) -> None:
        """A cubic to p."""
        s = self.position
        bend = max(
            math.hypot(s[0] - 2 * a[0] + b[0], s[1] - 2 * a[1] + b[1]),
            math.hypot(a[0] - 2 * b[0] + p[0], a[1] - 2 * b[1] + p[1]),
        )
        n = _chord_count(math.sqrt(6 * bend * self.scale / (8 * CHORD_DISTANCE)), 12 if bend > 1e-12 else 1)
        for k in range(1, n + 1):
            t = k / n
            u = 1 - t
            w = (u * u * u, 3 * u * u * t, 3 * u * t * t, t * t * t)
            self.line((
                w[0] * s[0] + w[1] * a[0] + w[2] * b[0] + w[3] * p[0],
                w[0] * s[1] + w[1] * a[1] + w[2] * b[1] + w[3] * p[1],
            ))  # fmt: skip

    def ellipse(self, c: Point, rx: float, ry: float, turned: float, begin: float, angle: float) -> None:
        """An arc of an ellipse about c, its axes turned [rad], from `begin` over `angle`."""
        size = max(rx, ry) * self.scale
        step = min(_CHORD_ANGLE, 2 * math.acos(1 - min(CHORD_DISTANCE / size, 1.0))) if size > 0 else _CHORD_ANGLE
        n = _chord_count(abs(angle) / step, 1)
        cos, sin = math.cos(turned), math.sin(turned)
        for k in range(1, n + 1):
            t = begin + angle * k / n
            x, y = rx * math.cos(t), ry * math.sin(t)
            self.line((c[0] + cos * x - sin * y, c[1] + sin * x + cos * y))

    def _place(self, p: Point) -> Point:
        a, b, c, d, e, f = self.m
        return a * p[0] + c * p[1] + e, b * p[0] + d * p[1] + f


def _chord_count(count: float, least: int) -> int:
    if not count <= _MAX_CHORDS:
        raise ShapeError(f"a curve needs more than {_MAX_CHORDS} chords: is the drawing this large?")
    return max(math.ceil(count), least)


def _draw_path(pen: _Outline, d: str) -> None:
    """Path data: both cases of M L H V C S Q T A Z (SVG 1.1, section 8.3)."""
    command, index, size = "", 0, len(d)
    bent: tuple[str, Point] | None = None  # the curve before, and its last control point
    while True:
        index = _skip_gap(d, index)
        if index >= size:
            return
        if d[index].isalpha():
            command, index = d[index], index + 1
            begun = pen.strokes or command.upper() == "M" or pen.position != (0, 0) or d.lstrip()[0] in "Mm"
            if command.upper() not in _COMMANDS or not begun:
                raise ShapeError(f"path data: '{command}' is not known here; it begins with M")
            if command in "Zz":
                pen.close()
                bent = None
                continue
        elif command in ("", "Z", "z"):
            raise ShapeError(f"path data: '{d[index : index + 12]}' stands where a command must")
        values, index = _command_values(d, index, command)
        bent = _draw_command(pen, command, values, bent)
        if command in "Mm":
            command = "L" if command == "M" else "l"


def _skip_gap(d: str, index: int) -> int:
    """Behind the space, and one comma, that may stand between numbers."""
    gap = _GAP.match(d, index)
    return index if gap is None else gap.end()


def _command_values(d: str, index: int, command: str) -> tuple[list[float], int]:
    """The numbers of one command from an index of the path data on, and the index behind them."""
    values: list[float] = []
    for k in range(_COMMANDS[command.upper()]):
        index = _skip_gap(d, index)
        if command in "Aa" and k in (3, 4):  # flags need no space between them
            if d[index : index + 1] not in ("0", "1"):
                raise ShapeError(f"path data: an arc's flag is 0 or 1, not '{d[index : index + 6]}'")
            values.append(float(d[index]))
            index += 1
            continue
        number = _NUMBER.match(d, index)
        if number is None:
            raise ShapeError(
                f"path data: {command} needs {_COMMANDS[command.upper()]} numbers, not '{d[index : index + 12]}'"
            )
        values.append(_check_bound(float(number[0])))
        index = number.end()
    return values, index


def _draw_command(
    pen: _Outline, command: str, v: list[float], bent: tuple[str, Point] | None
) -> tuple[str, Point] | None:
    """Draw one command; returns what a smooth one after it mirrors."""
    kind, (x, y) = command.upper(), pen.position
    v = _absolute_values(command, v, pen.position)
    if kind in "CSQT":
        return _draw_curve(pen, kind, v, bent)
    if kind == "M":
        pen.move((v[0], v[1]))
    elif kind == "A":
        _draw_arc(pen, v)
    else:
        pen.line({"H": (v[0], y), "V": (x, v[0])}.get(kind) or (v[0], v[1]))
    return None


def _absolute_values(command: str, v: list[float], position: Point) -> list[float]:
    """A command's numbers from the drawing's zero: small letters count from where the pen is."""
    if command.isupper():
        return v
    if command == "a":
        return [*v[:5], v[5] + position[0], v[6] + position[1]]
    shift = {"h": position[:1], "v": position[1:]}.get(command, position)
    return [value + shift[k % len(shift)] for k, value in enumerate(v)]


def _draw_curve(pen: _Outline, kind: str, v: list[float], bent: tuple[str, Point] | None) -> tuple[str, Point]:
    """A cubic (C, S) or quadratic (Q, T) curve; S and T mirror the last control point of a curve before, `bent`."""
    curve, start = "C" if kind in "CS" else "Q", pen.position
    first, end = (v[0], v[1]), (v[-2], v[-1])
    if kind in "ST":
        before = bent[1] if bent is not None and bent[0] == curve else start
        first = (2 * start[0] - before[0], 2 * start[1] - before[1])
    if curve == "C":
        second = (v[-4], v[-3])
        pen.bezier(first, second, end)
        return "C", second
    a, b = ((p[0] + 2 * (first[0] - p[0]) / 3, p[1] + 2 * (first[1] - p[1]) / 3) for p in (start, end))
    pen.bezier(a, b, end)
    return "Q", first


def _draw_arc(pen: _Outline, v: list[float]) -> None:
    """An elliptical arc by its ends (SVG 1.1, appendix F.6.5)."""
    (x1, y1), (x2, y2) = pen.position, (v[5], v[6])
    rx, ry, turned = abs(v[0]), abs(v[1]), math.radians(v[2])
    large, sweep = v[3] == 1, v[4] == 1
    if (x1, y1) == (x2, y2):
        return
    if min(rx, ry) < _NO_RADIUS:
        pen.line((x2, y2))
        return
    cos, sin = math.cos(turned), math.sin(turned)
    dx, dy = (x1 - x2) / 2, (y1 - y2) / 2
    x, y = cos * dx + sin * dy, -sin * dx + cos * dy  # half the chord, along the ellipse's axes
    scale = (x / rx) ** 2 + (y / ry) ** 2
    if scale > 1:  # too small for its chord: grown until it fits
        rx, ry = rx * math.sqrt(scale), ry * math.sqrt(scale)
    cx, cy = _ellipse_centre(x, y, rx, ry, -1 if large == sweep else 1)
    begin = math.atan2((y - cy) / ry, (x - cx) / rx)
    angle = (math.atan2((-y - cy) / ry, (-x - cx) / rx) - begin) % (2 * math.pi)
    angle = angle if sweep else angle - 2 * math.pi
    centre = cos * cx - sin * cy + (x1 + x2) / 2, sin * cx + cos * cy + (y1 + y2) / 2
    pen.ellipse(centre, rx, ry, turned, begin, angle)


def _ellipse_centre(x: float, y: float, rx: float, ry: float, side: int) -> Point:
    """The centre, seen from a chord's middle, of the ellipse through its ends (x, y) and (-x, -y); side: 1 or -1."""
    below = rx * rx * y * y + ry * ry * x * x
    root = math.sqrt(max(rx * rx * ry * ry - below, 0.0) / below) * side
    return root * rx * y / ry, -root * ry * x / rx


SHAPES: dict[str, Callable[[_Outline, Mapping[str, str]], None]] = {  # element -> how it is drawn
    "path": lambda pen, attributes: _draw_path(pen, attributes.get("d", "")),
    "line": _draw_line,
    "polyline": _draw_polyline,
    "polygon": _draw_polygon,
    "rect": _draw_rectangle,
    "circle": _draw_circle,
    "ellipse": _draw_ellipse,
}
