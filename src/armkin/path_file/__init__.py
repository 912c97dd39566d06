"""Path files: YAML or CSV in, one validated path out, or an error with its line.

path_keys.py        keys, types, bounds
path_key_errors.py  errors in the file's own words
csv_path.py         CSV: one row a corner, columns chosen by the header
drawing.py          foreign files as moves
gcode.py            G-code; gcode_words.py: its words, gcode_arcs.py: its arcs
svg.py              SVG; svg_shapes.py: its outlines

This package imports pydantic and yaml, and is itself imported only when a path is read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from armkin.errors import FileError, PathFileError
from armkin.path_file.path_keys import Move, PathFile, Source
from armkin.robot_file import catalogue, strict_yaml

if TYPE_CHECKING:
    from armkin.path_file.drawing import DrawingOptions, Placing

MAX_BYTES = 32_000_000  # size [bytes], at most, of a path file
_KIND = strict_yaml.Kind(
    "path file", "moves", "moves: and a list; rows of CSV belong into a .csv file", 4 * 1024 * 1024, 100_000
)
_FOREIGN = {".gcode": "gcode", ".gco": "gcode", ".nc": "gcode", ".ngc": "gcode", ".svg": "svg"}
__all__ = [
    "MAX_BYTES",
    "Move",
    "PathFile",
    "check_robot",
    "drawing_language",
    "json_schema",
    "parse_path_file",
    "read_drawing",
    "read_path_file",
    "validate_path",
]


def read_path_file(name: str) -> PathFile:
    """Read a path file, by its ending YAML or CSV. Raises FileError, or PathFileError with the line."""
    if drawing_language(name):
        raise PathFileError(
            f"{name}: a drawing does not say where its zero lies for the arm; armkin.drawing(arm, file, at) does",
            file=name,
        )
    return parse_path_file(_read_bytes(name), name)


def drawing_language(name: str) -> str | None:
    """Which language a file that only draws is in, by its ending: gcode, svg; None: it is a path file."""
    return _FOREIGN.get(os.path.splitext(name)[1].lower())


def read_drawing(name: str, placing: Placing, options: DrawingOptions) -> PathFile:
    """Read G-code or SVG as a path. Raises FileError, or PathFileError with line and word."""
    raw = _read_bytes(name)
    if drawing_language(name) == "svg":
        from armkin.path_file import svg

        return svg.parse_svg(raw, name, placing, options)
    from armkin.path_file import gcode

    return gcode.parse_gcode(raw, name, placing, options)


def _read_bytes(name: str) -> bytes:
    """The file's bytes; FileError if it cannot be read or is too large."""
    try:
        with open(name, "rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        hint = _similar_files_text(name) if isinstance(error, FileNotFoundError) else ""
        raise FileError(f"{name}: cannot read the path file: {reason}{hint}", file=name) from None
    if len(raw) > MAX_BYTES:
        raise FileError(f"{name} is larger than {MAX_BYTES // 1_000_000} MB: this is no path file", file=name)
    return raw


def parse_path_file(raw: bytes | str, name: str = "path.yaml") -> PathFile:
    """Validate the text of a path; `name` is what messages call it. Text without a colon in its head is CSV."""
    encoded = raw.encode() if isinstance(raw, str) else raw
    if not encoded.strip():
        raise _invalid_error(name, [(0, "the path is empty; it needs moves, or one row of CSV a corner")])
    if name.endswith(".csv") or not (name.endswith((".yaml", ".yml")) or _is_yaml(encoded)):
        from armkin.path_file import csv_path

        return csv_path.parse_csv(encoded, name)
    try:
        document = strict_yaml.load_yaml(encoded, _KIND)
    except strict_yaml.StrictYamlError as error:
        raise _invalid_error(name, [(error.line, error.problem)]) from None
    try:
        return PathFile.model_validate(_tuples_to_lists(document.data)).read_from(Source(name, document.lines))
    except ValidationError as error:
        from armkin.path_file import path_key_errors

        raise _invalid_error(
            name, [(document.line(key), text) for key, text in path_key_errors.problems(error)]
        ) from None


def validate_path(data: dict[str, Any], name: str = "path") -> PathFile:
    """Validate a path that is data already, as the page or a program has it."""
    try:
        return PathFile.model_validate(_tuples_to_lists(data))
    except ValidationError as error:
        from armkin.path_file import path_key_errors

        raise _invalid_error(name, [(0, text) for _, text in path_key_errors.problems(error)]) from None


def check_robot(file: PathFile, name: str, robot_file: str | None) -> None:
    """Raise PathFileError if a path says that it is of another robot than this, by its name or its file."""
    named_robot = file.robot
    if (
        named_robot is None
        or named_robot in (name, robot_file)
        or (robot_file is not None and _is_same_robot(named_robot, robot_file, file.folder))
    ):
        return
    raise PathFileError(
        f"{file.place('robot')}: this is a path of {named_robot}, and the arm is {name}; plan it for {named_robot}, "
        f"or write robot: {name} if it is meant for this arm",
        robot=name,
    )


def _is_same_robot(named_robot: str, robot_file: str, folder: str) -> bool:
    """Whether a shipped robot's name, or a file's as seen from here or from the path's folder, is the robot file."""
    for robot in (named_robot, os.path.join(folder, named_robot)):
        with suppress(OSError, ValueError, FileError):
            if os.path.samefile(catalogue.locate(robot), catalogue.locate(robot_file)):
                return True
    return False


def json_schema() -> dict[str, Any]:
    """JSON Schema of a path file, for editors (`robots/path.schema.json`)."""
    from armkin.robot_file.robot_schema import schema_of_model

    return schema_of_model(PathFile, "armkin path file")


def _similar_files_text(name: str) -> str:
    """Path files of the same folder with such a name, as the end of a message."""
    import difflib

    folder = Path(name).parent
    try:
        names = [file.name for file in folder.iterdir() if file.suffix in (".yaml", ".yml", ".csv")]
    except OSError:
        return f"; there is no folder {folder}"
    near = difflib.get_close_matches(Path(name).name, names, 1)
    return f"; did you mean {folder / near[0]}?" if near else ""


def _tuples_to_lists(value: Any) -> Any:
    """Data with its tuples (the reader's, or a program's) turned into lists."""
    if isinstance(value, Mapping):
        return {key: _tuples_to_lists(part) for key, part in value.items()}
    return [_tuples_to_lists(part) for part in value] if isinstance(value, list | tuple) else value


def _is_yaml(encoded: bytes) -> bool:
    """Whether the first line that says something has a colon: a mapping's key."""
    for line in encoded[:4096].splitlines():
        text = line.strip()
        if text and not text.startswith(b"#"):
            return b":" in text
    return True


def _invalid_error(name: str, problems: list[tuple[int, str]]) -> PathFileError:
    lines = [f"{name}:{line}: {text}" if line else f"{name}: {text}" for line, text in sorted(problems)]
    more_text = f"\n{len(lines) - 2} more problems" if len(lines) > 2 else ""
    return PathFileError("\n".join(lines[:2]) + more_text, problems=lines, file=name)
