"""Three turning joints near a special case: all four roots from an eigenvalue problem that the nearness does not blur.

Of ``closed.three_joints``' two equations ``A g = r(q3)``, ``g = Rz(q2) y``, A is then nearly of rank one: by its
singular values S0, ``S1 << S0``, ``S1 (V1 . g) = e(q3)`` and ``V0 . g = m(q3)``, both affine in (1, cos q3, sin q3).
As ``|g| = |y|`` across joint 2, ``e^2 + S1^2 (m^2 - y1^2 - y2^2) = 0``. Multiplied out this is a quartic whose roots
lie in pairs, S1 apart. It is also

    det [ e - S1 y1, S1 (y2 - m) ; S1 (y2 + m), e + S1 y1 ] = 0,

whose entries are affine, too: with the tangent of half an angle a quadratic pencil of two rows (Tisseur & Meerbergen,
The Quadratic Eigenvalue Problem, 2001), linearised four eigenvalues. Rounding moves its entries by as much as those of
one joint alone, and with them the roots by 1e-16 / S1: nothing is lost, unless two roots all but meet.
"""

from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Bool, slices
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.closed.geometry import Geometry, Rows
from armkin.inverse.closed.three_joints import Position
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain
from armkin.model.rotation import inverse

CHUNK = 1024  # targets solved at once
ORDERS = np.array(list(permutations(range(4))))  # orders of four roots: which of them goes where


class _Roots(NamedTuple):
    """The roots of N targets."""

    q: Array  # (N, 4, 3)
    is_real: Bool  # (N, 4)
    imaginary_part: Array  # (N, 4) [rad] the largest of joints 2 and 3
    has_free_joint: Bool  # (N,)


class PositionPencil:
    """The equations of an arm of three turning joints, prepared."""

    def __init__(self, arm: Arm, task: Task) -> None:
        position = Position(Chain(arm.link, arm.prismatic), arm.link[3][:3, 3], tol.EXACT, 0.0)
        self.arm, self.task, self.scale = arm, task, position.scale
        self.from_base, self.constant = inverse(arm.link[0]), position.rest
        self.weights = np.array([[1.0, 0.0], [0.0, 1.0 / position.scale]])
        U, S, self.V = np.linalg.svd(self.weights @ position.A)
        self.weights = U.T @ self.weights / position.scale
        self.weights[0] /= S[0]
        self.second_value, self.value_ratio = float(S[1]), float(S[1] / max(S[0], tol.TINY))
        self.fixed = np.array([position._affine(w, [0.0, 0.0])[:3] for w in self.weights], float)
        self.tip = position.Y / position.scale
        self.touching = max(tol.DOUBLE_DISTANCE, tol.BLUR_OF_PAIRS / max(self.value_ratio, tol.NO_SECOND) ** 0.5)

    def roots(self, target: Array) -> _Roots:
        """All four roots of targets (N, 3), complex ones by their real parts."""
        p = target @ self.from_base[:3, :3].T + self.from_base[:3, 3]
        right = np.stack([p[:, 2], 0.5 * (p * p).sum(axis=1)], axis=1) - self.constant
        m, e = (np.broadcast_to(fixed, (len(p), 3)).copy() for fixed in self.fixed)
        m[:, 0] += right @ self.weights[0]
        e[:, 0] += right @ self.weights[1]
        t, cosine, sine = self._half_tangents(m, e)
        cos_square = 1.0 / (1.0 + t * t)
        c, s = (1.0 - t * t) * cos_square, 2.0 * t * cos_square
        c, s = cosine * c - sine * s, sine * c + cosine * s

        def value(row: Array) -> Any:  # complex
            return row[..., 0, None] + row[..., 1, None] * c + row[..., 2, None] * s

        h0, h1 = value(m), value(e) / self.second_value
        gx, gy = (self.V[0, k] * h0 + self.V[1, k] * h1 for k in range(2))
        x, y, z = (value(row) for row in self.tip)
        radius2 = x * x + y * y
        on_axis = np.abs(radius2) < tol.NEARBY
        radius2 = np.where(on_axis, 1.0, radius2)
        c2, s2 = (x * gx + y * gy) / radius2, (x * gy - y * gx) / radius2
        imaginary = np.maximum(_imaginary(c, s), _imaginary(c2, s2))
        q2, q3 = np.arctan2(s2.real, c2.real), np.arctan2(s.real, c.real)
        c2, s2 = np.cos(q2), np.sin(q2)
        tip = np.stack([c2 * x.real - s2 * y.real, s2 * x.real + c2 * y.real, z.real], axis=2)
        tip = tip @ self.arm.link[1][:3, :3].T + self.arm.link[1][:3, 3] / self.scale
        q1 = np.arctan2(p[:, 1], p[:, 0])[:, None] - np.arctan2(tip[..., 1], tip[..., 0])
        free = (np.hypot(tip[..., 0], tip[..., 1]) < tol.NEARBY) | on_axis
        return _Roots(np.stack([q1, q2, q3], axis=2), t.imag == 0.0, imaginary, free.any(axis=1))

    def _half_tangents(self, m: Array, e: Array) -> tuple[NDArray[Any], Array, Array]:
        """Eigenvalues (N, 4): tan((q3 - psi) / 2); cosine and sine of psi, (N, 1): at ``psi + pi`` e is largest."""
        k, N = self.second_value, len(m)
        M = np.empty((N, 3, 2, 2))
        M[:, :, 0, 0], M[:, :, 0, 1] = e - k * self.tip[0], k * (self.tip[1] - m)
        M[:, :, 1, 0], M[:, :, 1, 1] = k * (self.tip[1] + m), e + k * self.tip[0]
        turn = np.hypot(e[:, 1], e[:, 2]) + tol.TINY
        turn = np.where(e[:, 0] < 0.0, turn, -turn)[:, None]
        cosine, sine = e[:, 1:2] / turn, e[:, 2:3] / turn
        c, s = cosine[:, :, None], sine[:, :, None]
        c_part, s_part = c * M[:, 1] + s * M[:, 2], c * M[:, 2] - s * M[:, 1]
        companion = np.zeros((N, 4, 4))
        companion[:, 0, 2] = companion[:, 1, 3] = 1.0
        right = np.concatenate([M[:, 0] + c_part, 2.0 * s_part], axis=2)
        companion[:, 2:] = -nudged(np.linalg.solve, M[:, 0] - c_part, right)
        return np.linalg.eigvals(companion), cosine, sine


