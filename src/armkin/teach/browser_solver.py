"""The arm's solver as a JavaScript module for the browser, and the labels that belong to it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from armkin.errors import UsageError
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model import units
from armkin.model.arm import actual_arm
from armkin.model.target_numbers import label_units
from armkin.motors import pulse_range

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def solver_json(arm: Arm, task_name: str | None = None) -> dict[str, Any]:
    """The data of a page about the module: the task, names and units of its numbers, ranges of the motors."""
    redundant = redundancy(actual_arm(arm), task_name)
    task = redundant.task if redundant else solver(actual_arm(arm), task_name)[0]
    return {
        "robot": Path(arm.path).stem if arm.path else arm.name,
        "task": task.name,
        "labels": list(task.labels),
        "units": label_units(task.labels),
        "held": arm.joint_names[redundant.joint] if redundant else "",
        "pulse_range": [[units.finite_or_none(end) for end in pair] for pair in pulse_range(arm).tolist()],
    }


def solver_fields(arm: Arm) -> dict[str, Any]:
    """The module's text and its `about` data; None for both if the arm has no module."""
    from armkin.export.js.es_module import module_text  # imported late, as only open pages need it

    try:
        return {"module": module_text(arm), "about": solver_json(arm)}
    except UsageError:
        return {"module": None, "about": None}
