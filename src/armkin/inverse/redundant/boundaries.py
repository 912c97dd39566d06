"""Where along the redundant joint another one may come to a limit or two branches may merge: all roots of equations.

Of arms whose axes 1 to 3 meet in a shoulder and whose axes 5 and 6 meet in a wrist (a Panda), with joint 7 at t: the
wrist, seen from the shoulder, goes round a circle, so its squared distance is h0 + h1 cos t + h2 sin t, and the cosine
of joint 4 is linear in it. Its sine is a square root, s; where axis 5 points has another one, g. A joint on a limit is
one equation in these: the axes on both its sides stand at a known angle to each other or to the line to the shoulder.
The product of such an equation over the signs of s and g, over the squares that its fractions stand on, is a
trigonometric polynomial in t of degree 8 at most, whatever branches are real. Between its roots nothing changes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, numbers_within
from armkin.inverse.closed.wrist import meeting_point, perpendicular_foot
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.turn_roots import Real, Roots, roots, sampled_at
from armkin.model.arm import Arm
from armkin.model.joint_chain import is_parallel
from armkin.model.rotation import inverse, rotation_about, shrink_translations

DEGREE = 8  # degree of the polynomial whose roots are the boundaries
MORE_DIGITS = bool(np.finfo(np.longdouble).eps < np.finfo(float).eps)  # whether this computer has any
Z = np.array([0.0, 0.0, 1.0])  # the base's z axis
Complex = NDArray[np.complex128]


class _Rooted:
    """Numbers x + y s, of a square root s."""

    def __init__(self, x: Complex, y: Complex, square: Complex) -> None:
        self.x, self.y, self.square = x, y, square

    def __add__(self, other: "_Rooted | Complex | float") -> "_Rooted":
        x, y = (other.x, other.y) if isinstance(other, _Rooted) else (other, 0.0)
        return _Rooted(self.x + x, self.y + y, self.square)

    def __mul__(self, other: "_Rooted | Complex | float") -> "_Rooted":
        if not isinstance(other, _Rooted):
            return _Rooted(self.x * other, self.y * other, self.square)
        x = self.x * other.x + self.square * (self.y * other.y)
        return _Rooted(x, self.x * other.y + self.y * other.x, self.square)

    def __sub__(self, other: "_Rooted | Complex | float") -> "_Rooted":
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
    in_line: Array | None  # cosine and sine of joint 4 where axes 3 and 5 and the line between both are one


@lru_cache(maxsize=64)
def boundaries(arm: Arm) -> Boundaries | None:
    """What is constant of an arm of seven joints with such a shoulder and wrist, else None."""
    if arm.n != 7 or arm.prismatic.any():
        return None
    L = shrink_translations(arm.link, arm.reach)
    shoulder = meeting_point(L[1], L[2], tol.EXACT)
    if shoulder is None or is_parallel(L[5], tol.PARALLEL_SINE):
        return None
    on5 = perpendicular_foot(L[5])
    wrist = (inverse(L[5]) @ [*on5, 1.0])[:3]
    upper, fore = (inverse(L[3]) @ [*shoulder[1], 1.0])[:3], (L[4] @ [*on5, 1.0])[:3]
    if np.hypot(*wrist[:2]) > tol.EXACT or np.hypot(*_apart(upper, fore)) <= tol.NO_LENGTH:
        return None
    return Boundaries(arm, L, shoulder[0], upper, fore, wrist, _in_line(L, upper, fore))


def _apart(v: Array, w: Array) -> Array:
    """Cosine and sine of the angle about z from w (3,) to v (3,), times their lengths across it."""
    return np.array([v[:2] @ w[:2], v[1] * w[0] - v[0] * w[1]])


def _in_line(L: Array, upper: Array, fore: Array) -> Array | None:
    """Cosine and sine (2,) of joint 4 at which axes 3 and 5 are one line, or None."""
    axis3, axis5 = L[3][:3, :3].T @ Z, L[4][:3, 2]
    way = _apart(axis3, axis5)
    for cos, sin in way / np.hypot(*way), -way / np.hypot(*way):
        turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], Z])  # rotation about z by -q4
        if max(np.abs(np.cross(v, axis5)).max() for v in (turn @ axis3, turn @ upper - fore)) <= tol.EXACT:
            return np.array([cos, sin])
    return None


class _WristFrame:
    """The arm with joint 7 held at t (M,), at targets `from_joint7`: what is about the wrist, seen behind joint 6."""

    def __init__(self, bounds: Boundaries, rotation: Array, shoulder: Array, t: Complex) -> None:
        self.bounds, self.rotation, self.t = bounds, rotation, t
        self.u = self.seen_behind6(shoulder) + (bounds.link[6][:3, 3] - bounds.wrist)[:, None, None]  # to the shoulder
        self.u_square = (self.u * self.u).sum(axis=0)
        # the wrist's squared distance is offset - 2 swing cos(q4 - middle)
        upper, fore, way = bounds.upper, bounds.fore, _apart(bounds.upper, bounds.fore)
        offset, swing = upper @ upper + fore @ fore - 2.0 * upper[2] * fore[2], np.sqrt(way @ way)
        self.middle = way / swing  # its cosine and sine
        self.cos = (offset - self.u_square) / (2.0 * swing)  # cosine of joint 4, from its middle
        self.square = 1.0 - self.cos * self.cos  # square of its sine, s

    def seen_behind6(self, v: Array) -> Complex:
        """Vectors (S, 3) seen behind joint 7, as seen behind joint 6 (3, S, M)."""
        c, s = np.cos(self.t), np.sin(self.t)
        x, y, z = v.T[:, :, None]
        return np.tensordot(self.bounds.link[6][:3, :3], np.stack([c * x - s * y, s * x + c * y, z + 0 * c]), 1)

    def before5(self, v: Array, origin: Array) -> list[_Rooted]:
        """A vector v (3,) seen before joint 4, less one seen behind it, as seen before joint 5."""
        c, s = self.middle
        # Rz(-q4) v = (vx, vy) cos(q4) + (vy, -vx) sin(q4), and q4 is the middle and an angle
        v_cos, v_sin = np.array([[v[0], v[1], 0.0], [v[1], -v[0], 0.0]])
        R = self.bounds.link[4][:3, :3].T
        parts = R @ (Z * v[2] - origin), R @ (c * v_cos + s * v_sin), R @ (c * v_sin - s * v_cos)
        return [_Rooted(a + b * self.cos, d + 0 * self.cos, self.square) for a, b, d in zip(*parts, strict=True)]


def _shoulder(frame: _WristFrame, e0: Array, e3: Array, cosine: float) -> Complex:
    """Where e0 (3,), seen before joint 1, and e3 (3,), seen behind joint 3, have an angle's cosine: values (S, M).

    With u from the wrist to the shoulder, p = u - h z6, q = z6 x p, d = z5 seen behind joint 5, and k1 = z5.u - h d2:

        e3 is w = (a z5 + b u + c z5 x u) / |z5 x u|^2,  z5 = d2 z6 + (k1 p + g q) / |p|^2,
        g^2 = (d0^2 + d1^2) |p|^2 - k1^2,  and of n, which is e0, (n.w - cosine) |z5 x u|^2 |p|^2 = A + g B.

    The product over both signs of g is A^2 - g^2 B^2.
    """
    bounds, (px, py, h), u_square = frame.bounds, frame.u, frame.u_square
    d = bounds.link[5][:3, :3].T @ Z
    # in the frame before joint 5, whose z axis is z5: u, w, and w's coefficients a, b, c
    u = frame.before5(bounds.upper, bounds.fore)
    w = frame.before5(bounds.link[3][:3, :3].T @ e3, np.zeros(3))
    k, u_w = u[2], u[0] * w[0] + u[1] * w[1] + u[2] * w[2]
    a, b, c = w[2] * u_square - k * u_w, u_w - k * w[2], w[1] * u[0] - w[0] * u[1]
    cross_square, p_square = k * k * -1.0 + u_square, px * px + py * py
    # in the frame behind joint 6, whose z axis is z6: n, n.p and n.q
    nx, ny, nz = frame.seen_behind6(e0 @ frame.rotation)
    n_p, n_q = nx * px + ny * py, ny * px - nx * py
    k1 = k - h * d[2]
    A = a * (k1 * n_p + d[2] * nz * p_square) + b * ((n_p + h * nz) * p_square)
    A = A + c * (k1 * (-h * n_q) + d[2] * n_q * p_square) - cross_square * (cosine * p_square)
    B = a * n_q + c * (h * n_p - nz * p_square)
    g_square = k1 * k1 * -1.0 + (d[0] * d[0] + d[1] * d[1]) * p_square
    product = A * A - g_square * (B * B)
    value = product.product() / (p_square * p_square * cross_square.product())  # over the signs of s
    if bounds.in_line is not None and np.array_equal(e3, Z):  # twice a root there, of branches that are not real
        value = value / (frame.cos - frame.middle @ bounds.in_line) ** 2
    return np.asarray(value)


def _limits_of_joint(arm: Arm, j: int) -> list[float]:
    """The limits of joint j that it may come to."""
    lower, upper = float(arm.lower[j]), float(arm.upper[j])
    return [lower, upper] if upper - lower < 2 * np.pi else []


def from_joint7(bounds: Boundaries, target: Array) -> tuple[Array, Array]:
    """Targets (S, 4, 4) as the frame behind joint 7: its rotations (S, 3, 3), and the shoulder (S, 3) seen there."""
    T = shrink_translations(target, bounds.arm.reach) @ inverse(bounds.link[7])
    return T[:, :3, :3], (inverse(T) @ (bounds.link[0] @ [*bounds.shoulder, 1.0]))[:, :3]


def equations(bounds: Boundaries, rotation: Array, shoulder: Array, t: Complex) -> Complex:
    """Values (F, S, M) of all polynomials at t (M,), of targets `from_joint7`."""
    frame = _WristFrame(bounds, rotation, shoulder, t)
    R, limits = bounds.link[:, :3, :3], [_limits_of_joint(bounds.arm, j) for j in range(6)]
    axis1, axis5 = R[0] @ Z, R[5].T @ Z
    u, h = frame.before5(bounds.upper, bounds.fore), frame.u[2]
    middle, way = R[1][2, 2] * R[2][2, 2], float(np.hypot(*R[1][2, :2]) * np.hypot(*R[2][:2, 2]))
    # branches of a shoulder merge where axes 1 and 3 are as near to each other, or as far, as axis 2 lets them
    apart = [cosine for cosine in (middle - way, middle + way) if abs(cosine) < 1.0 - tol.EXACT]
    values = [_shoulder(frame, axis1, Z, cosine) for cosine in apart]
    values += [_shoulder(frame, R[0] @ rotation_about(2, q) @ R[1] @ Z, Z, float(R[2][2, 2])) for q in limits[0]]
    values += [_shoulder(frame, axis1, Z, float((R[1] @ rotation_about(2, q) @ R[2])[2, 2])) for q in limits[1]]
    values += [_shoulder(frame, axis1, rotation_about(2, -q) @ R[2].T @ Z, float(R[1][2, 2])) for q in limits[2]]
    values += [frame.cos - cos for cos in (1.0, -1.0, *(frame.middle @ [np.cos(q), np.sin(q)] for q in limits[3]))]
    for q in limits[4]:  # axis 6 and the line to the shoulder
        x, y, z = rotation_about(2, q) @ R[5] @ Z
        values.append((u[0] * x + u[1] * y + u[2] * z - h).product())
    for q in limits[5]:  # axis 5 and that line
        values.append((u[2] - np.tensordot(rotation_about(2, -q) @ axis5, frame.u, 1)).product())
    k1 = u[2] - h * axis5[2]  # g is nothing
    values.append((k1 * k1 * -1.0 + (axis5[0] ** 2 + axis5[1] ** 2) * (frame.u[:2] ** 2).sum(axis=0)).product())
    return np.stack(values)


def _zeros(bounds: Boundaries, target: Array, real: Real, most: float) -> Roots:
    """Roots of all polynomials, of which of targets (S, 4, 4) each is, in numbers of a kind; most: as of `roots`."""
    rotation, shoulder = (x.astype(real) for x in from_joint7(bounds, target))
    # a rotation to the last digit
    rotation = np.asarray(rotation @ (3 * np.eye(3) - rotation.transpose(0, 2, 1) @ rotation) / 2)
    names = "link", "shoulder", "upper", "fore", "wrist"
    bounds = bounds._replace(**{name: getattr(bounds, name).astype(real) for name in names})
    values = equations(bounds, rotation, shoulder, sampled_at(DEGREE, real))
    F, S, M = values.shape
    found = roots(values.reshape(-1, M), DEGREE, most)
    return Roots(found.which % S, found.at, np.asarray(found.decided.reshape(F, S).all(axis=0)))


def boundary_angles(bounds: Boundaries, target: Array) -> tuple[Array, Bool]:
    """Where something may change at targets (S, 4, 4): (S, V), sorted, inf past the last; whether that is all (S,)."""
    S, zeros = len(target), _zeros(bounds, target, np.float64, tol.MOVED_ROOT)
    is_kept, limits = zeros.decided[zeros.which], np.array(_limits_of_joint(bounds.arm, 6))
    found = [(zeros.which[is_kept], zeros.at[is_kept]), (np.repeat(np.arange(S), len(limits)), np.tile(limits, S))]
    if MORE_DIGITS and len(rows := np.flatnonzero(~zeros.decided)):
        exact = _zeros(bounds, target[rows], np.longdouble, np.inf)
        found.append((rows[exact.which], exact.at))
        zeros.decided[rows] = exact.decided
    row, angles = (np.concatenate(column) for column in zip(*found, strict=True))
    angles = np.remainder(angles + np.pi, 2 * np.pi) - np.pi
    order = np.lexsort((angles, row))
    row, angles = row[order], angles[order]
    distinct = np.append(True, (np.diff(row) != 0) | (np.diff(angles) > tol.SAME_END))
    row, angles = row[distinct], angles[distinct]
    count = np.bincount(row, minlength=S)
    table = np.full((S, int(count.max(initial=0))), np.inf)
    table[row, numbers_within(count)] = angles
    return table, zeros.decided


def on_both_sides(angles: Array) -> Array:
    """Samples on both sides of places (S, V) of a turn: (S, 2 V), inf where there is none."""
    real = np.isfinite(angles)
    count = real.sum(axis=1)
    finite = np.where(real, angles, 0.0)
    first, last = finite[:, :1] + 2 * np.pi, finite[np.arange(len(angles)), count - 1] - 2 * np.pi
    gap_below = finite - np.concatenate([last[:, None], finite[:, :-1]], axis=1)
    next_angle = np.concatenate([finite[:, 1:], first], axis=1)
    gap_above = np.where(np.arange(angles.shape[1]) == count[:, None] - 1, first, next_angle) - finite
    sides = [finite - np.minimum(gap_below / 3, tol.BESIDE_END), finite + np.minimum(gap_above / 3, tol.BESIDE_END)]
    return np.where(np.tile(real, 2), np.remainder(np.hstack(sides) + np.pi, 2 * np.pi) - np.pi, np.inf)
