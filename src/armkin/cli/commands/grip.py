"""`armkin grip`."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli import inputs, linking, output, render
from armkin.cli.linking import Baud, PortName
from armkin.cli.numbers import is_number, number
from armkin.cli.options import Json, Robot
from armkin.errors import LinkError, UsageError

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration, Grip
    from armkin.board.firmware.machine import Machine
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
    baud: Baud = linking.BAUD,
    json: Json = False,
) -> None:
    """Open or close the gripper."""
    from armkin.board.firmware.segments import line

    arm = inputs.load(robot)
    configuration = linking.configured(arm, rehearsal=port == linking.SIM)
    gripper = _gripper(arm.name, configuration)
    target = _count(gripper, value, "VALUE")
    start = None if assume is None else _count(gripper, assume, "--assume")
    assert gripper.top is not None
    assert gripper.accel is not None
    with linking.machine(arm, configuration, port, baud) as machine:
        _prepare(machine, gripper, start, simulated=machine.session.port.simulated)
        at = machine.status.counts[gripper.axis]
        far = abs(target - at)
        if far:
            board = configuration.board
            move = line(
                [at],
                [target],
                gripper.top / far,
                gripper.accel / far,
                clock=board.clock,
                min_interval=board.min_interval,
            )
            machine.run_axis(move, gripper.axis, board.clock)
        at = machine.status.counts[gripper.axis]
    if at != target:
        there, wanted = _said(arm, gripper, at), _said(arm, gripper, target)
        raise LinkError(f"the gripper stands at {there} instead of {wanted}: please report this as a bug")
    found: dict[str, Any] = {
        **render.head(arm),
        "port": machine.session.port.name,
        "gripper": gripper.value(at),
        "counts": at,
    }
    with output.destination(None) as write:
        write(render.to_json(found) + "\n" if json else f"gripper: {_said(arm, gripper, at)}\n")


def _gripper(name: str, configuration: Configuration) -> Grip:
    gripper = configuration.grip
    if gripper is None:
        raise UsageError(f"{name} has no gripper; add gripper: to its robot file")
    for key, rate in (("max_speed", gripper.top), ("max_accel", gripper.accel)):
        if rate is None:
            raise UsageError(f"the gripper has no {key}: motion needs one; add {key}: to gripper:")
    return gripper


def _said(arm: Arm, gripper: Grip, count: int) -> str:
    """A count in words: ``29.97 deg (833 us)``."""
    drive = None if arm.file is None else arm.file.gripper
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


def _prepare(machine: Machine, gripper: Grip, start: int | None, *, simulated: bool) -> None:
    """Have the gripper's axis configured, known and on."""
    known = machine.configured and bool(machine.status.known >> gripper.axis & 1)
    if known and start is not None:
        raise LinkError("the gripper's position is known: --assume is only for a lost one; leave it out")
    if not known and start is None and not simulated:
        raise LinkError(
            "the gripper's position is lost: add --assume open (or closed, or a value)\n"
            "a servo jumps there at once, at its full speed: keep your fingers out"
        )
    if not machine.configured:
        machine.configure()
    if not known:
        machine.vouch({gripper.axis: gripper.open if start is None else start})
    machine.enable((gripper.axis,))
