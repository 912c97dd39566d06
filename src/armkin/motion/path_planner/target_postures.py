"""The postures of a target that a path may take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import find_branches
from armkin.inverse.solve import isolated_branches
from armkin.motion.tool_path import piece_shapes
from armkin.motion.tool_path.path_pieces import Spot

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def target_postures(arm: Arm, task: Task, goal: Spot, near: Array, branch: str | None) -> tuple[Array, ...]:
    """Joint values of a target on all branches within limits, or on the named one, nearest to `near` first."""
    target = piece_shapes.line(task, goal, goal).targets(np.zeros(1))[0]
    solutions = isolated_branches(arm, target, task.name, near=near)
    numbers = find_branches(solutions.names, branch) if branch else None
    clear = solutions.clear if arm.keep_out and not arm.ignores_keep_out else None
    allowed = solutions.valid & solutions.within_limits & (True if clear is None else clear)
    candidates = [row for row in solutions.order if numbers is None or solutions.branch[row] in numbers]
    postures = tuple(solutions.q[row] for row in candidates if allowed[row])
    if not postures:
        raise _no_posture(solutions, goal, branch, clear)
    return postures


def _no_posture(solutions: Solutions, goal: Spot, branch_name: str | None, clear: Bool | None) -> NoSolutionError:
    """The error of a target without a posture: out of reach, or every branch (of that name) hits or breaks a limit."""
    point = f"the point {', '.join(f'{x:g}' for x in goal.position.round(3).tolist())}"
    if solutions.status == Status.UNREACHABLE:
        return NoSolutionError(f"{point} is out of reach: nothing was moved")
    on_branch = f" on branch '{branch_name}'" if branch_name else ""
    if clear is not None and (solutions.within_limits & ~clear).any():
        return NoSolutionError(f"{point} has no solution{on_branch} that hits nothing: nothing was moved")
    return NoSolutionError(f"{point} has no solution within the limits{on_branch}: nothing was moved")
