"""The arm's solver for the browser itself: its module, and the words that go with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from armkin.errors import UsageError
from armkin.inverse.solvers.recognise import solver
from armkin.inverse.solvers.redundancy import redundancy
from armkin.model import units
from armkin.model.arm import actual_arm
from armkin.model.target_numbers import label_units
from armkin.motors import pulse_range

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def solver_json(arm: Arm, task_name: str | None = None) -> dict[str, Any]:
    """What a page must know of the module: the task, its numbers' names and units, how far the motors go."""
    spare = redundancy(actual_arm(arm), task_name)
    task = spare.task if spare else solver(actual_arm(arm), task_name)[0]
    return {
        "robot": Path(arm.path).stem if arm.path else arm.name,
        "task": task.name,
        "labels": list(task.labels),
        "units": label_units(task.labels),
        "held": arm.joint_names[spare.joint] if spare else "",
        "pulse_range": [[units.finite_or_none(end) for end in pair] for pair in pulse_range(arm).tolist()],
    }


def solver_fields(arm: Arm) -> dict[str, Any]:
    """The module's text and `about`; none where the arm has no module."""
    from armkin.export.js.es_module import module_text  # only pages that are open need it

    try:
        return {"module": module_text(arm), "about": solver_json(arm)}
    except UsageError:
        return {"module": None, "about": None}
