"""The robot file whole: the keys of ``robot_keys``, held to the rules of ``cross_key_checks``."""

from collections.abc import Sequence
from typing import Self

from pydantic import PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from armkin.errors import UsageError
from armkin.robot_file import cross_key_checks
from armkin.robot_file.robot_keys import Pose, RobotKeys


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

    def with_tool(self, numbers: Sequence[float]) -> Self:
        """The file with another tool: x, y, z, roll, pitch, yaw [mm, deg]. Raises UsageError for what is none."""
        try:
            tool = Pose(xyz=tuple(numbers[:3]), rpy=tuple(numbers[3:]))  # type: ignore[arg-type]
        except ValidationError as error:
            raise UsageError(f"tool {list(numbers)}: {error.errors()[0]['msg']}", argument="tool") from None
        return self.model_copy(update={"tool": tool})

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if problems := list(cross_key_checks.problems(self)):
            raise PydanticCustomError("problems", "{text}", {"text": problems[0][1], "problems": problems})
        return self
