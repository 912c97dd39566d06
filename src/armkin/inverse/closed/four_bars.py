"""Four-bar linkages: finds the circuit of a posture on a planar or spherical one, in closed form.

Four moving joints with parallel axes, or with axes that meet in a point, are a four-bar linkage while the tool keeps
its pose, with tool and base as one bar. If the linkage can neither stretch nor fold at some joint, it has two
circuits, the sine of the angle there of one sign on each; else one (Chiang, Kinematics of Spherical Mechanisms, 1988).
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, cross_rows
from armkin.forward import jacobian
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.model.arm import Arm


class _Linkages(NamedTuple):
    """Four axes of M postures.

    planar, spherical: (M,) whether they are parallel or meet. bars: (M, 4) lengths [reaches] or arcs [rad] from each
    axis to the next. sine: (M, 4) of the angle at each axis, times a positive number.
    """

    planar: Bool
    spherical: Bool
    bars: Array
    sine: Array


def dead_points(arm: Arm, q: Array, joints: Bool) -> tuple[Bool, Int]:
    """Whether the self-motions through q (M, n) are four-bar linkages, and the joint whose sine distinguishes circuits.

    joints: (M, n) those that move. Returns (M,) and (M,), the latter -1 for a single circuit.
    """
    is_linkage, joint = np.zeros(len(q), bool), np.full(len(q), -1)
    rows = np.flatnonzero((joints.sum(axis=1) == 4) & ~(joints & arm.prismatic).any(axis=1))
    if not len(rows):
        return is_linkage, joint
    four = np.nonzero(joints[rows])[1].reshape(-1, 4)
    linkage = _linkages(arm, q[rows], four)
    lowest, highest = _diagonals(linkage.bars, linkage.spherical)
    # the diagonal opposite to a joint belongs to the other two bars, too
    least, most = np.roll(lowest, -2, axis=1), np.roll(highest, -2, axis=1)
    # with equal bars several postures are in one line, and the curve may split into crossing ones
    ends = np.abs(np.stack([lowest - least, lowest - most, highest - least, highest - most]))
    several = ((ends < tol.NEAR_DEFECT).sum(axis=0) > 1).any(axis=1)
    # two circuits are one if the posture with all bars in a line solves the target
    least, most = least - tol.SOLUTION, most + tol.SOLUTION
    reaches = ((lowest > least) & (lowest < most)) | ((highest > least) & (highest < most))
    length = np.where(linkage.spherical[:, None], np.sin(linkage.bars), linkage.bars)
    is_linkage[rows] = (linkage.planar | linkage.spherical) & (length > tol.NEAR_DEFECT).all(axis=1) & ~several
    two = np.flatnonzero(~reaches.all(axis=1))
    joint[rows[two]] = four[two, reaches[two].argmin(axis=1)]
    return is_linkage, joint


def sides(arm: Arm, q: Array, joints: Bool, joint: Int) -> Bool:
    """The circuit of postures (M, n) on linkages, as the sign of the sine at a joint (M,): True if positive, (M,)."""
    four = np.nonzero(joints)[1].reshape(-1, 4)
    return np.asarray(np.where(four == joint[:, None], _linkages(arm, q, four).sine, 0.0).sum(axis=1) > 0.0)


def one_per_circuit(arm: Arm, q: Array, near: Array) -> tuple[Bool, Array]:
    """Choose one posture of q (N, S, B, n), nan for none, for each circuit of a four-bar linkage.

    near: (N, n). The S postures of a column are on one self-motion of the joints that differ. Returns (N, S, B) which
    postures are kept, all except those on linkages that are not the nearest to `near` on their circuit, and (N, B, n)
    a posture of each linkage, nan in its moving joints and where there is none.
    """
    N, _, B, n = q.shape
    present = ~np.isnan(q[..., 0])
    first = np.take_along_axis(q, present.argmax(axis=1)[:, None, :, None], axis=1)
    joints: Bool = np.asarray((np.abs(newton.difference(arm, q, first)) > tol.ROUNDING_DISTANCE).any(axis=1))
    k, b = np.nonzero(joints.sum(axis=2) == 4)
    is_linkage, joint = dead_points(arm, first[k, 0, b], joints[k, b])
    k, b, joint = k[is_linkage], b[is_linkage], joint[is_linkage]
    held = np.full((N, B, n), np.nan)
    held[k, b] = np.where(joints[k, b], np.nan, first[k, 0, b])
    chosen, solved = present.copy(), present[k, :, b]  # (m, S)
    side = np.zeros(solved.shape, bool)
    i, s = np.nonzero(solved & (joint >= 0)[:, None])
    side[i, s] = sides(arm, q[k[i], s, b[i]], joints[k[i], b[i]], joint[i])
    motion = np.abs(newton.difference(arm, q[k, :, b], near[k, None])).sum(axis=2)
    motion = np.where(solved, motion, np.inf)
    chosen[k, :, b] = False
    for way in (False, True):
        part = np.where(side == way, motion, np.inf)
        rows = np.isfinite(part).any(axis=1)
        chosen[k[rows], part[rows].argmin(axis=1), b[rows]] = True
    return chosen, held


def _diagonals(bars: Array, spherical: Bool) -> tuple[Array, Array]:
    """The shortest and longest diagonal over each joint, from the bars on both sides of it: (M, 4)."""
    previous = np.roll(bars, 1, axis=1)
    total = previous + bars
    arc = np.minimum(total, 2.0 * np.pi - total)
    return np.abs(previous - bars), np.where(spherical[:, None], arc, total)


def _linkages(arm: Arm, q: Array, four: Int) -> _Linkages:
    """Four axes (M, 4) of postures (M, n)."""
    J = np.take_along_axis(jacobian(arm, q), four[:, None], axis=2).swapaxes(1, 2)  # (M, 4, 6)
    axis, point = J[:, :, 3:], cross_rows(J[:, :, 3:], J[:, :, :3]) / arm.reach  # feet of perpendiculars from the tip
    after, ahead = np.roll(axis, -1, axis=1), np.roll(point, -1, axis=1) - point
    normal = cross_rows(axis, after)
    area = np.linalg.norm(normal, axis=2)
    planar = (area < tol.NO_AREA).all(axis=1)
    behind = np.roll(ahead, 1, axis=1)
    bars, sine = np.linalg.norm(ahead, axis=2), (cross_rows(behind, ahead) * axis[:, :1]).sum(axis=2)
    # the axes have to meet where the first two do
    far = np.maximum(area[:, :1] ** 2, tol.TINY)
    turn = cross_rows(ahead[:, 0], axis[:, 1])
    along = (turn * normal[:, 0]).sum(axis=1, keepdims=True) / far
    centre = point[:, :1] + (along * axis[:, 0])[:, None]
    miss = np.linalg.norm(cross_rows(centre - point, axis), axis=2)
    spherical = ~planar & (area > tol.PARALLEL_SINE).all(axis=1) & (miss < tol.NO_AREA).all(axis=1)
    arcs = np.arctan2(area, (axis * after).sum(axis=2))
    triple = (np.roll(axis, 1, axis=1) * normal).sum(axis=2)
    meeting = spherical[:, None]
    return _Linkages(planar, spherical, np.where(meeting, arcs, bars), np.where(meeting, triple, sine))
