"""`armkin import`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin import files
from armkin.cli.parsing.options import RobotOut
from armkin.cli.printing import output
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.robot_file.urdf_reader import UrdfRobot


def import_(
    file: Annotated[
        str, typer.Argument(metavar="FILE|-", help="A URDF, flattened if it was a xacro; -: standard input.")
    ],
    base: Annotated[
        str | None, typer.Option("--base", metavar="LINK", help="Where the chain begins. [default: the root]")
    ] = None,
    tip: Annotated[
        str | None, typer.Option("--tip", metavar="LINK", help="Where it ends; needed where the arm has several ends.")
    ] = None,
    dh: Annotated[bool, typer.Option("--dh", help="A DH table instead of screws, if the arm has one.")] = False,
    snap: Annotated[bool, typer.Option("--snap", help="Angles within 1e-4 rad of a right angle become one.")] = False,
    out: RobotOut = None,
) -> None:
    """A robot file from a URDF.

    Screws, exactly as the URDF has them, limits, speeds and names, on stdout: armkin import arm.urdf > arm.yaml
    """
    from armkin import robot_file
    from armkin.export import conventions
    from armkin.model.build_arm import arm_of_file
    from armkin.robot_file import catalogue, urdf_reader
    from armkin.robot_file.robot_file_text import format_robot_file

    if file.endswith((".yaml", ".yml")) or (catalogue.shipped_file(file) and not os.path.exists(file)):
        raise UsageError(f"{file} is a robot, and import reads URDFs: armkin info {file} says what it is")
    files.protect_input(file)
    try:
        raw = urdf_reader.read_bytes(file)  # once: a pipe can be read no second time
        urdf_robot = urdf_reader.parse_urdf(raw, "stdin" if file == "-" else file, base=base, tip=tip, snap=snap)
    except UsageError as error:
        option = next((end for end in ("base", "tip") if f"the {end} must be named" in str(error)), None)
        if option is None:
            raise
        raise UsageError(f"{error}\ngive it with --{option} LINK") from None
    arm = arm_of_file(robot_file.parse_robot_file(format_robot_file(urdf_robot.data), f"{file} as a robot file"))
    document: dict[str, Any] = conventions.dh(arm) if dh else urdf_robot.data
    with output.destination(out) as write:
        write(format_robot_file(document, urdf_robot.notes))
    for note in urdf_robot.notes:
        output.note(note)
    output.note(f"{arm.n} joints from {urdf_robot.base} to {urdf_robot.tip}")
    if not snap and (gain := _snap_gain(raw, urdf_robot, arm)):
        output.note(gain)


def _snap_gain(raw: bytes, urdf_robot: UrdfRobot, arm: Arm) -> str | None:
    """What --snap would buy: another solver class, and how far the tip would move for it."""
    import numpy as np

    from armkin import robot_file
    from armkin.model.build_arm import arm_of_file
    from armkin.robot_file import urdf_reader
    from armkin.robot_file.robot_file_text import format_robot_file

    snapped_arm = arm_of_file(
        robot_file.parse_robot_file(
            format_robot_file(urdf_reader.parse_urdf(raw, base=urdf_robot.base, tip=urdf_robot.tip, snap=True).data)
        )
    )
    try:
        method, snapped_method = armkin.method(arm)[0], armkin.method(snapped_arm)[0]
    except UsageError:
        return None
    if method == snapped_method:
        return None
    q = np.random.default_rng(2).uniform(-2.0, 2.0, (200, arm.n)) * np.where(arm.prismatic, arm.reach / 4, 1.0)
    tip_distance = np.linalg.norm((armkin.fk(arm, q) - armkin.fk(snapped_arm, q))[:, :3, 3], axis=1).max()
    tip_text = f"the tip moves by up to {tip_distance:.2g} mm"
    return f"ik is solved as: {method}; with --snap as: {snapped_method}, and {tip_text}"
