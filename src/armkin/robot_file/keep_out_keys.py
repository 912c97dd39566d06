"""Keep-outs as robot files and scenes have them: floors, boxes, capsules, and the arm's own bodies.

An entry has one of the keys of `SHAPES`; the word ``self`` is an entry, too. Distances to them are
`armkin.keep_out`'s.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from armkin.robot_file.key_types import Angle, Length, Model

MAX_ENTRIES = 256  # entries of a file, at most: each is held against every body
SELF = "self"

Path = tuple[str | int, ...]
Solid = Annotated[float, Field(gt=0, le=1e7)]


class Box(Model):
    """A box between two corners, or one of a size at a place."""

    min: tuple[Length, Length, Length] | None = Field(None, description="Corner with the least x, y and z, in mm.")
    max: tuple[Length, Length, Length] | None = Field(None, description="Corner with the greatest x, y and z, in mm.")
    size: tuple[Solid, Solid, Solid] | None = Field(
        None, description="Lengths of the edges in mm, instead of min and max."
    )
    xyz: tuple[Length, Length, Length] = Field((0.0, 0.0, 0.0), description="With size: the box's centre in mm.")
    rpy: tuple[Angle, Angle, Angle] = Field(
        (0.0, 0.0, 0.0), description="With size: roll, pitch, yaw in degrees, R = Rz(yaw) Ry(pitch) Rx(roll)."
    )


class Capsule(Model):
    """A cylinder with half balls as its ends: all points within a radius of a segment."""

    begin: tuple[Length, Length, Length] = Field(alias="from", description="One end of the segment, in mm.")
    end: tuple[Length, Length, Length] = Field(alias="to", description="The other end, in mm.")
    radius: Solid = Field(description="In mm.")


class Entry(Model):
    """One keep-out; none of the shapes' keys: the arm's bodies against each other."""

    floor: Length | None = Field(None, description="Nothing below this z, in mm.")
    box: Box | None = Field(None, description="{min: [x, y, z], max: [x, y, z]}, or {size, xyz, rpy}.")
    capsule: Capsule | None = Field(None, description="{from: [x, y, z], to: [x, y, z], radius: 60}.")
    name: Annotated[str, Field(min_length=1, max_length=40)] | None = Field(
        None, description="What answers call it; absent: floor, box 1, capsule 1, ..."
    )

    @property
    def kind(self) -> str:
        """The shape's key, or self."""
        return next((kind for kind in SHAPES if getattr(self, kind) is not None), SELF)


SHAPES = ("floor", "box", "capsule")
_ITSELF = Entry.model_construct()


def _to_entry(value: Any) -> Any:
    """``self`` as an entry; what is neither that nor a mapping is refused in words."""
    if value == SELF:
        return _ITSELF
    if isinstance(value, dict | Entry):
        return value
    value_text = f"'{value}'" if isinstance(value, str) else "this"
    raise PydanticCustomError(
        "problem", "{said} is no keep-out; write {example}", {"said": value_text, "example": EXAMPLE}
    )


EXAMPLE = "- self, - floor: 0, - box: {min: [200, -300, 0], max: [500, 300, 120]} or - capsule: {...}"
ENTRIES: TypeAdapter[tuple[Entry, ...]] = TypeAdapter(tuple[Annotated[Entry, BeforeValidator(_to_entry)], ...])


def read_keep_outs(values: Any) -> tuple[Entry, ...]:
    """The entries of a file. Raises PydanticCustomError with pydantic's `errors`, or with `problems`: path and text."""
    problems: list[tuple[Path, str]] = []
    if not isinstance(values, tuple | list):
        problems = [(("keep_out",), f"must be a list; write {EXAMPLE}")]
    elif len(values) > MAX_ENTRIES:
        problems = [
            (("keep_out",), f"{len(values)} entries; a file has at most {MAX_ENTRIES}: put a box around several")
        ]
    else:
        try:
            return ENTRIES.validate_python(tuple(values))
        except ValidationError as error:
            errors = [{**problem, "loc": ("keep_out", *problem["loc"])} for problem in error.errors(include_url=False)]
            raise PydanticCustomError("errors", "keep_out", {"errors": errors}) from None
    raise PydanticCustomError("problems", "{text}", {"text": problems[0][1], "problems": problems})


