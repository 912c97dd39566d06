"""Curves of answers that no plane has met, as answers with another joint held tell.

Where an arm is nearly stretched its elbow turns in a small circle, along which the joint of the planes hardly moves.
The joint between shoulder and elbow makes whole turns there, or swings about where the axes on its sides are parallel
or at right angles: one of two of its values has an answer of every such curve, if it is no smaller still.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Int, wrapped
from armkin.inverse.numeric import newton
from armkin.inverse.redundant.curve_points import Points, Ways
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.solvers.redundant import arm_without, nearly_closed

VALUES = 0.05, 0.05 + np.pi / 2  # [rad] at which that joint is held, beside where the other joints would be special
SECANTS = 4  # steps along a cubic to where it has such a value
ON_CURVE = 0.02  # [rad, reaches] an answer this close to a curve is on it


def missed(find: Follower, points: Points, row: Int, after: Int) -> tuple[Int, Array]:
    """Answers (M, n) of targets (M,) that no curve passes: points of curves, whose targets, the points after them."""
    guide = nearly_closed(find.arm, find.free)
    joint = 2 if guide.joint == 0 else 4  # the shoulder is on the far side of the three joints of a spherical wrist
    if guide is find.free or find.arm.prismatic[joint]:
        return row[:0], points.q[:0]
    parts = [_missed_at(find, joint, value, points, row, after) for value in VALUES]
    whose, q = (np.concatenate(column) for column in zip(*parts, strict=True))
    return whose, q


def _missed_at(find: Follower, joint: int, value: float, points: Points, row: Int, after: Int) -> tuple[Int, Array]:
    """Those with the joint at a value."""
    rest = arm_without(find.arm, ((find.arm.joint_names[joint], value),))
    s = find.ik(rest, find.target, find.free.task.name, examine=False)
    whose, branch = np.nonzero(s.valid)
    q = np.insert(s.q[whose, branch], joint, value, axis=1)
    crossing, owner = _crossings(find, joint, value, points, row, after)
    order, count = np.argsort(owner, kind="stable"), np.bincount(owner, minlength=len(find.target))
    place = np.arange(int(count.max(initial=0)))
    some, k = np.nonzero(place < count[whose, None])
    own = order[(np.cumsum(count) - count)[whose[some]] + k]
    passed = np.zeros(len(q), bool)
    passed[some[newton.wrapped_distance(find.arm, q[some], crossing[own]) < ON_CURVE]] = True
    return whose[~passed], q[~passed]


def _crossings(find: Follower, joint: int, value: float, points: Points, row: Int, after: Int) -> tuple[Array, Int]:
    """Postures (M, n) in which curves have the joint at a value, and of which targets they are (M,)."""
    off, change = wrapped(points.q[:, joint] - value), wrapped(points.q[after, joint] - points.q[:, joint])
    some = np.flatnonzero((off * (off + change) <= 0) & (change != 0))
    ways = Ways.between(find, rows_of(points, some), rows_of(points, after[some]))
    share = -off[some] / change[some]
    for _ in range(SECANTS):
        share = np.clip(share - wrapped(ways.at(find, share)[:, joint] - value) / change[some], 0.0, 1.0)
    return ways.at(find, share), row[some]
