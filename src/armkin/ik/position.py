"""Three joints of any kind and arrangement that place a point: the quartic and its special cases.

Undo joint 1: of ``x = link[1] Z2 y(q3)``, y the tip in the frame of joint 2, only what joint
1 cannot change is known. For a revolute joint 1 that is its height on the axis and its
distance, for a prismatic one its two components across the axis. Both are linear in
``g = Rz(q2) y`` (Pieper, The Kinematics of Manipulators under Computer Control, 1968).

Revolute joint 2: two equations ``A (gx, gy) = r(q3)`` with a constant A.
  A regular: ``|A^-1 r|^2 = |y across joint 2|^2``, a quadratic form in (1, cos q3, sin q3) or,
  joint 3 prismatic, in (1, d3, d3^2): a quartic, up to four branches.
  A of rank one (neighbouring axes parallel, intersecting, or at right angles): a combination
  of the equations holds q3 alone, two roots; the other gives q2, two roots each.
Prismatic joint 2: the same with ``g = y + d2 z``, linear in d2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin import soa
from armkin.errors import UsageError
from armkin.ik.chain import Chain, inverse
from armkin.ik.geometry import EXACT, NEAR, Geometry
from armkin.ik.subproblems import (
    TOUCHING,
    Candidates,
    Pair,
    Prefer,
    linear,
    normalised,
    quadratic,
    rotation_between,
    trig_quadratic,
)
from armkin.ik.tasks import Task, rank
from armkin.soa import Array, Bool, Entry

if TYPE_CHECKING:
    from armkin.arm import Arm


class Position:
    """``link[0] Z1 link[1] Z2 link[2] Z3 tip``, three joints, revolute or prismatic, any geometry."""

    def __init__(self, chain: Chain, tip: Array, tolerance: float = EXACT) -> None:
        """chain: its first three joints are used; tip: (3,) the point after joint 3 to be placed [mm].

        tolerance: what still counts as a special case. `close` says that the arm is farther from one than that,
        but so near that its branches lie too close together for the general case's equations.

        Raises UsageError if the three joints cannot place a point in space.
        """
        self.prismatic = [bool(p) for p in chain.prismatic[:3]]
        self.scale = max(float(np.abs(chain.link[1:3, :3, 3]).max()), float(np.abs(tip).max()), 1e-9)
        self.from_base = soa.constant(inverse(chain.link[0]))
        L1, L2 = chain.link[1], chain.link[2]
        self.L1 = soa.constant(L1)
        R2, t2 = L2[:3, :3], L2[:3, 3]
        # y = Y b with b = (1, cos q3, sin q3) or (1, d3, d3^2)
        if self.prismatic[2]:
            self.Y = np.column_stack([R2 @ tip + t2, R2[:, 2], np.zeros(3)])
        else:
            x, y, z = tip
            self.Y = np.column_stack([R2[:, 2] * z + t2, R2[:, :2] @ [x, y], R2[:, :2] @ [-y, x]])
        self.across = self._form(self.Y[:2])  # |y across joint 2|^2 as a quadratic form in b
        self.square = self._form(self.Y)  # |y|^2
        self.rows, self.rest, self.forms = self._equations(L1)
        self.A = self.rows[:, :2] if not self.prismatic[1] else self.rows[:, 2:]
        self.tolerance = tolerance
        self.close = False
        # the true arm's roots may be real where these of a similar one only just miss
        self.touching = 0.3 if tolerance >= NEAR else TOUCHING
        self.why = self._split()

    def _equations(self, L1: Array) -> tuple[Array, Array, list[Array]]:
        """What joint 1 cannot change, as ``rows[k] . g + form_k(b) = known_k - rest[k]``."""
        R, t = L1[:3, :3], L1[:3, 3]
        none = np.zeros((3, 3))
        if self.prismatic[0]:
            return R[:2], t[:2], [none, none]
        # height: R[2] . g + t_z; half the squared distance: (|y|^2 or |g|^2) / 2 + (R^T t) . g + |t|^2 / 2
        return np.array([R[2], R.T @ t]), np.array([t[2], t @ t / 2]), [none, self.square / 2]

    def _split(self) -> str:
        """Find the combination of the two equations without q2, if there is one; say what was found."""
        weight = np.array([1.0, 1.0 if self.prismatic[0] else 1.0 / self.scale])
        scaled = self.A * weight[:, None]
        if self.prismatic[1]:
            # one unknown d2 (its square cancels in no combination): eliminate it between the rows
            self.regular = not self.prismatic[0] and self._is_regular(abs(float(self.rows[0, 2])))
            if self.prismatic[0] and np.abs(self.A).max() < 1e-9:
                raise UsageError("joints 1 and 2 slide along one line: three joints cannot place a point")
            return "joint 2 slides, so its value is eliminated first"
        U, S, _ = np.linalg.svd(scaled)
        if S[0] < 1e-9:
            raise UsageError("joints 1 and 2 turn about one line: three joints cannot place a point")
        self.regular = self._is_regular(float(S[1] / S[0]))
        self.alone = U[:, 1] * weight  # combination that holds q3 alone
        self.main = U[:, 0] * weight  # the one that gives q2
        return "a quartic gives joint 3" if self.regular else "special axes give joint 3 by itself"

    def _unit(self, pair: Pair) -> Pair:
        """On the unit circle, so that the residual shows a missing root; `near` looks at the length itself."""
        return pair if self.tolerance >= NEAR else normalised(pair)

    def _is_regular(self, off: float) -> bool:
        """Whether the general equations serve, off being how far the arm is from a special case."""
        self.close = self.tolerance < off <= NEAR
        return off > self.tolerance

    def _form(self, rows: Array) -> Array:
        """Quadratic form G with ``b^T G b = |rows b|^2`` (3 x 3); prismatic powers above two stay inside."""
        return np.asarray(rows.T @ rows)

    def solve(self, p: list[Entry], prefer: Prefer) -> tuple[list[Pair], Bool]:
        """Joint motions that bring the tip to p: three pairs on branch axes (b0, b1, 1, N), and doubt."""
        p1 = [np.atleast_1d(np.asarray(v, dtype=float)) for v in soa.apply(self.from_base, p)]
        p1 = list(np.broadcast_arrays(*p1))
        if self.prismatic[0]:
            known = np.array([p1[0], p1[1]])
        else:
            known = np.array([p1[2], (p1[0] ** 2 + p1[1] ** 2 + p1[2] ** 2) / 2])
        known = known - self.rest[:, None]
        if self.prismatic[1]:
            third, second, doubt = self._slide(known, prefer)
        elif self.regular:
            third, second, doubt = self._quartic(known, prefer)
        else:
            third, second, doubt = self._rank_one(known, prefer)
        y = self._tip(third)
        if second.s is None:
            g = [y[0], y[1], y[2] + second.c]
        else:
            g = [second.c * y[0] - second.s * y[1], second.s * y[0] + second.c * y[1], y[2]]
        x = soa.apply(self.L1, g)
        if self.prismatic[0]:
            first = Pair(p1[2] - x[2], None)
        else:
            first, doubt1 = rotation_between(x[0], x[1], p1[0], p1[1], self.scale, prefer[0])
            doubt = doubt | doubt1
        return [first, second, third], doubt

    def _tip(self, third: Pair) -> list[Array]:
        if third.s is None:
            return [self.Y[i, 0] + self.Y[i, 1] * third.c for i in range(3)]
        return [self.Y[i, 0] + self.Y[i, 1] * third.c + self.Y[i, 2] * third.s for i in range(3)]

    def _affine(self, weights: Array, known: Array) -> Array:
        """``weights . (known - forms - rows_z y_z)`` as coefficients of (1, b1, b2, b1^2, b1 b2, b2^2): (6, N)."""
        height = self.Y[2]
        total = np.zeros((6, known.shape[1]))
        total[0] = weights @ known
        for w, row, form in zip(weights, self.rows, self.forms, strict=True):
            total[:3] -= (w * row[2] * height)[:, None]
            total -= w * _six(form)[:, None]
        return self._reduce(total)

    def _reduce(self, six: Array) -> Array:
        """|y|^2 is affine in (1, cos, sin) although its form is quadratic: use cos^2 + sin^2 = 1."""
        if not self.prismatic[2]:
            six = six.copy()
            six[0] += six[5]
            six[3] -= six[5]
            six[5] = 0.0
        return six

    def _quartic(self, known: Array, prefer: Prefer) -> tuple[Pair, Pair, Bool]:
        inverse_A = np.linalg.inv(self.A)
        g = [self._affine(row, known) for row in inverse_A]  # coefficients of gx, gy
        if self.prismatic[2]:
            # gx, gy are quadratic in d3; with d3 = scale tan(q/2) the quartic becomes a trigonometric one
            k = [-c for c in _expand(_six(self.across)[:, None] * np.ones((1, known.shape[1])))]
            for six in g:
                quad = [six[0], six[1], six[3]]
                for i in range(3):
                    for j in range(3):
                        k[i + j] = k[i + j] + quad[i] * quad[j]
            if self.prismatic[0]:  # nothing beyond d^2
                d, doubt = quadratic(k[2], k[1], k[0], 0, self.scale)
                return self._turn(g, Pair(d, None), doubt, prefer)
            k0, k1, k2, k3, k4 = (v * self.scale**i for i, v in enumerate(k))
            ecc = (k4 + k0 - k2) / 4
            form = [k2 / 2 + ecc, (k0 - k4) / 2, (k1 + k3) / 4, ecc, (k1 - k3) / 4, 0.0 * k0]
            q, doubt = trig_quadratic(form, self.touching)
            return self._turn(g, Pair(self.scale * np.tan(q / 2)[:, None, None, :], None), doubt, prefer)
        six = -_six(self.across)[:, None] + sum(_square(affine) for affine in g)
        q, doubt = trig_quadratic(list(six), self.touching)
        return self._turn(g, Pair(np.cos(q)[:, None, None, :], np.sin(q)[:, None, None, :]), doubt, prefer)

    def _turn(self, g: list[Array], third: Pair, doubt: Bool, prefer: Prefer) -> tuple[Pair, Pair, Bool]:
        """Joint 2 from the known g, given as six coefficients each."""
        last = 2 if third.s is not None else 3
        b2 = third.s if third.s is not None else third.c**2
        gx, gy = (six[0] + six[1] * third.c + six[last] * b2 for six in g)
        y = self._tip(third)
        second, doubt2 = rotation_between(y[0], y[1], gx, gy, self.scale, prefer[1])
        return third, second, doubt | doubt2

    def _rank_one(self, known: Array, prefer: Prefer) -> tuple[Pair, Pair, Bool]:
        alone = self._affine(self.alone, known)
        if self.prismatic[2]:
            d, doubt = quadratic(alone[3], alone[1], alone[0], 0, self.scale)
            third = Pair(d, None)
        else:
            # the combination is affine in (cos, sin): cos^2 and cos sin have cancelled
            third, doubt = linear(alone[1], alone[2], -alone[0], 0, self.scale, prefer[2])
            third = self._unit(third)
        y = self._tip(third)
        main = self._affine(self.main, known)
        b1 = third.c
        b2 = third.c**2 if third.s is None else third.s
        right = main[0] + main[1] * b1 + (main[3] if third.s is None else main[2]) * b2
        ax, ay = self.main @ self.A
        second, doubt2 = linear(ax * y[0] + ay * y[1], ay * y[0] - ax * y[1], right, 1, self.scale, prefer[1])
        return third, self._unit(second), doubt | doubt2

    def _slide(self, known: Array, prefer: Prefer) -> tuple[Pair, Pair, Bool]:
        """Joint 2 prismatic: g = y + d2 z."""
        across = [
            [known[k] - self.rows[k] @ self.Y[:, 0], -(self.rows[k] @ self.Y[:, 1]), -(self.rows[k] @ self.Y[:, 2])]
            for k in range(2)
        ]  # known_k - rows_k . y, coefficients of (1, b1, b2)
        zero = np.zeros_like(known[0])
        z0, z1 = self.rows[:, 2]
        if self.prismatic[0]:
            # two equations linear in d2: eliminate it, then take it from the larger one
            only = [z1 * a - z0 * b + zero for a, b in zip(*across, strict=True)]
            third, doubt = self._one_unknown(only, prefer)
            k = 0 if abs(z0) >= abs(z1) else 1
            second = Pair(self._at(across[k], third) / self.rows[k, 2], None)
            return third, second, doubt
        half = [self.square[0, 0] / 2, self.square[0, 1], self.square[0, 2]]  # |y|^2 / 2, R: affine in b
        curved = 0.0
        if self.prismatic[2]:
            curved = self.square[1, 1] / 2
        else:
            half[0] += self.square[1, 1] / 2  # cos^2 and sin^2 have equal factors and no product
        if not self.regular:
            # the height does not feel d2: it gives joint 3, then the distance gives d2
            third, doubt = self._one_unknown([v + zero for v in across[0]], prefer)
            y = self._tip(third)
            rest = self._at(across[1], third) - self._at(half, third)
            if third.s is None:
                rest = rest - curved * third.c**2
            # d^2 / 2 + (y_z + rows_z) d - rest = 0
            d, doubt2 = quadratic(0.5, y[2] + z1, -rest, 1, self.scale)
            return third, Pair(d, None), doubt | doubt2
        # d2 = (known_0 - rows_0 . y) / z0, affine in b, put into the distance
        d2 = [v / z0 + zero for v in across[0]]
        yz = [self.Y[2, j] + zero for j in range(3)]
        six = np.zeros((6, len(zero)))
        for j, v in enumerate(across[1]):
            six[j] -= v
        for j, v in enumerate(half):
            six[j] += v
        for j in range(3):
            six[j] += z1 * d2[j]
        six[3] += curved
        six += _product(d2, [v / 2 + w for v, w in zip(d2, yz, strict=True)])
        if self.prismatic[2]:
            d, doubt = quadratic(six[3], six[1], six[0], 0, self.scale)
            third = Pair(d, None)
        else:
            q, doubt = trig_quadratic(list(six), self.touching)
            third = Pair(np.cos(q)[:, None, None, :], np.sin(q)[:, None, None, :])
        return third, Pair(self._at(d2, third), None), doubt

    def _one_unknown(self, coefficients: list[Array], prefer: Prefer) -> tuple[Pair, Bool]:
        """Joint 3 from an equation affine in its b = (1, cos, sin) or (1, d)."""
        if self.prismatic[2]:
            slope = coefficients[1]
            if np.abs(slope).max() < 1e-12:
                raise UsageError("the three joints cannot place a point: they slide in one plane")
            return Pair((-coefficients[0] / slope)[None, None, None, :], None), np.zeros(1, bool)
        third, doubt = linear(coefficients[1], coefficients[2], -coefficients[0], 0, self.scale, prefer[2])
        return self._unit(third), doubt

    @staticmethod
    def _at(coefficients: list[Entry], third: Pair) -> Array:
        if third.s is None:
            return np.asarray(coefficients[0] + coefficients[1] * third.c)
        return np.asarray(coefficients[0] + coefficients[1] * third.c + coefficients[2] * third.s)


def _six(form: Array) -> Array:
    """A symmetric 3 x 3 form in (1, b1, b2) as coefficients of (1, b1, b2, b1^2, b1 b2, b2^2)."""
    return np.array([form[0, 0], 2 * form[0, 1], 2 * form[0, 2], form[1, 1], 2 * form[1, 2], form[2, 2]])


def _product(u: list[Array], v: list[Array]) -> Array:
    """Product of two affine functions of (b1, b2), as six coefficients (6, N)."""
    return np.array(
        [
            u[0] * v[0],
            u[0] * v[1] + u[1] * v[0],
            u[0] * v[2] + u[2] * v[0],
            u[1] * v[1],
            u[1] * v[2] + u[2] * v[1],
            u[2] * v[2],
        ]
    )


def _square(six: Array) -> Array:
    """Square of an affine function given as six coefficients whose quadratic ones are zero."""
    return _product(list(six[:3]), list(six[:3]))


def _expand(six: Array) -> list[Array]:
    """Six coefficients in (1, d, d^2) as b, to the powers d^0 ... d^4."""
    return [six[0], six[1], six[3] + six[2], six[4], six[5]]


def recognise(arm: Arm, task: Task, tolerance: float = EXACT) -> Geometry | None:
    """Any three joints that place a point."""
    if task.name != "xyz" or arm.n != 3:
        return None
    if rank(arm, task) < 3:
        raise UsageError(f"{arm.name}: its three joints cannot place a point: they move it in a plane or on a line")
    position = Position(Chain(arm.link, arm.prismatic), arm.link[3][:3, 3], tolerance)
    if position.close and tolerance == EXACT:
        return None
    kinds = "".join("P" if p else "R" for p in arm.prismatic)
    why = f"{kinds}: {position.why}"

    def solve(goal: list[Entry], prefer: Prefer) -> Candidates:
        return Candidates(*position.solve(goal, prefer))

    # a quartic's roots come in no order
    return Geometry("three joints", why, True, solve, ordered=not position.regular)
