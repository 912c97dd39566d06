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
_COUNTS = {
    "matrix": "6",
    "translate": "1 or 2",
    "scale": "1 or 2",
    "rotate": "1 or 3",
    "skewX": "1",
    "skewY": "1",
}  # of numbers
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


def _one_transform(kind: str, values: list[float]) -> Matrix:
    """The matrix of one function of a transform attribute (SVG 1.1, section 7.6)."""
    count = len(values)
    if kind == "matrix" and count == 6:
        return values[0], values[1], values[2], values[3], values[4], values[5]
    if kind == "translate" and count in (1, 2):
        return 1.0, 0.0, 0.0, 1.0, values[0], values[1] if count == 2 else 0.0
    if kind == "scale" and count in (1, 2):
        return values[0], 0.0, 0.0, values[-1], 0.0, 0.0
    if kind == "rotate" and count in (1, 3):
        cosine, sine = math.cos(math.radians(values[0])), math.sin(math.radians(values[0]))
        x, y = (values[1], values[2]) if count == 3 else (0.0, 0.0)
        return cosine, sine, -sine, cosine, x - cosine * x + sine * y, y - sine * x - cosine * y
    if kind in ("skewX", "skewY") and count == 1:
        tangent = math.tan(math.radians(values[0]))
        return (1.0, 0.0, tangent, 1.0, 0.0, 0.0) if kind == "skewX" else (1.0, tangent, 0.0, 1.0, 0.0, 0.0)
    raise ShapeError(f"{kind} has {count} numbers; it takes {_COUNTS[kind]}")


def outlines(tag: str, attributes: Mapping[str, str], transform: Matrix) -> list[list[Point]]:
    """The strokes of one of `SHAPES`, transformed to millimetres: points."""
    pen = _Outline(transform)
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
    given_width, given_height, round_x, round_y = above_zero(attributes, "width", "height", "rx", "ry")
    width, height = given_width or 0.0, given_height or 0.0
    if width == 0 or height == 0:
        return
    rx = min((round_y if round_x is None else round_x) or 0.0, width / 2)
    ry = min((round_x if round_y is None else round_y) or 0.0, height / 2)
    pen.move((x + rx, y))
    corners = (
        (x + width - rx, y + ry, -90),
        (x + width - rx, y + height - ry, 0),
        (x + rx, y + height - ry, 90),
        (x + rx, y + ry, 180),
    )
    for cx, cy, begin in corners:
        begin_angle = math.radians(begin)
        pen.line((cx + rx * math.cos(begin_angle), cy + ry * math.sin(begin_angle)))
        if rx > 0 and ry > 0:
            pen.ellipse((cx, cy), rx, ry, 0.0, begin_angle, math.pi / 2)
    pen.close()


class _Outline:
    """Strokes in the element's coordinates, kept transformed."""

    def __init__(self, transform: Matrix) -> None:
        self.transform = transform
        self.strokes: list[list[Point]] = []
        self.position: Point = (0.0, 0.0)
        self.begun: Point = (0.0, 0.0)
        self.scale = max(math.hypot(transform[0], transform[1]), math.hypot(transform[2], transform[3]), 1e-12)
        self.open = False

    def move(self, point: Point) -> None:
        """Lift the pen and go to a point."""
        self.position = self.begun = point
        self.open = False

    def line(self, point: Point) -> None:
        """A straight line to a point; a stroke begins with its first."""
        if not self.open:
            self.strokes.append([self._place(self.position)])
            self.open = True
        self.strokes[-1].append(self._place(point))
        self.position = point

    def close(self) -> None:
        """A line back to where the outline began."""
        if self.open:
            self.line(self.begun)
        self.position, self.open = self.begun, False

    def bezier(self, a: Point, b: Point, end: Point) -> None:
        """A cubic to its end."""
        start = self.position
        bend = max(
            math.hypot(start[0] - 2 * a[0] + b[0], start[1] - 2 * a[1] + b[1]),
            math.hypot(a[0] - 2 * b[0] + end[0], a[1] - 2 * b[1] + end[1]),
        )
        count = _chord_count(math.sqrt(6 * bend * self.scale / (8 * CHORD_DISTANCE)), 12 if bend > 1e-12 else 1)
        for k in range(1, count + 1):
            t = k / count
            u = 1 - t
            weights = (u * u * u, 3 * u * u * t, 3 * u * t * t, t * t * t)
            self.line((
                weights[0] * start[0] + weights[1] * a[0] + weights[2] * b[0] + weights[3] * end[0],
                weights[0] * start[1] + weights[1] * a[1] + weights[2] * b[1] + weights[3] * end[1],
            ))  # fmt: skip

    def ellipse(self, centre: Point, rx: float, ry: float, tilt: float, begin: float, angle: float) -> None:
        """An arc of an ellipse about its centre, its axes tilted [rad], from `begin` over `angle`."""
        size = max(rx, ry) * self.scale
        step = min(_CHORD_ANGLE, 2 * math.acos(1 - min(CHORD_DISTANCE / size, 1.0))) if size > 0 else _CHORD_ANGLE
        count = _chord_count(abs(angle) / step, 1)
        cos, sin = math.cos(tilt), math.sin(tilt)
        for k in range(1, count + 1):
            t = begin + angle * k / count
            x, y = rx * math.cos(t), ry * math.sin(t)
            self.line((centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y))

    def _place(self, point: Point) -> Point:
        a, b, c, d, e, f = self.transform
        return a * point[0] + c * point[1] + e, b * point[0] + d * point[1] + f


