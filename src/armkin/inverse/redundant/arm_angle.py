"""Seven joints, a spherical shoulder, an elbow and a spherical wrist: all families in closed form by the arm angle.

The elbow turns by psi about the line from the shoulder to the wrist, so that every entry of the rotations before and
behind the elbow is e0 + ec cos(psi) + es sin(psi). A joint stands on a limit, or at `near`, where an equation
a cos(psi) + b sin(psi) = c holds; the redundant joint, the last one, turns back at two roots of such an equation
(Shimizu, Kakuya, Yoon, Kitagaki and Kosuge, Analytical inverse kinematic computation for 7-DOF redundant manipulators
with joint limits and its application to redundancy resolution, IEEE Transactions on Robotics 24, 2008). The roots part
the turn of psi into pieces that are legal or not as a whole. Shoulder and wrist have two halves each and the elbow two
values: eight curves.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.branches.whole_turns import nearest_of_joint, nearest_row
from armkin.inverse.closed.wrist import meeting_point
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.interval_pieces import Pieces, best_samples, holding_none, none, runs
from armkin.model.arm import Arm
from armkin.model.rotation import inverse, rotation_about
from armkin.model.units import TURN

EVEN_SAMPLES = 24  # samples of a turn besides the roots
STEPS = 8  # steps of the golden section: the kinks of the motion from near are samples, and a parabola ends it
JOINTS = (0, 1, 2), (4, 5, 6)  # numbers of the joints of the shoulder and of the wrist


def _offsets(A: Array, B: Array) -> Array | None:
    """Three axes at right angles, Rz(q1) A Rz(q2) B Rz(q3) = Rz(t1) Rx(90) Rz(t2) Rx(90) Rz(t3): t - q (3,)."""
    if max(abs(A[2, 2]), abs(B[2, 2])) > tol.EXACT:
        return None
    # Rz(u) Rx(90) Rz(v) has the third column (sin u, -cos u, 0) and the third row (sin v, cos v, 0)
    (u, v), (x, y) = ((np.arctan2(L[0, 2], -L[1, 2]), np.arctan2(L[2, 0], L[2, 1])) for L in (A, B))
    return np.array([u, v + x, y])


class ArmAngle(NamedTuple):
    """Constants of an arm whose joints 1 to 3 and 5 to 7 are a spherical shoulder and wrist."""

    arm: Arm
    shoulder: Array  # (3,) seen before joint 1
    shoulder_to_elbow: Array  # (3,) from the shoulder to axis 4, seen before joint 4
    elbow_to_wrist: Array  # (3,) from axis 4 to the wrist, seen behind joint 4
    wrist: Array  # (3,) seen before joint 7
    offset: Array  # (3, 2) of the angles t of shoulder and wrist from joint values


@lru_cache(maxsize=64)
def arm_angle(arm: Arm) -> ArmAngle | None:
    """What is constant of an arm of seven joints with a spherical shoulder and wrist at right angles, else None."""
    if arm.n != 7 or arm.prismatic.any():
        return None
    L = arm.link
    shoulder, wrist = (meeting_point(L[k], L[k + 1], tol.EXACT * arm.reach) for k in (1, 5))
    first, second = (_offsets(L[k], L[k + 1]) for k in (1, 5))
    if shoulder is None or wrist is None or first is None or second is None:
        return None
    shoulder_to_elbow = L[3][:3, :3].T @ (L[3][:3, 3] - shoulder[1])
    elbow_to_wrist = L[4][:3, :3] @ wrist[0] + L[4][:3, 3]
    if min(np.hypot(*shoulder_to_elbow[:2]), np.hypot(*elbow_to_wrist[:2])) <= tol.NO_LENGTH:
        return None  # joint 4 does not move the wrist away from the shoulder
    offset = np.stack([first, second], axis=1)
    return ArmAngle(arm, shoulder[0], shoulder_to_elbow, elbow_to_wrist, wrist[1], offset)


class _Circles(NamedTuple):
    """Elbows M of some targets N, each turning about the line from its shoulder to its wrist."""

    R: Array  # (3, 3, 3, 2, M) rotations of shoulder and wrist: the first axis are their parts 1, cos(psi), sin(psi)
    q4: Array  # (M,)
    row: Int  # (M,) whose target
    half: Int  # (M,) which of its two elbows
    complete: Bool  # (N,) no posture on a circle has a straight shoulder or wrist


def _frame(v: Array) -> Array:
    """Right-handed frames (M, 3, 3) whose third column is along v (M, 3)."""
    z = v / np.linalg.norm(v, axis=1, keepdims=True)
    x = np.cross(np.eye(3)[np.abs(z).argmin(axis=1)], z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _circles(srs: ArmAngle, target: Array) -> _Circles:
    """The circles of elbows that reach targets (N, 4, 4)."""
    L, u, p = srs.arm.link, srs.shoulder_to_elbow, srs.elbow_to_wrist
    hand = inverse(L[0]) @ target @ inverse(L[7])
    d = hand[:, :3, :3] @ srs.wrist + hand[:, :3, 3] - srs.shoulder
    d_norm = np.linalg.norm(d, axis=1)
    # |d|^2 = |upper + Rz(q4) fore|^2 = offset + 2 swing cos(q4 - middle)
    a, b = u[0] * p[0] + u[1] * p[1], u[1] * p[0] - u[0] * p[1]
    offset, swing = u @ u + p @ p + 2.0 * u[2] * p[2], float(np.hypot(a, b))
    cos = np.clip((d_norm * d_norm - offset) / (2.0 * swing), -1.0, 1.0)
    miss = np.abs(d_norm - np.sqrt(np.maximum(offset + 2.0 * swing * cos, 0.0)))
    is_reached = (miss <= tol.SOLUTION * srs.arm.reach) & (d_norm > tol.NO_SIZE * srs.arm.reach)
    angle = np.arccos(cos)
    angle = np.where(angle < tol.ROUNDING_DISTANCE, 0.0, np.where(angle > np.pi - tol.ROUNDING_DISTANCE, np.pi, angle))
    single = (angle == 0.0) | (angle == np.pi)  # the two elbows are the same
    row, side = np.nonzero(np.stack([is_reached, is_reached & ~single], axis=1))
    q4 = np.arctan2(b, a) + np.where(side == 0, angle[row], -angle[row])
    elbow = L[3][:3, :3] @ rotation_about(2, q4)
    # columns first, targets last
    f, g = (_frame(v).transpose(2, 1, 0) for v in (d[row], elbow @ p + L[3][:3, :3] @ u))
    dyad = np.einsum("aim,bjm->abijm", f, g)
    upper = np.stack([dyad[2, 2], dyad[0, 0] + dyad[1, 1], dyad[1, 0] - dyad[0, 1]])  # f Rz(psi) g'
    fore = np.einsum("mjk,eijm->ekim", elbow @ L[4][:3, :3], upper)
    hand = np.einsum("ekim,mil->eklm", fore, hand[row, :3, :3])
    R = np.stack([upper, hand], axis=3)
    stretched = (np.abs(R[0, 2, 2]) + np.hypot(R[1, 2, 2], R[2, 2, 2]) > 1.0 - tol.SHARP_DISCRIMINANT).any(axis=0)
    complete = d_norm > tol.SOLUTION * srs.arm.reach
    complete[row[stretched]] = False
    return _Circles(R, q4, row, side, complete)


def _angles(srs: ArmAngle, R: Array, psi: Array) -> Array:
    """Angles t (3, 2, M, ...) of shoulder and wrist, their first halves, at psi (M, ...); R: of `_Circles`."""
    parts = R.reshape(3, 3, 3, 2, len(psi), *[1] * (psi.ndim - 1))[:, :, ::2]
    (x0, z0), (x1, z1), (x2, z2) = parts[0] + parts[1] * np.cos(psi) + parts[2] * np.sin(psi)
    r = np.hypot(z0, z1)
    size = np.where(r > tol.ROUNDING, r, 1.0)
    c, s = np.where(r > tol.ROUNDING, z0 / size, 1.0), z1 / size
    t3 = np.arctan2(s * x0 - c * x1, r * x2 - z2 * (c * x0 + s * x1))
    return np.stack([np.arctan2(s, c), np.arctan2(r, -z2), t3])


def _joint_values(srs: ArmAngle, t: Array, flip: Array) -> Array:
    """Joint values (3, 2, ...) of shoulder and wrist: of the first half, or where flip of t + pi, -t, t + pi."""
    second_half = np.stack([t[0] + np.pi, -t[1], t[2] + np.pi])
    return np.asarray(np.where(flip, second_half, t) - srs.offset.reshape(3, 2, *[1] * (t.ndim - 2)))


def _roots(a: Array, b: Array, c: Array) -> Array:
    """The two angles (M, 2) where a cos + b sin = c; where there is none the one that comes closest, twice."""
    half_angle = np.arccos(np.clip(c / np.maximum(np.hypot(a, b), tol.TINY), -1.0, 1.0))
    middle = np.arctan2(b, a)
    return np.stack([middle - half_angle, middle + half_angle], axis=1)


def _turning_rate(R: Array) -> tuple[Array, Array, Array]:
    """a, b, c (M,): the last joint turns at the rate (a cos(psi) + b sin(psi) + c) / (R31^2 + R32^2)."""
    x, y = R[:, 2, 0, 1], -R[:, 2, 1, 1]
    return x[0] * y[2] - y[0] * x[2], y[0] * x[1] - x[0] * y[1], x[1] * y[2] - y[1] * x[2]


def _special_angles(srs: ArmAngle, R: Array, near: Array) -> Array:
    """Values of psi (M, K), sorted, where a joint may stand on a limit or at near (M, n), or the last one turns back,
    and some between."""
    rate = _turning_rate(R)
    angles = [_roots(rate[0], rate[1], -rate[2])]
    for k, joints in enumerate(JOINTS):
        e = R[:, :, :, k]
        for i, joint in enumerate(joints):
            lower, upper = srs.arm.lower[joint], srs.arm.upper[joint]
            for value in [near[:, joint], *([lower, upper] if upper - lower < TURN else [])]:
                t = value + srs.offset[i, k]
                c, s = np.cos(t), np.sin(t)
                if i == 1:
                    angles.append(_roots(e[1, 2, 2], e[2, 2, 2], -c - e[0, 2, 2]))
                else:
                    f = e[:, 0, 2] * s - e[:, 1, 2] * c if i == 0 else e[:, 2, 0] * s + e[:, 2, 1] * c
                    angles.append(_roots(f[1], f[2], -f[0]))
    angles.append(np.broadcast_to(np.arange(EVEN_SAMPLES) * (TURN / EVEN_SAMPLES), (len(near), EVEN_SAMPLES)))
    return np.sort(np.remainder(np.concatenate(angles, axis=1), TURN), axis=1)


class _Samples(NamedTuple):
    """On curves (M, 2, 2), the halves of shoulder and wrist, at 2 K samples: K places and the middles behind them."""

    psi: Array  # (M, 2 K + 1)
    cost: Array  # (M, 2, 2, 2 K) motion from near
    legal: Bool  # (M, 2, 2, 2 K)
    rises: Bool  # (M, K) whether the last joint grows behind a place
    legal_between: Bool  # (M, 2, 2, K) legal behind a place
    isolated_legal: Bool  # (M, 2, 2, K) legal at a place, and neither before nor behind it
    turned: Array  # (M, 2 K) the last joint, of the first half


def _samples(srs: ArmAngle, circles: _Circles, near: Array) -> _Samples:
    """Samples of the curves of circles M; near: (M, n) [rad]."""
    arm = srs.arm
    psi = _special_angles(srs, circles.R, near)
    M, K = psi.shape
    ends = np.concatenate([psi, psi[:, :1] + TURN], axis=1)
    psi = np.empty((M, 2 * K + 1))
    psi[:, ::2], psi[:, 1::2] = ends, 0.5 * (ends[:, 1:] + ends[:, :-1])
    t = _angles(srs, circles.R, psi[:, :-1])
    elbow, elbow_fits = nearest_of_joint(arm, 3, circles.q4, near[:, 3])
    cost = np.broadcast_to(np.abs(elbow - near[:, 3])[:, None, None, None], (M, 2, 2, 2 * K)).copy()
    legal = np.broadcast_to(np.broadcast_to(elbow_fits, M)[:, None, None, None], cost.shape).copy()
    for side in range(2):
        q = _joint_values(srs, t, np.array(side == 1))
        for k, joints in enumerate(JOINTS):
            halves = (slice(None), side) if k == 0 else (slice(None), slice(None), side)
            for i, joint in enumerate(joints):
                reference = near[:, joint, None]
                value, in_limits = nearest_of_joint(arm, joint, q[i, k], reference)
                change, fits = np.abs(value - reference), np.broadcast_to(in_limits, (M, 2 * K))
                cost[halves] += change[:, None]
                legal[halves] &= fits[:, None]
    a, b, c = (x[:, None] for x in _turning_rate(circles.R))
    middle = psi[:, 1::2]
    rises = (a * np.cos(middle) + b * np.sin(middle) + c >= 0.0) | (np.hypot(a, b) + np.abs(c) < tol.NO_SIZE)
    # a piece shorter than rounding has the sense of the piece before it
    has_length = np.diff(ends, axis=1) > tol.EXACT
    source = np.maximum.accumulate(np.where(np.tile(has_length, 2), np.arange(2 * K), -1), axis=1)[:, K:] % K
    rises = np.take_along_axis(rises, source, axis=1)
    legal_cell = np.take_along_axis(legal[..., 1::2], source[:, None, None], axis=3)
    isolated = legal[..., ::2] & has_length[:, None, None] & ~legal_cell & ~np.roll(legal_cell, 1, axis=3)
    return _Samples(psi, cost, legal, rises, legal_cell, isolated, t[2, 1] - srs.offset[2, 1])


class Turning(NamedTuple):
    """`families.Curves` of targets (N, 4, 4) by the arm angle: it is their parameter."""

    srs: ArmAngle
    circles: _Circles
    near: Array  # (N, n)
    pieces: Pieces
    short: Bool
    complete: Bool  # (N,) whether no curve of a target can be missing
    steps: int = STEPS

    @classmethod
    def along(cls, srs: ArmAngle, target: Array, near: Array) -> Turning:
        """The curves of targets, near (N, n)."""
        circles = _circles(srs, target)
        pieces = _pieces(srs, circles, near[circles.row]) if len(circles.row) else none(srs.arm.n)
        curves = cls(srs, circles, near, pieces, np.zeros(len(target), bool), circles.complete)
        return curves._replace(pieces=pieces._replace(start=curves.at(pieces, pieces.at)[0]))

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """A posture (P, n) on each piece, at its legal copy nearest to near, and whether it is legal."""
        place = np.zeros((len(self.near), 2), np.intp)
        place[self.circles.row, self.circles.half] = np.arange(len(self.circles.row))
        circle = place[pieces.row, pieces.branch // 4]
        t = _angles(self.srs, self.circles.R[..., circle], parameter)
        q = _joint_values(self.srs, t, np.stack([pieces.branch // 2 % 2 == 1, pieces.branch % 2 == 1]))
        row = np.stack([*q[:, 0], self.circles.q4[circle], *q[:, 1]], axis=1)
        return nearest_row(self.srs.arm, row, self.near[pieces.row])


def _pieces(srs: ArmAngle, circles: _Circles, near: Array) -> Pieces:
    """All pieces of M circles, by the cost of their samples from near (M, n) [rad]; each start (n,) is left zero."""
    samples = _samples(srs, circles, near)
    M, K = samples.rises.shape
    curve, begin, count, legal = _spans(samples)
    circle, first, last = curve // 4, 2 * begin, 2 * (begin + count)
    start = samples.turned[circle, first] + np.pi * (curve % 2)
    travel = _travel(samples, circle, first, last)
    end = start + np.where(samples.rises[circle, begin], travel, -travel)
    costs = np.concatenate([samples.cost, np.where(samples.legal, samples.cost, np.inf)]).reshape(-1, 2 * K)
    best = first + best_samples(costs, curve + 4 * M * legal, first, 2 * count + 1)

    def psi(sample: Int) -> Array:
        return np.asarray(samples.psi[circle, sample % (2 * K)] + TURN * (sample // (2 * K)))

    return Pieces(
        row=circles.row[circle], branch=circles.half[circle] * 4 + curve % 4, legal=legal,
        a=np.minimum(start, end), b=np.maximum(start, end), first=psi(first), last=psi(last),
        low=psi(np.maximum(best - 1, first)), at=psi(best), high=psi(np.minimum(best + 1, last)),
        start=np.zeros((len(curve), srs.arm.n)),
    )  # fmt: skip


def _spans(samples: _Samples) -> tuple[Int, Int, Int, Bool]:
    """Spans of curves along which the last joint does not turn back, legal ones and those that hold no legal place: the
    curves (P,), counted over all (M, 2, 2), their first places, how many samples they are long, and whether legal."""
    between, isolated = (x.reshape(-1, x.shape[-1]) for x in (samples.legal_between, samples.isolated_legal))
    turns_back = np.repeat(samples.rises != np.roll(samples.rises, 1, axis=1), 4, axis=0)
    every = runs(np.ones_like(between), turns_back)
    empty = holding_none(between | isolated, *every)
    places = (*np.nonzero(isolated), np.zeros(isolated.sum(), np.intp))
    parts = [runs(between, turns_back), places, tuple(column[empty] for column in every)]
    curve, begin, count = (np.concatenate(column) for column in zip(*parts, strict=True))
    return curve, begin, count, np.arange(len(curve)) < len(curve) - empty.sum()


def _travel(samples: _Samples, circle: Int, first: Int, last: Int) -> Array:
    """How far the last joint turns along spans (P,) of samples, between two of which it is monotone; a turn at most."""
    sign = np.where(np.repeat(samples.rises, 2, axis=1), 1.0, -1.0)
    step = np.remainder(sign * (np.roll(samples.turned, -1, axis=1) - samples.turned), TURN)
    step[step > TURN - tol.ROUNDING_DISTANCE * 10] = 0.0  # rounding, backwards
    way = np.cumsum(np.tile(step, 2), axis=1)
    way = np.concatenate([np.zeros((len(way), 1)), way], axis=1)
    travel = way[circle, last] - way[circle, first]
    return np.where(last - first == step.shape[1], np.where(travel > np.pi, TURN, 0.0), travel)
