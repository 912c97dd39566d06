"""Answers of some targets at which curves of answers are begun.

On planes, values of one joint: of one whose others miss a closed form by little, as a spherical wrist whose axes do not
quite meet, the branches of the arm that has it, moved onto the arm; else of the redundant one, at whose values the
elimination answers.

And off the curves that pass these, with another joint held: where an arm is nearly stretched its elbow turns in a small
circle, along which the joint of the planes hardly moves. The joint between shoulder and elbow makes whole turns there,
or swings about where the axes on its sides are parallel or at right angles: one of two of its values has an answer of
every such curve, if it is no smaller still.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int, numbers_within, wrap_angle
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.curve_points import Points, Ways, onto_curves
from armkin.inverse.redundant.interval_pieces import may_turn_back
from armkin.inverse.redundant.other_joints import Follower, over_a_turn
from armkin.inverse.solvers.redundancy import Redundancy, arm_without, nearly_closed

PLANES = 60  # values of the joint at which the target is solved
WAY_PARTS = 12  # parts of the way between two planes, where answers may be that neither plane has
VALUES = 0.05, 0.05 + np.pi / 2  # angles [rad] at which the other joint is held: the remaining ones are not special
SECANTS = 4  # steps along a cubic to where the other joint has such a value
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
        directions = np.zeros((count, self.follower.arm.n))
        directions[:, self.guide.joint] = 1.0
        return directions

    def place(self, row: Int, plane: Int) -> Int:
        """One number for targets and their planes (M,), counted round the turn."""
        return np.asarray(row * self.values.shape[1] + plane % self.counts[row])

    def answers(self, row: Int, plane: Int, q: Array) -> tuple[Nodes, Int]:
        """Postures (M, n) moved along their planes (M,) onto curves, each once, and which of them are (K,)."""
        points = onto_curves(self.follower, row, q, self.held(len(q)), tol.SAME_SEED)
        good = np.flatnonzero(points.step < tol.SAME_SEED)
        good = good[first_of_equals(self.follower, self.place(row[good], plane[good]), points.q[good])]
        return Nodes(row[good], plane[good], rows_of(points, good)), good


def answers_on_planes(follower: Follower, whose: Int, postures: Array) -> tuple[Planes, Nodes, Int]:
    """The planes of all targets, and the answers on them; which is whose, by plane and branch (N, V, B), -1: none.

    whose: (M,) targets of answers that are postures (M, n) besides: each gets a plane; none without a closed form.
    """
    guide, even, N = nearly_closed(follower.arm, follower.free), over_a_turn(PLANES), len(follower.target)
    row, t = np.repeat(np.arange(N), PLANES), np.tile(even, N)
    source = follower._replace(free=guide)
    if guide is follower.free:
        q = follower.branches_at(row, t)
        solving, extra = ~np.isnan(q[:, :, 0]), q[:0, 0]
    else:
        q, missed = source.candidates(row, t)
        more, extra = _answers_between(source, even, missed.reshape(N, PLANES, -1))
        more, extra = np.append(more, whose), np.append(extra, postures, axis=0)
        row, t = np.append(row, more), np.append(t, extra[:, guide.joint])
        beside = source.candidates(more, t[N * PLANES :])
        q, solving = np.append(q, beside[0], axis=0), np.append(missed, beside[1], axis=0) < tol.NEAR_DEFECT
    order, count = np.lexsort((t, row)), np.bincount(row, minlength=N)
    plane = np.empty_like(row)
    plane[order] = numbers_within(count)
    planes = Planes(follower, guide, np.full((N, int(count.max(initial=PLANES))), np.inf), count)
    planes.values[row, plane] = t
    sample, branch = np.nonzero(solving)
    last = np.arange(N * PLANES, len(row))  # rows between are answers already, of no branch
    start = np.append(q[sample, branch], extra, axis=0)
    sample, branch = np.append(sample, last), np.append(branch, np.full(len(last), q.shape[1]))
    nodes, good = planes.answers(row[sample], plane[sample], start)
    grid = np.full((*planes.values.shape, q.shape[1] + 1), -1)
    grid[nodes.row, nodes.plane, branch[good]] = np.arange(len(good))
    return planes, nodes, grid[:, :, :-1]


def _answers_between(source: Follower, t: Array, missed: Array) -> tuple[Int, Array]:
    """Answers (M, n) of targets (M,) where these may be between values t (K,) alone, as what branches miss (N, K, B)
    tells: of a short curve, whose joint cannot be held where it turns back."""
    width, part = t[1] - t[0], np.arange(1, WAY_PARTS) / WAY_PARTS
    misses = np.where(missed <= tol.ACCEPTED, np.nan, -missed)
    row, k = np.nonzero(may_turn_back(misses, np.broadcast_to(t, missed.shape[:2])).any(axis=2))
    row, values = np.repeat(row, len(part)), (t[k, None] + width * part).ravel()
    q, missed = source.candidates(row, values)
    best = missed.min(axis=1).reshape(-1, len(part)).argmin(axis=1) + len(part) * np.arange(len(k))
    place, branch = np.nonzero(missed[best] < tol.NEAR_DEFECT)
    row, q = row[best[place]], q[best[place], branch]
    q, miss = newton.correct(source.arm, source.free.task, q, source.target[row])
    good = np.flatnonzero(miss < tol.SAME_SEED)
    good = good[first_of_equals(source, row[good], q[good])]
    return row[good], q[good]


def first_of_equals(follower: Follower, group: Int, q: Array) -> Bool:
    """Which postures (M, n) of groups (M,) are the first of those that are the same."""
    key = np.cos(q - 0.3) @ np.sqrt(np.arange(2.0, 2.0 + q.shape[1]))
    order = np.lexsort((key, group))
    first, second = order[:-1], order[1:]
    close = (group[first] == group[second]) & (np.abs(key[first] - key[second]) < 10 * tol.SAME_SEED)
    twin = np.flatnonzero(close)
    unique = np.ones(len(q), bool)
    unique[second[twin[newton.wrapped_distance(follower.arm, q[first[twin]], q[second[twin]]) < tol.SAME_SEED]]] = False
    return unique


def answers_off_curves(follower: Follower, points: Points, row: Int, after: Int) -> tuple[Int, Array]:
    """Answers (M, n) of targets (M,) that no curve passes: points of curves, whose targets, the points after them."""
    guide = nearly_closed(follower.arm, follower.free)
    joint = 2 if guide.joint == 0 else 4  # the shoulder is on the far side of the three joints of a spherical wrist
    if guide is follower.free or follower.arm.prismatic[joint]:
        return row[:0], points.q[:0]
    parts = [_off_curves_at(follower, joint, value, points, row, after) for value in VALUES]
    whose, q = (np.concatenate(column) for column in zip(*parts, strict=True))
    return whose, q


def _off_curves_at(
    follower: Follower, joint: int, value: float, points: Points, row: Int, after: Int
) -> tuple[Int, Array]:
    """Answers (M, n) off the curves with the joint at a value, and whose they are (M,)."""
    held_arm = arm_without(follower.arm, ((follower.arm.joint_names[joint], value),))
    s = follower.ik(held_arm, follower.target, follower.free.task.name, examine=False)
    whose, branch = np.nonzero(s.valid)
    q = np.insert(s.q[whose, branch], joint, value, axis=1)
    crossing, owner = _crossings(follower, joint, value, points, row, after)
    order, count = np.argsort(owner, kind="stable"), np.bincount(owner, minlength=len(follower.target))
    place = np.arange(int(count.max(initial=0)))
    pair, k = np.nonzero(place < count[whose, None])
    index = order[(np.cumsum(count) - count)[whose[pair]] + k]
    passed = np.zeros(len(q), bool)
    passed[pair[newton.wrapped_distance(follower.arm, q[pair], crossing[index]) < ON_CURVE]] = True
    return whose[~passed], q[~passed]


def _crossings(follower: Follower, joint: int, value: float, points: Points, row: Int, after: Int) -> tuple[Array, Int]:
    """Postures (M, n) in which curves have the joint at a value, and of which targets they are (M,)."""
    away, change = wrap_angle(points.q[:, joint] - value), wrap_angle(points.q[after, joint] - points.q[:, joint])
    begins = np.flatnonzero((away * (away + change) <= 0) & (change != 0))
    ways = Ways.between(follower, rows_of(points, begins), rows_of(points, after[begins]))
    share = -away[begins] / change[begins]
    for _ in range(SECANTS):
        share = np.clip(share - wrap_angle(ways.at(follower, share)[:, joint] - value) / change[begins], 0.0, 1.0)
    return ways.at(follower, share), row[begins]
