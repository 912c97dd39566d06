"""`armkin home`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli import board_link, completion, inputs, output, render
from armkin.cli.board_link import Baud, NoReset
from armkin.cli.default_port import PortName
from armkin.cli.options import Json, Robot
from armkin.errors import HomingIncompleteError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.firmware.homing import Lost
    from armkin.board.foreign import Foreign
    from armkin.model.arm import Arm

_REHEARSAL = "the simulated arm starts in its home pose; its switches are where the robot file says"


def home(
    robot: Robot,
    port: PortName = None,
    joints: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[JOINT...]", help="These joints only. [default: all]", autocompletion=completion.joints
        ),
    ] = None,
    rest_at_home: Annotated[
        bool,
        typer.Option("--rest-at-home", help="The joints without a switch stand in their home pose: take my word."),
    ] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Stay at the switches; do not move to the home pose.")] = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Find the limit switches, and with them the position.

    Each joint approaches its switch, backs off and touches it again slowly, in the order of the robot
    file's homing; then the arm moves to its home pose. Where the position was known,
    steps lost since are told. Keep clear of it: it moves as far as it must. With
    --port sim the switches are where the robot file says.
    """
    arm = inputs.load(robot)
    other = board_link.foreign(arm)
    if other is not None:
        found = _of_others(arm, other, port, baud, joints, rest_at_home, stay, not no_reset)
    else:
        found = _ours(arm, port, baud, joints or (), rest_at_home, stay, not no_reset)
    with output.destination(None) as write:
        write(render.to_json(found) + "\n" if json else board_link.where_text(arm, found))


def _ours(
    arm: Arm, port: str | None, baud: int | None, joints: Sequence[str], rest_at_home: bool, stay: bool, reset: bool
) -> dict[str, Any]:
    """Home the arm on a board with armkin's firmware."""
    from armkin.board.firmware import homing
    from armkin.board.planner import where

    configuration = board_link.configured(arm, rehearsal=port == board_link.SIM)
    homing.searches(arm, configuration, joints, rest_at_home=rest_at_home)  # refuses before a port is opened
    with board_link.machine(arm, configuration, port, baud, simulated=_REHEARSAL, reset=reset) as machine:
        steps = homing.home(machine, joints, lambda name: output.note(f"homing {name}"), rest_at_home=rest_at_home)
        lost = homing.lost_joints(machine)
        if lost:
            done = [name for name in arm.joint_names if name not in lost]
            raise HomingIncompleteError(
                f"homed {', '.join(done) or 'nothing'}; the position of {', '.join(lost)} is still lost",
                advice="home these joints, too, or home(..., rest_at_home=True) if they stand in their home pose",
                joints=lost,
                homing=all(arm.homing[arm.joint_names.index(name)] for name in lost),
                robot_file=arm.path,
            )
        if not stay:
            output.note("moving to the home pose")
            homing.go_home(machine)
        return {**render.head(arm), "port": machine.port.name, **where(machine), "lost_steps": _told(arm, steps)}


def _told(arm: Arm, found: Sequence[Lost]) -> list[dict[str, Any]]:
    """What the switches tell of the counts, as JSON; a warning where more than a step is missing."""
    told = []
    for one in found:
        slides = arm.prismatic[arm.joint_names.index(one.joint)]
        difference = None if one.difference is None else one.difference / (1.0 if slides else units.DEGREE)
        told.append({"joint": one.joint, "steps": one.steps, "difference": difference})
        if one.steps is not None and abs(one.steps) > 1:
            off = f"({difference:.3f} {'mm' if slides else 'deg'})"
            output.warn(f"{one.joint}: {abs(one.steps)} steps were lost since its position was last set {off}")
    return told


def _of_others(
    arm: Arm,
    other: Foreign,
    port: str | None,
    baud: int | None,
    joints: Sequence[str] | None,
    rest_at_home: bool,
    stay: bool,
    reset: bool,
) -> dict[str, Any]:
    """Home the arm on a board that homes by itself, all joints at once."""
    from armkin.board.planner import where

    kind = other.board.kind
    if joints:
        raise UsageError(f"boards of kind {kind} home all joints at once: leave {' '.join(joints)} out")
    if rest_at_home:
        raise UsageError(f"boards of kind {kind} home all joints at once: leave --rest-at-home out")
    with board_link.backend(arm, other, port, baud, reset=reset) as backend:
        other.home(backend)
        if not stay:
            output.note("moving to the home pose")
            other.go_home(backend)
        return {**render.head(arm), "port": backend.port.name, **where(backend)}
