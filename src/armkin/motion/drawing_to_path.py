"""G-code and SVG as paths of an arm."""

from __future__ import annotations

import os
from collections.abc import Sequence

from armkin.errors import UsageError
from armkin.model.arm import Arm
from armkin.motion.tool_path.drawing_frame import place_drawing
from armkin.path_file import PathFile, drawing_language, read_drawing
from armkin.path_file.drawing import DrawingOptions


def drawing(
    arm: Arm,
    file: str | os.PathLike[str],
    at: Sequence[float],
    *,
    task: str | None = None,
    scale: float = 1.0,
    feed: float | None = None,
    lift: float = 5.0,
    grip_by: str | None = None,
) -> PathFile:
    """A drawing as a path for `armkin.path`: G-code (.gcode, .gco, .nc, .ngc) or SVG.

    Args:
        arm: the arm, as `armkin.load` gives it.
        file: the drawing's name.
        at: where the file's zero lies in the arm's base frame, x y z [mm] or with roll pitch yaw [deg]; the tool points
            against the drawing's z.
        task: what the path's targets prescribe; by default the arm's own task.
        scale: [1] factor of the file's lengths.
        feed: [mm/s] speed of the tool where the file has none; None: as fast as the joints allow.
        lift: [mm] height of the pen between strokes of an SVG.
        grip_by: the words that close and open the gripper, "M3" or "M106".

    Returns:
        The moves, in mm and degrees as a path file has them; what was left out of the file is in `notes`.

    Raises:
        FileError: the file cannot be read.
        PathFileError: it is not valid; the message has line and word.
        UsageError: its name has another ending, `at` has not 3 or 6 numbers, or the task cannot hold the tool so.

    >>> import armkin
    >>> layer = drawing(armkin.load("three_dof"), "examples/drawing.svg", [320, -50, 200], feed=60)
    >>> layer.moves[0].point
    [324.0, -44.0, 205.0]
    """
    name = os.fspath(file)
    if drawing_language(name) is None:
        raise UsageError(f"{name}: a drawing's name ends in .gcode, .gco, .nc, .ngc or .svg")
    if len(at) not in (3, 6):
        raise UsageError(f"at: where the drawing's zero lies is x y z, or x y z roll pitch yaw; got {len(at)} numbers")
    return read_drawing(name, place_drawing(arm, at, task=task, scale=scale), DrawingOptions(feed, lift, grip_by))
