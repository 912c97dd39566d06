"""Where along the redundant joint another one may come to a limit or two branches may merge: all roots of equations.

Of arms whose axes 1 to 3 meet in a shoulder and whose axes 5 and 6 meet in a wrist (a Panda), with joint 7 at t: the
wrist, seen from the shoulder, goes round a circle, so its squared distance is h0 + h1 cos t + h2 sin t, and the cosine
of joint 4 is linear in it. Its sine is a square root, s; where axis 5 points has another one, g. A joint on a limit is
one equation in these: the axes on both its sides stand at a known angle to each other or to the line to the shoulder.
The product of such an equation over the signs of s and g, over the squares that its fractions stand on, is a
trigonometric polynomial in t of degree 8 at most, whatever branches are real. Between its roots nothing changes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, numbers_within
from armkin.inverse.closed.wrist import meeting_point, perpendicular_foot
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.turn_roots import roots, sampled_at
from armkin.model.arm import Arm
from armkin.model.joint_chain import is_parallel
from armkin.model.rotation import inverse, rotation_about, shrink_translations

DEGREE = 8  # degree of the polynomial whose roots are the boundaries
Z = np.array([0.0, 0.0, 1.0])  # the base's z axis
Complex = NDArray[np.complex128]


class _Rooted:
    """Numbers x + y s, of a square root s."""

    def __init__(self, x: Complex, y: Complex, square: Complex) -> None:
        self.x, self.y, self.square = x, y, square

    def __add__(self, other: _Rooted | Complex | float) -> _Rooted:
        x, y = (other.x, other.y) if isinstance(other, _Rooted) else (other, 0.0)
        return _Rooted(self.x + x, self.y + y, self.square)

    def __mul__(self, other: _Rooted | Complex | float) -> _Rooted:
        if not isinstance(other, _Rooted):
            return _Rooted(self.x * other, self.y * other, self.square)
        x = self.x * other.x + self.square * (self.y * other.y)
        return _Rooted(x, self.x * other.y + self.y * other.x, self.square)

    def __sub__(self, other: _Rooted | Complex | float) -> _Rooted:
        return self + other * -1.0

    def product(self) -> Complex:
        """The product of the numbers of both signs of the root."""
        return np.asarray(self.x * self.x - self.square * (self.y * self.y))


class Boundaries(NamedTuple):
    """What is constant of such an arm; lengths in reaches."""

    arm: Arm
    link: Array  # (8, 4, 4)
    shoulder: Array  # (3,) seen before joint 1
    upper: Array  # (3,) the shoulder, seen before joint 4
    fore: Array  # (3,) the wrist, seen behind joint 4
    wrist: Array  # (3,) seen behind joint 6
    in_line: float | None  # cosine of joint 4, from its middle, where axes 3 and 5 and the line between both are one
    still: float  # squared distance of the wrist: still - 2 swing cos(q4 - middle)
    swing: float
    middle: float


@lru_cache(maxsize=64)
def boundaries(arm: Arm) -> Boundaries | None:
    """What is constant of an arm of seven joints with such a shoulder and wrist, else None."""
    if arm.n != 7 or arm.prismatic.any():
        return None
    L = shrink_translations(arm.link, arm.reach)
    shoulder = meeting_point(L[1], L[2], tol.EXACT)
    if shoulder is None or is_parallel(L[5], tol.PARALLEL):
        return None
    on5 = perpendicular_foot(L[5])
    wrist = (inverse(L[5]) @ [*on5, 1.0])[:3]
    upper, fore = (inverse(L[3]) @ [*shoulder[1], 1.0])[:3], (L[4] @ [*on5, 1.0])[:3]
    along, across = upper[:2] @ fore[:2], upper[1] * fore[0] - upper[0] * fore[1]
    swing = float(np.hypot(along, across))
    if np.hypot(*wrist[:2]) > tol.EXACT or swing <= tol.NO_LENGTH:
        return None
    still = float(upper @ upper + fore @ fore - 2.0 * upper[2] * fore[2])
    middle = float(np.arctan2(across, along))
    return Boundaries(arm, L, shoulder[0], upper, fore, wrist, _in_line(L, upper, fore, middle), still, swing, middle)


def _in_line(L: Array, upper: Array, fore: Array, middle: float) -> float | None:
    """The cosine of joint 4 at which axes 3 and 5 are one line, or None."""
    axis3, axis5 = L[3][:3, :3].T @ Z, L[4][:3, 2]
    along, across = axis3[:2] @ axis5[:2], axis3[1] * axis5[0] - axis3[0] * axis5[1]
    for q4 in (np.arctan2(across, along), np.arctan2(-across, -along)):
        back, line = rotation_about(2, -q4), upper - rotation_about(2, q4) @ fore
        if max(np.abs(np.cross(back @ v, axis5)).max() for v in (axis3, line)) <= tol.EXACT:
            return float(np.cos(q4 - middle))
    return None


class _Held:
    """The arm with joint 7 held at t (M,), at targets (S, 4, 4): what is about the wrist, seen behind joint 6."""

    def __init__(self, bounds: Boundaries, target: Array, t: Complex) -> None:
        self.bounds, self.t = bounds, t
        self.target = shrink_translations(target, bounds.arm.reach)
        base = bounds.link[0] @ [*bounds.shoulder, 1.0]
        shoulder = (bounds.link[7] @ inverse(self.target) @ base)[:, :3]
        self.to = self.turned(shoulder) + (bounds.link[6][:3, 3] - bounds.wrist)[:, None, None]  # the shoulder
        self.far = (self.to * self.to).sum(axis=0)  # squared
        self.cos = (bounds.still - self.far) / (2.0 * bounds.swing)  # cosine of joint 4, from its middle
        self.square = 1.0 - self.cos * self.cos  # square of its sine, s

    def turned(self, v: Array) -> Complex:
        """Vectors (S, 3) seen behind joint 7, as seen behind joint 6 (3, S, M)."""
        c, s = np.cos(self.t), np.sin(self.t)
        x, y, z = v.T[:, :, None]
        return np.tensordot(self.bounds.link[6][:3, :3], np.stack([c * x - s * y, s * x + c * y, z + 0 * c]), 1)

    def before5(self, v: Array, origin: Array) -> list[_Rooted]:
        """A vector v (3,) seen before joint 4, less one seen behind it, as seen before joint 5."""
        c, s = np.cos(self.bounds.middle), np.sin(self.bounds.middle)
        # Rz(-q4) v = (vx, vy) cos(q4) + (vy, -vx) sin(q4), and q4 is the middle and an angle
        ahead = np.array([[v[0], v[1], 0.0], [v[1], -v[0], 0.0]])
        R = self.bounds.link[4][:3, :3].T
        parts = R @ (Z * v[2] - origin), R @ (c * ahead[0] + s * ahead[1]), R @ (c * ahead[1] - s * ahead[0])
        return [_Rooted(a + b * self.cos, d + 0 * self.cos, self.square) for a, b, d in zip(*parts, strict=True)]


def _shoulder(held: _Held, e0: Array, e3: Array, cosine: float) -> Complex:
    """Where e0 (3,), seen before joint 1, and e3 (3,), seen behind joint 3, have an angle's cosine: values (S, M)."""
    bounds, (px, py, h), far = held.bounds, held.to, held.far
    d = bounds.link[5][:3, :3].T @ Z  # axis 5, seen behind joint 5
    to = held.before5(bounds.upper, bounds.fore)  # the shoulder from the wrist
    w = held.before5(bounds.link[3][:3, :3].T @ e3, np.zeros(3))
    k = to[2]
    dot = to[0] * w[0] + to[1] * w[1] + to[2] * w[2]
    # w = (a z5 + b to + c z5 x to) / across, and axis 5 is (d2 z6 + (k1 p + g q) / round), q at right angles to p
    a, b, c = w[2] * far - k * dot, dot - k * w[2], w[1] * to[0] - w[0] * to[1]
    across, round6 = k * k * -1.0 + far, px * px + py * py
    k1 = k - h * d[2]
    nx, ny, nz = held.turned(e0 @ (held.target[:, :3, :3] @ bounds.link[7][:3, :3].T))
    p, q = nx * px + ny * py, ny * px - nx * py
    still = a * (k1 * p + d[2] * nz * round6) + b * ((p + h * nz) * round6)
    still = still + c * (k1 * (-h * q) + d[2] * q * round6) - across * (cosine * round6)
    moving = a * q + c * (h * p - nz * round6)
    g2 = k1 * k1 * -1.0 + (d[0] * d[0] + d[1] * d[1]) * round6
    product = still * still - g2 * (moving * moving)
    value = product.product() / (round6 * round6 * across.product())
    if bounds.in_line is not None and np.array_equal(e3, Z):  # twice a root there, of branches that are not real
        value = value / (held.cos - bounds.in_line) ** 2
    return np.asarray(value)


