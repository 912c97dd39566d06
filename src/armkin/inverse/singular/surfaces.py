"""Self-motions of two dimensions that two joints about one line sweep: as many as curves of the others.

Where two joints turn about one line and all joints between them rest (an elbow that is folded or stretched), their
common motion keeps the target wherever the others are. So a surface of postures is a circle times a curve: with the
second of the two held it is that curve, and each curve of the arm of the others is a surface of its own.
"""

from __future__ import annotations

import itertools

import numpy as np

from armkin.formula.array_tuples import widened
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import OWN, Examined, Goals, Seeds
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.components import examine
from armkin.model.arm import Arm
from armkin.model.lock_joints import lock

Pair = tuple[int, int, float]  # joints about one line, and the way of the first for a turn of the second


def swept(goals: Goals, seen: Examined) -> Examined:
    """The same, surfaces listed by the curves that they are swept from."""
    if goals.task.orientation == "none":  # sums of joint values are those of all joints
        return seen
    for k in np.flatnonzero(seen.surface):
        seen = _with_curves(goals, seen, k)
    return seen


def no_more(target: Array, near: Array, lost: Bool) -> tuple[Array, Int, Bool]:
    """Further candidates: none, those that were found are all."""
    return np.full((len(near), 1, near.shape[1]), np.nan), np.zeros(1, np.int64), np.zeros(len(near), bool)


def _with_curves(goals: Goals, seen: Examined, k: np.intp) -> Examined:
    """The same, with a posture of each curve in place of those on surfaces of target k.

    Where three joints are about one line, the two of them that sweep the most surfaces tell.
    """
    arm, one = goals.arm, goals.of(np.array([k]))
    q, label = seen.q[k, seen.valid[k]], seen.label[k, seen.valid[k]]
    at, rest = _jacobians(one, q)
    found = [_curves(one, q[on], label[on], pair) for pair, on in _pairs(arm, at, rest)]
    if not found:
        return seen
    rows, names, free, pair = max(found, key=lambda curves: len(curves[0]))
    if not len(rows):
        return seen
    on = _about_one_line(at, pair)
    rows, names = np.concatenate([q[~on], rows]), np.append(label[~on], names)
    q, valid, label = (widened(array, len(rows)) for array in (seen.q, seen.valid, seen.label))
    out = seen._replace(q=q, valid=valid, label=label, free=seen.free.copy())
    there = np.arange(out.q.shape[1]) < len(rows)
    out.q[k], out.valid[k], out.label[k] = np.nan, there, OWN
    out.q[k, there], out.label[k, there] = rows, names
    out.free[k] |= free
    return out


def _curves(goals: Goals, q: Array, label: Int, pair: Pair) -> tuple[Array, Int, Bool, Pair]:
    """The curves that postures q (M, n) of one target lie on, and all others, with the second joint of a pair held: a
    posture of each, its label, and the joints that move (n,) besides the surfaces' others."""
    arm, task, target, [near] = goals
    i, j, way = pair
    turned = q.copy()
    turned[:, i] += way * (turned[:, j] - near[j])
    others = np.delete(np.arange(arm.n), j)
    rest = lock(arm, {arm.joint_names[j]: float(near[j])})
    starts = newton.many_starts(rest, task, target, np.ones(1, bool))[0]
    starts = starts[~np.isnan(starts[:, 0])]
    marks = np.concatenate([label, np.full(len(starts), OWN)])
    seeds = Seeds.of(np.concatenate([turned[:, others], starts])[None], marks[None])
    found = examine(Goals(rest, task, target, near[None, others]), seeds, no_more)
    there = found.valid[0]
    rows, free = np.insert(found.q[0, there], j, near[j], axis=1), np.insert(found.free[0], j, True)
    free[i] = True
    on = _about_one_line(_jacobians(goals, rows)[0], pair)
    return rows[on], found.label[0, there][on], free, pair


def _jacobians(goals: Goals, q: Array) -> tuple[Array, Bool]:
    """Jacobians of postures (M, n) of one target, and the joints (M, n) that rest where several directions are lost."""
    arm, task, target, _ = goals
    _, J = newton.scaled(arm, task, q, np.repeat(target, len(q), axis=0))
    S, V = np.linalg.svd(J)[1:]
    lost = arm.n - (S > tol.FOLDED).sum(axis=1)
    null = np.arange(arm.n) >= arm.n - lost[:, None]
    moves = (np.where(null[:, :, None], np.abs(V), 0.0) > tol.FOLDED).any(axis=1)
    return J, np.asarray(~moves & (lost > 1)[:, None])


def _about_one_line(J: Array, pair: Pair) -> Bool:
    """Of which Jacobians (M, r, n) the columns of two joints are equal or opposite: (M,).

    Where an elbow is stretched they are known to the root of rounding.
    """
    i, j, way = pair
    return np.asarray(np.abs(J[:, :, j] - way * J[:, :, i]).max(axis=1) < tol.FOLDED)


def _pairs(arm: Arm, J: Array, rests: Bool) -> list[tuple[Pair, Bool]]:
    """Pairs of joints that are about one line in some posture in which those between them rest; all postures (M,) in
    which they are about one.
    """
    out = []
    for i, j in itertools.combinations(np.flatnonzero(~arm.prismatic).tolist(), 2):
        for way in (1.0, -1.0):
            on = _about_one_line(J, (i, j, way))
            if (on & rests[:, i + 1 : j].all(axis=1)).any():
                out.append(((i, j, way), on))
    return out
