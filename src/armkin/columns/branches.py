"""Targets to the columns of `ik`: one row a target with its best branch, or one a branch.

What `armkin.inverse.choose` answers target by target, on arrays; only branches that are listed get their residual.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.columns.table import Table, Words
from armkin.forward import fk
from armkin.inverse import choose
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.names import find
from armkin.inverse.numeric.tolerances import EQUAL
from armkin.inverse.tasks.residuals import residual
from armkin.model import limits, units
from armkin.model.lock import unlock

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool

_STATUS = tuple(status.name.lower() for status in Status)


class Listed(NamedTuple):
    """Columns of the branches of some targets, and which targets have no best branch (N,)."""

    table: Table
    unsolved: Bool


def columns(request: choose.Request, targets: Array, rows: NDArray[np.integer], every: bool, **more: Any) -> Listed:
    """The columns of ik: targets (N, ...) [mm, rad], rows (N,) their numbers; every: all branches, not the best alone.

    more: of `armkin.ik`. The request sweeps no joint.
    """
    arm, near = request.arm, units.joints_in(request.arm, request.near_out)
    kept = [i for i, name in enumerate(arm.joint_names) if name not in request.held]
    s = request.ik(choose.locked(request), targets, request.task, near=near[kept], **more)
    q, within = s.q, s.within_limits
    if request.held:
        values = units.joints_in(arm, [request.held.get(name, 0.0) for name in arm.joint_names])
        q = unlock(arm, {name: values[arm.joint_names.index(name)] for name in request.held}, s.q)
        within = within & ~limits.outside(arm, q).any(axis=-1)
    motion = _sum(units.joints_out(arm, np.abs(q - near)))
    key = np.where(s.valid, motion.round(EQUAL), np.inf)
    free = within & s.clear if arm.keep_out else within
    wanted = free if request.branch is None else free & np.isin(s.branch, find(s.names, request.branch))
    unsolved = np.asarray(~wanted.any(axis=1))
    if every:
        count = s.valid.sum(axis=1)
        lines = np.maximum(count, 1)
        target = np.repeat(np.arange(len(lines)), lines)
        there = np.repeat(count > 0, lines)
        place = np.arange(len(target)) - np.repeat(np.cumsum(lines) - lines, lines)
        rank = np.lexsort((key, within & ~free, ~within, ~s.valid), axis=-1)  # equal ones as found
        branch = rank[target[there], place[there]]
    else:
        target, there = np.arange(len(unsolved)), ~unsolved
        branch = np.where(wanted, key, np.inf)[there].argmin(axis=1) if there.any() else np.zeros(0, int)
    chosen = target[there], branch
    table = _table(request, s, rows[target], target, there, q[chosen], within[chosen], motion[chosen], chosen)
    return Listed(table, unsolved)


def _sum(values: Array) -> Array:
    """``values.sum(axis=-1)``, to the same bits: numpy adds up to seven numbers from left to right, but slowly."""
    if values.shape[-1] > 7:
        return np.asarray(values.sum(axis=-1))
    total = values[..., 0].copy()
    for i in range(1, values.shape[-1]):
        total += values[..., i]
    return total


def _table(
    request: choose.Request,
    s: Solutions,
    rows: NDArray[np.integer],
    target: NDArray[np.intp],
    there: Bool,
    q: Array,
    within: Bool,
    motion: Array,
    chosen: tuple[NDArray[np.intp], NDArray[np.intp]],
) -> Table:
    """One line for each of `target`, with numbers where a branch is `there`."""
    mm, rad = _missed(s, *chosen)
    names = tuple(name.replace(",", "") for name in s.names)  # so that `cut` sees one column
    label = np.full(len(target), -1)
    label[there] = s.branch[chosen]
    table: Table = {"row": rows, "status": Words(s.status[target], _STATUS), "branch": Words(label, names)}
    joints = units.joints_out(request.arm, q)
    for i, name in enumerate(request.arm.joint_names):
        table[name] = _spread(joints[:, i], there)
    legal = np.zeros(len(target), bool)
    legal[there] = within
    table["within_limits"] = legal
    table["residual_mm"], table["residual_deg"] = _spread(mm, there), _spread(units.angles_out(rad), there)
    table["motion"] = _spread(motion, there)
    return table


def _missed(s: Solutions, target: NDArray[np.intp], branch: NDArray[np.intp]) -> tuple[Array, Array]:
    """What some branches miss: (K,) [mm] and (K,) [rad]."""
    q = s.q[target, branch]
    missing = residual(s.task, fk(s.arm, q), q, s.target[target])
    p = s.task.position
    return np.linalg.norm(missing[:, :p], axis=1), np.linalg.norm(missing[:, p:], axis=1)


def _spread(values: Array, there: Bool) -> Array:
    """Values where they are `there`, nan elsewhere."""
    out = np.full(len(there), np.nan)
    out[there] = values
    return out
