"""The next step after an error, as options and commands.

Errors of the core advise what a program can do. This module replaces that by advice for a user at a terminal.
"""

import os
from collections.abc import Callable

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


def next_step(error: ArmkinError) -> str:
    """The options or the command to type next; empty if the message is enough.

    >>> next_step(PortInUseError("in use", advice="wait for it", port="COM3", process=7))
    'wait for it, or armkin stop --port COM3'
    """
    for kind, words in _WORDS.items():
        if isinstance(error, kind):
            return words(error)
    return error.advice


def message_with_advice(error: ArmkinError) -> str:
    """An error's message with its next step."""
    step = next_step(error)
    if not step:
        return error.message
    lines = error.message.count("\n") + 1
    if error.fields.get("lines_to_add"):  # a shipped robot needs a copy first, and `info` shows the lines
        return f"{error.message.partition('; add to ')[0]}\n{step}"
    return f"{error.message}{': ' if lines > 1 or isinstance(error, _ONE_LINE) else chr(10)}{step}"


def _redundant_advice(error: ArmkinError) -> str:
    joints = ", ".join(error.fields["joints"])
    fix = f"fix {error.fields['surplus']} of {joints} with --lock JOINT=VALUE"
    return f"{fix}, or try values with --sweep JOINT=LOW:HIGH:COUNT"


def _missing_keys_advice(error: ArmkinError) -> str:
    """The command that shows the lines to add, in a copy of the file for a shipped robot."""
    if (step := _NEEDED.get(error.fields.get("needs", ""))) is not None:
        return step
    if error.fields.get("undriven"):
        return "armkin info ROBOT shows lines to add"
    name = error.fields.get("robot_file")
    if not error.fields.get("lines_to_add") or not name or shipped_file(name) is None or os.path.isfile(name):
        return error.advice
    copy = f"armkin info {name} shows lines to add, to a copy: armkin export {name} --dh -o my_{name}.yaml"
    return f"{copy}\nor rehearse with --accel 60, for example" if error.fields.get("option") == "--accel" else copy


def _lost_advice(error: ArmkinError) -> str:
    home = f"armkin home {error.fields['robot_file']} --port {error.fields['port']}"
    assume = "add --assume-home (the arm stands in its home pose; --assume Q,...: there)"
    return f"{home}, or {assume}" if error.fields["homing"] else f"put the arm in its home pose and {assume}"


_NEEDED = {
    "blend": "--blend 5 alone gives one, or blend: 5 at the head of the path file",
    "task": "--task pose asks for whole poses, some of which it reaches; so does task: pose in the robot file",
    "task pose": "add --task pose",
    "other joint": "write two paths, or hold another joint with --lock JOINT=VALUE",
}
_ONE_LINE = (RedundantArmError, PortInUseError, NoHomingError, UnfinishedError)
_WORDS: dict[type[ArmkinError], Callable[[ArmkinError], str]] = {
    RedundantArmError: _redundant_advice,
    NoBranchError: lambda error: "ik --all-branches lists all branches, also those outside limits",
    NoHomingError: lambda error: (
        "add --rest-at-home if these joints stand in their home pose"
        if error.fields.get("some")
        else "without limit switches put the arm in its home pose, and give --assume-home to the next send"
    ),
    HomingIncompleteError: lambda error: (
        f"armkin home {error.fields['robot_file']} {' '.join(error.fields['joints'])}"
        if error.fields["homing"]
        else f"armkin home {error.fields['robot_file']} --rest-at-home, with these joints in their home pose"
    ),
    PortInUseError: lambda error: f"wait for it, or armkin stop --port {error.fields['port']}",
    PositionLostError: _lost_advice,
    HeldError: lambda error: (
        "the same command with --resume goes on, any other starts there"
        if error.fields.get("resumable")
        else "the next command starts there"
    ),
    NothingHeldError: lambda error: "give the same arguments again, or leave --resume out",
    PositionKnownError: lambda error: "leave --assume-home (--assume) out",
    GripperLostError: lambda error: "armkin grip ROBOT open --assume open (or closed, or a value) says where it stands",
    GripperKnownError: lambda error: "leave --assume out",
    UnfinishedError: lambda error: "the same command with --resume goes on; without these parts another one may begin",
    UsageError: _missing_keys_advice,  # last, as it is a base class of NoHomingError and others
}
