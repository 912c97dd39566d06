"""What a class of arms provides to be solved, and which class an arm belongs to.

A new geometry is one new file with a function ``recognise(arm, task) -> Geometry | None``
and a line in `_CLASSES`, the most special class first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.errors import UsageError
from armkin.ik.subproblems import Candidates, Prefer
from armkin.ik.tasks import Task, default_task, rank, task_for
from armkin.soa import Array, Entry

if TYPE_CHECKING:
    from armkin.arm import Arm

EXACT = 1e-12  # axes parallel [rad] or meeting [of the reach] to this count as exactly so
NEAR = 1e-3  # and to this as nearly so: `armkin.ik.near`

# Modules of `armkin.ik`, in the order in which they are asked.
_CLASSES = ("planar", "elbow", "position", "spherical", "three_parallel", "near", "axis", "general")


@dataclass(frozen=True, eq=False)
class Geometry:
    """A solver for one arm and task.

    Closed forms set `pairs`: called with the target's entries (the columns of the targets,
    or a `soa.Pose`) and the preferred motions of free joints, it returns `Candidates`. It is made of numpy's
    elementwise functions alone, so that `armkin.straight` can record it. Others set `rows`: called with
    targets (N, m) or (N, 4, 4) it returns q (N, B, n), nan past the last branch, and doubt.
    """

    name: str
    why: str
    complete: bool
    pairs: Callable[[list[Entry], Prefer], Candidates] | None = None
    rows: Callable[[Array], tuple[Array, NDArray[np.bool_]]] | None = None
    labels: tuple[str, ...] = ()  # what the branch axes mean: ("shoulder", "elbow", "wrist")
    ordered: bool = True  # a branch keeps its index along a path; otherwise `armkin.ik.tracking` sees to it
    branches: int | None = None  # of `rows`: columns that the labels name; what follows is numbered


@lru_cache(maxsize=64)
def solver(arm: Arm, task_name: str | None) -> tuple[Task, Geometry]:
    """The task and the solver for an arm, prepared once.

    Raises UsageError if the task does not fit the arm.
    """
    task = task_for(arm, task_name)
    if arm.n > task.constraints:
        surplus = arm.n - task.constraints
        raise UsageError(
            f"{arm.name}: {arm.n} joints for the {task.constraints} constraints of task {task.name} leave "
            f"{surplus} degree{'s' if surplus > 1 else ''} of freedom: fix {surplus} of "
            f"{', '.join(arm.joint_names)} with --lock JOINT=VALUE, or try values with --sweep JOINT=LOW:HIGH:COUNT"
        )
    effective = rank(arm, task, 1e-9)
    if effective < arm.n:  # a self-motion at every target: no list of isolated branches could be complete
        usual = default_task(arm)
        fix = f"fix {arm.n - effective} of {', '.join(arm.joint_names)} with --lock JOINT=VALUE"
        way_out = fix if usual in (None, task.name) else f"its usual task is {usual}"
        raise UsageError(
            f"{arm.name}: task {task.name} has {task.constraints} constraints, of which its {arm.n} joints can meet "
            f"{effective} at a time:\nthere would be infinitely many solutions or none; {way_out}"
        )
    for name in _CLASSES:
        module: Any = import_module(f"armkin.ik.{name}")
        geometry: Geometry | None = module.recognise(arm, task)
        if geometry is not None:
            return task, geometry
    usual = default_task(arm)
    hint = f"; its usual task is {usual}" if usual and usual != task.name else ""
    locked = arm.file is not None and len(arm.file.joints) > arm.n
    joints = f"the {arm.n} joints left after --lock" if locked else f"its {arm.n} joints"
    raise UsageError(f"{arm.name}: task {task.name} does not fit {joints}{hint}")


def method(arm: Arm, task: str | None = None) -> tuple[str, str, bool]:
    """Solver class of an arm, why it applies, and whether it guarantees all branches."""
    geometry = solver(arm, task)[1]
    return geometry.name, geometry.why, geometry.complete
