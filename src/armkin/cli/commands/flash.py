"""`armkin flash`."""

from typing import Annotated

import typer

from armkin.cli.boards.board_link import SIM
from armkin.cli.boards.default_port import only_port, port_option
from armkin.cli.parsing import arguments, completion
from armkin.cli.parsing.options import Json
from armkin.cli.printing import output, render
from armkin.errors import UsageError


def flash(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT]",
            help="Robot file, or the name of a shipped robot: it says the board's kind.",
            autocompletion=completion.robots,
        ),
    ] = None,
    board: Annotated[
        str | None,
        typer.Option("--board", metavar="KIND", help="uno_cnc_shield, mega_ramps14, uno_servos or pico6."),
    ] = None,
    port: Annotated[
        str | None,
        port_option(
            "Device or COM port; a Pico: also its boot drive's folder. [default: ARMKIN_PORT, else the only one]"
        ),
    ] = None,
    json: Json = False,
) -> None:
    """armkin's firmware onto a board.

    The image is in the installed package; nothing is compiled. A Pico without armkin: hold BOOTSEL while you plug it
    in, and name the folder of the drive that appears. At the end the board is asked what it is. The board restarts:
    motors are off, and the arm's position is lost.
    """
    from armkin.flash import image, upload

    if port == SIM:
        raise UsageError("flash needs a real board: sim, a board in this process, has its firmware")
    kind = _board_kind(robot, board)
    program = image(kind)
    port = port or _only_port(kind)
    with output.progress("bytes out and back") as tick:
        flash_result = upload(program, port, tick)
    answer: dict[str, object] = {"board": kind, **flash_result._asdict()}
    with output.destination(None) as write:
        write(render.to_json(answer) + "\n" if json else _text(answer))


def _text(answer: dict[str, object]) -> str:
    if answer["port"] is None:
        return f"{answer['board']}: {answer['bytes']} bytes copied; armkin ports shows the Pico when it has restarted\n"
    return f"{answer['board']} on {answer['port']}: firmware {answer['firmware']}, {answer['bytes']} bytes\n"


def _board_kind(robot: str | None, board: str | None) -> str:
    """The kind of board, by the robot file or by --board; UsageError where they differ or it is unknown."""
    from armkin.board_catalogue import BOARDS

    kind = board
    if robot is not None:
        arm = arguments.load_arm(robot)
        arm_board = arm.board.kind if arm.board is not None else None
        if board is not None and arm_board is not None and arm_board != board:
            raise UsageError(f"{arm.name}'s board is {arm_board}, and --board says {board}: leave one of them out")
        kind = board or arm_board
        if kind is None:
            raise UsageError(f"{arm.name} names no board: add --board, one of {', '.join(BOARDS)}")
    if kind is None:
        raise UsageError(f"which board? Name a robot file with board:, or --board, one of {', '.join(BOARDS)}")
    if kind not in BOARDS:
        raise UsageError(f"armkin has no firmware for '{kind}': it has for {', '.join(BOARDS)}")
    return kind


def _only_port(kind: str) -> str:
    """The only port that looks like an Arduino or a Pico: what is not flashed cannot be asked."""
    from armkin.board.ports import list_ports

    candidates = [port.device for port in list_ports() if port.board]
    hint = "armkin ports lists them, a Pico's may be the folder of its boot drive"
    return only_port(candidates, f"a board for {kind}", hint, asked=False)
