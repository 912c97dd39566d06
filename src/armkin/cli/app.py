"""The group of commands, and the function that runs a command line; `exit_codes` handles its errors."""

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from keyword import iskeyword
from types import FrameType
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from armkin.cli.boards import link_trace
from armkin.cli.commands import COMMANDS
from armkin.cli.parsing.negative_numbers import options_first
from armkin.cli.printing import output
from armkin.signals import put_off

_INTERRUPT_CODE = 130  # exit code after Ctrl-C
_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


class Command(TyperCommand):
    """A command that takes negative numbers as arguments, and whose help has no names of Python types."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the options first, then the arguments."""
        options = [
            param for param in self.params if param.param_type_name == "option" and not getattr(param, "is_flag", False)
        ]
        takes_value = [name for option in options for name in option.opts]
        if ctx.resilient_parsing and args and args[-1] in takes_value:
            args = args[:-1]  # Tab was pressed for its value
        return super().parse_args(ctx, options_first(args, takes_value))

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """The usage line as the documents write it: ``ROBOT Q... [OPTIONS]``."""
        return [*(name for name, _ in self._arguments()), "[OPTIONS]"]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments and options, without Typer's names of Python types."""
        options = [param.get_help_record(ctx) for param in self.get_params(ctx) if param.param_type_name == "option"]
        for title, entries in (("Arguments", self._arguments()), ("Options", options)):
            if entries:
                with formatter.section(title):
                    formatter.write_dl(entries)

    def _arguments(self) -> list[tuple[str, str]]:
        """Names and help texts of the arguments."""
        arguments = [param for param in self.params if param.param_type_name == "argument"]
        return [(str(param.metavar or param.name), str(getattr(param, "help", None) or "")) for param in arguments]


class Commands(TyperGroup):
    """The group of all commands, which imports only the one that runs."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name, text in COMMANDS.items():
            self.add_command(TyperCommand(name, help=text, rich_markup_mode=None))

    def make_context(self, *args: Any, **settings: Any) -> Any:
        """Read the words before the command; --help and --version end here."""
        with _closed_pipes():
            return super().make_context(*args, **settings)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that the words name."""
        with _closed_pipes():
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str, Any, list[str]]:
        """The command that the first word names, in place of its entry in the list."""
        from armkin.cli import exit_codes

        name = args[0]
        if name not in COMMANDS and ctx.resilient_parsing:  # Tab was pressed: no command, no complaint
            return name, None, args[1:]
        if name not in COMMANDS:
            raise exit_codes.no_command(name, args[1:])
        return name, load_command(name), args[1:]


@cache
def load_command(name: str) -> Any:
    """Import a command's module and let Typer read its function; once in a process that runs many command lines."""
    word = f"{name}_" if iskeyword(name) else name  # Python has `import` for itself
    function = getattr(import_module(f"armkin.cli.commands.{word}"), word)
    typer_app = typer.Typer(add_completion=False, rich_markup_mode=None)
    typer_app.command(name, cls=Command, context_settings=_SETTINGS)(link_trace.add_trace_option(function))
    return typer.main.get_command(typer_app)


def option_names(words: Sequence[str]) -> list[str]:
    """The options of the command that a command line, without the program's name, begins with."""
    if not words or words[0] not in COMMANDS:
        return []
    return [name for parameter in load_command(words[0]).params for name in parameter.opts]


app = typer.Typer(cls=Commands, rich_markup_mode=None, context_settings=_SETTINGS, name="armkin")


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from armkin import __version__

        with output.destination(None) as write:
            write(f"armkin {__version__}\n")
        raise typer.Exit


@app.callback(no_args_is_help=False)
def armkin(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Robot arms from a YAML table to real motion. Millimetres and degrees throughout."""


@cache
def _command_group() -> Any:
    """The group with all its commands."""
    return typer.main.get_command(app)


def run(arguments: list[str]) -> int:
    """Run a command line, without the program's name, and return its exit code; no exception leaves here."""
    old_handlers = {number: signal.signal(number, _terminate) for number in _ending_signals()}
    if arguments[:1] in ([], ["help"]):  # armkin help fk
        arguments = [*arguments[1:2], "--help"]
    output.for_programs("--json" in arguments, [*arguments, os.environ.get("ARMKIN_PORT", "")])
    try:
        code = _exit_code(lambda: _command_group()(arguments, prog_name="armkin", standalone_mode=False), arguments)
        # The output of a failed command is kept, for example the rows of a batch before a malformed one.
        return _exit_code(_flush_output, arguments) or code
    finally:
        output.flush()
        for number, handler in old_handlers.items():
            signal.signal(number, handler)


def _exit_code(command: Callable[[], Any], words: list[str]) -> int:
    """Run a command and return its exit code, errors told on stderr; words: the command line."""
    try:
        return int(command() or 0)
    except (KeyboardInterrupt, typer.Abort):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # ignore a second Ctrl-C during clean-up
        return _INTERRUPT_CODE
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 1
    except Exception as error:
        from armkin.cli import exit_codes

        return exit_codes.exit_code(error, words, option_names)


def _flush_output() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def _ending_signals() -> list[int]:
    """The signals that end a command, except those that its parent ignores, as `nohup` does."""
    numbers = (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP"))
    return [number for number in numbers if number is not None and signal.getsignal(number) != signal.SIG_IGN]


def _terminate(signum: int, frame: FrameType | None) -> None:
    """SIGTERM and SIGHUP end the command as Ctrl-C does, through its ``finally``s, with their own exit codes."""
    if put_off(signum, frame):
        return
    for number in _ending_signals():
        signal.signal(number, signal.SIG_IGN)  # ignore repeated signals
    sys.exit(128 + signum)


@contextmanager
def _closed_pipes() -> Iterator[None]:
    """Turn a closed pipe into ClosedPipe, since Typer would end the process with exit code 1."""
    try:
        yield
    except OSError as error:
        from armkin.cli import exit_codes

        if exit_codes.is_closed_pipe(error):
            raise exit_codes.ClosedPipe from None
        raise
