"""Scenes: keep-outs in a file of their own, which are added to those of a robot file."""

from __future__ import annotations

import hashlib
import os
from typing import NoReturn

from pydantic import Field, PrivateAttr, ValidationError

from armkin.errors import FileError, RobotFileError
from armkin.robot_file import keep_out_keys as entries
from armkin.robot_file import robot_key_errors, strict_yaml
from armkin.robot_file.key_types import Model
from armkin.robot_file.robot_keys import KeepOut, Size

_KIND = strict_yaml.Kind("scene", "keep_out", "keep_out: [self, floor: 0]", 1024 * 1024, 50_000)
_TOLD = 20  # problems that are told at once


class Scene(Model):
    """What stands around an arm. Frame and units are those of targets."""

    clearance: Size = Field(0.0, description="How far the arm keeps from every keep-out, in mm.")
    keep_out: KeepOut = Field(description="Where the arm must not go: self, floors, boxes, capsules.")

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


def read(path: str | os.PathLike[str]) -> Scene:
    """Read and validate a scene. Raises FileError, or RobotFileError with the line."""
    name = os.fspath(path)
    try:
        with open(name, "rb") as file:
            raw = file.read(_KIND.size + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"{name}: cannot read the scene: {reason}", file=name) from None
    return parse(raw, name)


def parse(raw: bytes | str, name: str = "scene.yaml") -> Scene:
    """Validate the text of a scene; `name` is what messages call it."""
    data = raw.encode() if isinstance(raw, str) else raw
    try:
        document = strict_yaml.loads(data, _KIND)
    except strict_yaml.StrictYamlError as error:
        _refuse(name, [(error.line, error.problem)])
    try:
        scene = Scene.model_validate(document.data)
    except ValidationError as error:
        told = []
        for path, text in robot_key_errors.problems(error.errors(include_url=False)):
            if text.startswith("unknown key") and len(path) == 1:
                text = "unknown key; a scene has clearance and keep_out"
            told.append((path, text))
        _refuse(name, [(document.line(path), f"{_place_text(path)}{text}") for path, text in told])
    scene._path, scene._sha256 = name, hashlib.sha256(data).hexdigest()
    if found := list(entries.problems(scene.keep_out)):
        _refuse(name, [(document.line(path), f"{_place_text(path)}{text}") for path, text in found])
    return scene


def _place_text(path: strict_yaml.Path) -> str:
    """The place in words: ``keep_out 2: box.min: ``."""
    if not path:
        return ""
    key, rest = path[0], path[1:]
    if rest and isinstance(rest[0], int):
        key, rest = f"{key} {rest[0] + 1}", rest[1:]
    inner = ".".join(strict_yaml.one_line(str(part)) for part in rest if not isinstance(part, int))
    return f"{strict_yaml.one_line(str(key))}: " + (f"{inner}: " if inner else "")


def _refuse(name: str, problems: list[tuple[int, str]]) -> NoReturn:
    problems.sort(key=lambda problem: problem[0])
    told = [f"{name}:{line}: {text}" if line else f"{name}: {text}" for line, text in problems]
    more = f"\nand {len(told) - _TOLD} more problems" if len(told) > _TOLD else ""
    raise RobotFileError("\n".join(told[:_TOLD]) + more, file=name, line=problems[0][0] or None, problems=told)
