"""Golden values of a generated program: postures, their poses and branches, as armkin's Python says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.c_and_js_code import number_text
from armkin.forward import fk
from armkin.inverse.numeric.newton import null_space
from armkin.inverse.solve import ik
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.tasks.task import targets_of
from armkin.model.arm import actual_arm
from armkin.model.lock_joints import lock, unlock

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

POSTURES = 8  # postures whose values are written
_CLEAR = 0.02  # singular value, lengths in reaches, from which on a posture is far from singular


def golden_test(arm: Arm, task: Task, text: str, single: bool, has_names: bool) -> str:
    """The text of a test program with its values filled in; fields that the other files share stay as they are.

    has_names: branches are numbered as Python numbers them; else their numbers are not compared (-1).
    """
    q = _postures(arm, task, POSTURES)
    T = fk(arm, q)
    target = targets_of(task, T, q * arm.ratio)
    values, valid, branch = _solve_branches(arm, task, target)
    lengths = _length_indices(task)
    fields = {
        "postures": str(len(q)),
        "golden_joints": _table_text(q, single),
        "golden_poses": _table_text(T.reshape(len(q), 16), single),
        "golden_targets": _table_text(target.reshape(len(q), -1), single),
        "golden_counts": ", ".join(map(str, valid.sum(axis=1))),
        "golden_branches": _table_text(values[valid], single),
        "golden_indices": ", ".join(str(index if has_names else -1) for index in branch[valid]),
        "rows": str(valid.sum()),
        "turns": _row_text(np.where(arm.prismatic, 0.0, arm.ratio**2), single),
        "home": _row_text(arm.home, single),
        # millimetres of a pose or a slide, and everything else
        "lengths": ", ".join("1" if k in lengths else "0" for k in range(target[0].size)),
        "length": number_text((1e-5 if single else 1e-10) * arm.reach, single),
        "angle": number_text(2e-3 if single else 1e-7, single),
    }
    for name, value in fields.items():
        text = text.replace(f"@{name}@", value)
    return text


def _solve_branches(arm: Arm, task: Task, target: Array) -> tuple[Array, Bool, NDArray[np.int8]]:
    """Branches (N, B, n), which are there and their indices (N, B), a redundant joint held at home."""
    redundant = redundancy(actual_arm(arm), task.name)
    held = {}
    if redundant is not None and not redundant.about_tool_axis:
        held = {arm.joint_names[redundant.joint]: float(arm.home[redundant.joint])}
    solutions = ik(lock(arm, held) if held else arm, target, task.name)
    return unlock(arm, held, solutions.q), solutions.valid, solutions.branch


def _length_indices(task: Task) -> tuple[int, ...]:
    """Which numbers of a target are millimetres."""
    return (3, 7, 11) if task.orientation == "full" else tuple(range(task.position))


def _postures(arm: Arm, task: Task, count: int) -> Array:
    """Random postures within limits whose branches all stand clear of singularities, or farthest from them."""
    rng = np.random.default_rng(20)
    turn = np.where(arm.prismatic, arm.reach / 4, np.pi)
    low = np.where(np.isfinite(arm.lower), np.maximum(arm.lower, -turn), -turn)
    high = np.where(np.isfinite(arm.upper), np.minimum(arm.upper, turn), turn)
    q = rng.uniform(low, high, (50 * count, arm.n))
    if redundant := redundancy(actual_arm(arm), task.name):
        q[:, redundant.joint] = arm.home[redundant.joint]
    branches, valid, _ = _solve_branches(arm, task, targets_of(task, fk(arm, q), q))
    sigma = _least_singular_values(arm, task, branches, valid)
    order = np.argsort(-np.minimum(sigma, _CLEAR), kind="stable")  # clear ones as they come, then the next best
    return q[order[sigma[order] > 0.0]][:count]


def _least_singular_values(arm: Arm, task: Task, q: Array, valid: Bool) -> Array:
    """Smallest singular value (N,) of any branch's Jacobian, branches (N, B, n); 0 without branches."""
    N, B, n = q.shape
    flat_q = np.nan_to_num(q).reshape(-1, n)
    target = targets_of(task, fk(arm, flat_q), flat_q)
    sigma = null_space(arm, task, flat_q, target)[0].reshape(N, B)
    return np.where(valid.any(axis=1), np.where(valid, sigma, np.inf).min(axis=1), 0.0)


def _table_text(values: Array, single: bool) -> str:
    """Rows (N, k) as initialisers of C, a line a row."""
    return ",\n    ".join(f"{{{_row_text(row, single)}}}" for row in values)


def _row_text(values: Array, single: bool) -> str:
    """Numbers (k,) as C99, between commas."""
    return ", ".join(number_text(float(value), single) for value in values)
