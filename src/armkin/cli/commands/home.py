"""`armkin home`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.boards.keep_outs import NoScene
from armkin.cli.parsing import completion
from armkin.cli.parsing.options import Json, Robot, Scene
from armkin.cli.printing import output, render
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend.board import LostSteps
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
        typer.Option("--rest-at-home", help="Trust that joints without a switch stand in their home pose."),
    ] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Stay at the switches; do not move to the home pose.")] = False,
    scene: Scene = None,
    no_scene: NoScene = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Find the limit switches, and with them the position.

    Each joint approaches its switch, backs off and touches it again slowly, in the order of the robot
    file's homing; then the arm moves to its home pose. If the position was known,
    the steps lost since are reported. Keep clear: a joint moves as far as its switch is away. With
    --port sim the switches are where the robot file says.
    """
    from armkin.board.planner import where_arm_stands

    keep_outs.check_together(scene, no_scene)
    arm = keep_outs.load_moving_arm(robot, scene)
    if arm.keep_out:
        output.note("the search for the switches is not proved free of keep-outs; the move after it is")
    board = board_link.board_of(arm, rehearsal=port == board_link.SIM)
    board.check_home(joints or (), rest_at_home=rest_at_home)  # refuses before a port is opened
    with board_link.open_backend(board, port, baud, simulated=_REHEARSAL, reset=not no_reset) as machine:
        switch_report: dict[str, Any] = {}
        keep_outs.check_port(machine.port.name, arm, no_scene, simulated=machine.port.simulated)
        lost_steps = board.home(joints or (), lambda name: output.note(f"homing {name}"), rest_at_home=rest_at_home)
        if lost_steps is not None:
            switch_report["lost_steps"] = _lost_steps(arm, lost_steps)
        if not stay:
            output.note("moving to the home pose")
            board.go_home()
        answer = {**render.head(arm), "port": machine.port.name, **where_arm_stands(machine), **switch_report}
    with output.destination(None) as write:
        write(render.to_json(answer) + "\n" if json else board_link.where_text(arm, answer))


def _lost_steps(arm: Arm, searches: Sequence[LostSteps]) -> list[dict[str, Any]]:
    """What the switches tell of the counts, as JSON; a warning where more than a step is missing."""
    rows = []
    for search in searches:
        slides = arm.prismatic[arm.joint_names.index(search.joint)]
        unit = 1.0 if slides else units.DEGREE
        difference = None if search.difference is None else search.difference / unit
        rows.append({"joint": search.joint, "steps": search.steps, "difference": difference})
        if search.steps is not None and abs(search.steps) > 1:
            difference_text = f"({difference:.3f} {'mm' if slides else 'deg'})"
            output.warn(
                f"{search.joint}: {abs(search.steps)} steps were lost since its position was last set {difference_text}"
            )
    return rows
