"""The next step after an error, as options and commands.

Errors of the core advise what a program can do. This module replaces that by advice for a user at a terminal.
"""

import os
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

from armkin.errors import (
    ArmkinError,
    GripperKnownError,
    GripperLostError,
    HeldError,
    HomingIncompleteError,
    NoBranchError,
    NoHomingError,
    NothingHeldError,
    PortInUseError,
    PositionKnownError,
    PositionLostError,
    RedundantArmError,
    UnfinishedError,
    UsageError,
)
from armkin.robot_file.catalogue import shipped_file

HOLD_JOINTS = "ik --lock and Python's armkin.lock hold joints"  # what is advised in place of --lock


class CommandLine(NamedTuple):
    """The command line that has failed: an option is advised to commands that have it, and to those alone."""

    words: Sequence[str]  # without the program's name
    options: Collection[str]  # those of its command

    def takes(self, option: str) -> bool:
        """Whether the option may be added."""
        if option in _NOT_OF_A_PATH and self.words[:1] == ["send"]:
            return not any(word.split("=")[0] == "--path" for word in self.words)
        return option in self.options


def next_step(error: ArmkinError, line: CommandLine) -> str:
    """The options or the command to type next; empty if the message is enough.

    >>> error = PortInUseError("in use", advice="wait for it", port="COM3", process=7)
    >>> next_step(error, CommandLine(["status", "three_dof"], ["--port"]))
    'wait for it, or armkin stop --port COM3'
    """
    for kind, words in _WORDS.items():
        if isinstance(error, kind):
            return words(error, line)
    return error.advice


def message_with_advice(error: ArmkinError, line: CommandLine) -> str:
    """An error's message with its next step."""
    step = next_step(error, line)
    if not step:
        return error.message
    lines = error.message.count("\n") + 1
    if error.fields.get("lines_to_add"):  # a shipped robot needs a copy first, and `info` shows the lines
        return f"{error.message.partition('; add to ')[0]}\n{step}"
    return f"{error.message}{': ' if lines > 1 or isinstance(error, _ONE_LINE) else chr(10)}{step}"


def _redundant_advice(error: ArmkinError, line: CommandLine) -> str:
    if not line.takes("--lock"):
        return HOLD_JOINTS
    joints = ", ".join(error.fields["joints"])
    fix = f"fix {error.fields['surplus']} of {joints} with --lock JOINT=VALUE"
    return f"{fix}, or try values with --sweep JOINT=LOW:HIGH:COUNT" if line.takes("--sweep") else fix


def _missing_keys_advice(error: ArmkinError, line: CommandLine) -> str:
    """The command that shows the lines to add, in a copy of the file for a shipped robot."""
    if (need := error.fields.get("needs", "")) in _NEEDED:
        option, with_option, without = _NEEDED[need]
        return with_option if line.takes(option) else without
    if error.fields.get("undriven"):
        return "armkin info ROBOT shows lines to add"
    name = error.fields.get("robot_file")
    if not error.fields.get("lines_to_add") or not name or shipped_file(name) is None or os.path.isfile(name):
        return error.advice
    copy = f"armkin info {name} shows lines to add, to a copy: armkin export {name} --dh -o my_{name}.yaml"
    return f"{copy}\nor rehearse with --accel 60, for example" if error.fields.get("option") == "--accel" else copy


def _lost_advice(error: ArmkinError, line: CommandLine) -> str:
    """How the position is known again; a command without --assume leaves that to `send`."""
    robot, port, homing = (error.fields[name] for name in ("robot_file", "port", "homing"))
    home = f"armkin home {robot} --port {port}"
    if not line.takes("--assume"):
        by_hand = f"put the arm in its home pose, then armkin send {robot} home --port {port} --assume-home"
        return f"{home}, or {by_hand}" if homing else by_hand
    assume = "add --assume-home (the arm stands in its home pose; --assume Q,...: there)"
    return f"{home}, or {assume}" if homing else f"put the arm in its home pose and {assume}"


_NOT_OF_A_PATH = ("--blend", "--lock", "--task")  # options of `send` that --path refuses
_NEEDED = {  # the option, what is advised to a command that has it, and to the others
    "blend": (
        "--blend",
        "--blend 5 alone gives one, or blend: 5 at the head of the path file",
        "blend: 5 at the head of the path file gives one",
    ),
    "task": (
        "--task",
        "--task pose asks for whole poses, some of which it reaches; so does task: pose in the robot file",
        "task: pose in the robot file asks for whole poses, some of which it reaches",
    ),
    "task pose": ("--task", "add --task pose", "write task: pose in the robot file"),
    "other joint": (
        "--lock",
        "write two paths, or hold another joint with --lock JOINT=VALUE",
        "write two paths, or hold another joint with armkin path --lock JOINT=VALUE",
    ),
}
_ONE_LINE = (RedundantArmError, PortInUseError, NoHomingError, UnfinishedError)
_WORDS: dict[type[ArmkinError], Callable[[ArmkinError, CommandLine], str]] = {
    RedundantArmError: _redundant_advice,
    NoBranchError: lambda error, line: (
        "" if "--all-branches" in line.words else "ik --all-branches lists all branches, also those outside limits"
    ),
    NoHomingError: lambda error, line: (
        "add --rest-at-home if these joints stand in their home pose"
        if error.fields.get("some")
        else "without limit switches put the arm in its home pose, and give --assume-home to the next send"
    ),
    HomingIncompleteError: lambda error, line: (
        f"armkin home {error.fields['robot_file']} {' '.join(error.fields['joints'])}"
        if error.fields["homing"]
        else f"armkin home {error.fields['robot_file']} --rest-at-home, with these joints in their home pose"
    ),
    PortInUseError: lambda error, line: f"wait for it, or armkin stop --port {error.fields['port']}",
    PositionLostError: _lost_advice,
    HeldError: lambda error, line: (
        "the same command with --resume goes on, any other starts there"
        if error.fields.get("resumable")
        else "the next command starts there"
    ),
    NothingHeldError: lambda error, line: "give the same arguments again, or leave --resume out",
    PositionKnownError: lambda error, line: "leave --assume-home (--assume) out",
    GripperLostError: lambda error, line: (
        "armkin grip ROBOT open --assume open (or closed, or a value) says where it stands"
    ),
    GripperKnownError: lambda error, line: "leave --assume out",
    UnfinishedError: lambda error, line: (
        f"the same command{' with --resume' * line.takes('--resume')} goes on; "
        "without these parts another one may begin"
    ),
    UsageError: _missing_keys_advice,  # last, as it is a base class of NoHomingError and others
}
