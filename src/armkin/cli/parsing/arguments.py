"""Converts words of the command line to arguments of the API: arm, joint values, targets."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import TYPE_CHECKING

from armkin import files
from armkin.cli.parsing import unit_notes
from armkin.cli.parsing.number_parsing import NOT_FINITE, comma_separated, is_number, number, numbers, place_numbers
from armkin.cli.printing import output
from armkin.errors import FileError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def load_arm(robot: str, scene: str | None = None, tool: str | None = None) -> Arm:
    """The arm of a robot file, or of a shipped robot, in its scene; tool: the value of `--tool`."""
    from armkin.keep_out.load_with_scene import load
    from armkin.robot_file.catalogue import locate

    if not robot:
        raise UsageError("the robot file's name is empty; name a file, for example robots/three_dof.yaml")
    if is_number(robot) and not os.path.exists(robot):
        raise UsageError(f"ROBOT comes first, then the numbers: '{robot}' is no robot file")
    files.protect_input(locate(robot))
    if scene is not None:
        files.protect_input(scene)
    arm = load(robot, scene, tool=None if tool is None else _tool_numbers(tool))
    unit_notes.robot_file(arm)
    return arm


def _tool_numbers(tool: str) -> list[float]:
    """`--tool X,Y,Z[,R,P,Y]` as six numbers [mm, deg]."""
    return [*place_numbers(tool, "--tool"), 0.0, 0.0, 0.0][:6]


def percent(text: str, option: str) -> float:
    """A share of the joints' limits from percent: 0.0001 to 1; a note warns of a value below 1, perhaps a share."""
    value = number(text, option)
    if not 0.01 <= value <= 100:
        raise UsageError(f"{option}: '{text}' must be from 0.01 to 100 percent", argument=option, least=0.01, most=100)
    if value < 1:
        output.note(f"{option} {text}: {value:g} percent; half is {option} 50")
    return value / 100


def standard_input(max_bytes: int, advice: str = "") -> bytes:
    """All of standard input, at most `max_bytes`; advice: for a longer one.

    Raises FileError if it is closed or cannot be read, UsageError if it is longer.
    """
    if sys.stdin is None:
        raise FileError("standard input is closed")
    files.protect_input(0)
    try:
        content = sys.stdin.buffer.read(max_bytes + 1)
    except (OSError, ValueError) as error:
        raise FileError(f"standard input: cannot read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > max_bytes:
        size_text = f"{max_bytes // 1_000_000} MB" if max_bytes >= 1_000_000 else f"{max_bytes // 1000} kB"
        raise UsageError(f"more than {size_text} on standard input{advice}")
    return content


def required_robot(robot: str | None) -> str:
    """The robot's name, which must be given."""
    if robot is None:
        raise UsageError("missing argument 'ROBOT': a robot file or the name of a shipped robot (armkin robots)")
    return robot


def joints(arm: Arm, words: Sequence[str] | None) -> list[float]:
    """One value for each joint [deg | mm], or the name of a pose."""
    if words is not None and len(words) == 1 and (pose := _named_pose(arm, words[0], "")) is not None:
        return pose
    values = numbers(words or (), arm.joint_names, arm.name)
    unit_notes.joint_values(arm, values)
    return values


def joint_list(arm: Arm, text: str, option: str) -> list[float]:
    """One value for each joint [deg | mm], comma-separated, or the name of a pose."""
    pose = _named_pose(arm, text, f"{option}: ")
    if pose is not None:
        return pose
    values = comma_separated(text, arm.joint_names, option)
    unit_notes.joint_values(arm, values, f"{option}'s numbers")
    return values


def _named_pose(arm: Arm, word: str, context: str) -> list[float] | None:
    """The joint values of a named pose [deg | mm]; None for a word that is no name."""
    poses = units.poses_out(arm)
    if word in poses:
        return poses[word]
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]*", word) or word.lower() in (*NOT_FINITE, "pi"):
        return None
    matches = get_close_matches(word, poses, 1)
    hint = f"did you mean {matches[0]}?" if matches else f"its poses: {', '.join(poses)}"
    example = " ".join(arm.joint_names)
    raise UsageError(f"{context}{arm.name} has no pose '{word}'; {hint} (or give joint values: {example})")


def target(arm: Arm, task: Task, words: Sequence[str] | None) -> list[float]:
    """The target's numbers [mm, deg], one word each."""
    try:
        values = numbers(words or (), task.labels, f"task {task.name}")
    except UsageError as error:
        if "got" in error.fields:
            error.message += _other_task(arm, task, error.fields["got"])
        raise
    unit_notes.note_target(arm, task.labels, values)
    return values


_MEANING = {"phi": "phi is the tool's pitch, the sum of the parallel joints' angles"}


def _other_task(arm: Arm, task: Task, count: int) -> str:
    """Hints: the meaning of a label that is no coordinate, and a task with as many numbers as were given."""
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.inverse.tasks.task import LABELS

    hints = [words for label, words in _MEANING.items() if label in task.labels]
    for name, labels in LABELS.items():
        if len(labels) == count and name != task.name:
            with suppress(UsageError):
                hints.append(f"--task {task_for(arm, name).name} takes {' '.join(labels)}")
                break
    return "".join(f"; {words}" for words in hints)


def target_list(arm: Arm, task: Task, text: str, words: Sequence[str] | None = None) -> list[float]:
    """The numbers of `--target X,Y,Z` [mm, deg]; words: words that stand behind the option, numbers for its target."""
    if words and is_number(text) and all(map(is_number, words)):
        example = ",".join([text, *words])
        raise UsageError(f"--target: separate the numbers with commas: --target {example}")
    values = comma_separated(text, task.labels, f"--target (task {task.name})")
    unit_notes.note_target(arm, task.labels, values)
    return values


def check_commas(arm: Arm, task: str | None, text: str, words: Sequence[str]) -> None:
    """Raise UsageError for `--target 390 80 300`, where a target's numbers stand behind it as words of their own."""
    from armkin.inverse.tasks.choose_task import task_for

    target_list(arm, task_for(arm, task), text, words)


def one_alone(workers: int, cluster: str | None, resume: bool) -> None:
    """Raise UsageError for options of batches beside a single row."""
    for option, is_given in (("--workers", workers > 1), ("--cluster", cluster is not None), ("--resume", resume)):
        if is_given:
            raise UsageError(f"{option} belongs to --batch: one row is not shared")


def no_numbers(words: Sequence[str] | None) -> None:
    """Raise UsageError for numbers beside --batch."""
    if words:
        raise UsageError(f"numbers on the command line ({' '.join(words)}) and --batch: give one of the two")
