"""Three neighbouring axes that are parallel or meet in a point, anywhere among six revolute joints.

The joints of the three axes do not change a direction and the height along it, or a point. The other three joints are
neighbours, too, if the pose counts as one more link of a closed loop (Pieper, The Kinematics of Manipulators under
Computer Control, 1968). With these joints called a, b and c,

    (1)  Za La Zb Lb Zc d = e

holds for the direction and the height along it, or for the point. Let ``f = Za^-1 e`` and ``g = Zc d``. Joint b does
not change heights along its own axis, so

    (2)  (Ra z) . f - (Rb^T z) . g = known,    ta . f + (Rb^T tb) . g = known

hold in both cases: the second is the height along the direction, or the distance of the point. Where the pose is not
La, the factors of f depend on the arm alone. If they are independent, f follows from g, and its known length makes a
quartic for joint c; if not, a combination of the two equations has only g. Joint b follows from (1), and the rest of
the loop is a planar arm of three joints or a wrist: 8 branches.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.formula.pose import Pose
from armkin.inverse.closed import quadratics
from armkin.inverse.closed import subproblems as sub
from armkin.inverse.closed.candidates import is_sound
from armkin.inverse.closed.elbow import ThreeLink
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer
from armkin.inverse.closed.wrist import Wrist, meeting_point
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, is_parallel, reverse_chain
from armkin.model.rotation import inverse, shrink_translations


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Six revolute joints and a full pose, three neighbouring axes parallel or meeting in a point."""
    if task.name != "pose" or arm.n != 6 or arm.prismatic.any():
        return None
    chain = Chain(arm.link, arm.prismatic)
    for backward, first in product((False, True), (1, 3)):
        loop = _Loop.of(reverse_chain(chain) if backward else chain, first, tolerance, arm.reach)
        if loop is not None and not loop.ends.close:
            geometry = _class_of(loop, range(5, -1, -1) if backward else range(6))
            if backward:  # the chain was reversed
                geometry = replace(geometry, pairs=sub.walked_back(loop.solve))
            if is_sound(arm, task, geometry):
                return geometry
    return None


def _class_of(loop: "_Loop", names: Sequence[int]) -> Geometry:
    """The class of a loop, whose chain has joints with these numbers (0..5)."""
    axes = sorted(names[i] + 1 for i in range(loop.first, loop.first + 3))
    relation, name = "meet in a point", "three axes that meet"
    if loop.three_link:
        relation, name = "are parallel", "three parallel axes"
    c = names[loop.joints[2]] + 1
    source = f"a quartic gives joint {c}" if loop.ends.regular else f"special axes give joint {c} by itself"
    why = f"axes {axes[0]}, {axes[1]} and {axes[2]} {relation}; {source}"
    # a free joint may have only a few values with solutions, where other self-motions cross
    ends = tuple(names[j] for j in loop.joints)
    return Geometry(name, why, True, loop.solve, ordered=not loop.ends.regular, ends=ends)


