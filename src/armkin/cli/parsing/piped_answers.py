"""Answers of `fk`, `ik` and `pulses` on standard input, as `armkin send` takes them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from armkin.cli.parsing import arguments
from armkin.cli.printing import output
from armkin.errors import FileError, NoSolutionError, UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_MAX_BYTES = 32_000_000  # size [bytes], at most, of standard input: some 50,000 answers
_TOOL = ("xyz", "rpy")
_NO_JSON = "standard input is no JSON: give --json to the command before the pipe"


@dataclass(frozen=True)
class PipedPoses:
    """Poses for one robot file."""

    robot_file: str
    robot_sha256: str
    poses: list[Pose]
    scene: str | None = None
    scene_sha256: str | None = None
    tool: list[float] | None = None  # x, y, z, roll, pitch, yaw [mm, deg]


@dataclass(frozen=True)
class Pose:
    """A pose in the terms of the answer: joint values [deg | mm], or pulses if it had them."""

    joints: list[float]
    pulses: list[int] | None


def read_poses(robot: str | None) -> PipedPoses:
    """What a command before the pipe has printed: one JSON object, or one a line.

    robot: a robot file given as well, which must be the same. Raises UsageError if there is nothing to send,
    NoSolutionError for an answer of ik without a best branch.
    """
    if sys.stdin is None or sys.stdin.isatty():
        raise UsageError(
            "nothing to send: give joint values, --target X,Y,Z or --batch FILE,\n"
            "or pipe an answer in: armkin ik ROBOT 390 80 300 --json | armkin send --port PORT"
        )
    text = _stdin_text()
    if not text.strip():
        raise UsageError("nothing to send: standard input is empty (did the command before the pipe fail?)")
    answers = [_parse_answer(part) for part in _json_parts(text)]
    first = answers[0]
    _check_alike(answers, "robot files", "robot_file", "robot_sha256")
    if robot is not None and robot != first["robot_file"]:
        raise UsageError(f"{robot} is not {first['robot_file']}, the robot file of the answer on standard input")
    _check_alike(answers, "scenes", "scene", "scene_sha256")
    _check_alike(answers, "tools", "tool")
    poses = [_answer_pose(answer) for answer in answers]
    scene = first.get("scene"), first.get("scene_sha256")
    return PipedPoses(first["robot_file"], first["robot_sha256"], poses, *scene, _tool_numbers(first.get("tool")))


def _check_alike(answers: Sequence[dict[str, Any]], difference: str, *keys: str) -> None:
    if any(answer.get(key) != answers[0].get(key) for answer in answers for key in keys):
        raise UsageError(f"the answers on standard input are of different {difference}: send one at a time")


def _tool_numbers(tool: Any) -> list[float] | None:
    """An answer's tool as six numbers [mm, deg]."""
    if tool is None:
        return None
    if not (isinstance(tool, dict) and all(isinstance(tool.get(key), list) for key in _TOOL)):
        raise UsageError("the answer on standard input is damaged: its tool is no xyz and rpy")
    return [number for key in _TOOL for number in _checked_numbers(tool[key])]


def arm_and_poses(
    robot: str | None, words: Sequence[str] | None, scene: str | None = None, tool: str | None = None
) -> tuple[Arm, list[list[float]]]:
    """The arm and joint values [deg | mm]: the command line's, or those of an answer on standard input."""
    if not words and (arm_and_joints := joint_values(robot, scene, tool)) is not None:
        return arm_and_joints
    arm = arguments.load_arm(arguments.required_robot(robot), scene, tool)
    return arm, [arguments.joints(arm, words)]


def joint_values(
    robot: str | None, scene: str | None = None, tool: str | None = None
) -> tuple[Arm, list[list[float]]] | None:
    """The arm and joint values [deg | mm] of what `fk`, `ik` or `pulses` with --json has printed.

    robot: a robot given as well, which must be the same. None if there is a robot and nothing on standard
    input. Answers of ik without a branch within limits are skipped, with a warning.
    """
    arm_and_answers = answers(robot, scene, tool)
    if arm_and_answers is None:
        return None
    arm, answer_list = arm_and_answers
    return arm, joints_of(arm, answer_list)