def keep_out_names(entries: Iterable[Entry], used: Iterable[str] = ()) -> list[str]:
    """What each entry is called; defaults count the nameless ones of a kind."""
    count: dict[str, int] = {}
    found_names = []
    for entry in entries:
        if entry.name is not None or entry.kind == SELF:
            found_names.append(entry.name or SELF)
            continue
        number = count[entry.kind] = count.get(entry.kind, 0) + 1
        found_names.append(entry.kind if entry.kind == "floor" and number == 1 else f"{entry.kind} {number}")
    return found_names


def keep_out_problems(
    entries: Iterable[Entry], bodies: Iterable[str] = (), earlier: Iterable[Entry] = ()
) -> Iterator[tuple[Path, str]]:
    """What is wrong with entries whose keys and types are right.

    bodies: names that the arm's own bodies have; earlier: the robot file's entries, where these are a scene's.
    """
    body_names, earlier_entries = set(bodies), list(earlier)
    entries = list(entries)
    names = keep_out_names([*earlier_entries, *entries])
    known_names = set(names[: len(earlier_entries)]) - {SELF}
    for i, (entry, name) in enumerate(zip(entries, names[len(earlier_entries) :], strict=True)):
        for path, text in _check_shape(entry):
            yield ("keep_out", i, *path), text
        if entry.kind == SELF:
            continue
        if entry.name is not None and (not name.isprintable() or not name.strip() or name == SELF):
            yield ("keep_out", i, "name"), "must be a word or two of printable text, and not self"
        if name in body_names:
            yield ("keep_out", i, "name"), f"{name} is the name of one of the arm's bodies; choose another one"
        if name in known_names:
            yield ("keep_out", i), f"a keep-out named {name} is there already; give this one a name of its own"
        known_names.add(name)


def _check_shape(entry: Entry) -> Iterator[tuple[Path, str]]:
    shapes = [kind for kind in SHAPES if getattr(entry, kind) is not None]
    if not shapes and entry is not _ITSELF:
        yield (), f"is no keep-out: it has none of {', '.join(SHAPES)}; write {EXAMPLE}"
    if len(shapes) > 1:
        yield (), f"has {' and '.join(shapes)}; write an entry for each"
    if entry.box is not None:
        yield from ((("box", *path), text) for path, text in _check_box(entry.box))


def _check_box(box: Box) -> Iterator[tuple[Path, str]]:
    has_corners, has_size = box.min is not None or box.max is not None, box.size is not None
    if has_corners and (has_size or box.model_fields_set & {"xyz", "rpy"}):
        yield (), "has min or max and size, xyz or rpy; write {min, max}, or {size, xyz, rpy}"
    elif not has_corners and not has_size:
        yield (), "needs min and max, [200, -300, 0] and [500, 300, 120], or size, xyz and rpy"
    elif has_corners and (box.min is None or box.max is None):
        yield (), f"has no {'min' if box.min is None else 'max'}; a box has both corners"
    elif box.min is not None and box.max is not None:
        yield from (((), text) for text in _check_thickness(box.min, box.max))


def _check_thickness(low_corner: Sequence[float], high_corner: Sequence[float]) -> Iterator[str]:
    """What is wrong along each axis with a box of these corners."""
    for axis, low, high in zip("xyz", low_corner, high_corner, strict=True):
        if low == high:
            yield f"has no thickness: its {axis} goes from {low:g} to {high:g}"
        elif low > high:
            inside_out = f"is inside out: its {axis} goes from {low:g} to {high:g}"
            yield f"{inside_out}; write {high:g} into min and {low:g} into max"
