"""Drawings in SVG as a path: every outline a stroke, the pen lifted in between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

from armkin.errors import PathFileError
from armkin.path_file.drawing import MAX_COORDINATE, DrawingOptions, Pen, Placing
from armkin.path_file.path_keys import MAX_POINTS, PathFile
from armkin.path_file.svg_shapes import (
    SHAPES,
    Matrix,
    Point,
    ShapeError,
    above_zero,
    multiply,
    outlines,
    parse_length,
    parse_numbers,
    parse_transform,
)

_MM = 25.4 / 96  # pixel [mm]
_GROUPS = {"svg", "g", "a", "symbol"}
_REFUSED = {"text", "tspan", "textPath", "image", "foreignObject", "switch"}
_MAX_DEPTH, _MAX_ELEMENTS = 64, 200_000  # elements in each other, and in all, at most
_SAME_POINT = 1e-9  # distance [px] of points that are one


@dataclass
class _Element:
    """An element with its attributes, the line where it begins, and what stands in it."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[_Element] = field(default_factory=list)

    def style(self, key: str) -> str | None:
        """A property, by its attribute or in style."""
        for declaration in self.attributes.get("style", "").split(";"):
            name, _, value = declaration.partition(":")
            if name.strip() == key:
                return value.strip()
        return self.attributes.get(key)


def parse_svg(raw: bytes, name: str, placing: Placing, options: DrawingOptions) -> PathFile:
    """The path of a drawing: x right, y up, zero at the viewBox's lower left corner.

    Raises PathFileError with the line of what is refused.
    """
    root = _parse_tree(raw, name)
    if root.tag != "svg":
        raise PathFileError(f"{name}:{root.line}: is <{root.tag}>, and no <svg>", file=name, line=root.line)
    element_of_id = {element.attributes["id"]: element for element in _elements(root) if "id" in element.attributes}
    pen = _Drawer(name, Pen(placing), options, options.lift / placing.scale)
    try:
        frame = _drawing_frame(root)
    except ShapeError as error:
        raise PathFileError(f"{name}:{root.line}: <svg>: {error}", file=name, line=root.line) from None
    for child in root.children:
        pen.draw(child, frame, element_of_id, 0)
    pen.lift()
    return pen.pen.file(name, (), raw, f"it needs an outline of {', '.join(sorted(SHAPES))}")


def _parse_tree(raw: bytes, name: str) -> _Element:
    """The document's elements, their names without prefixes."""
    text = raw.lstrip()
    reader = _Reader(name, raw[: len(raw) - len(text)].count(b"\n"))
    try:
        reader.parser.Parse(text, True)
    except PathFileError:
        raise
    except expat.ExpatError as error:
        line = reader.skipped + error.lineno
        reason = expat.ErrorString(error.code)
        raise PathFileError(f"{name}:{line}: is not XML: {reason}", file=name, line=line) from None
    except (LookupError, ValueError) as error:
        raise PathFileError(f"{name}:1: is not XML: {error}", file=name, line=1) from None
    return reader.top.children[0]


class _Reader:
    """Puts elements together as expat reads them; skipped: lines before the text that it reads."""

    def __init__(self, name: str, skipped_lines: int) -> None:
        self.name, self.skipped = name, skipped_lines
        self.top = _Element("", {}, 0)
        self._open = [self.top]
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._begin
        self.parser.EndElementHandler = self._end
        self.parser.EntityDeclHandler = self._entity

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        element = _Element(tag.rpartition(":")[2], attributes, self.skipped + self.parser.CurrentLineNumber)
        if tag.partition(":")[0] in ("sodipodi", "inkscape"):
            element.tag = "metadata"
        self._open[-1].children.append(element)
        self._open.append(element)
        if len(self._open) > 4 * _MAX_DEPTH:
            place = f"{self.name}:{element.line}"
            raise PathFileError(f"{place}: elements in each other deeper than {4 * _MAX_DEPTH}", file=self.name)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _entity(self, *_: object) -> None:
        line = self.skipped + self.parser.CurrentLineNumber
        raise PathFileError(f"{self.name}:{line}: has entities, which are not read", file=self.name, line=line)


def _elements(element: _Element) -> Iterator[_Element]:
    yield element
    for child in element.children:
        yield from _elements(child)


def _drawing_frame(root: _Element) -> Matrix:
    """From the drawing's coordinates to millimetres, x right and y up from the viewBox's lower left corner."""
    attributes = {key: text for key, text in root.attributes.items() if not text.strip().endswith("%")}
    lengths = above_zero(attributes, "width", "height")
    if 0.0 in lengths:
        raise ShapeError("width and height are above 0, or left out")
    box = parse_numbers(root.attributes.get("viewBox", ""))
    if box and (len(box) != 4 or box[2] <= 0 or box[3] <= 0):
        raise ShapeError("viewBox needs x y width height, the last two above 0")
    if not box:
        return _MM, 0.0, 0.0, -_MM, 0.0, (lengths[1] or 0.0) * _MM
    sx, sy = _scales(lengths, box[2:], root.attributes.get("preserveAspectRatio", ""))
    return sx * _MM, 0.0, 0.0, -sy * _MM, -box[0] * sx * _MM, (box[1] + box[3]) * sy * _MM


