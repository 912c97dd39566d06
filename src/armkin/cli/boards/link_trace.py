"""`--trace`, of every command that talks to a board: what the logger `armkin.board` says, on stderr.

`send` has had another `--trace` for long, a plan as CSV: there it is `--log`, which the others take, too.
"""

import sys
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any, get_type_hints

import typer

_TEXT = "Write what is said on the port, and what the board does, to stderr: the logger armkin.board."
Log = Annotated[bool, typer.Option("--log", help=_TEXT)]
Trace = Annotated[bool, typer.Option("--trace", "--log", help=_TEXT)]


def add_trace_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command's function, with the option where it opens ports."""
    if "no_reset" not in signature(command).parameters:
        return command
    hints = get_type_hints(command, include_extras=True)
    command_signature = signature(command)
    resolved_signature = command_signature.replace(
        parameters=[option.replace(annotation=hints[name]) for name, option in command_signature.parameters.items()]
    )

    @wraps(command)
    def run(*words: Any, log: bool = False, **options: Any) -> Any:
        if not log:
            return command(*words, **options)
        with BoardLog():
            return command(*words, **options)

    option = Log if "trace" in resolved_signature.parameters else Trace
    log_parameter = Parameter("log", Parameter.KEYWORD_ONLY, default=False, annotation=option)
    run.__annotations__ = {**hints, "log": option}
    run.__signature__ = resolved_signature.replace(parameters=[*resolved_signature.parameters.values(), log_parameter])  # type: ignore[attr-defined]
    return run


class BoardLog:
    """The logger `armkin.board` on stderr, all of it, within a block."""

    def __enter__(self) -> None:
        import logging

        self._log = logging.getLogger("armkin.board")
        self._before = self._log.level
        self._handler = logging.StreamHandler(sys.stderr)
        form = "%(asctime)s.%(msecs)03d %(levelname)s %(message)s"
        self._handler.setFormatter(logging.Formatter(form, "%H:%M:%S"))
        self._log.addHandler(self._handler)
        self._log.setLevel(logging.DEBUG)

    def __exit__(self, *error: object) -> None:
        self._log.removeHandler(self._handler)
        self._log.setLevel(self._before)