class _EndJoints:
    """Joints a, b and c of (1), La without the pose; lengths in units of the arm."""

    def __init__(self, La: Array, points: bool, tolerance: float) -> None:
        """points: d and e are points, else directions."""
        self.La, self.points = pose.constant(La), points
        self.rows = np.array([La[:3, :3] @ [0.0, 0.0, 1.0], La[:3, 3]])  # factors of f in (2)
        self.A = self.rows[:, :2]
        U, S, _ = np.linalg.svd(self.A)
        ratio = float(S[1] / max(S[0], tol.NO_SIZE))
        self.regular, self.close = ratio > tolerance, tolerance < ratio <= tol.NEAR_DEFECT
        self.alone, self.main = U[:, 1], U[:, 0]  # combinations of (2) without f, and with f

    def solve(
        self, Lb: Pose, d: list[Entry], e: list[Entry], height: Entry, prefer: Prefer
    ) -> tuple[list[Pair], Doubt]:
        """The three joints on branch axes (b0, b1, 1, N), and doubt; height: the known side of (2) for directions."""
        ta, tb = self.La[9:12], Lb[9:12]
        factors = [[arrays.mul(-1.0, v) for v in (Lb[2], Lb[5], Lb[8])], pose.turn_back(Lb, tb)]  # factors of g
        right: list[Entry] = [0.0, height]
        if self.points:
            length = arrays.sub(arrays.add(arrays.dot(e, e), arrays.dot(ta, ta)), arrays.dot(d, d))
            along = arrays.add(tb[2], arrays.dot(self.La[6:9], ta))
            right = [along, arrays.mul(0.5, arrays.sub(length, arrays.dot(tb, tb)))]
        # (2) solved for its part in f across joint a, as coefficients of (1, cos qc, sin qc)
        sides: list[list[Entry]] = []
        for row, (gx, gy, gz), value in zip(self.rows.tolist(), factors, right, strict=True):
            constant = arrays.sub(arrays.sub(value, arrays.mul(row[2], e[2])), arrays.mul(gz, d[2]))
            cosine = arrays.add(arrays.mul(gx, d[0]), arrays.mul(gy, d[1]))
            sine = arrays.sub(arrays.mul(gy, d[0]), arrays.mul(gx, d[1]))
            sides.append([constant, arrays.mul(-1.0, cosine), arrays.mul(-1.0, sine)])
        first, last, doubt = (self._quartic if self.regular else self._rank_one)(sides, e, prefer)
        u = pose.turn_direction(Lb, sub.spin(*last, d))
        v = sub.spin(first.c, arrays.mul(-1.0, first.s), e)
        if self.points:
            u = arrays.combine(1.0, u, 1.0, tb)
            v = arrays.combine(1.0, v, -1.0, ta)
        v = pose.turn_back(self.La, v)
        second, _ = sub.rotation_between(u[0], u[1], v[0], v[1], 1.0, None)
        across = arrays.dot(u[:2], u[:2]) + arrays.dot(v[:2], v[:2])
        free = (across < tol.LOOSE_LEVER) | (doubt.edge & (across < tol.LOOSE_DOUBLE_LEVER))
        return [first, sub.with_preferred(second, free, prefer[1]), last], doubt | Doubt(free, free)

    def _quartic(self, sides: list[list[Entry]], e: list[Entry], prefer: Prefer) -> tuple[Pair, Pair, Doubt]:
        f = [_combination(row, sides) for row in np.linalg.inv(self.A)]
        across = arrays.add(arrays.mul(e[0], e[0]), arrays.mul(e[1], e[1]))
        start: list[Entry] = [arrays.mul(-1.0, across), 0.0, 0.0, 0.0, 0.0, 0.0]
        last, doubt = quadratics.turn(quadratics.total(start, *(quadratics.product(k, k) for k in f)), 1.0, prefer[2])
        fx, fy = (_affine_at(k, last) for k in f)
        first, doubt_a = sub.rotation_between(fx, fy, e[0], e[1], 1.0, prefer[0])
        return first, last, doubt | doubt_a

    def _rank_one(self, sides: list[list[Entry]], e: list[Entry], prefer: Prefer) -> tuple[Pair, Pair, Doubt]:
        constant, cosine, sine = _combination(self.alone, sides)
        right = arrays.mul(-1.0, constant)
        last, doubt = sub.linear(cosine, sine, right, 0, 1.0, prefer[2], sub.one_root(cosine, sine, right))
        last = sub.on_unit_circle(last)
        fx, fy = (self.main @ self.A).tolist()
        a = arrays.add(arrays.mul(fx, e[0]), arrays.mul(fy, e[1]))
        b = arrays.sub(arrays.mul(fx, e[1]), arrays.mul(fy, e[0]))
        first, doubt_a = sub.linear(a, b, _affine_at(_combination(self.main, sides), last), 1, 1.0, prefer[0])
        return sub.on_unit_circle(first), last, doubt | doubt_a


