"""Scenes: keep-outs in a file of their own, which are added to those of a robot file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from operator import itemgetter
from typing import TYPE_CHECKING, NoReturn

from pydantic import Field, PrivateAttr, ValidationError

from armkin.errors import FileError, RobotFileError
from armkin.robot_file import keep_out_keys as entries
from armkin.robot_file import robot_key_errors, strict_yaml
from armkin.robot_file.key_types import Model
from armkin.robot_file.robot_keys import KeepOut, Size

if TYPE_CHECKING:
    from armkin.robot_file.robot import RobotFile

_KIND = strict_yaml.Kind("scene", "keep_out", "keep_out: [self, floor: 0]", 1024 * 1024, 50_000)
_MAX_PROBLEMS = 20  # problems that are told at once


class Scene(Model):
    """What stands around an arm. Frame and units are those of targets."""

    clearance: Size = Field(0.0, description="How far the arm keeps from every keep-out, in mm.")
    keep_out: KeepOut = Field(description="Where the arm must not go: self, floors, boxes, capsules.")

    _document: strict_yaml.Document = PrivateAttr(strict_yaml.Document({}, {(): 0}))
    _path: str = PrivateAttr("")
    _sha256: str = PrivateAttr("")

    @property
    def path(self) -> str:
        """The file as it was named when read."""
        return self._path

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes."""
        return self._sha256


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Read and validate a scene. Raises FileError, or RobotFileError with the line."""
    name = os.fspath(path)
    try:
        with open(name, "rb") as file:
            raw = file.read(_KIND.size + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"{name}: cannot read the scene: {reason}", file=name) from None
    return parse_scene(raw, name)


def parse_scene(raw: bytes | str, name: str = "scene.yaml") -> Scene:
    """Validate the text of a scene; `name` is what messages call it."""
    encoded = raw.encode() if isinstance(raw, str) else raw
    try:
        document = strict_yaml.load_yaml(encoded, _KIND)
    except strict_yaml.StrictYamlError as error:
        _refuse(name, [(error.line, error.problem)])
    try:
        scene = Scene.model_validate(document.data)
    except ValidationError as error:
        problems = []
        for path, text in robot_key_errors.problems(error.errors(include_url=False)):
            if text.startswith("unknown key") and len(path) == 1:
                text = "unknown key; a scene has clearance and keep_out"
            problems.append((path, text))
        _refuse(name, _with_lines(document, problems))
    scene._document, scene._path, scene._sha256 = document, name, hashlib.sha256(encoded).hexdigest()
    if scene_problems := list(entries.keep_out_problems(scene.keep_out)):
        _refuse(name, _with_lines(document, scene_problems))
    return scene


def check_names_beside(robot: RobotFile, scene: Scene) -> None:
    """Raise RobotFileError, with the scene's line, for names that the robot's bodies or keep-outs have already."""
    bodies = ["base", *(joint.name for joint in robot.joints)]
    if problems := list(entries.keep_out_problems(scene.keep_out, bodies, robot.keep_out)):
        _refuse(scene.path, _with_lines(scene._document, problems))


def _with_lines(
    document: strict_yaml.Document, problems: Iterable[tuple[strict_yaml.Path, str]]
) -> list[tuple[int, str]]:
    """Problems as their lines and texts, which begin with the place."""
    return [(document.line(path), f"{_place_text(path)}{text}") for path, text in problems]


def _place_text(path: strict_yaml.Path) -> str:
    """The place in words: ``keep_out 2: box.min: ``."""
    if not path:
        return ""
    key, inner_path = path[0], path[1:]
    if inner_path and isinstance(inner_path[0], int):
        key, inner_path = f"{key} {inner_path[0] + 1}", inner_path[1:]
    inner = ".".join(strict_yaml.one_line(str(part)) for part in inner_path if not isinstance(part, int))
    return f"{strict_yaml.one_line(str(key))}: " + (f"{inner}: " if inner else "")


def _refuse(name: str, problems: list[tuple[int, str]]) -> NoReturn:
    """Raise the RobotFileError that lists problems, by their lines (0: of the whole file)."""
    problems = sorted(problems, key=itemgetter(0))
    lines = [f"{name}:{line}: {text}" if line else f"{name}: {text}" for line, text in problems]
    more = f"\nand {len(lines) - _MAX_PROBLEMS} more problems" if len(lines) > _MAX_PROBLEMS else ""
    raise RobotFileError(
        "\n".join(lines[:_MAX_PROBLEMS]) + more, file=name, line=problems[0][0] or None, problems=lines
    )
