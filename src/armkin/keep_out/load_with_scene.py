"""`armkin.load`: a robot by name or file, and the scene that it stands in."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

from armkin.model.build_arm import arm_of_file

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.robot_file.robot import RobotFile
    from armkin.robot_file.scene_file import Scene


def load(
    path: str | PathLike[str],
    scene: str | PathLike[str] | None = None,
    *,
    tool: Sequence[float] | None = None,
) -> Arm:
    """Read and validate a robot file, and the scene that the arm stands in.

    Args:
        path: of a robot file, or the name of a shipped robot; a path to a file wins.
        scene: a file whose keep-outs are added to the robot's.
        tool: x, y, z, roll, pitch, yaw [mm, deg] after the last joint, in place of the file's, as on the command line.

    Returns:
        The arm, read-only.

    Raises:
        FileError: a file cannot be read.
        RobotFileError: a file is not valid, or a keep-out is hit in every posture.
        UsageError: path is neither text nor path-like.

    >>> load("three_dof").joint_names
    ('q1', 'q2', 'q3')
    """
    from armkin import robot_file

    file, keep_out_scene = robot_file.read_robot_file(path), None
    if scene is not None:
        from armkin.robot_file.scene_file import read_scene

        keep_out_scene = read_scene(scene)
    return arm_in_scene(file, keep_out_scene, tool)


def arm_in_scene(file: RobotFile, scene: Scene | None = None, tool: Sequence[float] | None = None) -> Arm:
    """The arm of a robot file and a scene.

    Raises RobotFileError if names of the two clash, or a keep-out is hit in every posture.
    """
    if scene is not None:
        from armkin.robot_file.scene_file import check_names_beside

        check_names_beside(file, scene)
    arm = arm_of_file(file, scene, tool)
    if arm.keep_out:
        from armkin.keep_out.body_pairs import check_keep_out

        check_keep_out(arm)
    return arm
