"""`armkin setup`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli import board_link, inputs, output, render
from armkin.cli.board_link import Baud, NoReset
from armkin.cli.default_port import PortName
from armkin.cli.options import Json, Robot
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.board.grbl.settings import Difference


def setup(
    robot: Robot,
    port: PortName = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write what differs, and read it back. The position is lost with it.")
    ] = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """A board's settings against the robot file.

    Tells what differs, and changes nothing without --write. For GRBL boards: armkin's own firmware takes its
    settings from the robot file at every command, and bus servos have none that matter here.
    """
    from armkin.board.grbl.machine import GrblMachine

    arm = inputs.load(robot)
    other = board_link.foreign(arm)
    if other is None or other.board.kind != "grbl":
        raise UsageError(f"{arm.name}'s board has no settings to compare: setup is for board: {{kind: grbl}}")
    with board_link.backend(arm, other, port, baud, reset=not no_reset) as machine:
        assert isinstance(machine, GrblMachine)
        found = machine.wrong()
        if write:
            machine.setup()
        answer: dict[str, Any] = {
            **render.head(arm),
            "port": machine.port.name,
            "firmware": f"GRBL {machine.session.version}",
            "differences": [
                {"setting": d.number, "what": d.what, "found": d.found, "wanted": d.wanted, "serious": d.serious}
                for d in found
            ],
            "written": write,
        }
    with output.destination(None) as put:
        put(render.to_json(answer) + "\n" if json else _text(found, write))


def _text(found: list[Difference], written: bool) -> str:
    if not found:
        return "the settings fit the robot file\n"
    rows = [["setting", "what", "board", "robot file", ""]]
    for d in found:
        there = "-" if d.found is None else f"{d.found:g}"
        rows.append([f"${d.number}", d.what, there, f"{d.wanted:g}", "" if d.serious else "no harm"])
    end = "written, and read back" if written else "--write writes them; the arm's position is lost with that"
    return f"{render.table(rows, left=(0, 1, 4))}\n{end}\n"