def _limits_of_joint(arm: Arm, j: int) -> list[float]:
    """The limits of joint j that it may come to."""
    lower, upper = float(arm.lower[j]), float(arm.upper[j])
    return [lower, upper] if upper - lower < 2 * np.pi else []


def _equations(bounds: Boundaries, target: Array) -> Complex:
    """Values of all polynomials at samples (F, S, M)."""
    held = _Held(bounds, target, sampled_at(DEGREE))
    R, limits = bounds.link[:, :3, :3], [_limits_of_joint(bounds.arm, j) for j in range(6)]
    axis1, axis5 = R[0] @ Z, R[5].T @ Z
    to, h = held.before5(bounds.upper, bounds.fore), held.to[2]
    values = [_shoulder(held, R[0] @ rotation_about(2, q) @ R[1] @ Z, Z, float(R[2][2, 2])) for q in limits[0]]
    values += [_shoulder(held, axis1, Z, float((R[1] @ rotation_about(2, q) @ R[2])[2, 2])) for q in limits[1]]
    values += [_shoulder(held, axis1, rotation_about(2, -q) @ R[2].T @ Z, float(R[1][2, 2])) for q in limits[2]]
    values += [held.cos - cos for cos in (1.0, -1.0, *(float(np.cos(q - bounds.middle)) for q in limits[3]))]
    for q in limits[4]:  # axis 6 and the line to the shoulder
        x, y, z = rotation_about(2, q) @ R[5] @ Z
        values.append((to[0] * x + to[1] * y + to[2] * z - h).product())
    for q in limits[5]:  # axis 5 and that line
        values.append((to[2] - np.tensordot(rotation_about(2, -q) @ axis5, held.to, 1)).product())
    k1 = to[2] - h * axis5[2]  # g is nothing
    values.append((k1 * k1 * -1.0 + (axis5[0] ** 2 + axis5[1] ** 2) * (held.to[:2] ** 2).sum(axis=0)).product())
    return np.stack(values)


