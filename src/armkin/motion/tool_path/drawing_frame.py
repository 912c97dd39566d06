"""The frame of a drawing in the arm's base frame, and the orientation of the tool on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model import units
from armkin.model.rotation import rpy, transform
from armkin.path_file.drawing import Placing

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

_PLANE_SINE = 1e-6  # sine of the angle between the tool's axis and the arm's plane


def place_drawing(arm: Arm, origin: Sequence[float], *, task: str | None = None, scale: float = 1.0) -> Placing:
    """The frame of a drawing whose zero is `origin`: x y z [mm], or with roll pitch yaw [deg].

    The tool points against the drawing's z: its rotation is that of `origin`, then half a turn about x. Raises
    UsageError for a task that cannot prescribe this orientation.
    """
    definition = task_for(arm, task)
    if definition.position != 3:
        raise UsageError(f"a drawing has x, y and z, and task {definition.name} has no z: it cannot lift the tool")
    numbers = [float(x) for x in origin]
    angles = numbers[3:] or [0.0, 0.0, 0.0]
    R = transform((0.0, 0.0, 0.0), angles)[:3, :3]
    tool = R @ np.diag([1.0, -1.0, -1.0])
    x, y, z = ((float(row[0]), float(row[1]), float(row[2])) for row in R)
    return Placing(
        (numbers[0], numbers[1], numbers[2]), (x, y, z), _orientation_numbers(arm, definition, tool, angles[2]), scale
    )


def _orientation_numbers(arm: Arm, task: Task, tool: Array, yaw: float) -> tuple[float, ...]:
    """The numbers of a target behind x y z that give the tool this rotation."""
    values = {"yaw": yaw, "roll": 0.0}
    if task.orientation == "full":
        values |= dict(zip(("roll", "pitch", "yaw"), units.angles_out(rpy(tool)).tolist(), strict=True))
    if task.orientation == "axis":
        values |= dict(zip(("ax", "ay", "az"), tool[:, 2].tolist(), strict=True))
    if "phi" in task.labels:
        values["phi"] = _pitch_along(arm, task, tool[:, 2])
    return tuple(values[label] + 0.0 for label in task.labels[3:])


def _pitch_along(arm: Arm, task: Task, axis: Array) -> float:
    """The pitch [deg] at which the tool points along `axis` at any angle of the arm's plane."""
    up = arm.base[:3, 2]
    if np.linalg.norm(np.cross(up, axis)) > _PLANE_SINE:
        raise UsageError(
            f"task {task.name} holds the tool in the arm's plane, which turns: on a drawing it can only point along "
            "the base's z; place it without a tilt"
        )
    q = arm.home[None]
    column = task.labels.index("phi")
    weights = task.sums[column - task.position]
    phi = float(targets_of(task, fk(arm, q), q)[0, column])
    q_pitched = q.copy()
    pitch = int(np.flatnonzero(weights)[-1])
    q_pitched[0, pitch] += 0.1 / (weights[pitch] * arm.ratio[pitch])  # phi grows by 0.1
    first, second = fk(arm, q)[0, :3, 2], fk(arm, q_pitched)[0, :3, 2]
    normal = np.cross(first, second)
    if np.linalg.norm(normal) < 1e-6 or abs(float(normal @ axis)) > _PLANE_SINE * 0.1:
        raise UsageError(f"the tool of {arm.name} does not lie in the arm's plane: no pitch points it straight down")
    normal /= np.linalg.norm(normal)
    angle = float(np.arctan2(normal @ np.cross(first, axis), first @ axis))
    return float((np.rad2deg(phi + angle) + 180.0) % 360.0 - 180.0)
