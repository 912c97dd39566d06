"""Everything that armkin raises on purpose.

    ArmkinError
    ├── FileError          a file that cannot be read or written
    │   └── UnfinishedError     finished parts of a file wait for a run that goes on
    ├── RobotFileError     a robot file that is not valid
    ├── UsageError         an argument that does not fit the arm or the command
    │   ├── PathFileError  a path file that is not valid
    │   ├── RedundantArmError   more joints than the task has constraints
    │   ├── NoHomingError       joints without a limit switch
    │   └── NothingHeldError    there is no motion to go on with, or another one
    ├── NoSolutionError    no pose reaches the target, or none within the limits
    │   └── NoBranchError       branches reach the target, and none that may be taken
    ├── MissingExtraError  an optional package is not installed
    ├── ClusterError       the scheduler of a cluster, or its workers
    └── LinkError          the port, or the board behind it
        ├── HeldError           a motion was held on its way, and the position is known
        ├── PortInUseError      another armkin has the port
        ├── PositionLostError   nobody knows where the arm stands
        ├── HomingIncompleteError  some joints were homed, others are still lost
        ├── PositionKnownError  the arm stands elsewhere than somebody vouches for
        ├── GripperLostError    nobody knows where the gripper stands
        └── GripperKnownError   its position is known, so that nobody may vouch for another

A message says what is wrong, where and what is allowed, in one or two lines. It may name a command of armkin, as
`armkin ports`, and no option: only the command line names these (`armkin.cli.advice`) and has exit codes. `fields`
holds values for a program; a class below names those that it always has, and other errors have few or none.
"""

from __future__ import annotations

import re
from typing import Any, Self


class ArmkinError(Exception):
    """Base of all errors that armkin raises on purpose.

    Args:
        message: what is wrong, where and what is allowed.
        advice: the next step in Python; the command line has its own words for it.
        **fields: values of JSON in mm and degrees, as joint, value, lower, upper, file; see the classes.

    >>> error = NoSolutionError("q2 = 130 deg is outside -20 to 120 deg", joint="q2", value=130.0)
    >>> error.kind, error.fields
    ('no_solution', {'joint': 'q2', 'value': 130.0})
    """

    def __init__(self, message: str = "", *, advice: str = "", **fields: Any) -> None:
        super().__init__(f"{message}: {advice}" if advice else message)
        self.message = message
        self.advice = advice  # the next step in Python; the command line has its own words for it
        self.fields = fields

    @property
    def kind(self) -> str:
        """The class in one word, for programs in other languages: ``robot_file`` of RobotFileError."""
        return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(self).__name__.removesuffix("Error")).lower()

    def within(self, place: str, **fields: Any) -> Self:
        """This error, said of a place: ``row 3: ...``.

        Args:
            place: what the message begins with.
            **fields: more of them; they replace those of the same name.

        Returns:
            An error of the same class.
        """
        return type(self)(f"{place}: {self.message}", advice=self.advice, **{**self.fields, **fields})


class FileError(ArmkinError):
    """A file cannot be read or written."""


class UnfinishedError(FileError):
    """Finished parts of a file stand beside it, and a later run can go on with them; fields: file, parts (a folder)."""


class RobotFileError(ArmkinError):
    """A robot file is not valid; the message begins with ``file:line:`` where a line is known.

    The message tells the first problem and where the others are; `problems` holds one line for each.
    """

    @property
    def problems(self) -> tuple[str, ...]:
        """All problems of the file."""
        return tuple(self.fields.get("problems", ()))


class UsageError(ArmkinError, ValueError):
    """An argument does not fit the arm or the command."""


class RedundantArmError(UsageError):
    """An arm has joints beyond its task's constraints, or that move alike; fields: robot, joints, surplus."""


class NoHomingError(UsageError):
    """Joints have no limit switch to home by; fields: joints, file, some (whether others have one)."""


class PathFileError(UsageError):
    """A path file is not valid; the message begins with ``file:line:`` where a line is known."""


class NothingHeldError(UsageError):
    """There is no motion to go on with, or it is another one than is asked for."""


class NoSolutionError(ArmkinError):
    """No pose reaches the target, or none does so within the limits.

    Attributes:
        plan: of a path that is not carried the PathPlan as far as it is known, else None.
    """

    plan: Any = None

    def within(self, place: str, **fields: Any) -> Self:
        """This error with its plan, said of a place.

        Args:
            place: what the message begins with.
            **fields: more of them; they replace those of the same name.

        Returns:
            An error of the same class.
        """
        error = super().within(place, **fields)
        error.plan = self.plan
        return error


class NoBranchError(NoSolutionError):
    """Branches reach the target, and none within the limits, or none of the name asked for.

    fields: robot, status, branches_within_limits, and distance_mm or, if keep-outs block all branches, hits.
    """


class MissingExtraError(ArmkinError):
    """An optional package is needed and not installed."""


class ClusterError(ArmkinError):
    """The scheduler of a cluster cannot be reached, or its workers have another armkin or fail."""


class LinkError(ArmkinError):
    """The port, or the board behind it, does not answer as it must."""


class HeldError(LinkError):
    """The board has held a motion on its way, and knows where the arm stands; fields: joints (values)."""


class PortInUseError(LinkError):
    """Another armkin has the port; fields: port, process."""


class PositionLostError(LinkError):
    """Nobody knows where the arm stands; fields: robot_file, port, homing (whether it can home)."""


class HomingIncompleteError(LinkError):
    """Some joints were homed, others are still lost; fields: joints (the lost ones), homing, robot_file."""


class PositionKnownError(LinkError):
    """The arm's position is known, so that nobody may vouch for another; fields: joints (values)."""


class GripperLostError(LinkError):
    """Nobody knows where the gripper stands."""


class GripperKnownError(LinkError):
    """The gripper's position is known, so that nobody may vouch for another."""
