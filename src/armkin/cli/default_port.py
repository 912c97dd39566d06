"""The port that a command speaks to: `--port`, else ARMKIN_PORT, else the only board that answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli import completion, output
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board.kinds import Foreign

PortName = Annotated[
    str | None,
    typer.Option(
        "--port",
        "-p",
        metavar="PORT",
        envvar="ARMKIN_PORT",
        show_envvar=False,
        autocompletion=completion.ports,
        help="Device, COM port, pyserial URL, or sim: a board in this process. "
        "[default: ARMKIN_PORT, else the only board that answers]",
    ),
]


def port_name(given: str | None, configuration: Configuration | None, baud: int, *, reset: bool = True) -> str:
    """The port given (or ARMKIN_PORT), else the only one where a board answers as the robot file's kind."""
    if given is not None:
        return given
    from armkin.board.firmware.find_boards import answering
    from armkin.board.stopping import stoppable

    kind = (
        "a board"
        if configuration is None
        else f"{'an' if configuration.board.kind[0] in 'aeiou' else 'a'} {configuration.board.kind}"
    )
    with stoppable() as stop:
        found = answering(None if configuration is None else configuration.board.number, baud, stop, reset=reset)
    return _only(found, kind)


def _only(found: Sequence[str], kind: str) -> str:
    """The one port that was found. Raises UsageError if there are none or several."""
    if len(found) == 1:
        output.note(f"using {found[0]}, the only port where {kind} answers")
        return found[0]
    where = f"{len(found)} boards answer ({', '.join(found)})" if found else f"no port where {kind} answers was found"
    lists = "it is a socket, as klippy.py -a names it" if "klipper" in kind else "armkin ports lists them"
    raise UsageError(
        f"--port is missing, and {where}\n"
        f"{lists}, ARMKIN_PORT names one for every command; sim is a board in this process"
    )


def foreign_port(given: str | None, board: Foreign, baud: int | None, *, reset: bool = True) -> str:
    """The port given (or ARMKIN_PORT), else the only one where a board of the robot file's kind answers.

    GRBL and Klipper are asked for their status, a bus for its servos' numbers: nothing moves.
    """
    if given is not None:
        return given
    from armkin.board.stopping import stoppable

    with stoppable() as stop:
        found = [name for name in board.likely() if board.answers(name, baud, stop, reset=reset)]
    return _only(found, f"a {board.board.kind} board")
