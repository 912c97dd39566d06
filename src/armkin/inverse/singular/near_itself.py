"""If `near` already solves the target within limits, it is returned unchanged, as the best branch.

The exact answer to a rounded target may be 1e-9 over the smallest singular value away from the posture that the target
was made from. Both solve it: the arm that stands there stays.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.array_tuples import stacked
from armkin.formula.arrays import Array, Int
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, empty, named
from armkin.inverse.answers.solutions import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.high_order_roots import BESIDE
from armkin.inverse.singular.self_motions import follow
from armkin.inverse.tasks.task import Task
from armkin.model import limits
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

AT_ONCE = 4096  # targets whose branches are compared with `near` together
ROOM = 2.0 * tol.SOLUTION  # [reaches] from the tool to a target that `near` might solve: twice, for rounding
COARSE = 1e4 * ROOM  # and to a pose that is rounded where its rotation does not show it, to six digits
ROUNDED = 1.001 * tol.SOLUTION  # residual that solves a rounded target, if it is more


def reached(
    arm: Arm, task: Task, target: Array, tip: Array, first: Array | None = None, room: Array | None = None
) -> Int:
    """Which targets (N, m) or (N, 4, 4) are where the tool is at `near`.

    tip: (3,) or (N, 3), its `position`; first: (N,) the targets' first coordinate, where it stands alone; room: (N,)
    how far off they may be [reaches], by default `ROOM`.
    """
    point = target[:, :3, 3] if task.orientation == "full" else target[:, : task.position]
    most = ROOM * arm.reach if room is None else room * arm.reach
    x = point[:, 0] if first is None else first
    rows = np.flatnonzero(np.abs(x - tip[..., 0]) <= most)  # one coordinate tells nearly all others
    if len(rows):
        away = np.abs(point[rows] - (tip if tip.ndim == 1 else tip[rows])[..., : task.position])
        rows = rows[away.max(axis=1) <= (most if isinstance(most, float) else most[rows])]
    return rows


def take(goals: Goals, out: Batch, rows: Int) -> Int:
    """Put `near` in place of the branch that it is one with; returns the targets that have to be examined.

    goals, out: N targets and their branches; rows: those of `reached`. Two are one if the posture between them solves
    the target, too. Where there is no such branch, or another one close by, `near` still solves the target.
    """
    left = [_taken(goals, out, rows[start : start + AT_ONCE]) for start in range(0, len(rows), AT_ONCE)]
    return np.concatenate(left) if left else rows


def _taken(goals: Goals, out: Batch, rows: Int) -> Int:
    arm, task = goals.arm, goals.task
    rows = rows[~limits.outside(arm, goals.near[rows]).any(axis=1)]
    if not len(rows):
        return rows
    near, target = goals.near[rows], goals.target[rows]
    if not out.valid.shape[1]:  # an elimination that found nothing at all
        return np.asarray(rows[newton.missing(arm, task, near, target) <= tol.SOLUTION])
    away = newton.wrapped_distance(arm, out.q[rows], near[:, None])
    away = np.where(out.valid[rows], away, np.inf)
    place = away.argmin(axis=1)
    least = away.min(axis=1)
    stays, solves = least <= tol.THERE, np.ones(len(rows), bool)
    some = np.flatnonzero(~stays)
    if len(some):
        solves[some] = newton.missing(arm, task, near[some], target[some]) <= tol.SOLUTION
        some = some[solves[some] & ((away[some] < tol.CLOSE_BY).sum(axis=1) == 1)]
        way = newton.difference(arm, out.q[rows[some], place[some]], near[some])
        between = near[some] + 0.5 * way * radian_or_reach(arm)
        stays[some] = newton.missing(arm, task, between, target[some]) <= tol.SOLUTION
    out.q[rows[stays], place[stays]] = near[stays]
    out.within[rows[stays], place[stays]] = True
    return np.asarray(rows[solves & ~stays])


def standing(arm: Arm, task: Task, target: Array, near: Array, most: Array) -> Int:
    """Which targets (N, ...) are solved by `near` (n,) or (N, n), within limits, to within most (N,) [reaches, rad].

    Of those that are known better than to `SOLUTION` there are none: of these `take` has decided.
    """
    known = most > ROUNDED
    if not known.any():
        return np.flatnonzero(known)
    close = np.broadcast_to(near, (len(target), arm.n))
    rows = reached(arm, task, target, position(arm, near), room=np.where(known, most, -1.0))
    rows = rows[~limits.outside(arm, close[rows]).any(axis=1)]
    return np.asarray(rows[newton.missing(arm, task, close[rows], target[rows]) <= most[rows]])


def stand(goals: Goals, out: Batch, most: Array) -> Batch:
    """The same branches, with `near` among them where it solves a rounded target: see `standing`.

    In place of the branch that it is one with to within the rounding; else beside the others. Where there are no
    others, the target is a boundary.
    """
    arm, task, target, near = goals
    rows = standing(arm, task, target, near, most)
    if not len(rows):
        return out
    way = newton.difference(arm, out.q[rows], near[rows, None])
    away = np.where(out.valid[rows], np.abs(way).max(axis=2), np.inf)
    away = np.pad(away, ((0, 0), (0, 1)), constant_values=np.inf)
    one, nearest = away <= tol.THERE, away == away.min(axis=1, keepdims=True)
    for some, steps in (nearest, 0), (away < np.inf, 0), (away < np.inf, 6):  # in the last the component may bend
        k, b = np.nonzero(some & (away < np.inf) & ~one.any(axis=1, keepdims=True))
        halfway = near[rows[k]] + 0.5 * way[k, b] * radian_or_reach(arm)
        beside, size = follow(arm, task, halfway, target[rows[k]], steps)
        off = newton.wrapped_distance(arm, beside, halfway)
        one[k, b] = (size <= most[rows[k]]) & (off <= BESIDE * away[k, b])
    place, there = np.where(one, away, np.inf).argmin(axis=1), one.any(axis=1)
    count = out.valid[rows].sum(axis=1)
    place = np.where(there, place, count)
    out = stacked([out, empty(0, int(place.max()) + 1, arm.n)])
    out.q[rows, place], out.valid[rows, place], out.within[rows, place] = near[rows], True, True
    out.branch[rows] = named(out.branch[rows].astype(np.int64), out.valid[rows])
    out.status[rows[count == 0]] = Status.BOUNDARY
    return out
