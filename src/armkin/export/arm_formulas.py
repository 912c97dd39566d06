"""Recorded formulas of an arm for C and JavaScript: candidates and targets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin import forward
from armkin.formula import arrays, recording
from armkin.inverse.closed.candidates import Recorded
from armkin.inverse.closed.subproblems import Pair

if TYPE_CHECKING:
    from armkin.formula.c_and_js_code import Code
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def goal_size(task: Task) -> int:
    """Number of inputs of the formulas for a target."""
    return 12 if task.orientation == "full" else len(task.labels)


def record_candidates(
    arm: Arm, task: Task, geometry: Geometry, prefer: bool = True, measured: bool = False
) -> recording.Recording:
    """Candidates of a closed form: joint values, squared residuals, doubt.

    With `measured`, the residuals of lengths and of angles precede the doubt. Inputs are the numbers of the target and,
    with `prefer`, the value of each joint if it is free, as cosine and sine, or as length for a slide. Without
    `prefer`, the last output tells whether a joint is free.
    """
    recorded, n, entries = Recorded(arm, task, geometry), arm.n, goal_size(task)

    def formula(inputs: list[Any]) -> list[Any]:
        held: list[Pair | None] = [None] * n
        if prefer:
            index = entries
            for j in range(n):
                held[j] = Pair(inputs[index], None) if arm.prismatic[j] else Pair(inputs[index], inputs[index + 1])
                index += 1 if arm.prismatic[j] else 2
        recorded_formula = recorded.measured if measured else recorded.candidates
        outputs = recorded_formula(inputs[:entries], held)
        return outputs[:-1] if prefer else outputs

    free_numbers = 2 * n - int(arm.prismatic.sum())
    return recording.record(formula, entries + (free_numbers if prefer else 0))


def record_target(arm: Arm, task: Task) -> recording.Recording:
    """The target that joint values reach, as given by users: a pose row by row, or the numbers of the task."""

    def formula(q: list[Any]) -> list[Any]:
        T = forward.tip_formula(arm, q)
        if task.orientation == "full":
            return T
        goal = [T[4 * k + 3] for k in range(task.position)]
        for row, offset in zip(task.sums * arm.ratio, task.offsets, strict=True):
            goal.append(arrays.add(arrays.dot([float(weight) for weight in row], q), float(offset)))
        return goal + ([T[2], T[6], T[10]] if task.orientation == "axis" else [])

    return recording.record(formula, arm.n)


def by_branch(recorded: recording.Recording, code: Code) -> list[list[str]]:
    """The expressions of every output, one for each branch of all branch axes."""
    shape = np.broadcast_shapes((1, 1, 1), *(recording.axes_of(x) for x in recorded.outputs))
    return [_spread_over_branches(x, texts, shape) for x, texts in zip(recorded.outputs, code.outputs, strict=True)]


def _spread_over_branches(node: Any, texts: list[str], shape: tuple[int, ...]) -> list[str]:
    """The expressions of an output for each branch of all branch axes."""
    index = np.arange(len(texts)).reshape(recording.axes_of(node) or (1,))
    return [texts[k] for k in np.broadcast_to(index, shape).ravel()]
