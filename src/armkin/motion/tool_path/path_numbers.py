"""Converts the numbers of a path file, in millimetres and degrees, to joint values and targets."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.inverse.tasks.choose_task import task_for
from armkin.model import units
from armkin.model.rotation import rpy
from armkin.model.target_numbers import label_scale, targets_in
from armkin.motion.tool_path.path_pieces import Spot, split_target

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile

OF_JOINTS = ("joint", "wait", "grip")  # moves that need no targets


def as_path_file(arm: Arm, path: Any, task: str | None = None) -> PathFile:
    """The path file model of any argument that `armkin.path` accepts."""
    from armkin import path_file

    if isinstance(path, path_file.PathFile):
        return path
    if isinstance(path, str | os.PathLike):
        return path_file.read_path_file(os.fspath(path))
    if isinstance(path, Mapping):
        return path_file.validate_path(dict(path))
    definition = task_for(arm, task)
    rows = np.asarray(path, dtype=float)
    if definition.orientation == "full" and rows.ndim == 3:
        rows = np.concatenate([rows[:, :3, 3], units.angles_out(rpy(rows[:, :3, :3]))], axis=1)
    elif rows.ndim == 2:
        rows = rows / np.array(label_scale(definition.labels))[: rows.shape[-1]]
    if rows.ndim != 2 or len(rows) < 2 or not np.isfinite(rows).all():
        raise UsageError(f"a path of targets has shape (w, {len(definition.labels)}), w at least 2, all finite")
    moves = [{"point": rows[0].tolist()}, *({"line": row} for row in rows[1:].tolist())]
    return path_file.validate_path({"moves": moves, "task": definition.name})


def moves_tool(file: PathFile) -> bool:
    """Whether a path has targets of the tool, and not joint values alone."""
    start = file.start
    point = start is not None and not isinstance(start, str) and start.joints is None
    return point or any(move.kind not in OF_JOINTS for move in file.moves)


def joint_values(arm: Arm, present: Array, value: Any) -> Array:
    """Joint values (n,) [rad | mm]: a list, a pose's name, or {name: value}, the others as at present."""
    if isinstance(value, str):
        if value not in arm.poses:
            raise UsageError(f"there is no pose '{value}'; {arm.name} has {', '.join(arm.poses)}")
        return np.asarray(arm.poses[value])
    if isinstance(value, Mapping):
        unknown = [name for name in value if name not in arm.joint_names]
        if unknown:
            raise UsageError(f"there is no joint {unknown[0]}; {arm.name} has {', '.join(arm.joint_names)}")
        present_values = units.joints_out(arm, present).tolist()
        value = [
            value.get(name, present_value) for name, present_value in zip(arm.joint_names, present_values, strict=True)
        ]
    if len(value) != arm.n:
        raise UsageError(f"{arm.name} has {arm.n} joints ({', '.join(arm.joint_names)}); got {len(value)} values")
    return np.asarray(units.joints_in(arm, value))


def target_spot(task: Task, last_spot: Spot, value: Sequence[float]) -> Spot:
    """The spot of a target's numbers; a position alone keeps the last sums and orientation."""
    labels = task.labels
    if len(value) == task.position < len(labels):
        return replace(last_spot, position=np.asarray(value, dtype=float))
    if len(value) != len(labels):
        alternative = f", or {' '.join(labels[: task.position])} alone" if len(labels) > task.position else ""
        raise UsageError(f"a target of task {task.name} is {' '.join(labels)}{alternative}; got {len(value)} numbers")
    if task.orientation == "axis" and not np.linalg.norm(value[-3:]) > 1e-9:
        raise UsageError("a target's axis ax ay az has no length")
    [target] = targets_in(labels, [value])
    return split_target(task, target)


def check_numbers(arm: Arm, file: PathFile) -> None:
    """Raise UsageError where a move has too few or too many numbers for the arm; reach is not tested."""
    task = None
    for number, move in enumerate(file.moves):
        kind = move.kind
        try:
            value = getattr(move, kind)
            if kind == "joint":
                joint_values(arm, arm.home, value)
            elif kind == "grip":
                check_grip(arm, value)
            elif kind != "wait":
                task = task or task_for(arm, file.task)
                _check_targets(task, kind, value)
        except UsageError as error:
            raise error.within(file.place_of(number, number), move=number + 1) from None


def _check_targets(task: Task, kind: str, value: Any) -> None:
    start = split_target(task, np.zeros(len(task.labels)))
    targets = {"point": [value], "line": [value], "polyline": value, "spline": value}
    places = {"arc": ("via",), "circle": ("centre", "normal"), "offset": ("xyz",)}
    for numbers in targets.get(kind, [value.to] if kind == "arc" else []):
        target_spot(task, start, numbers)
    for name in places.get(kind, ()):
        coordinates(task, getattr(value, name))


def coordinates(task: Task, value: Sequence[float]) -> Array:
    """A position or a direction, with as many coordinates as the task has."""
    if len(value) < task.position:
        raise UsageError(f"x y z are needed; got {len(value)} numbers")
    return np.asarray(value[: task.position], dtype=float)


def check_grip(arm: Arm, value: str | float) -> None:
    """Raise UsageError for an arm without a gripper, and for a value beyond open and closed of its robot file."""
    if arm.gripper is None:
        raise UsageError(f"grip: {arm.name} has no gripper; add gripper: to its robot file")
    if not isinstance(value, str):
        arm.gripper.check_value(value)
