"""From words to what the API takes: the arm, joint values, one pose or a batch of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armkin.cli.numbers import listed, numbers
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def load(robot: str) -> Arm:
    """The arm of a robot file."""
    from armkin.model.build import load

    if not robot:
        raise UsageError("the robot file's name is empty; name a file, for example robots/three_dof.yaml")
    return load(robot)


def joints(arm: Arm, words: Sequence[str] | None) -> list[float]:
    """One value for each joint [deg | mm]."""
    return numbers(words or (), arm.joint_names, arm.name)


def joint_list(arm: Arm, text: str, option: str) -> list[float]:
    """One value for each joint [deg | mm], comma-separated."""
    return listed(text, arm.joint_names, option)


def target(task: Task, words: Sequence[str] | None) -> list[float]:
    """One value for each of the target's numbers [mm, deg]."""
    return numbers(words or (), task.labels, f"task {task.name}")


def no_numbers(words: Sequence[str] | None) -> None:
    """A batch takes its numbers from the file alone."""
    if words:
        raise UsageError(f"numbers on the command line ({' '.join(words)}) and --batch: give one of the two")
