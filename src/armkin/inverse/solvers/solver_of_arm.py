"""Which class an arm belongs to.

A new geometry is one new file with a function ``recognise(arm, task) -> Geometry | None``
and a line in `_CLASSES`, the most special class first.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from armkin.errors import UsageError
from armkin.inverse.closed import anywhere, elbow, planar, spherical, three_joints, three_parallel
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.solvers import general, nearly_special, tool_axis
from armkin.inverse.tasks.choose_task import default_task, rank, redundant_error, task_for
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm, actual_arm


@lru_cache(maxsize=256)
def solver(arm: Arm, task_name: str | None) -> tuple[Task, Geometry]:
    """The task and the solver for an arm, prepared once.

    Raises UsageError if the task does not fit the arm.
    """
    task = task_for(arm, task_name)
    if task_name is None:  # the geometry of the task by its name is this one, prepared once
        return solver(arm, task.name)
    if arm.n > task.constraints:
        surplus = arm.n - task.constraints
        left = f"leave {surplus} degree{'s' if surplus > 1 else ''} of freedom"
        problem = f"{arm.name}: {arm.n} joints for the {task.constraints} constraints of task {task.name} {left}"
        raise redundant_error(arm, surplus, problem)
    effective = rank(arm, task, tol.RANK_VALUE)
    if effective < arm.n:  # a self-motion at every target: no list of isolated branches could be complete
        default = default_task(arm)
        problem = (
            f"{arm.name}: task {task.name} has {task.constraints} constraints, of which its {arm.n} joints can meet "
            f"{effective} at a time:\nthere would be infinitely many solutions or none"
        )
        if default in (None, task.name):
            raise redundant_error(arm, arm.n - effective, problem)
        raise UsageError(f"{problem}; its usual task is {default}", robot=arm.name, task=task.name, usual_task=default)
    for recognise in _CLASSES:
        geometry = recognise(arm, task)
        if geometry is not None:
            return task, geometry
    default = default_task(arm)
    hint = f"; its usual task is {default}" if default and default != task.name else ""
    joints = f"the {arm.n} joints that are not held" if arm.held else f"its {arm.n} joints"
    hint = hint or ("; hold fewer joints" if arm.held else "")
    raise UsageError(f"{arm.name}: task {task.name} does not fit {joints}{hint}", robot=arm.name, task=task.name)


def method(arm: Arm, task: str | None = None) -> tuple[str, str, bool]:
    """Solver class of an arm, why it applies, and whether it guarantees all branches.

    Args:
        arm: the arm, as `armkin.load` gives it.
        task: what targets prescribe; by default the arm's own task.

    Returns:
        The class's name, the reason in words, and True if every isolated branch is guaranteed to be found.

    Raises:
        UsageError: the task does not fit the arm, or leaves it a redundant joint (RedundantArmError).

    >>> import armkin
    >>> armkin.method(armkin.load("three_dof"))
    ('elbow', 'joints 2 and 3 are parallel', True)
    """
    geometry = solver(actual_arm(arm), task)[1]
    return geometry.name, geometry.why, geometry.complete


_CLASSES: tuple[Callable[[Arm, Task], Geometry | None], ...] = (
    planar.recognise,
    elbow.recognise,
    three_joints.recognise,
    spherical.recognise,
    three_parallel.recognise,
    anywhere.recognise,
    nearly_special.recognise,
    # the class of the arm with a virtual sixth joint is asked of the same list
    lambda arm, task: tool_axis.recognise(arm, task, lambda six: solver(six, "pose")[1]),
    general.recognise,
)
