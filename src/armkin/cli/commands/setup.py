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
    from armkin.board.kinds import Foreign
    from armkin.model.arm import Arm


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
    from armkin.board.kinds import foreign

    arm = inputs.load(robot)
    other = foreign(arm)
    if other is None or other.board.kind not in ("grbl", "klipper"):
        raise UsageError(
            f"{arm.name}'s board has no settings to compare: setup is for board: {{kind: grbl}} and {{kind: klipper}}"
        )
    if other.board.kind == "klipper":
        if write:
            raise UsageError("Klipper's settings stand in printer.cfg, which armkin does not write: setup prints it")
        answer = _klipper(arm, other, port, reset=not no_reset)
        text = f"{answer['printer_cfg']}\n{_differing(answer['differences'])}"
    else:
        answer, found = _grbl(arm, other, port, baud, write, reset=not no_reset)
        text = _text(found, write)
    with output.destination(None) as put:
        put(render.to_json(answer) + "\n" if json else text)


def _grbl(
    arm: Arm, other: Foreign, port: str | None, baud: int | None, write: bool, *, reset: bool
) -> tuple[dict[str, Any], list[Difference]]:
    from armkin.board.grbl.machine import GrblMachine

    with board_link.backend(arm, other, port, baud, reset=reset) as machine:
        assert isinstance(machine, GrblMachine)
        found = machine.wrong()
        if write:
            machine.setup()
        answer = {
            **render.head(arm),
            "port": machine.port.name,
            "firmware": f"GRBL {machine.session.version}",
            "differences": [
                {"setting": d.number, "what": d.what, "found": d.found, "wanted": d.wanted, "serious": d.serious}
                for d in found
            ],
            "written": write,
        }
    return answer, found


def _klipper(arm: Arm, other: Foreign, port: str | None, *, reset: bool) -> dict[str, Any]:
    from armkin.board.klipper.axes import axes_of, printer_cfg
    from armkin.board.klipper.machine import KlipperMachine

    answer: dict[str, Any] = {**render.head(arm), "port": port, "firmware": None, "differences": None}
    if port is not None:
        with board_link.backend(arm, other, port, None, reset=reset) as machine:
            assert isinstance(machine, KlipperMachine)
            answer["firmware"] = f"Klipper {machine.version}"
            answer["differences"] = [
                {"setting": d.setting, "found": d.found, "wanted": d.wanted} for d in machine.wrong()
            ]
    return answer | {"printer_cfg": printer_cfg(axes_of(arm))}


def _differing(found: list[dict[str, Any]] | None) -> str:
    """What differs, as comments below the sections."""
    if found is None:
        return "# not compared: --port names the socket of Klipper's API server\n"
    if not found:
        return "# Klipper's settings fit the robot file; pins are not compared\n"
    rows = (f"# {d['setting']} is {d['found'] or 'not there'}: the robot file wants {d['wanted']}\n" for d in found)
    return "".join(rows)


def _text(found: list[Difference], written: bool) -> str:
    if not found:
        return "the settings fit the robot file\n"
    rows = [["setting", "what", "board", "robot file", ""]]
    for d in found:
        there = "-" if d.found is None else f"{d.found:g}"
        rows.append([f"${d.number}", d.what, there, f"{d.wanted:g}", "" if d.serious else "no harm"])
    end = "written, and read back" if written else "--write writes them; the arm's position is lost with that"
    return f"{render.table(rows, left=(0, 1, 4))}\n{end}\n"
