"""The shipped robots, by name and from any folder.

A wheel holds them in ``armkin/robots`` (pyproject.toml, force-include); a clone or an editable install has
them in ``robots`` at its top.
"""

from __future__ import annotations

import os
from pathlib import Path

from armkin.errors import FileError

_HERE = Path(__file__).resolve().parents[1]  # the package
_FOLDERS = (_HERE / "robots", _HERE.parents[1] / "robots")
_SUFFIXES = (".yaml", ".yml")


def names() -> tuple[str, ...]:
    """Names of the shipped robots, in alphabetical order.

    >>> "three_dof" in names()
    True
    """
    return tuple(sorted(path.stem for path in _folder().glob("*.yaml")))


def shipped(name: str) -> Path | None:
    """File of a shipped robot; None if there is none of that name.

    >>> shipped("three_dof").name, shipped("robots/three_dof.yaml")
    ('three_dof.yaml', None)
    """
    return _folder() / f"{name}.yaml" if name in names() else None


def locate(robot: str) -> str:
    """Path of a robot file, given its path or the name of a shipped robot; a path to a file wins.

    Raises FileError, with near names, for what is neither; a path that cannot be examined is returned as it
    is, and opening it tells why.
    """
    try:
        if os.path.exists(robot) and not os.path.isdir(robot):
            return robot
        found = shipped(robot)
        if found is not None:
            return str(found)
        if os.path.isdir(robot):
            return robot
        os.stat(robot)
    except FileNotFoundError:
        raise FileError(_missing(robot), file=robot) from None
    except (OSError, ValueError):
        pass
    return robot


def _missing(robot: str) -> str:
    near = _near(robot)
    if near:
        return f"there is no robot {robot}; did you mean {' or '.join(near)}?"
    if os.path.dirname(robot) or robot.endswith(_SUFFIXES):
        return f"{robot}: cannot read the robot file: No such file or directory"
    return f"there is no robot {robot}: neither a file nor a shipped robot (three_dof, ur5e, ...: armkin robots)"


def _near(robot: str) -> list[str]:
    """What may have been meant: a file beside it, a shipped robot, or those whose names it begins."""
    from difflib import get_close_matches

    folder, base = os.path.split(robot)
    stem = os.path.splitext(base)[0] if base.endswith(_SUFFIXES) else base
    if not stem or len(stem) > 100:
        return []
    try:
        beside = [entry for entry in sorted(os.listdir(folder or ".")) if entry.endswith(_SUFFIXES)]
    except OSError:
        beside = []
    for choices, where, cutoff in ((beside, folder, 0.75), (list(names()), "", 0.76)):  # arm is no xarm6
        # Case, dashes and the suffix are what people get wrong most: compare without them.
        plain = {_comparable(choice): choice for choice in choices}
        close = get_close_matches(_comparable(base), plain, n=1, cutoff=cutoff)
        if close:
            return [os.path.join(where, plain[close[0]])]
    begun = [name for name in names() if len(stem) > 1 and name.startswith(_comparable(base))]
    return begun[:4]


def _comparable(name: str) -> str:
    return os.path.splitext(name)[0].lower().replace("-", "_").replace(" ", "_")


def _folder() -> Path:
    return next((folder for folder in _FOLDERS if folder.is_dir()), _FOLDERS[0])