def _chord_count(count: float, min_count: int) -> int:
    if not count <= _MAX_CHORDS:
        raise ShapeError(f"a curve needs more than {_MAX_CHORDS} chords: is the drawing this large?")
    return max(math.ceil(count), min_count)


def _draw_path(pen: _Outline, data: str) -> None:
    """Path data: both cases of M L H V C S Q T A Z (SVG 1.1, section 8.3)."""
    command, index, size = "", 0, len(data)
    last_control: tuple[str, Point] | None = None  # the curve before, and its last control point
    while True:
        index = _skip_gap(data, index)
        if index >= size:
            return
        if data[index].isalpha():
            command, index = data[index], index + 1
            has_begun = pen.strokes or command.upper() == "M" or pen.position != (0, 0) or data.lstrip()[0] in "Mm"
            if command.upper() not in _COMMANDS or not has_begun:
                raise ShapeError(f"path data: '{command}' is not known here; it begins with M")
            if command in "Zz":
                pen.close()
                last_control = None
                continue
        elif command in ("", "Z", "z"):
            raise ShapeError(f"path data: '{data[index : index + 12]}' stands where a command must")
        values, index = _command_values(data, index, command)
        last_control = _draw_command(pen, command, values, last_control)
        if command in "Mm":
            command = "L" if command == "M" else "l"


def _skip_gap(data: str, index: int) -> int:
    """Behind the space, and one comma, that may stand between numbers."""
    gap = _GAP.match(data, index)
    return index if gap is None else gap.end()


def _command_values(data: str, index: int, command: str) -> tuple[list[float], int]:
    """The numbers of one command from an index of the path data on, and the index behind them."""
    values: list[float] = []
    for k in range(_COMMANDS[command.upper()]):
        index = _skip_gap(data, index)
        if command in "Aa" and k in (3, 4):  # flags need no space between them
            if data[index : index + 1] not in ("0", "1"):
                raise ShapeError(f"path data: an arc's flag is 0 or 1, not '{data[index : index + 6]}'")
            values.append(float(data[index]))
            index += 1
            continue
        number = _NUMBER.match(data, index)
        if number is None:
            raise ShapeError(
                f"path data: {command} needs {_COMMANDS[command.upper()]} numbers, not '{data[index : index + 12]}'"
            )
        values.append(_check_bound(float(number[0])))
        index = number.end()
    return values, index


def _draw_command(
    pen: _Outline, command: str, values: list[float], last_control: tuple[str, Point] | None
) -> tuple[str, Point] | None:
    """Draw one command; returns what a smooth one after it mirrors."""
    kind, (x, y) = command.upper(), pen.position
    values = _absolute_values(command, values, pen.position)
    if kind in "CSQT":
        return _draw_curve(pen, kind, values, last_control)
    if kind == "M":
        pen.move((values[0], values[1]))
    elif kind == "A":
        _draw_arc(pen, values)
    else:
        pen.line({"H": (values[0], y), "V": (x, values[0])}.get(kind) or (values[0], values[1]))
    return None


def _absolute_values(command: str, values: list[float], position: Point) -> list[float]:
    """A command's numbers from the drawing's zero: small letters count from where the pen is."""
    if command.isupper():
        return values
    if command == "a":
        return [*values[:5], values[5] + position[0], values[6] + position[1]]
    shift = {"h": position[:1], "v": position[1:]}.get(command, position)
    return [value + shift[k % len(shift)] for k, value in enumerate(values)]


def _draw_curve(
    pen: _Outline, kind: str, values: list[float], last_control: tuple[str, Point] | None
) -> tuple[str, Point]:
    """A cubic (C, S) or quadratic (Q, T) curve; S and T mirror the last control point of a curve before."""
    curve, start = "C" if kind in "CS" else "Q", pen.position
    first, end = (values[0], values[1]), (values[-2], values[-1])
    if kind in "ST":
        last_second = last_control[1] if last_control is not None and last_control[0] == curve else start
        first = (2 * start[0] - last_second[0], 2 * start[1] - last_second[1])
    if curve == "C":
        second = (values[-4], values[-3])
        pen.bezier(first, second, end)
        return "C", second
    a, b = (
        (point[0] + 2 * (first[0] - point[0]) / 3, point[1] + 2 * (first[1] - point[1]) / 3) for point in (start, end)
    )
    pen.bezier(a, b, end)
    return "Q", first


def _draw_arc(pen: _Outline, values: list[float]) -> None:
    """An elliptical arc by its ends (SVG 1.1, appendix F.6.5)."""
    (x1, y1), (x2, y2) = pen.position, (values[5], values[6])
    rx, ry, tilt = abs(values[0]), abs(values[1]), math.radians(values[2])
    large, sweep = values[3] == 1, values[4] == 1
    if (x1, y1) == (x2, y2):
        return
    if min(rx, ry) < _NO_RADIUS:
        pen.line((x2, y2))
        return
    cos, sin = math.cos(tilt), math.sin(tilt)
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
    pen.ellipse(centre, rx, ry, tilt, begin, angle)


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
