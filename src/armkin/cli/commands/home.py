"""`armkin home`."""

from __future__ import annotations

from typing import Annotated

import typer

from armkin.cli import completion, inputs, linking, output, render
from armkin.cli.linking import Baud, PortName
from armkin.cli.options import Json, Robot
from armkin.errors import UsageError


def home(
    robot: Robot,
    port: PortName = None,
    joints: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[JOINT...]", help="These joints only. [default: all]", autocompletion=completion.joints
        ),
    ] = None,
    baud: Baud = None,
    json: Json = False,
) -> None:
    """Find the limit switches, and with them the position.

    Each joint approaches its switch, backs off and touches it again slowly, in the order of the robot
    file's homing. Keep clear of the arm: it moves as far as it must.
    """
    from armkin.board.firmware import homing
    from armkin.board.moving import where

    arm = inputs.load(robot)
    other = linking.foreign(arm)
    if other is not None:
        if joints:
            raise UsageError(f"boards of kind {other.board.kind} home all joints at once: leave {' '.join(joints)} out")
        with linking.backend(arm, other, port, baud) as backend:
            other.home(backend)
            told = {**render.head(arm), "port": backend.port.name, **where(backend)}
        with output.destination(None) as write:
            write(render.to_json(told) + "\n" if json else linking.where_text(arm, told))
        return
    configuration = linking.configured(arm, rehearsal=port == linking.SIM)
    homing.searches(arm, configuration, joints or ())  # refuses before a port is opened
    with linking.machine(arm, configuration, port, baud) as machine:
        homing.home(machine, joints or (), lambda name: output.note(f"homing {name}"))
        found = where(machine)
    with output.destination(None) as write:
        write(
            render.to_json({**render.head(arm), "port": machine.session.port.name, **found}) + "\n"
            if json
            else linking.where_text(arm, found)
        )