def _scales(size: Sequence[float | None], box: Sequence[float], ratio: str) -> tuple[float, float]:
    """The drawing's length of a unit of the viewBox along x and y; ratio: what preserveAspectRatio says."""
    x_scale, y_scale = (
        None if length is None else length / box_length for length, box_length in zip(size, box, strict=True)
    )
    sx, sy = x_scale or y_scale or 1.0, y_scale or x_scale or 1.0
    if ratio.split()[:1] == ["none"]:
        return sx, sy
    scale = max(sx, sy) if "slice" in ratio else min(sx, sy)
    return scale, scale


@dataclass
class _Drawer:
    """Draws strokes one after another."""

    name: str
    pen: Pen
    options: DrawingOptions
    height: float  # [mm of the drawing] of the lifted pen
    position: Point | None = None
    points: int = 0
    elements: int = 0
    line: int = 0

    def draw(self, element: _Element, transform: Matrix, element_of_id: dict[str, _Element], depth: int) -> None:
        """An element and all in it; transform: from where it stands to millimetres."""
        if not self._is_drawn(element, depth):
            return
        try:
            transform = multiply(transform, parse_transform(element.attributes.get("transform", "")))
            if element.tag == "use":
                shift = (parse_length(element.attributes.get("x")), parse_length(element.attributes.get("y")))
                self._draw_used(element, multiply(transform, (1.0, 0.0, 0.0, 1.0, *shift)), element_of_id, depth)
            elif element.tag in SHAPES:
                for stroke in outlines(element.tag, element.attributes, transform):
                    self._draw_stroke(element, stroke)
        except ShapeError as error:
            raise self._error(element, str(error)) from None
        if element.tag in _GROUPS and (element.tag != "symbol" or depth):
            for child in element.children:
                self.draw(child, transform, element_of_id, depth + 1)

    def _is_drawn(self, element: _Element, depth: int) -> bool:
        """Whether an element can be seen. Raises PathFileError for one that would be drawn wrongly."""
        self.elements += 1
        if self.elements > _MAX_ELEMENTS:
            raise self._error(element, f"is one of more than {_MAX_ELEMENTS} elements")
        if depth > _MAX_DEPTH:
            raise self._error(element, f"stands in others deeper than {_MAX_DEPTH}, or uses itself")
        if element.tag in _REFUSED:
            raise self._error(element, "is not drawn: make its outlines a path first")
        is_known = element.tag in SHAPES or element.tag in _GROUPS or element.tag == "use"
        if not is_known or element.style("display") == "none" or element.style("visibility") == "hidden":
            return False
        for key in ("clip-path", "mask"):
            if element.style(key) not in (None, "none"):
                raise self._error(element, f"has {key}: cut its outlines off first")
        if element.tag == "svg":
            raise self._error(element, "stands inside of another <svg>")
        return True

    def _draw_used(self, element: _Element, transform: Matrix, element_of_id: dict[str, _Element], depth: int) -> None:
        """Draw the element that a <use> names; PathFileError if there is none."""
        href = element.attributes.get("href", element.attributes.get("xlink:href", ""))
        if href[:1] != "#" or href[1:] not in element_of_id:
            raise self._error(element, f"uses '{href[:40]}', which is not in this file")
        target = element_of_id[href[1:]]
        if target.tag != "symbol":
            self.draw(target, transform, element_of_id, depth + 1)
            return
        if "viewBox" in target.attributes:
            raise self._error(element, "uses a symbol with a viewBox")
        for child in target.children:
            self.draw(child, transform, element_of_id, depth + 1)

    def _draw_stroke(self, element: _Element, stroke: list[Point]) -> None:
        """Draw a stroke of points [mm], the pen lifted on the way to where it begins."""
        self.points += len(stroke)
        if self.points > MAX_POINTS:
            raise self._error(element, f"is beyond {MAX_POINTS} points: give the drawing in parts")
        if not all(abs(x) <= MAX_COORDINATE for point in stroke for x in point):
            raise self._error(element, f"is farther away than {MAX_COORDINATE:g} mm")
        line, (x, y) = element.line, stroke[0]
        if self.position is None:
            self.pen.jump((x, y, self.height), line)
        elif abs(self.position[0] - x) + abs(self.position[1] - y) > _SAME_POINT:
            self.lift()
            self.pen.line((x, y, self.height), None, line)
        if self.position is None or abs(self.position[0] - x) + abs(self.position[1] - y) > _SAME_POINT:
            self._move_to((x, y, 0.0), line)
        for x, y in stroke[1:]:
            self.pen.line((x, y, 0.0), self.options.feed, line)
        self.position, self.line = stroke[-1], line

    def _move_to(self, point: tuple[float, float, float], line: int) -> None:
        if self.height > 0:
            self.pen.line(point, self.options.feed, line)

    def lift(self) -> None:
        """Lift the pen where it is."""
        if self.position is not None and self.height > 0:
            self.pen.line((*self.position, self.height), None, self.line)

    def _error(self, element: _Element, text: str) -> PathFileError:
        place = f"{self.name}:{element.line}: <{element.tag}>"
        return PathFileError(f"{place} {text}", file=self.name, line=element.line)
