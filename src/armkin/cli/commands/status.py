"""`armkin status`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.cli import inputs, linking, output, render
from armkin.cli.linking import Baud, PortName
from armkin.cli.options import Json, Robot

if TYPE_CHECKING:
    from armkin.board.firmware.machine import Machine
    from armkin.cli.answers import StatusOfBoard


def status(robot: Robot, port: PortName = None, baud: Baud = linking.BAUD, json: Json = False) -> None:
    """Where the board says that the arm stands.

    Moves nothing and changes nothing. (Opening its port resets an Uno the first time: an arm that stood
    still keeps its position.)
    """
    arm = inputs.load(robot)
    new = "the simulated board is new in every command: nothing has told it yet where the arm stands"
    with linking.machine(
        arm, linking.configured(arm, rehearsal=port == linking.SIM), port, baud, simulated=new
    ) as machine:
        found = _found(machine)
    with output.destination(None) as write:
        write(render.to_json(found) + "\n" if json else linking.where_text(arm, found) + _text(found))


def _found(machine: Machine) -> StatusOfBoard:
    from armkin.board.firmware.protocol import Error, Flag, State
    from armkin.board.moving import where

    info, status, board = machine.info, machine.status, machine.configuration.board
    flags = Flag(status.flags)
    return {
        **render.head(machine.arm),
        "port": machine.session.port.name,
        "board": board.kind,
        "firmware": ".".join(map(str, info.firmware)),
        "configured": machine.configured,
        **where(machine),
        "state": State(status.state).name.lower(),
        "error": Error(status.error).name.lower() if status.error else None,
        "drivers_on": Flag.DRIVERS in flags,
        "servo_pulses_on": Flag.SERVOS in flags,
        "abort_input": Flag.ABORT in flags,
        "switches": {name: bool(status.switches >> i & 1) for i, name in enumerate(board.switches)},
        "boots": info.boots,
        "reset_cause": info.cause,
    }


def _text(found: StatusOfBoard) -> str:
    high = [name for name, level in found["switches"].items() if level]
    low = [name for name, level in found["switches"].items() if not level]
    on = {True: "on", False: "off"}
    rows = [
        ["board", f"{found['board']} on {found['port']}, firmware {found['firmware']}"],
        ["configured", "for this robot file" if found["configured"] else "not for this robot file"],
        ["state", found["state"]],
        ["drivers", f"{on[found['drivers_on']]}, servo pulses {on[found['servo_pulses_on']]}"],
        ["switches", f"high: {', '.join(high) or 'none'}; low: {', '.join(low) or 'none'}"],
        ["abort input", "active" if found["abort_input"] else "not active"],
    ]
    return render.table(rows, left=(0, 1)) + "\n"
