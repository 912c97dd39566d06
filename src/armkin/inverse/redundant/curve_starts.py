"""Answers of some targets at which curves of answers are begun.

On planes, values of one joint: of one whose others miss a closed form by little, as a spherical wrist whose axes do not
quite meet, the branches of the arm that has it, moved onto the arm; else of the redundant one, at whose values the
elimination answers.

And off the curves that pass these, with another joint held: where an arm is nearly stretched its elbow turns in a small
circle, along which the joint of the planes hardly moves. The joint between shoulder and elbow makes whole turns there,
or swings about where the axes on its sides are parallel or at right angles: one of two of its values has an answer of
every such curve, if it is no smaller still.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int, numbers_within, wrap_angle
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.curve_points import Points, Ways, onto_curves
from armkin.inverse.redundant.interval_pieces import may_turn_back
from armkin.inverse.redundant.other_joints import Follower, over_a_turn
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, arm_without, near_classes, nearly_closed

PLANES = 60  # values of the joint at which the target is solved
WAY_PARTS = 12  # parts of the way between two planes, where answers may be that neither plane has
VALUES = 0.05, 0.05 + np.pi / 2  # angles [rad] at which the other joint is held: the remaining ones are not special
SECANTS = 4  # steps along a cubic to where the other joint has such a value
GROUP_WIDTH = 64.0  # more than twice the largest key of a posture
ON_CURVE = 0.02  # distance [rad, reaches] of an answer from a curve up to which it is on it


class Nodes(NamedTuple):
    """Points of curves: whose target (M,), on which plane (M,), -1 of none; there the tangents raise the joint.

    The half 2 m of a curve leaves node m along its tangent, 2 m + 1 against it.
    """

    row: Int
    plane: Int
    points: Points

    def leaving(self, half: Int) -> Points:
        """The nodes of halves (...), their tangents along these."""
        points = rows_of(self.points, half >> 1)
        return points._replace(tangent=points.tangent * (1 - 2 * (half & 1))[..., None])


class Planes(NamedTuple):
    """Values of a joint that are answered: (N, V), inf behind the last ones, and how many of each target (N,)."""

    follower: Follower
    guide: Redundancy  # the joint that guides, and the others
    values: Array
    counts: Int

    def held(self, count: int) -> Array:
        """Directions (M, n) in which that joint alone moves."""
        return np.tile(np.eye(self.follower.arm.n)[self.guide.joint], (count, 1))

    def place(self, row: Int, plane: Int) -> Int:
        """One number for targets and their planes (M,), counted round the turn."""
        return np.asarray(row * self.values.shape[1] + plane % self.counts[row])

    def answers(self, row: Int, plane: Int, q: Array) -> tuple[Nodes, Int]:
        """Postures (M, n) moved along their planes (M,) onto curves, each once, and which of them are (K,)."""
        points = onto_curves(self.follower, row, q, self.held(len(q)), tol.SAME_SEED)
        rows = np.flatnonzero(points.step < tol.SAME_SEED)
        rows = rows[first_of_equals(self.follower, self.place(row[rows], plane[rows]), points.q[rows])]
        return Nodes(row[rows], plane[rows], rows_of(points, rows)), rows


def answers_on_planes(follower: Follower, owner: Int, postures: Array) -> tuple[Planes, Nodes, Int]:
    """The planes of all targets, the answers on them, and the answer's number at each plane and branch (N, V, B).

    The last branch is none: answers between the others. The number is -1 where there is no answer. postures: (M, n)
    further answers of targets owner (M,), for each of which a plane is added; they are left out where the joint of the
    planes is the redundant one.
    """
    guide, N = nearly_closed(follower.arm, follower.redundant), len(follower.target)
    row, t, q, solving, extra = _starts_on_planes(follower, guide, owner, postures)
    order, count = np.lexsort((t, row)), np.bincount(row, minlength=N)
    plane = np.empty_like(row)
    plane[order] = numbers_within(count)
    planes = Planes(follower, guide, np.full((N, int(count.max(initial=PLANES))), np.inf), count)
    planes.values[row, plane] = t
    sample, branch = np.nonzero(solving)
    last = np.arange(N * PLANES, len(row))  # rows between are answers already, of no branch
    start = np.append(q[sample, branch], extra, axis=0)
    sample, branch = np.append(sample, last), np.append(branch, np.full(len(last), q.shape[1]))
    nodes, index = planes.answers(row[sample], plane[sample], start)
    grid = np.full((*planes.values.shape, q.shape[1] + 1), -1)
    grid[nodes.row, nodes.plane, branch[index]] = np.arange(len(index))
    return planes, nodes, grid


def _starts_on_planes(
    follower: Follower, guide: Redundancy, owner: Int, postures: Array
) -> tuple[Int, Array, Array, Bool, Array]:
    """Targets (S,) and values (S,) of the guide's joint, candidates (S, B, n) there, and which are near answers (S, B).

    The last (E,) have planes of their own, through answers (E, n) between the others, and the postures that are given.
    """
    values, N = over_a_turn(PLANES), len(follower.target)
    row, t = np.repeat(np.arange(N), PLANES), np.tile(values, N)
    if guide is follower.redundant:
        q = follower.branches_at(row, t)
        return row, t, q, ~np.isnan(q[:, :, 0]), q[:0, 0]
    source = follower._replace(redundant=guide)
    q, defect = source.candidates(row, t)
    between, answers = _answers_between(source, values, defect.reshape(N, PLANES, -1))
    own_row, extra = np.append(between, owner), np.append(answers, postures, axis=0)
    own_t = wrap_angle(extra[:, guide.joint])
    own_q, own_defect = source.candidates(own_row, own_t)
    solving = np.append(defect, own_defect, axis=0) < tol.NEAR_DEFECT
    return np.append(row, own_row), np.append(t, own_t), np.append(q, own_q, axis=0), solving, extra


def _answers_between(source: Follower, t: Array, defect: Array) -> tuple[Int, Array]:
    """Answers (M, n) of targets (M,) where these may be between values t (K,) alone, as what branches miss (N, K, B)
    tells: of a short curve, whose joint cannot be held where it turns back."""
    width, part = t[1] - t[0], np.arange(1, WAY_PARTS) / WAY_PARTS
    misses = np.where(defect <= tol.ACCEPTED, np.nan, -defect)
    row, k = np.nonzero(may_turn_back(misses, np.broadcast_to(t, defect.shape[:2])).any(axis=2))
    row, values = np.repeat(row, len(part)), (t[k, None] + width * part).ravel()
    q, defect = source.candidates(row, values)
    least = defect.min(axis=1).reshape(-1, len(part))
    best = least <= np.maximum(least.min(axis=1, keepdims=True), tol.ACCEPTED)  # the middle one where several are exact
    best_row = (best.cumsum(axis=1) > best.sum(axis=1)[:, None] // 2).argmax(axis=1) + len(part) * np.arange(len(k))
    place, branch = np.nonzero(defect[best_row] < tol.NEAR_DEFECT)
    row, q = row[best_row[place]], q[best_row[place], branch]
    q, miss = newton.correct(source.arm, source.redundant.task, q, source.target[row])
    rows = np.flatnonzero(miss < tol.SAME_SEED)
    rows = rows[first_of_equals(source, row[rows], q[rows])]
    return row[rows], q[rows]


def first_of_equals(follower: Follower, group: Int, q: Array) -> Bool:
    """Which postures (M, n) of groups (M,) are the first of those that are the same."""
    # cos is even: without a shift q and -q would share a key; joints differ in weight so that angles do not swap unseen
    key = np.cos(q - 0.3) @ np.sqrt(np.arange(2.0, 2.0 + q.shape[1]))
    order = np.argsort(group * GROUP_WIDTH + key)
    first, second = order[:-1], order[1:]
    similar = (group[first] == group[second]) & (np.abs(key[first] - key[second]) < 10 * tol.SAME_SEED)
    twin = np.flatnonzero(similar)
    unique = np.ones(len(q), bool)
    unique[second[twin[newton.wrapped_distance(follower.arm, q[first[twin]], q[second[twin]]) < tol.SAME_SEED]]] = False
    return unique


def answers_off_curves(follower: Follower, points: Points, row: Int, after: Int) -> tuple[Int, Array]:
    """Answers (M, n) of targets (M,) that no curve passes: points of curves, whose targets, the points after them."""
    guide = nearly_closed(follower.arm, follower.redundant)
    joint = 2 if guide.joint == 0 else 4  # the shoulder is on the far side of the three joints of a spherical wrist
    if guide is follower.redundant or follower.arm.prismatic[joint]:
        return row[:0], points.q[:0]
    parts = [_off_curves_at(follower, joint, value, points, row, after) for value in VALUES]
    target, q = (np.concatenate(column) for column in zip(*parts, strict=True))
    return target, q


def _off_curves_at(follower: Follower, j: int, value: float, points: Points, row: Int, after: Int) -> tuple[Int, Array]:
    """Targets (M,) and their answers (M, n) [rad | mm] that lie on no curve, with joint j held at a value [rad].

    Not solved are targets of which each candidate of a class that the arm misses by little has a crossing of its own.
    """
    task, rows = follower.redundant.task, np.arange(len(follower.target))
    held_arm = arm_without(follower.arm, ((follower.arm.joint_names[j], value),))
    crossings = _crossings(follower, j, value, points, row, after)

    def distances(q: Array, rows: Int | slice) -> Array:
        """How far postures (M, B, n - 1), without joint j, are from the crossings of their targets: (M, B, K)."""
        distance = newton.distances(follower.arm, np.insert(q, j, value, axis=2), crossings[rows])
        return np.where(np.isnan(distance), np.inf, distance)

    for ideal in near_classes(held_arm, task)[:1]:
        q, squared_miss, _ = recorded_formula(held_arm, task, ideal).rows(follower.target)
        # where branches are about to merge they miss by the root of a defect
        distance, candidate = distances(q, rows), squared_miss < tol.NEAR_DEFECT
        nearest = distance.argmin(axis=2)[:, :, None] == np.arange(distance.shape[2])
        own = (nearest & (distance < ON_CURVE) & candidate[:, :, None]).any(axis=1)
        rows = np.flatnonzero(own.sum(axis=1) < candidate.sum(axis=1))
    s = follower.ik(held_arm, follower.target[rows], task.name, examine=False)
    target, branch = np.nonzero(s.valid & ~(distances(s.q, rows) < ON_CURVE).any(axis=2))
    return rows[target], np.insert(s.q[target, branch], j, value, axis=1)


def _crossings(follower: Follower, joint: int, value: float, points: Points, row: Int, after: Int) -> Array:
    """Postures (N, K, n) in which curves of all targets have the joint at a value; nan where there are fewer."""
    gap, change = wrap_angle(points.q[:, joint] - value), wrap_angle(points.q[after, joint] - points.q[:, joint])
    begins = np.flatnonzero((gap * (gap + change) <= 0) & (change != 0))
    cubics = Ways.between(follower, rows_of(points, begins), rows_of(points, after[begins]))
    share = -gap[begins] / change[begins]
    for _ in range(SECANTS):
        share = np.clip(share - wrap_angle(cubics.at(follower, share)[:, joint] - value) / change[begins], 0.0, 1.0)
    owner = row[begins]
    order, count = np.argsort(owner, kind="stable"), np.bincount(owner, minlength=len(follower.target))
    table = np.full((len(count), max(int(count.max(initial=0)), 1), follower.arm.n), np.nan)
    table[owner[order], numbers_within(count)] = cubics.at(follower, share)[order]
    return table
