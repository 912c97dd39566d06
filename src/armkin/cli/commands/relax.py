"""`armkin relax`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import number
from armkin.cli.parsing.options import Robot, RowsOut
from armkin.cli.printing import output
from armkin.columns.csv_cells import csv_line
from armkin.errors import UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend.board import Board
    from armkin.model.arm import Arm

_MAX_SECONDS = 3600.0  # time [s], at most, that the arm is relaxed and recorded
_ROW_RATE = 10  # rows a second


def relax(
    robot: Robot,
    port: PortName = None,
    seconds: Annotated[
        str, typer.Option("--seconds", metavar="S", help="How long the joints are read; Ctrl-C ends it earlier.")
    ] = "0",
    out: RowsOut = None,
    baud: Baud = None,
    no_reset: NoReset = False,
) -> None:
    """Switch bus servos off, to move the arm by hand and read it.

    Hold the arm: without its motors it falls. Prints joint values as CSV with a header, one row, or ten a second
    for --seconds; `armkin send ROBOT --batch FILE` plays them back.
    """
    arm = arguments.load_arm(robot)
    board = _with_servos(arm)
    time = number(seconds, "--seconds")
    if not 0 <= time <= _MAX_SECONDS:
        raise UsageError(f"--seconds: '{seconds}' must be from 0 to {_MAX_SECONDS:g}")
    with board_link.open_backend(board, port, baud, reset=not no_reset) as machine, output.destination(out) as write:
        board.relax()
        output.note("the motors are off; armkin send switches them on again, where the arm then stands")
        write(csv_line(arm.joint_names) + "\n")
        begin, rows = machine.port.now(), 0
        while rows <= _ROW_RATE * time and board.wait(begin + rows / _ROW_RATE):
            machine.refresh()
            write(csv_line(units.joints_out(arm, machine.joints()).tolist()) + "\n")
            rows += 1
    if out not in (None, "-"):
        output.note(f"{rows} row{'s' * (rows != 1)} in {out}")


def _with_servos(arm: Arm) -> Board:
    """The arm's board. Raises UsageError if its motors cannot be moved by hand and read."""
    board = board_link.board_of(arm, rehearsal=True)
    if not board.can("relax"):
        raise UsageError(f"{arm.name} has no bus servos: other motors cannot be moved by hand and read")
    return board
