"""Three joints of any kind and arrangement that place a point: the quartic and its special cases.

With joint 1 undone, only what joint 1 cannot change is known of ``x = link[1] Z2 y(q3)``, y the
tip in the frame of joint 2. For a revolute joint 1 these are the height on its axis and the
distance, for a prismatic one the two components across its axis. Both are linear in
``g = Rz(q2) y`` (Pieper, The Kinematics of Manipulators under Computer Control, 1968).

Revolute joint 2: two equations ``A (gx, gy) = r(q3)`` with a constant A.
  A regular: ``|A^-1 r|^2 = |y across joint 2|^2``, a quadratic form in (1, cos q3, sin q3) or,
  joint 3 prismatic, in (1, d3, d3^2): a quartic, up to four branches.
  A of rank one (neighbouring axes parallel, intersecting, or at right angles): a combination
  of the equations has only q3, with two roots; the other gives q2, two roots each.
Prismatic joint 2: the same with ``g = y + d2 z``, linear in d2.
"""

from itertools import accumulate, product
from typing import cast

import numpy as np

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry, Truth
from armkin.inverse.closed import quadratics
from armkin.inverse.closed import subproblems as sub
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.choose_task import rank
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain
from armkin.model.rotation import inverse


class Position:
    """``link[0] Z1 link[1] Z2 link[2] Z3 tip``, three joints, revolute or prismatic, any geometry."""

    def __init__(self, chain: Chain, tip: Array, tolerance: float = tol.EXACT, near: float = tol.NEAR_DEFECT) -> None:
        """chain: its first three joints are used; tip: (3,) the point after joint 3 to be placed [mm].

        tolerance: what still counts as a special case. `close` says that the arm is farther from one than that,
        but, by less than `near`, so near that its branches lie too close together for the general case's equations.

        Raises UsageError if the three joints cannot place a point in space.
        """
        self.prismatic = [bool(p) for p in chain.prismatic[:3]]
        self.scale = max(float(np.abs(chain.link[1:3, :3, 3]).max()), float(np.abs(tip).max()), tol.NO_LENGTH)
        self.from_base = pose.constant(inverse(chain.link[0]))
        L1, L2 = chain.link[1], chain.link[2]
        self.L1 = pose.constant(L1)
        R2, t2 = L2[:3, :3], L2[:3, 3]
        # y = Y b with b = (1, cos q3, sin q3) or (1, d3, d3^2)
        if self.prismatic[2]:
            self.Y = np.column_stack([R2 @ tip + t2, R2[:, 2], np.zeros(3)])
        else:
            x, y, z = tip
            self.Y = np.column_stack([R2[:, 2] * z + t2, R2[:, :2] @ [x, y], R2[:, :2] @ [-y, x]])
        self.across = self.Y[:2].T @ self.Y[:2]  # |y across joint 2|^2 as a quadratic form in b
        self.square = self.Y.T @ self.Y  # |y|^2
        self.rows, self.rest, self.forms = self._equations(L1)
        self.A = self.rows[:, :2] if not self.prismatic[1] else self.rows[:, 2:]
        self.tolerance, self.near = tolerance, near
        self.close = False
        self.why = self._split()

    def _equations(self, L1: Array) -> tuple[Array, Array, list[Array]]:
        """The two invariants of joint 1, as ``rows[k] . g + form_k(b) = known_k - rest[k]``."""
        R, t = L1[:3, :3], L1[:3, 3]
        none = np.zeros((3, 3))
        if self.prismatic[0]:
            return R[:2], t[:2], [none, none]
        # height: R[2] . g + t_z; half the squared distance: (|y|^2 or |g|^2) / 2 + (R^T t) . g + |t|^2 / 2
        return np.array([R[2], R.T @ t]), np.array([t[2], t @ t / 2]), [none, self.square / 2]

    def _split(self) -> str:
        """Find the combination of the two equations without q2, if there is one; returns the reason in words."""
        weight = np.array([1.0, 1.0 if self.prismatic[0] else 1.0 / self.scale])
        scaled = self.A * weight[:, None]
        if self.prismatic[1]:
            # one unknown d2 (its square cancels in no combination): eliminate it between the rows
            self.regular = not self.prismatic[0] and self._is_regular(abs(float(self.rows[0, 2])))
            if self.prismatic[0] and np.abs(self.A).max() < tol.NO_COEFFICIENT:
                raise UsageError("joints 1 and 2 slide along one line: three joints cannot place a point")
            return "joint 2 slides, so its value is eliminated first"
        U, S, _ = np.linalg.svd(scaled)
        if S[0] < tol.NO_COEFFICIENT:
            raise UsageError("joints 1 and 2 turn about one line: three joints cannot place a point")
        self.regular = self._is_regular(float(S[1] / S[0]))
        self.alone = U[:, 1] * weight  # combination that has only q3
        self.main = U[:, 0] * weight  # combination that gives q2
        return "a quartic gives joint 3" if self.regular else "special axes give joint 3 by itself"

    def _is_regular(self, ratio: float) -> bool:
        """Whether the general equations are used; ratio: the distance of the arm from a special case."""
        self.close = self.tolerance < ratio <= self.near
        return ratio > self.tolerance

    def solve(self, p: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        """Joint motions that bring the tip to p: three pairs on branch axes (b0, b1, 1, N), and doubt."""
        x, y, z = pose.apply(self.from_base, p)
        square = x * x + y * y + z * z
        # a slide may be far longer than the links
        size = arrays.sqrt(self.scale**2 + square) if any(self.prismatic) else self.scale
        sides = [x, y] if self.prismatic[0] else [z, 0.5 * square]
        sides = [arrays.sub(value, float(constant)) for value, constant in zip(sides, self.rest, strict=True)]
        if self.prismatic[1]:
            third, second, doubt = self._slide(sides, size, prefer)
        elif self.regular:
            third, second, doubt = self._quartic(sides, size, prefer)
        else:
            third, second, doubt = self._rank_one(sides, size, prefer)
        g = self._tip(third)
        g = sub.spin(*second, g) if second.s is not None else [g[0], g[1], g[2] + second.c]
        tip = pose.apply(self.L1, g)
        if self.prismatic[0]:
            first = Pair(z - tip[2], None)
        else:
            first, doubt1 = sub.rotation_between(tip[0], tip[1], x, y, size, prefer[0])
            doubt = doubt | doubt1
        return [first, second, third], doubt

    def _tip(self, third: Pair) -> list[Entry]:
        """The tip in the frame of joint 2."""
        return [_at_joint(row.tolist(), third) for row in self.Y]

    def _affine(self, weights: Array, sides: list[Entry]) -> list[Entry]:
        """``weights . (sides - forms - rows_z y_z)`` as coefficients of (1, b1, b2, b1^2, b1 b2, b2^2)."""
        fixed = np.zeros(6)
        for w, row, form in zip(weights, self.rows, self.forms, strict=True):
            fixed[:3] -= w * row[2] * self.Y[2]
            fixed -= w * quadratics.of_form(form)
        if not self.prismatic[2]:
            # |y|^2 is affine in (cos, sin) although its form is quadratic: cos^2 + sin^2 = 1
            fixed[[0, 3, 5]] += fixed[5] * np.array([1.0, -1.0, -1.0])
        six = cast("list[Entry]", fixed.tolist())
        six[0] = arrays.add(six[0], arrays.dot(weights.tolist(), sides))
        return six

    def _quartic(self, sides: list[Entry], size: Entry, prefer: Prefer) -> tuple[Pair, Pair, Doubt]:
        """Joint 3 as a root of the quartic, A regular; joint 2 then turns y(q3) to (gx, gy). size: a unit of length."""
        g = [self._affine(row, sides) for row in np.linalg.inv(self.A)]  # coefficients of gx, gy
        across = (-quadratics.of_form(self.across)).tolist()
        if not self.prismatic[2]:
            squared = quadratics.total(across, *(quadratics.product(six, six) for six in g))
            third, doubt = quadratics.turn(squared, size, prefer[2])
        else:
            # gx, gy are quadratic in d3; with d3 = scale tan(q/2) the quartic becomes a trigonometric one
            k: list[Entry] = [*across[:2], across[3] + across[2], across[4], across[5]]  # coefficients of d^0 ... d^4
            for six in g:
                quad = [six[0], six[1], six[3]]
                for i, j in product(range(3), repeat=2):
                    k[i + j] = arrays.add(k[i + j], arrays.mul(quad[i], quad[j]))
            if self.prismatic[0]:  # nothing beyond d^2
                d, doubt = sub.quadratic(k[2], k[1], k[0], 0, size, tol.NO_SIZE * size * size, prefer[2])
            else:
                d, doubt = _quartic_roots(k, size, prefer[2])
            third = Pair(d, None)
        gx, gy = (_at_joint(six, third) for six in g)
        y = self._tip(third)
        second, doubt2 = sub.rotation_between(y[0], y[1], gx, gy, size, prefer[1])
        return third, second, doubt | doubt2

    def _rank_one(self, sides: list[Entry], size: Entry, prefer: Prefer) -> tuple[Pair, Pair, Doubt]:
        """Solve for joints 2 and 3 where A has rank one: one combination of the equations holds q3 alone, one both."""
        alone = self._affine(self.alone, sides)
        if self.prismatic[2]:
            d, doubt = sub.quadratic(alone[3], alone[1], alone[0], 0, size, tol.NO_SIZE * size, prefer[2])
            third = Pair(d, None)
        else:
            # the combination is affine in (cos, sin): cos^2 and cos sin have cancelled
            a, b, c = alone[1], alone[2], arrays.mul(-1.0, alone[0])
            # rounding splits a double root by 1e-8; if the tip is then on axis 2, joint 2 must count as free
            third, doubt = sub.linear(a, b, c, 0, size, prefer[2], sub.one_root(a, b, c))
            third = sub.on_unit_circle(third)
        y = self._tip(third)
        main = self._affine(self.main, sides)
        right = _at_joint(main, third)
        ax, ay = (self.main @ self.A).tolist()
        a = arrays.add(arrays.mul(ax, y[0]), arrays.mul(ay, y[1]))
        b = arrays.sub(arrays.mul(ay, y[0]), arrays.mul(ax, y[1]))
        second, doubt2 = sub.linear(a, b, right, 1, size, prefer[1])
        # without a real joint 3 the nearest one may put the tip on axis 2, where no joint is free
        return third, sub.on_unit_circle(second), doubt | doubt2.where(_is_root(alone, third, size))

    def _slide(self, sides: list[Entry], size: Entry, prefer: Prefer) -> tuple[Pair, Pair, Doubt]:
        """Joint 2 prismatic: g = y + d2 z."""
        # known_k - rows_k . y, coefficients of (1, b1, b2)
        across: list[list[Entry]] = (-self.rows @ self.Y).tolist()
        for k in range(2):
            across[k][0] = arrays.add(across[k][0], sides[k])
        z0, z1 = self.rows[:, 2].tolist()
        if self.prismatic[0]:
            # two equations linear in d2: eliminate it, then take it from the larger one
            only = [arrays.sub(arrays.mul(z1, a), arrays.mul(z0, b)) for a, b in zip(*across, strict=True)]
            third, doubt = self._one_unknown(only, size, prefer)
            k = 0 if abs(z0) >= abs(z1) else 1
            return third, Pair(_at_joint(across[k], third) / float(self.rows[k, 2]), None), doubt
        # |y|^2 / 2, for a revolute joint 3 affine in b: cos^2 and sin^2 have equal factors and no product
        half = [self.square[0, 0] / 2, self.square[0, 1], self.square[0, 2]]
        curved = self.square[1, 1] / 2
        if not self.prismatic[2]:
            half[0], curved = half[0] + curved, 0.0
        half, curved = [float(v) for v in half], float(curved)
        if not self.regular:
            # the height does not depend on d2 and gives joint 3, then the distance gives d2
            third, doubt = self._one_unknown(across[0], size, prefer)
            remainder = arrays.sub(_at_joint(across[1], third), _at_joint(half, third))
            if third.s is None:
                remainder = arrays.sub(remainder, arrays.mul(curved, third.c * third.c))
            # d^2 / 2 + (y_z + rows_z) d - rest = 0
            d, doubt2 = sub.quadratic(0.5, arrays.add(self._tip(third)[2], z1), -remainder, 1, size, tol.TINY, None)
            return third, Pair(d, None), doubt | doubt2
        # d2 = (known_0 - rows_0 . y) / z0, affine in b, put into the distance
        d2 = [arrays.mul(1.0 / z0, v) for v in across[0]]
        fixed = [arrays.add(arrays.sub(h, a), arrays.mul(z1, d)) for h, a, d in zip(half, across[1], d2, strict=True)]
        factor = [arrays.add(arrays.mul(0.5, d), float(y)) for d, y in zip(d2, self.Y[2], strict=True)]
        six = quadratics.total([*fixed, curved, 0.0, 0.0], quadratics.product(d2, factor))
        if self.prismatic[2]:
            d, doubt = sub.quadratic(six[3], six[1], six[0], 0, size, tol.NO_SIZE * size * size, prefer[2])
            third = Pair(d, None)
        else:
            third, doubt = quadratics.turn(six, size, prefer[2])
        return third, Pair(_at_joint(d2, third), None), doubt

    def _one_unknown(self, coefficients: list[Entry], size: Entry, prefer: Prefer) -> tuple[Pair, Doubt]:
        """Joint 3 from an equation affine in its b = (1, cos, sin) or (1, d)."""
        constant, slope, sine = coefficients
        if self.prismatic[2]:
            if abs(slope) < tol.NO_SIZE:
                raise UsageError("the three joints cannot place a point: they slide in one plane")
            return Pair(arrays.mul(-1.0 / slope, constant), None), Doubt(np.zeros(1, bool))
        third, doubt = sub.linear(slope, sine, arrays.mul(-1.0, constant), 0, size, prefer[2])
        return sub.on_unit_circle(third), doubt


def _quartic_roots(k: list[Entry], size: Entry, prefer: Pair | None) -> tuple[Entry, Doubt]:
    """The roots d = size tan(q/2) of a quartic with coefficients k of d^0 ... d^4: those of a quadratic in cos, sin."""
    powers = accumulate([size] * 4, arrays.mul, initial=cast("Entry", 1.0))
    k0, k1, k2, k3, k4 = (arrays.mul(value, power) for value, power in zip(k, powers, strict=True))
    ecc = 0.25 * (k4 + k0 - k2)
    form = [0.5 * k2 + ecc, 0.5 * (k0 - k4), 0.25 * (k1 + k3), ecc, 0.25 * (k1 - k3), 0.0]
    turn, doubt = sub.trig_quadratic(form, size * size)
    d = size * sub.half_tangent(turn)
    if prefer is not None and np.any(doubt.free):
        d = arrays.where(doubt.free, prefer.c, d)
    return d, doubt


def _at_joint(terms: list[Entry], joint: Pair) -> Entry:
    """An expression affine in a joint's cosine and sine, at the joint; of a slide d k0 + k1 d, of six + k3 d^2."""
    total = arrays.add(terms[0], arrays.mul(terms[1], joint.c))
    if joint.s is not None:
        return arrays.add(total, arrays.mul(terms[2], joint.s))
    return total if len(terms) < 6 else arrays.add(total, arrays.mul(terms[3], joint.c * joint.c))


def _is_root(six: list[Entry], third: Pair, length: Entry) -> Truth:
    """Whether joint 3 is a root of its equation, or nearly one; length: of the arm, as at zero all terms vanish."""
    third_power = third.s if third.s is not None else third.c * third.c
    terms = [six[0], arrays.mul(six[1], third.c), arrays.mul(six[2] if third.s is not None else six[3], third_power)]
    total, size = terms[0], abs(terms[0])
    for term in terms[1:]:
        total, size = arrays.add(total, term), arrays.add(size, abs(term))
    solves: Truth = arrays.absolute(total) <= arrays.add(tol.SEED_RESIDUAL * size, tol.NEARBY * length)
    return solves


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Any three joints that place a point; none that is near a special case but not one."""
    if task.name != "xyz" or arm.n != 3:
        return None
    if rank(arm, task) < 3:
        raise UsageError(f"{arm.name}: its three joints cannot place a point: they move it in a plane or on a line")
    position = Position(Chain(arm.link, arm.prismatic), arm.link[3][:3, 3], tolerance, tol.COUNTED_DEFECT)
    if position.close and tolerance == tol.EXACT:
        return None
    kinds = "".join("P" if p else "R" for p in arm.prismatic)
    why = f"{kinds}: {position.why}"

    def solve(goal: list[Entry], prefer: Prefer) -> Candidates:
        return Candidates(*position.solve(goal, prefer))

    # a quartic's roots come in no order
    return Geometry("three joints", why, True, solve, ordered=not position.regular)
