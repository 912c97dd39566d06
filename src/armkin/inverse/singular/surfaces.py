"""Self-motions of two dimensions that two joints about one line sweep: as many as curves of the others.

Where two joints turn about one line and all joints between them rest (an elbow that is folded or stretched), their
common motion keeps the target wherever the others are. So a surface of postures is a circle times a curve: with the
second of the two held it is that curve, and each curve of the arm of the others is a surface of its own.
"""

import itertools

import numpy as np

from armkin.formula.array_tuples import widen_columns
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import OWN_LABEL, Examined, Goals, Seeds
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.groups import examine
from armkin.model.arm import Arm
from armkin.model.lock_joints import lock

Pair = tuple[int, int, float]  # joints about one line, and the way of the first for a turn of the second


def list_swept(goals: Goals, decision: Examined) -> Examined:
    """The decision with surfaces listed by the curves that they are swept from."""
    if goals.task.orientation == "none":  # sums of joint values are those of all joints
        return decision
    for k in np.flatnonzero(decision.surface):
        decision = _with_curves(goals, decision, k)
    return decision


def no_more(target: Array, near: Array, lost: Bool) -> tuple[Array, Int, Bool]:
    """The strategy `more` of `examine` that finds nothing: one posture of nan for each target, and no search."""
    return np.full((len(near), 1, near.shape[1]), np.nan), np.zeros(1, np.int64), np.zeros(len(near), bool)


def _with_curves(goals: Goals, decision: Examined, k: np.intp) -> Examined:
    """The decision with a posture of each curve in place of those on surfaces of target k.

    Where three joints are about one line, the two of them that sweep the most surfaces tell.
    """
    arm, subset = goals.arm, goals.of(np.array([k]))
    q, label = decision.q[k, decision.valid[k]], decision.label[k, decision.valid[k]]
    J, rests = _jacobians(subset, q)
    options = [_other_curves(subset, q[on_line], label[on_line], pair) for pair, on_line in _joint_pairs(arm, J, rests)]
    if not options:
        return decision
    rows, labels, free, pair = max(options, key=lambda curves: len(curves[0]))
    if not len(rows):
        return decision
    on_line = _about_one_line(J, pair)
    rows, labels = np.concatenate([q[~on_line], rows]), np.append(label[~on_line], labels)
    q, valid, label = (widen_columns(array, len(rows)) for array in (decision.q, decision.valid, decision.label))
    listed = decision._replace(q=q, valid=valid, label=label, free=decision.free.copy())
    used = np.arange(listed.q.shape[1]) < len(rows)
    listed.q[k], listed.valid[k], listed.label[k] = np.nan, used, OWN_LABEL
    listed.q[k, used], listed.label[k, used] = rows, labels
    listed.free[k] |= free
    return listed


def _other_curves(goals: Goals, q: Array, label: Int, pair: Pair) -> tuple[Array, Int, Bool, Pair]:
    """The curves that postures q (M, n) of one target lie on, and all others, with the second joint of a pair held: a
    posture of each, its label, and the joints that move (n,) besides the surfaces' others."""
    arm, task, target, [near] = goals
    i, j, sense = pair
    turned = q.copy()
    turned[:, i] += sense * (turned[:, j] - near[j])
    joints = np.delete(np.arange(arm.n), j)
    held_arm = lock(arm, {arm.joint_names[j]: float(near[j])})
    starts = newton.many_starts(held_arm, task, target, np.ones(1, bool))[0]
    starts = starts[~np.isnan(starts[:, 0])]
    labels = np.concatenate([label, np.full(len(starts), OWN_LABEL)])
    seeds = Seeds.of(np.concatenate([turned[:, joints], starts])[None], labels[None])
    decision = examine(Goals(held_arm, task, target, near[None, joints]), seeds, no_more)
    valid = decision.valid[0]
    rows, free = np.insert(decision.q[0, valid], j, near[j], axis=1), np.insert(decision.free[0], j, True)
    free[i] = True
    shares_line = _about_one_line(_jacobians(goals, rows)[0], pair)
    return rows[shares_line], decision.label[0, valid][shares_line], free, pair


def _jacobians(goals: Goals, q: Array) -> tuple[Array, Bool]:
    """Jacobians of postures (M, n) of one target, and the joints (M, n) that rest where several directions are lost."""
    arm, task, target, _ = goals
    _, J = newton.scaled_residual_and_jacobian(arm, task, q, np.repeat(target, len(q), axis=0))
    S, V = np.linalg.svd(J)[1:]
    nullity = arm.n - (S > tol.WEAK).sum(axis=1)
    in_null = np.arange(arm.n) >= arm.n - nullity[:, None]
    has_motion = (np.where(in_null[:, :, None], np.abs(V), 0.0) > tol.FOLD_VALUE).any(axis=1)
    return J, np.asarray(~has_motion & (nullity > 1)[:, None])


def _about_one_line(J: Array, pair: Pair) -> Bool:
    """In which Jacobians (M, r, n) the columns of two joints are equal or opposite: (M,).

    Where an elbow is stretched they are known to the root of rounding.
    """
    i, j, sense = pair
    return np.asarray(np.abs(J[:, :, j] - sense * J[:, :, i]).max(axis=1) < tol.FOLD_VALUE)


def _joint_pairs(arm: Arm, J: Array, rests: Bool) -> list[tuple[Pair, Bool]]:
    """Pairs of joints that are about one line in a posture in which those between rest; (M,) where they are."""
    pairs = []
    for i, j in itertools.combinations(np.flatnonzero(~arm.prismatic).tolist(), 2):
        for sense in (1.0, -1.0):
            shares_line = _about_one_line(J, (i, j, sense))
            if (shares_line & rests[:, i + 1 : j].all(axis=1)).any():
                pairs.append(((i, j, sense), shares_line))
    return pairs
