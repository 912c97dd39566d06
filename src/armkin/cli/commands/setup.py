"""`armkin setup`."""

from typing import Annotated, Any

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import Json, Robot
from armkin.cli.printing import output, render
from armkin.errors import UsageError


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

    Tells what differs, and changes nothing without --write. For GRBL boards, and for Klipper: without --port it prints
    the sections that printer.cfg needs. armkin's own firmware takes its settings from the robot file at every command,
    and bus servos have none that matter here.
    """
    arm = arguments.load_arm(robot)
    board = board_link.board_of(arm, rehearsal=True)
    if not board.can("settings"):
        raise UsageError(
            f"{arm.name}'s board has no settings to compare: setup is for board: {{kind: grbl}} and {{kind: klipper}}"
        )
    if write:
        board.require("write_settings")
    answer: dict[str, Any] = {**render.head(arm), "port": port, "firmware": None, "differences": None}
    file = board.settings_file
    if file is None or port is not None:
        with board_link.open_backend(board, port, baud, reset=not no_reset) as machine:
            differences = board.settings()
            if write:
                board.write_settings()
            answer |= {"port": machine.port.name, "firmware": machine.report()["firmware"], "differences": differences}
    if file is None:
        answer["written"], text = write, _text(answer["differences"], write)
    else:
        answer["printer_cfg"], text = file, f"{file}\n{_differences_text(answer['differences'])}"
    with output.destination(None) as write_out:
        write_out(render.to_json(answer) + "\n" if json else text)


def _differences_text(differences: list[dict[str, Any]] | None) -> str:
    """What differs, as comments below the sections."""
    if differences is None:
        return "# not compared: --port names the socket of Klipper's API server\n"
    if not differences:
        return "# Klipper's settings fit the robot file; pins are not compared\n"
    rows = (
        f"# {entry['setting']} is {entry['found'] or 'not there'}: the robot file wants {entry['wanted']}\n"
        for entry in differences
    )
    return "".join(rows)


def _text(differences: list[dict[str, Any]], written: bool) -> str:
    if not differences:
        return "the settings fit the robot file\n"
    rows = [["setting", "what", "board", "robot file", ""]]
    for entry in differences:
        board_value = "-" if entry["found"] is None else f"{entry['found']:g}"
        effect = "" if entry["serious"] else "no harm"
        rows.append([f"${entry['setting']}", entry["what"], board_value, f"{entry['wanted']:g}", effect])
    end = "written, and read back" if written else "--write writes them; the arm's position is lost with that"
    return f"{render.table(rows, left_aligned=(0, 1, 4))}\n{end}\n"
