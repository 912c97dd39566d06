"""`armkin jog`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from armkin.cli import completion, inputs, linking, output, render
from armkin.cli.linking import Baud, PortName
from armkin.cli.numbers import number
from armkin.cli.options import Json, Robot
from armkin.errors import LinkError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.firmware.machine import Machine
    from armkin.model.arm import Arm

_SLOW = 8  # a lost position: an eighth of max_speed
_LONGEST = 60.0  # [s]


def jog(
    robot: Robot,
    joint: Annotated[str, typer.Argument(metavar="JOINT", help="The joint's name.", autocompletion=completion.joints)],
    speed: Annotated[str, typer.Argument(metavar="SPEED", help="In deg/s (prismatic joints: mm/s), signed.")],
    port: PortName = None,
    seconds: Annotated[str, typer.Option("--seconds", metavar="S", help="How long; Ctrl-C ends it earlier.")] = "0.5",
    baud: Baud = linking.BAUD,
    json: Json = False,
) -> None:
    """Move one joint at a constant speed, for a short time.

    For setting up: it also works while the position is lost, at an eighth of max_speed. The board stops by
    itself when this command falls silent, and before the joint limits if the position is known.
    """
    from armkin.board.moving import where
    from armkin.model.lock import joint_index

    arm = inputs.load(robot)
    configuration = linking.configured(arm, rehearsal=port == linking.SIM)
    j = joint_index(arm, joint)
    rate = number(speed, "SPEED")
    time = number(seconds, "--seconds")
    if not 0 < time <= _LONGEST:
        raise UsageError(f"--seconds: '{seconds}' must be above 0 and at most {_LONGEST:g}")
    top = float(units.joints_out(arm, arm.max_speed)[j])
    if abs(rate) > top * (1 + 1e-9) or rate == 0:
        raise UsageError(f"SPEED: {speed} must be from -{top:g} to {top:g}, and not 0")
    with linking.machine(arm, configuration, port, baud) as machine:
        _prepare(machine)
        if machine.position() == "lost" and abs(rate) > top / _SLOW:
            rate = top / _SLOW if rate > 0 else -top / _SLOW
            output.warn(f"the position is lost: {abs(rate):g} instead of {speed}, and no limits")
        machine.jog(_rates(arm, machine, j, rate), time)
        found = where(machine)
    with output.destination(None) as write:
        write(
            render.to_json({**render.head(arm), "port": machine.session.port.name, **found}) + "\n"
            if json
            else linking.where_text(arm, found)
        )


def _prepare(machine: Machine) -> None:
    if machine.session.port.simulated:
        machine.prepare()
        return
    if not machine.configured:
        if machine.info.known:
            raise LinkError(
                f"the board knows the position of another arm, or {machine.arm.path} has changed:\n"
                "armkin home or armkin send --assume-home configures it anew"
            )
        machine.configure()
    machine.enable(machine.configuration.axes)


def _rates(arm: Arm, machine: Machine, joint: int, rate: float) -> dict[int, int]:
    """Counts per second of the joint's motors, by axis."""
    vector = [0.0] * arm.n
    vector[joint] = rate
    exact = arm.motor_gain @ units.joints_in(arm, vector)
    # Towards zero: rounding must not exceed what the board allows.
    found = {axis: int(value) for axis, value in zip(machine.configuration.axes, exact, strict=True)}
    if not any(found.values()):
        raise UsageError(f"SPEED: {rate:g} is less than one count a second")
    return found
