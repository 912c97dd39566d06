"""The robot file whole: the keys of ``model``, held to the rules of ``checks``."""

from typing import Self

from pydantic import PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from armkin.robot_file import checks
from armkin.robot_file.model import RobotKeys


class RobotFile(RobotKeys):
    """A robot arm: geometry, limits and drives. Millimetres and degrees throughout."""

    _path: str = PrivateAttr("")
    _sha256: str = PrivateAttr("")

    @property
    def path(self) -> str:
        """The file as it was named when read; empty for a model made in memory."""
        return self._path

    @property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes; empty for a model made in memory."""
        return self._sha256

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if problems := list(checks.problems(self)):
            raise PydanticCustomError("problems", "{text}", {"text": problems[0][1], "problems": problems})
        return self
