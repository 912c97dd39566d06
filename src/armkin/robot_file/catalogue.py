"""The shipped robots, by name and from any folder.

A wheel holds them in ``armkin/robots`` (pyproject.toml, force-include); a clone or an editable install has
them in ``robots`` at its top.
"""

import os
from pathlib import Path

from armkin.errors import FileError

_HERE = Path(__file__).resolve().parents[1]  # folder of the package
_FOLDERS = (_HERE / "robots", _HERE.parents[1] / "robots")
_SUFFIXES = (".yaml", ".yml")


def robot_names() -> tuple[str, ...]:
    """Names of the shipped robots, in alphabetical order.

    >>> "three_dof" in robot_names()
    True
    """
    return tuple(sorted(path.stem for path in _robots_folder().glob("*.yaml")))


def shipped_file(name: str) -> Path | None:
    """File of a shipped robot; None if there is none of that name.

    >>> shipped_file("three_dof").name, shipped_file("robots/three_dof.yaml")
    ('three_dof.yaml', None)
    """
    return _robots_folder() / f"{name}.yaml" if name in robot_names() else None


def locate(robot: str) -> str:
    """Path of a robot file, given its path or the name of a shipped robot; a path to a file wins.

    Raises FileError, with near names, for what is neither; a path that cannot be examined is returned as it
    is, and opening it tells why.
    """
    try:
        if os.path.exists(robot) and not os.path.isdir(robot):
            return robot
        file = shipped_file(robot)
        if file is not None:
            return str(file)
        if os.path.isdir(robot):
            return robot
        os.stat(robot)
    except FileNotFoundError:
        raise FileError(_missing_text(robot), file=robot) from None
    except (OSError, ValueError):
        pass
    return robot


def _missing_text(robot: str) -> str:
    if not robot:
        return "the robot file's name is empty; name a file or a shipped robot (three_dof, ur5e, ...: armkin robots)"
    near = _similar_names(robot)
    if near:
        return f"there is no robot {robot}; did you mean {' or '.join(near)}?"
    if os.path.dirname(robot) or robot.endswith(_SUFFIXES):
        return f"{robot}: cannot read the robot file: No such file or directory"
    return f"there is no robot {robot}: neither a file nor a shipped robot (three_dof, ur5e, ...: armkin robots)"


def _similar_names(robot: str) -> list[str]:
    """What may have been meant: a file beside it, a shipped robot, or those whose names it begins."""
    from difflib import get_close_matches

    folder, base = os.path.split(robot)
    stem = os.path.splitext(base)[0] if base.endswith(_SUFFIXES) else base
    if not stem or len(stem) > 100:
        return []
    try:
        files_there = [entry for entry in sorted(os.listdir(folder or ".")) if entry.endswith(_SUFFIXES)]
    except OSError:
        files_there = []
    for choices, parent, cutoff in ((files_there, folder, 0.75), (list(robot_names()), "", 0.76)):  # arm is no xarm6
        # Case, dashes and the suffix are what people get wrong most: compare without them.
        choice_of = {_comparable_name(choice): choice for choice in choices}
        matches = get_close_matches(_comparable_name(base), choice_of, n=1, cutoff=cutoff)
        if matches:
            return [os.path.join(parent, choice_of[matches[0]])]
    same_beginning = [name for name in robot_names() if len(stem) > 1 and name.startswith(_comparable_name(base))]
    return same_beginning[:4]


def _comparable_name(name: str) -> str:
    return os.path.splitext(name)[0].lower().replace("-", "_").replace(" ", "_")


def _robots_folder() -> Path:
    return next((folder for folder in _FOLDERS if folder.is_dir()), _FOLDERS[0])
