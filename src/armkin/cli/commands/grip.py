"""`armkin grip`."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli import board_link, inputs, output, render
from armkin.cli.board_link import Baud, NoReset
from armkin.cli.default_port import PortName
from armkin.cli.numbers import is_number, number
from armkin.cli.options import Json, Robot
from armkin.errors import LinkError, UsageError

if TYPE_CHECKING:
    from armkin.board.firmware.gripper_counts import Grip
    from armkin.board.kinds import Foreign
    from armkin.cli.answers import Grip as Answer
    from armkin.model.arm import Arm


_WORD = {"open": "open", "closed": "closed", "close": "closed", "shut": "closed"}


def grip(
    robot: Robot,
    value: Annotated[str, typer.Argument(metavar="open|closed|VALUE", help="In the gripper drive's degrees (mm).")],
    port: PortName = None,
    assume: Annotated[
        str | None,
        typer.Option(
            "--assume",
            metavar="open|closed|VALUE",
            help="Where a gripper whose position is lost stands: a servo jumps there first.",
        ),
    ] = None,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Open or close the gripper."""
    from armkin.board.firmware import gripping
    from armkin.board.firmware.machine import Machine
    from armkin.board.kinds import Foreign

    arm = inputs.load(robot)
    board = board_link.board_of(arm, rehearsal=port == board_link.SIM)
    if isinstance(board, Foreign):
        _grip_other(arm, board, value, port, baud, not no_reset, json)
        return
    gripper = gripping.gripper_of(arm.name, board)
    target = _count(gripper, value, "VALUE")
    start = None if assume is None else _count(gripper, assume, "--assume")
    with board_link.backend(arm, board, port, baud, reset=not no_reset) as machine:
        assert isinstance(machine, Machine)
        gripping.prepare(machine, gripper, start)
        at = gripping.grip(machine, gripper, target)
    if at != target:
        there, wanted = _said(arm, gripper, at), _said(arm, gripper, target)
        raise LinkError(f"the gripper stands at {there} instead of {wanted}: please report this as a bug")
    found: Answer = {
        **render.head(arm),
        "port": machine.port.name,
        "gripper": gripper.value(at),
        "counts": at,
    }
    with output.destination(None) as write:
        write(render.to_json(found) + "\n" if json else f"gripper: {_said(arm, gripper, at)}\n")


def _grip_other(
    arm: Arm, other: Foreign, value: str, port: str | None, baud: int | None, reset: bool, json: bool
) -> None:
    """A gripper on a board of another kind: a servo may close on something before it is where it was sent."""
    gripper = other.gripper()
    target = other.grip_value(_WORD[value] if value in _WORD else number(value, "VALUE"))
    with board_link.backend(arm, other, port, baud, reset=reset) as machine:
        at = other.grip(machine, target)
    unit = "S" if gripper.kind == "spindle" else "deg"
    measured = gripper.kind == "bus"
    found = {**render.head(arm), "port": machine.port.name, "gripper": at, "target": target, "measured": measured}
    with output.destination(None) as write:
        held = "" if abs(at - target) < 1.5 else f" of {render.short(target)}: it holds something, or is blocked"
        said = f"gripper: {render.short(at)} {unit}{held if measured else ', as sent: nothing measures it'}\n"
        write(render.to_json(found) + "\n" if json else said)


def _said(arm: Arm, gripper: Grip, count: int) -> str:
    """A count in words: ``29.97 deg (833 us)``."""
    drive = arm.gripper
    assert drive is not None
    unit = "deg" if drive.lead is None else "mm"
    return f"{render.short(gripper.value(count))} {unit} ({count} {'us' if drive.kind == 'servo' else 'steps'})"


def _count(gripper: Grip, text: str, what: str) -> int:
    named = {"open": gripper.open, "closed": gripper.closed}
    if text in named:
        return named[text]
    if not is_number(text) and (close := get_close_matches(text.lower(), (*named, "close", "shut"), 1)):
        raise UsageError(f"{what}: '{text}' is neither open nor closed nor a number; did you mean {_WORD[close[0]]}?")
    count = gripper.count(number(text, what))
    low, high = sorted(named.values())
    if not low <= count <= high:
        ends = sorted((gripper.value(low), gripper.value(high)))
        raise UsageError(f"{what}: {text} is outside of the gripper's {ends[0]:g} to {ends[1]:g}")
    return count