def boundary_angles(bounds: Boundaries, target: Array) -> tuple[Array, Bool]:
    """Where something may change at targets (S, 4, 4): (S, V), sorted, inf where there are fewer; whether these are all
    (S,)."""
    values = _equations(bounds, target)
    F, S, M = values.shape
    zeros = roots(values.reshape(-1, M), DEGREE)
    limits = np.array(_limits_of_joint(bounds.arm, 6))
    row = np.concatenate([zeros.which % S, np.repeat(np.arange(S), len(limits))])
    angles = np.concatenate([zeros.at, np.tile(limits, S)])
    angles = np.remainder(angles + np.pi, 2 * np.pi) - np.pi
    order = np.lexsort((angles, row))
    row, angles = row[order], angles[order]
    apart = np.append(True, (np.diff(row) != 0) | (np.diff(angles) > tol.SAME_END))
    row, angles = row[apart], angles[apart]
    count = np.bincount(row, minlength=S)
    table = np.full((S, int(count.max(initial=0))), np.inf)
    table[row, numbers_within(count)] = angles
    return table, np.asarray(zeros.decided.reshape(F, S).all(axis=0))


def on_both_sides(angles: Array) -> Array:
    """Samples on both sides of places (S, V) of a turn: (S, 2 V), inf where there is none."""
    real = np.isfinite(angles)
    count = real.sum(axis=1)
    finite = np.where(real, angles, 0.0)
    first, last = finite[:, :1] + 2 * np.pi, finite[np.arange(len(angles)), count - 1] - 2 * np.pi
    before = finite - np.concatenate([last[:, None], finite[:, :-1]], axis=1)
    following = np.concatenate([finite[:, 1:], first], axis=1)
    behind = np.where(np.arange(angles.shape[1]) == count[:, None] - 1, first, following) - finite
    sides = [finite - np.minimum(before / 3, tol.BESIDE_END), finite + np.minimum(behind / 3, tol.BESIDE_END)]
    return np.where(np.tile(real, 2), np.remainder(np.hstack(sides) + np.pi, 2 * np.pi) - np.pi, np.inf)