def _imaginary(c: NDArray[Any], s: NDArray[Any]) -> Array:
    """The imaginary part [rad] of an angle whose cosine and sine these are."""
    return np.abs(np.log(np.maximum(np.abs(c + 1j * s), tol.TINY)))


def recognise(arm: Arm, task: Task, ideal: Geometry, why: str) -> Geometry | None:
    """All roots of three turning joints near the class `ideal`, whose branches' places they take."""
    pencil = PositionPencil(arm, task)
    seeds = recorded_formula(arm, task, ideal)
    if pencil.value_ratio < tol.NO_SECOND or np.prod(seeds.axes) != 4:
        return None

    def rows(target: Array) -> Rows:
        roots = stack_rows([_solve_chunk(pencil, target[part]) for part in slices(max(len(target), 1), CHUNK)])
        # each of the four places takes the root that makes their distances (N, places, roots) least in all
        distances = np.nan_to_num(newton.distances(arm, seeds.rows(target)[0], roots.q), nan=np.pi)
        order = ORDERS[distances[:, np.arange(4), ORDERS].sum(axis=2).argmin(axis=1)]
        return roots._replace(q=np.take_along_axis(roots.q, order[:, :, None], axis=1))

    return Geometry(f"near {ideal.name}", why, True, rows=rows, labels=ideal.labels, ordered=ideal.ordered, branches=4)


def _solve_chunk(pencil: PositionPencil, target: Array) -> Rows:
    """Branches (N, 4, 3), nan where a root is not real; guesses are complex roots that all but are."""
    arm, task, roots = pencil.arm, pencil.task, pencil.roots(target)
    row, place = np.nonzero(roots.is_real)
    root, size = newton.correct(arm, task, roots.q[row, place], target[row])
    q = np.full_like(roots.q, np.nan)
    q[row, place] = np.where((size <= tol.ANSWERED)[:, None], root, np.nan)
    absent = np.isnan(q[:, :, 0])
    near_root = absent & (roots.is_real | (roots.imaginary_part < pencil.touching))
    gaps = newton.distances(arm, q, q) + 9.0 * np.eye(4)
    meeting = (gaps < max(tol.APART_ROOTS, 2.0 * pencil.touching)).any(axis=(1, 2))
    doubt = near_root.any(axis=1) | meeting | roots.has_free_joint
    return Rows(q, doubt, np.ones(len(target), bool), None, np.where(near_root[:, :, None], roots.q, np.nan))
