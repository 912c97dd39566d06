"""One row a branch: equal answers merged, the rest sorted and packed by pose."""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int, numbers_within
from armkin.inverse.elimination.polish import pose_error, tip
from armkin.inverse.numeric import tolerances as tol

MAX_ANSWERS = 16  # isolated answers a 6-joint chain can have (Primrose 1986)

# A projection of the joint circles that tells different answers apart: it orders a pose's answers, the
# same way every time, and shows which of them can be equal.
_WEIGHTS: Array = np.random.default_rng(11).uniform(-1, 1, (2, 6))


class Answers(NamedTuple):
    """Exact solutions of many poses, in any order.

    pose: (M,).  q: (M, 6) wrapped, scaled.  residual: (M,).  weakness: (M,) norm of the inverse Jacobian.
    """

    pose: Int
    q: Array
    residual: Array
    weakness: Array


def weights(joints: int) -> Array:
    """The weights (2, 6) of `projection` for the first joints of six, of which the others are dropped."""
    return _WEIGHTS * (np.arange(6) < joints)


def projection(prismatic: Bool, q: Array) -> Array:
    """One number for each joint vector (..., n), n <= 6, equal for equal poses of the joints, else hardly ever."""
    cosine, sine = np.where(prismatic, q, np.cos(q)), np.where(prismatic, q, np.sin(q))
    weights = _WEIGHTS[:, : q.shape[-1]]
    return np.asarray(cosine @ weights[0] + sine @ weights[1])


def difference(prismatic: Bool, end: Array, start: Array) -> Array:
    """Joint values (M, 6) less others, turns the short way round."""
    step = end - start
    return np.where(prismatic, step, step - 2 * np.pi * np.round(step / (2 * np.pi)))


def merge_equal(chain: Array, prismatic: Bool, goal: Array, answers: Answers) -> tuple[Answers, Bool]:
    """Sort answers by pose and keep one of each set of equal ones.

    Two answers are one if the point halfway between them is an answer too, to the accuracy that both
    have, or if one lies within the other's uncertainty: the radius is 1e-6 where the Jacobian is good
    and grows like residual / sigma_min, up to the root of the residual, where it is weak.  Two real roots
    near a fold stay apart: halfway, the pose is off by the square of their distance.

    Args:
        chain, prismatic: (7, 4, 4) and (6,), scaled.
        goal: (N, 4, 4) poses.
        answers: to be merged.

    Returns:
        The answers that stay, poses ascending, and for each pose (N,) whether two answers further apart
        than rounding explains were merged.
    """
    key = projection(prismatic, answers.q)
    order = np.lexsort((key, answers.pose))
    key, answers = key[order], rows_of(answers, order)
    pose, q, residual = answers.pose, answers.q, answers.residual
    keep, merged_poses = np.ones(pose.size, dtype=np.bool_), np.zeros(goal.shape[0], dtype=np.bool_)
    widest = float(np.abs(_WEIGHTS).sum()) * tol.EXAMINED_DISTANCE
    for gap in range(1, pose.size):
        first = np.flatnonzero((pose[gap:] == pose[:-gap]) & (key[gap:] - key[:-gap] < widest))
        if first.size == 0:
            break
        second = first + gap
        step = difference(prismatic, q[second], q[first])
        distance = np.abs(step).max(axis=1)
        examined = np.flatnonzero((distance < tol.EXAMINED_DISTANCE) & keep[first] & keep[second])
        if examined.size == 0:
            continue
        first, second = first[examined], second[examined]
        step, distance = step[examined], distance[examined]
        target = np.ascontiguousarray(goal[pose[first], :3].transpose(1, 2, 0))
        _, middle_error = pose_error(tip(chain, prismatic, (q[first] + step / 2).T)[0], target)
        blur = np.maximum(tol.HALFWAY_RESIDUAL, 4 * np.maximum(residual[first], residual[second]))
        # An answer may be off by a Newton step, at most weakness * residual, along a curve of answers that all but
        # solve its pose: two on both sides of one answer are two such steps apart; 3 leaves room.
        radius = 3 * answers.weakness * residual
        reach = np.maximum(radius[first], radius[second])
        equal = (distance < np.maximum(tol.SAME_ANSWER, reach)) | (middle_error < blur)
        second_worse = residual[second] > residual[first]
        keep[np.where(second_worse, second, first)[equal]] = False
        # rounding: of 4,122 equal pairs of 20 chains with a norm of J^-1 below 100 99 % are at most 1.5e-13 apart and
        # 0.1 % more than 1e-8; of 2,817 with one above 1e4 it is 87 %
        merged_poses[pose[first[equal & (distance > 1e-2 * tol.SAME_ANSWER)]]] = True
    return rows_of(answers, keep), merged_poses


def pack_by_pose(answers: Answers, count: int) -> tuple[Array, Bool]:
    """Answers, poses ascending, as (N, B, 6) with NaN past a pose's last one; and which poses are near singular (N,).

    Near singular are poses with an answer near a singularity or with more answers than can be isolated; of
    these the 16 furthest from singularities are given.
    """
    number = np.bincount(answers.pose, minlength=count)
    near_singular = number > MAX_ANSWERS
    near_singular[answers.pose[answers.weakness > tol.ILL_INVERSE]] = True
    if number.max(initial=0) > MAX_ANSWERS:
        rank = np.empty(answers.pose.size, dtype=np.int64)
        rank[np.lexsort((answers.weakness, answers.pose))] = numbers_within(number)
        answers = rows_of(answers, rank < MAX_ANSWERS)
    return _table(answers, count, MAX_ANSWERS), near_singular


def best_answers(answers: Answers, count: int, limit: int) -> Array:
    """At most so many answers of every pose (N = count), those of the smallest residual: (N, B, 6), NaN past them."""
    return _table(rows_of(answers, np.lexsort((answers.residual, answers.pose))), count, limit)


def _table(answers: Answers, count: int, limit: int) -> Array:
    """At most so many answers of each pose, poses ascending, in their order: (N, B, 6), NaN past the last one."""
    column = numbers_within(np.bincount(answers.pose, minlength=count))
    q, fits = np.full((count, min(int(column.max(initial=-1)) + 1, limit), 6), np.nan), column < limit
    q[answers.pose[fits], column[fits]] = answers.q[fits]
    return q
