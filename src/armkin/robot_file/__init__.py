"""Robot files: YAML in, one validated, immutable model out, or an error with its line.

strict_yaml.py     YAML without its traps
robot_keys.py      keys, types, bounds, as pydantic has them; cross_key_checks.py, drive_checks.py: rules between values
robot.py           `RobotFile`: the two together; robot_key_errors.py: errors in the file's own words
key_types.py       what all keys are made of
keep_out_keys.py   floors, boxes, capsules; scene_file.py: such in a file of their own
robot_schema.py    JSON Schema, for editors
catalogue.py       the shipped robots by name
new_file.py        a robot file from a DH table
replace_values.py  other values in a robot file's text; robot_file_text.py: a whole file's text
urdf_reader.py     a URDF as a robot file; urdf_document.py: its XML

This package imports pydantic and yaml, and is itself imported only when a robot file is read.
"""

import hashlib
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from armkin.errors import FileError, RobotFileError, UsageError
from armkin.robot_file import catalogue, strict_yaml
from armkin.robot_file.robot import RobotFile
from armkin.robot_file.robot_keys import DH, Board, Drive, Gripper, Homing, Joint, Motor, Pose, Screw

__all__ = [
    "DH",
    "Board",
    "Drive",
    "Gripper",
    "Homing",
    "Joint",
    "Motor",
    "Pose",
    "RobotFile",
    "Screw",
    "json_schema",
    "parse_robot_file",
    "read_robot_file",
]


_MAX_PROBLEMS = 20  # problems of one file that are told at once


def read_robot_file(path: str | os.PathLike[str]) -> RobotFile:
    """Read and validate a robot file, given its path or the name of a shipped robot.

    Raises FileError if it cannot be read, RobotFileError (``file:line: what; what is allowed``) if it
    is not valid, UsageError for what is no path.
    """
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"a robot is a path or a name, of type str or os.PathLike; got {type(path).__name__}")
    name = os.fspath(path)
    try:
        with Path(catalogue.locate(name)).open("rb") as file:
            # One byte more than is allowed: enough to know, also of /dev/zero.
            raw = file.read(strict_yaml.MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        is_folder = isinstance(error, IsADirectoryError)
        hint = "; name a file, for example robots/three_dof.yaml" if is_folder else ""
        raise FileError(f"{name}: cannot read the robot file: {reason}{hint}", file=name) from None
    return parse_robot_file(raw, name)


def parse_robot_file(raw: bytes | str, name: str = "robot.yaml") -> RobotFile:
    """Validate the text of a robot file; ``name`` is what messages call it."""
    if isinstance(raw, str):
        raw = raw.encode()
    try:
        document = strict_yaml.load_yaml(raw)
    except strict_yaml.StrictYamlError as error:
        raise _invalid_error(name, [(error.line, error.problem)]) from None
    if "moves" in document.data and "joints" not in document.data:
        line = document.line(("moves",))
        raise _invalid_error(name, [(line, "moves: this is a path file, not a robot; write armkin path ROBOT FILE")])
    try:
        robot = _validate(document.data)
    except ValidationError as error:
        from armkin.robot_file import robot_key_errors  # imported for invalid files only

        problems = [
            (document.line(path), f"{_place_text(path, document.data)}{text}")
            for path, text in robot_key_errors.problems(error.errors(include_url=False))
        ]
        problems.sort(key=lambda problem: problem[0])
        raise _invalid_error(name, problems) from None
    robot._path = name
    robot._sha256 = hashlib.sha256(raw).hexdigest()
    return robot


def json_schema() -> dict[str, Any]:
    """JSON Schema of a robot file, for editors (see ``robots/robot.schema.json``)."""
    from armkin.robot_file import robot_schema

    return robot_schema.json_schema()


def _validate(keys: dict[str, Any]) -> RobotFile:
    """The keys as a robot file; pydantic's ValidationError lists what is wrong."""
    if not RobotFile.__pydantic_complete__:
        # Looking for pydantic's plugins reads the metadata of every installed package, which takes
        # longer than all the rest of a robot file; nothing here is for them to observe.
        old_setting = os.environ.get("PYDANTIC_DISABLE_PLUGINS")
        os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
        try:
            RobotFile.model_rebuild()
        finally:
            if old_setting is None:
                del os.environ["PYDANTIC_DISABLE_PLUGINS"]
            else:
                os.environ["PYDANTIC_DISABLE_PLUGINS"] = old_setting
    return RobotFile.model_validate(keys)


def _with_line(name: str, line: int, text: str) -> str:
    return f"{name}:{line}: {text}" if line else f"{name}: {text}"


def _invalid_error(name: str, problems: list[tuple[int, str]]) -> RobotFileError:
    """All problems, a line each; of very many, the first and how many more there are."""
    lines = tuple(_with_line(name, line, text) for line, text in problems)
    message = "\n".join(lines[:_MAX_PROBLEMS])
    if len(lines) > _MAX_PROBLEMS:
        message += f"\nand {len(lines) - _MAX_PROBLEMS} more problems"
    return RobotFileError(message, file=name, line=problems[0][0] or None, problems=list(lines))


def _place_text(path: strict_yaml.Path, keys: dict[str, Any]) -> str:
    """The place in words: ``joint q2: dh.alpha: ``."""
    words: list[str] = []
    if len(path) > 1 and path[0] in ("joints", "motors") and isinstance(path[1], int):
        item = keys[path[0]][path[1]]
        name = item.get("name") if isinstance(item, dict) else None
        kind = str(path[0])[:-1]
        has_name = isinstance(name, str) and 0 < len(name) <= 40 and name.isprintable()
        words.append(f"{kind} {name}" if has_name else f"{kind} number {path[1] + 1}")
        path = path[2:]
    while path and isinstance(path[-1], int):  # the line is the item's; its number says nothing
        path = path[:-1]
    if path:
        words.append(".".join(strict_yaml.one_line(str(part)) for part in path))
    return "".join(f"{word}: " for word in words)