class _Loop:
    """The closed loop of a chain and its pose, beginning at the first of the three axes."""

    def __init__(self, chain: Chain, first: int, reach: float, points: tuple[Array, Array] | None, tolerance: float):
        """first: the joint (0..5) of the first axis, 1 or 3; points: where they meet, seen before the first and after
        the last of them [units of the reach], None of parallel axes; tolerance: as in `recognise`."""
        self.unit = 1.0 / reach
        link = shrink_translations(chain.link, reach)
        self.from_base, self.from_tool = pose.constant(inverse(link[0])), pose.constant(inverse(link[6]))
        self.first = first
        self.joints = [(first + k) % 6 for k in (3, 4, 5)]  # a, b and c
        self.out = link[1] if first == 1 else link[3]  # the link after c
        self.ends = _EndJoints(link[5] if first == 1 else link[1], points is not None, tolerance)
        self.before, self.between = pose.constant(link[4]), pose.constant(link[2])  # a, and a and b: or the pose
        two = link[first + 1], link[first + 2]
        self.points = points
        self.three_link = ThreeLink(*two) if points is None else None
        self.wrist = Wrist(*two)

    @classmethod
    def of(cls, chain: Chain, first: int, tolerance: float, reach: float) -> "_Loop | None":
        """The loop if the axes of joints `first` to `first` + 2 are parallel, or meet and `first` is 1; else None."""
        L1, L2 = chain.link[first + 1], chain.link[first + 2]
        if is_parallel(L1, tolerance) and is_parallel(L2, tolerance):
            return cls(chain, first, reach, None, tolerance)
        met = meeting_point(L1, L2, tolerance * reach)
        if met is None or first != 1:  # at an end of the arm they are a spherical wrist or shoulder
            return None
        return cls(chain, first, reach, (met[0] / reach, met[1] / reach), tolerance)

    def solve(self, goal: Pose, prefer: Prefer) -> Candidates:
        """All joints for a pose, on branch axes (b0, b1, 2, N)."""
        goal = [*goal[:9], *(arrays.mul(self.unit, v) for v in goal[9:])]
        back = pose.inverse(pose.compose(pose.compose(self.from_base, goal), self.from_tool))
        before, between = (self.before, back) if self.first == 1 else (back, self.between)
        after = pose.constant(self.out)
        height: Entry = 0.0
        three_angles: Sequence[Entry | None]
        if self.points is None:
            assert self.three_link is not None
            sense = self.three_link.sense4
            d, e = after[6:9], [arrays.mul(sense, before[k]) for k in (2, 5, 8)]
            height = arrays.mul(-1.0, self.three_link.height4 + arrays.dot(d, after[9:12]))
            height = arrays.sub(height, arrays.mul(sense, before[11]))
        else:
            seen_before, seen_after = (point.tolist() for point in self.points)
            d, e = pose.apply(after, seen_before), pose.apply(pose.inverse(before), seen_after)
        ends, doubt = self.ends.solve(between, d, e, height, [prefer[j] for j in self.joints])
        P = pose.compose(pose.rotate(before, *ends[0]), self.ends.La)
        P = pose.compose(pose.rotate(P, *ends[1]), between)
        # joint `first` seen from the frame after the last of the three
        P = pose.compose(pose.rotate(P, *ends[2]), after)
        x, z = [P[0], P[3], P[6]], [P[2], P[5], P[8]]
        prefer3 = prefer[self.first : self.first + 3]
        if self.three_link is None:
            three, three_angles, doubt3, _ = self.wrist.solve(x, z, prefer3)
        else:
            p = [arrays.mul(-1.0, v) for v in pose.turn_back(P, P[9:12])]
            three, three_angles, doubt3 = self.three_link.solve(p, x, prefer3, axis=2)
        pairs: list[Pair] = [Pair(1.0, 0.0)] * 6
        angles: list[Entry | None] = [None] * 6
        for joint, pair in zip(self.joints, ends, strict=True):
            pairs[joint] = pair
        pairs[self.first : self.first + 3] = three
        if three_angles:
            angles[self.first : self.first + 3] = three_angles
        return Candidates(pairs, doubt | doubt3, None, angles)


def _combination(weights: Array, sides: list[list[Entry]]) -> list[Entry]:
    """A combination of two expressions affine in (cos, sin)."""
    return arrays.combine(float(weights[0]), sides[0], float(weights[1]), sides[1])


def _affine_at(affine: list[Entry], pair: Pair) -> Entry:
    """An affine expression of a joint's cosine and sine, at the joint."""
    return arrays.add(affine[0], arrays.add(arrays.mul(affine[1], pair.c), arrays.mul(affine[2], pair.s)))
