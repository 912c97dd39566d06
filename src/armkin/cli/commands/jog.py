"""`armkin jog`."""

from typing import Annotated

import typer

from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.boards.keep_outs import Ignore, NoScene
from armkin.cli.parsing import completion
from armkin.cli.parsing.number_parsing import number
from armkin.cli.parsing.options import Json, Robot, Scene
from armkin.cli.printing import output, render
from armkin.errors import UsageError
from armkin.model import units

_MAX_SECONDS = 60.0  # length [s], at most, of a jog


def jog(
    robot: Robot,
    joint: Annotated[str, typer.Argument(metavar="JOINT", help="The joint's name.", autocompletion=completion.joints)],
    speed: Annotated[str, typer.Argument(metavar="SPEED", help="In deg/s (prismatic joints: mm/s), signed.")],
    port: PortName = None,
    scene: Scene = None,
    no_scene: NoScene = False,
    ignore_keep_out: Ignore = False,
    seconds: Annotated[str, typer.Option("--seconds", metavar="S", help="How long; Ctrl-C ends it earlier.")] = "0.5",
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Move one joint at a constant speed, for a short time.

    For setting up: boards with armkin's firmware move while the position is lost, too, at an eighth of max_speed.
    The board stops by itself when this command is gone, and before the joint limits and keep-outs if the position
    is known.
    """
    from armkin.board.backend.motion_start import jog_motion
    from armkin.board.planner import where_arm_stands
    from armkin.model.lock_joints import joint_index

    keep_outs.check_together(scene, no_scene)
    arm = board_link.arm_for_port(keep_outs.load_moving_arm(robot, scene, ignore_keep_out), port)
    board = board_link.board_of(arm, rehearsal=port == board_link.SIM)
    j = joint_index(arm, joint)
    rate = number(speed, "SPEED")
    time = number(seconds, "--seconds")
    if not 0 < time <= _MAX_SECONDS:
        raise UsageError(f"--seconds: '{seconds}' must be above 0 and at most {_MAX_SECONDS:g}")
    top = float(units.joints_out(arm, arm.max_speed)[j])
    if abs(rate) > top * (1 + 1e-9) or rate == 0:
        raise UsageError(f"SPEED: {speed} must be from -{top:g} to {top:g}, and not 0")
    with board_link.open_backend(board, port, baud, reset=not no_reset) as machine:
        keep_outs.check_port(machine.port.name, arm, no_scene, simulated=machine.port.simulated)
        joint_rate = float(units.joints_in(arm, [rate] * arm.n)[j])
        allowed = board.ready_to_jog(j, joint_rate)
        if allowed != joint_rate:
            allowed_speed = abs(rate * allowed / joint_rate)
            output.warn(f"the position is lost: {allowed_speed:g} instead of {speed}, and no limits")
        if machine.position() != "lost":  # a simulated board knows it since it got ready
            keep_outs.tell_start_hit(arm, machine.joints())
            if arm.ignores_keep_out:
                keep_outs.tell_ignored([jog_motion(arm, machine.joints(), j, allowed, time)])
        board.jog(j, allowed, time)
        answer = {**render.head(arm), "port": machine.port.name, **where_arm_stands(machine)}
    with output.destination(None) as write:
        write(render.to_json(answer) + "\n" if json else board_link.where_text(arm, answer))