def joints_of(arm: Arm, answer_list: Sequence[dict[str, Any]]) -> list[list[float]]:
    """Joint values [deg | mm] of answers; those without a branch within limits are skipped, with a warning."""
    values = [_answer_joints(answer, arm) for answer in answer_list if not _is_unsolved(answer)]
    if len(values) < len(answer_list):
        count_text = f"{len(answer_list) - len(values)} of {len(answer_list)} answers have no branch within limits"
        if not values:
            raise NoSolutionError(f"{count_text}: there are no joint values on standard input")
        output.warn(f"{count_text}: skipped")
    return values


def answers(
    robot: str | None, scene: str | None = None, tool: str | None = None
) -> tuple[Arm, list[dict[str, Any]]] | None:
    """The arm, and the answers on standard input as data; None if there is a robot and nothing on standard input."""
    text = _stdin_text()
    if not text.strip():
        arguments.required_robot(robot)
        return None
    try:
        answer_list = [_parse_answer(part) for part in _json_parts(text)]
    except UsageError:
        if robot is None or text.lstrip()[:1] == "{":
            raise
        raise UsageError("standard input is no JSON; for rows of CSV add --batch -") from None
    arm = arguments.load_arm(robot or answer_list[0]["robot_file"], scene, tool)
    for answer in answer_list:
        if answer["robot_sha256"] != arm.sha256:
            name = answer["robot_file"]
            if answer.get("robot", arm.name) != arm.name:
                raise FileError(
                    f"the answer on standard input is of {answer['robot']}, and the command is for {arm.name}"
                )
            raise FileError(f"the answer on standard input was computed with another {name}, or it has changed since")
    return arm, answer_list


def _stdin_text() -> str:
    """Standard input; nothing if that is a terminal."""
    if sys.stdin is None or sys.stdin.isatty():
        return ""
    try:
        return arguments.standard_input(_MAX_BYTES, ": give rows to --batch - instead").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(_NO_JSON) from None


def _is_unsolved(answer: dict[str, Any]) -> bool:
    return "branches" in answer and answer.get("best") is None


def _answer_joints(answer: dict[str, Any], arm: Arm) -> list[float]:
    values = _answer_pose(answer).joints
    if len(values) != arm.n:
        raise UsageError(f"the answer has {len(values)} joint values, {arm.name} has {arm.n} joints")
    return values


def _json_parts(text: str) -> list[str]:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines if all(line.startswith("{") and line.endswith("}") for line in lines) else [text]


def _parse_answer(text: str) -> dict[str, Any]:
    """The JSON object of an answer; UsageError if it names no robot file."""
    import json

    try:
        answer = json.loads(text)
    except (ValueError, RecursionError):
        raise UsageError(_NO_JSON) from None
    named = answer if isinstance(answer, dict) else {}
    for key in ("robot_file", "robot_sha256"):
        if not isinstance(named.get(key), str):
            raise UsageError(f"standard input is no answer of armkin fk, ik or pulses: it has no {key}")
    return named


def _answer_pose(answer: dict[str, Any]) -> Pose:
    """The pose of an answer: its best branch's joints, or its joints and pulses."""
    if "branches" in answer:
        best_index = answer.get("best")
        branches = answer["branches"]
        if best_index is None:
            raise NoSolutionError("the answer on standard input has no branch within limits: nothing was moved")
        if type(best_index) is not int or not isinstance(branches, list) or not 0 <= best_index < len(branches):
            raise UsageError("the answer on standard input is damaged: its best branch is not there")
        branch = branches[best_index]
        return Pose(_checked_numbers(branch.get("joints") if isinstance(branch, dict) else None), None)
    pulses = answer.get("pulses")
    if pulses is not None and not (isinstance(pulses, list) and all(type(pulse) is int for pulse in pulses)):
        raise UsageError("the answer on standard input is damaged: its pulses are not whole numbers")
    return Pose(_checked_numbers(answer.get("joints")), pulses)


def _checked_numbers(values: Any) -> list[float]:
    if not values:
        raise UsageError("the answer on standard input has no joints to send")
    if not isinstance(values, list) or not all(type(number) in (int, float) for number in values):
        raise UsageError("the answer on standard input is damaged: joint values and tool are lists of numbers")
    try:
        return [float(number) for number in values]
    except OverflowError:
        raise UsageError("joint values must be finite to be sent") from None
