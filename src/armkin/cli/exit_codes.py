"""Where errors become messages and exit codes.

Imported before a command is: what has no memory, or no open files left, imports nothing. `armkin --help` needs none.
"""

import errno
import os
import sys
from collections.abc import Callable, Collection, Sequence
from difflib import get_close_matches
from typing import Any

from armkin import errors
from armkin.cli.commands import COMMANDS
from armkin.cli.printing import output

RUNTIME = 1  # exit codes; those of a batch: `cli.batches.batch_answers.Tally`
USAGE = 2
NO_SOLUTION = 3
ROBOT_FILE = 4
LINK = 5

EXIT_CODES: dict[type[errors.ArmkinError], int] = {
    errors.FileError: RUNTIME,
    errors.RobotFileError: ROBOT_FILE,
    errors.UsageError: USAGE,
    errors.NoSolutionError: NO_SOLUTION,  # no pose, or none within the limits: `inverse.choose_branch.refusal_error`
    errors.MissingExtraError: RUNTIME,
    errors.ClusterError: RUNTIME,
    errors.LinkError: LINK,
}


class ClosedPipe(Exception):  # noqa: N818 - no error
    """The reader of standard output has closed the pipe. (Typer would end the process with 1 for the OSError.)"""


def exit_code(
    error: BaseException, words: Sequence[str], option_names: Callable[[Sequence[str]], Collection[str]]
) -> int:
    """Say on stderr why the command fails; its exit code.

    words: the command line, without the program's name; option_names: gives the options of its command.
    """
    if isinstance(error, errors.ArmkinError):
        from armkin.cli import advice

        code = next(code for kind, code in EXIT_CODES.items() if isinstance(error, kind))
        line = advice.CommandLine(words, option_names(words))
        message, step = advice.message_with_advice(error, line), advice.next_step(error, line)
        output.error(message, error.kind, code, error.fields, step)
        return code
    if isinstance(error, ClosedPipe):
        return _closed_pipe()
    if isinstance(error, OSError):
        return _os_error(error)
    if isinstance(error, MemoryError):
        output.error("not enough memory; ask for less at once", "memory", RUNTIME)
        return RUNTIME
    return _unexpected_code(error)


def no_command(name: str, words: list[str]) -> errors.UsageError:
    """The error of a first word that is no command, before the words `words`."""
    return errors.UsageError(f"there is no command '{name}'; {_other_command(name, words)}")


def _other_command(name: str, words: list[str]) -> str:
    """What to type in place of a word that is no command."""
    if words and words[0] in COMMANDS:
        return f"the command comes first: armkin {words[0]} {name} ..."
    matches = get_close_matches(name.lower(), COMMANDS, 1)
    return f"did you mean {matches[0]}?" if matches else "armkin --help lists them"


def _os_error(error: OSError) -> int:
    """An error of the system that nobody foresaw; of those, stdout's are the usual ones."""
    if is_closed_pipe(error):
        return _closed_pipe()
    file_name = error.filename if error.filename is not None else "standard output"
    output.error(f"{file_name}: {error.strerror or error}", "system", RUNTIME, {"file": str(file_name)})
    _drop_stdout()
    return RUNTIME


def is_closed_pipe(error: OSError) -> bool:
    """Whether the reader of what is written has gone."""
    return error.errno == errno.EPIPE or (os.name == "nt" and error.errno == errno.EINVAL)


def _closed_pipe() -> int:
    """Exit code 0 where the reader has closed the pipe, as `| head` does."""
    _drop_stdout()
    return 0


def _drop_stdout() -> None:
    """Throw away what is still buffered: the interpreter would complain about it at its end."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _similar_options(error: Any, context: Any) -> list[str]:
    """Options that a mistyped one is near to, or begins: --all for --all-branches."""
    word = getattr(error, "option_name", None)
    if not isinstance(word, str) or context is None:
        return []
    option_names = [
        name
        for param in context.command.params
        for name in (*param.opts, *param.secondary_opts)
        if name.startswith("--")
    ]
    same_beginning = [name for name in option_names if len(word) > 3 and name.startswith(f"{word}-")]
    return list(getattr(error, "possibilities", None) or same_beginning)


def _unexpected_code(error: BaseException) -> int:
    """Typer's own complaints about the command line, and our bugs."""
    if hasattr(error, "format_message"):  # click's exceptions; Typer does not export their base
        from armkin.cli.parsing.number_parsing import is_number

        message = str(error.format_message()).rstrip(".")
        context = getattr(error, "ctx", None)
        if similar_options := _similar_options(error, context):
            message = f"{str(error).rstrip('.')}; did you mean {' or '.join(similar_options)}?"
        if message.endswith("'ROBOT'"):
            message += ": a robot file or the name of a shipped robot (armkin robots)"
        if context is not None:
            if "unexpected extra argument" in message and any(
                map(is_number, message.rstrip(")").split("(")[-1].split())
            ):
                message += "; an option's numbers have commas and no spaces, as 390,80,300"
            if "unexpected extra argument" in message and context.command.name == "stop":
                message = "stop takes no robot: it stops what moves behind a port, armkin stop --port PORT"
            message = f"{message}\nsee {context.command_path} --help"
        code = int(getattr(error, "exit_code", USAGE))
        output.error(message[:1].lower() + message[1:], "usage", code)
        return code
    if os.environ.get("ARMKIN_TRACEBACK"):
        import traceback

        traceback.print_exc()
    output.error(
        f"internal error: {type(error).__name__}: {error}\n"
        "this is a bug in armkin: please report it with the command line and ARMKIN_TRACEBACK=1's output",
        "internal",
        RUNTIME,
    )
    return RUNTIME
