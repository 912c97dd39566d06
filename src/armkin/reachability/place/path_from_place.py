"""Plans a path for an arm at its best places.

The path planner is imported by the functions that plan: its 48 modules take 0.03 s, and targets need none of them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin import path_file
from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.motion.joint_moves import check_rates
from armkin.reachability.place.arm_among_obstacles import Obstacles, arm_at_place

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan
    from armkin.path_file import PathFile

STEP = 0.01  # distance between targets along a path, as a share of the arm's reach


@dataclass(frozen=True)
class PathFromPlace:
    """A place from which a path was planned. index: in the arrays of `Place`; plan: None if it was refused."""

    index: tuple[int, int, int]
    plan: PathPlan | None = field(repr=False)
    refused: str = ""


def path_of(targets: Any) -> PathFile | None:
    """The path of a file name, a model or its data; None for an array of targets."""
    if isinstance(targets, str | os.PathLike):
        name = os.fspath(targets)
        if Path(name).suffix.lower() not in (".yaml", ".yml"):
            raise UsageError(f"{name}: a path to place an arm for is a .yaml file; targets are given as an array")

        return path_file.read_path_file(name)
    if isinstance(targets, Mapping):
        return path_file.validate_path(dict(targets))
    return targets if hasattr(targets, "moves") else None


def ways_of_path(arm: Arm, file: PathFile) -> tuple[Task, list[Array]]:
    """The task, and the targets of each part of the path that one branch has to follow."""
    from armkin.motion.path_planner.path_outline import route_targets

    task, routes = route_targets(arm, file, STEP * arm.reach)
    return task, [np.asarray(route) for route in routes]


def joint_to_hold(arm: Arm, file: PathFile) -> tuple[str, tuple[float, ...]]:
    """The redundant joint that a plan holds, and its possible values [rad], as in `armkin.path`; "" without one."""
    from armkin.motion.path_planner.choose_held_value import values_to_hold

    redundant = redundancy(arm, file.task)
    return ("", ()) if redundant is None else (arm.joint_names[redundant.joint], values_to_hold(arm, file, redundant))


def missing_rates_text(arm: Arm) -> str:
    """The reason why no path can be planned, joint rates missing in the file; "" if there is none."""
    try:
        check_rates(arm)
    except UsageError as error:
        return str(error)
    return ""


def plan_from_place(
    arm: Arm,
    obstacles: Obstacles,
    index: tuple[int, int, int],
    position: tuple[float, float, float],
    turn: float,
    file: PathFile,
) -> PathFromPlace:
    """The plan of the path from a place, or the reason for none."""
    from armkin.motion.path_planner.path import path

    any_robot_file = file.model_copy(update={"robot": None})  # the path may name another robot
    try:
        return PathFromPlace(index, path(arm_at_place(arm, obstacles, position, turn), any_robot_file))
    except NoSolutionError as error:
        return PathFromPlace(index, None, str(error).splitlines()[0])
