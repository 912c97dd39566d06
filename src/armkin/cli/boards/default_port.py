"""The port that a command speaks to: `--port`, else ARMKIN_PORT, else the only board that answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.parsing import completion
from armkin.cli.printing import output
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.board.backend.board import Board


def port_option(help_text: str) -> Any:
    """`--port`, for commands that take another help than `PortName`'s."""
    return typer.Option(
        "--port",
        "-p",
        metavar="PORT",
        envvar="ARMKIN_PORT",
        show_envvar=False,
        autocompletion=completion.ports,
        help=help_text,
    )


PortName = Annotated[
    str | None,
    port_option(
        "Device, COM port, pyserial URL, or sim: a board in this process. "
        "[default: ARMKIN_PORT, else the only board that answers]"
    ),
]


def port_name(port: str | None, board: Board, baud: int | None, *, reset: bool = True) -> str:
    """The port given (or ARMKIN_PORT), else the only one where a board of the robot file's kind answers.

    It is asked for its status or numbers: nothing moves.
    """
    if port is not None:
        return port
    from armkin.board.stop_signals import stoppable

    with stoppable() as stop:
        answering_ports = [name for name in board.likely() if board.answers(name, baud, stop, reset=reset)]
    return only_port(answering_ports, board.called, board.hint)


def only_port(ports: Sequence[str], called: str, hint: str = "armkin ports lists them", *, asked: bool = True) -> str:
    """The one port that was found. Raises UsageError if there are none or several.

    asked: whether a board answered there; else a port's adapter looks like one, and sim is none.
    """
    verb, plural = ("answers", "boards answer") if asked else ("is plugged in", "ports look like one")
    if len(ports) == 1:
        output.note(f"using {ports[0]}, the only port where {called} {verb}")
        return ports[0]
    count_text = f"{len(ports)} {plural} ({', '.join(ports)})" if ports else f"no port where {called} {verb} was found"
    sim = "; sim is a board in this process" if asked else ""
    raise UsageError(
        f"--port is missing, and {count_text}\n{hint}, ARMKIN_PORT names one for every command{sim}",
    )
