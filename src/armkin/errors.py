"""Everything that armkin raises on purpose.

    ArmkinError
    ├── FileError          a file that cannot be read or written
    ├── RobotFileError     a robot file that is not valid
    ├── UsageError         an argument that does not fit the arm or the command
    ├── NoSolutionError    no pose reaches the target, or none within the limits
    ├── MissingExtraError  an optional package is not installed
    └── LinkError          the port, or the board behind it

A message says what is wrong, where, what is allowed and what to do next, in one
or two lines. Only the command line maps these classes to exit codes.
"""


class ArmkinError(Exception):
    """Base of all errors that armkin raises on purpose."""


class FileError(ArmkinError):
    """A file cannot be read or written."""


class RobotFileError(ArmkinError):
    """A robot file is not valid; the message begins with ``file:line:`` where a line is known.

    The message tells the first problem and where the others are; `problems` holds one line for each.
    """

    problems: tuple[str, ...] = ()


class UsageError(ArmkinError, ValueError):
    """An argument does not fit the arm or the command."""


class NoSolutionError(ArmkinError):
    """No pose reaches the target, or none does so within the limits."""


class MissingExtraError(ArmkinError):
    """An optional package is needed and not installed."""


class LinkError(ArmkinError):
    """The port, or the board behind it, does not answer as it must."""
