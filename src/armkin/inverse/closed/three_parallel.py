"""Six revolute joints, axes 2, 3 and 4 parallel, axes 5 and 6 meeting: the UR arms and their kin.

Joints 2, 3 and 4 do not change the distance along their common direction n, nor the angle between n and axis 6. The
distance gives joint 1, the angle joint 5; joint 6 follows from n in the tool's frame, and the rest is a planar arm of
three joints with a known direction (Hawkins, Analytic Inverse Kinematics for the Universal Robots UR-5/UR-10 Arms,
2013, here for any convention). The reversed chain covers axes 3, 4 and 5.
"""

from collections.abc import Sequence

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.formula.pose import Pose
from armkin.inverse.closed import subproblems as sub
from armkin.inverse.closed.elbow import ThreeLink
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, is_parallel, reverse_chain
from armkin.model.rotation import inverse


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Six revolute joints and a full pose."""
    if task.name != "pose" or arm.n != 6 or arm.prismatic.any():
        return None
    chain = Chain(arm.link, arm.prismatic)
    if has_three_parallel(chain, tolerance, arm.reach):
        why = "axes 2, 3 and 4 are parallel, axes 5 and 6 meet"
        labels = ("shoulder", "elbow", "wrist")
        return Geometry("three parallel axes", why, True, ThreeParallel(chain).solve, labels=labels)
    chain = reverse_chain(chain)
    if not has_three_parallel(chain, tolerance, arm.reach):
        return None
    solve = sub.walked_back(ThreeParallel(chain).solve)
    return Geometry("three parallel axes", "axes 3, 4 and 5 are parallel, axes 1 and 2 meet", True, solve)


def has_three_parallel(chain: Chain, tolerance: float, reach: float) -> bool:
    """Whether axes 2, 3 and 4 are parallel, axes 1 and 5 are not, and axes 5 and 6 meet."""
    L1, L2, L3, L4, L5 = chain.link[1:6]
    if not (is_parallel(L2, tolerance) and is_parallel(L3, tolerance)):
        return False
    if any(is_parallel(L, max(tolerance, tol.PARALLEL_SINE)) for L in (L1, L4, L5)):
        return False
    return float(np.hypot(*_meeting_of_axes(L5)[1])) <= tolerance * reach


def _meeting_of_axes(L5: Array) -> tuple[float, Array]:
    """Height on axis 6 of its point nearest to axis 5, and that point's distance from axis 5 (2,)."""
    t, b = L5[:2, 3], L5[:2, 2]
    height = -float(t @ b) / float(b @ b)
    return height, t + height * b


class ThreeParallel:
    """``link[0] Z1 ... Z6 link[6]`` with axes 2, 3, 4 parallel and axes 5, 6 meeting."""

    def __init__(self, chain: Chain) -> None:
        L1, L2, L3, L4, L5 = chain.link[1:6]
        self.from_base = pose.constant(inverse(chain.link[0]))
        self.from_tool = pose.constant(inverse(chain.link[6]))
        self.shoulder = pose.constant(L1)
        self.to_joint2 = pose.constant(inverse(L1))
        self.back5, self.back4 = pose.constant(inverse(L5)), pose.constant(inverse(L4))
        self.height6, _ = _meeting_of_axes(L5)
        self.scale = max(float(np.abs(chain.link[1:6, :3, 3]).max()), tol.NO_LENGTH)
        # common direction of the parallel axes, along joint 2's, seen from joint 5
        self.three_link = ThreeLink(L2, L3)
        m = self.three_link.sense4 * L4[2, :3]
        b = L5[:3, 2]
        # m . Rz(q5) b
        self.cos5, self.sin5 = float(m[0] * b[0] + m[1] * b[1]), float(m[1] * b[0] - m[0] * b[1])
        self.rest5 = float(m[2] * b[2])
        self.orthogonal = abs(self.rest5) < tol.EXACT and abs(self.cos5**2 + self.sin5**2 - 1.0) < tol.EXACT
        self.m = [float(v) for v in m]
        self.B = pose.constant(L5)
        # distance along the common direction from joint 2 to the point where axes 5 and 6 meet
        meeting = L5[:3, 3] + self.height6 * b
        past = L4[:3, 3] + L4[:3, :3] @ [0.0, 0.0, meeting[2]]
        R23 = L2[:3, :3] @ L3[:3, :3]
        self.along = float((L2[:3, 3] + L2[:3, :3] @ L3[:3, 3] + R23 @ past)[2])
        self.reach = max(float(np.linalg.norm(chain.link[1:, :3, 3], axis=1).sum()), tol.NO_LENGTH)

    def solve(self, goal: Pose, prefer: Prefer) -> Candidates:
        """All joints for a pose, on branch axes (shoulder, elbow, wrist, N)."""
        D = pose.compose(pose.compose(self.from_base, goal), self.from_tool)  # joint 6's frame seen from joint 1
        first, doubt1 = self._shoulder_joint(D, prefer[0])
        c1, s1 = first
        n_tool = pose.turn_back(D, sub.spin(c1, s1, self.shoulder[6:9]))
        (fifth, doubt5), (sixth, doubt6) = self._wrist_joints(n_tool, prefer)
        # joint 4's frame seen from joint 2
        X = pose.compose(pose.rotate(D, sixth.c, -sixth.s), self.back5)
        X = pose.compose(pose.rotate(X, fifth.c, -fifth.s), self.back4)
        p = pose.apply(self.to_joint2, _turned_back(c1, s1, X[9:12]))
        x = pose.turn_direction(self.to_joint2, _turned_back(c1, s1, X[0:3]))
        pairs, angles, doubt234 = self.three_link.solve(p, x, prefer[1:4])
        doubt = doubt1 | doubt5 | doubt6 | doubt234
        # the residual compares joint 4's frame from both sides of the chain, its origin and the common
        # direction; about that direction joint 4 takes the remaining angle
        across, height = self.three_link.miss(pairs, p)
        along = pose.turn_direction(self.to_joint2, _turned_back(c1, s1, X[6:9]))
        scale = 1.0 / self.reach**2
        offset = height * scale + sub.distance2(along, [0.0, 0.0, self.three_link.sense4])
        return Candidates([first, *pairs, fifth, sixth], doubt, across * scale + offset, [None, *angles, None, None])

    def _shoulder_joint(self, D: Pose, prefer: Pair | None) -> tuple[Pair, Doubt]:
        """Joint 1: where axes 5 and 6 meet has a known height along n. D: joint 6's frame seen from joint 1."""
        n, o = self.shoulder[6:9], self.shoulder[9:12]
        g = arrays.combine(1.0, D[9:12], self.height6, D[6:9])
        a = arrays.add(arrays.mul(n[0], g[0]), arrays.mul(n[1], g[1]))
        b = arrays.sub(arrays.mul(n[0], g[1]), arrays.mul(n[1], g[0]))
        right = arrays.sub(self.along + arrays.dot(n, o), arrays.mul(n[2], g[2]))
        return sub.linear(a, b, right, 0, self.scale, prefer)

    def _wrist_joints(self, n: Sequence[Entry], prefer: Prefer) -> tuple[tuple[Pair, Doubt], tuple[Pair, Doubt]]:
        """Joint 5 from the angle between n, seen from joint 6, and axis 6; joint 6 from n itself: Rz(-q6) v = n."""
        disc = n[0] * n[0] + n[1] * n[1] if self.orthogonal else None
        # the two roots of an oblique wrist merge as a whole
        tangent = sub.precision().sharp if self.orthogonal else sub.precision().tangent
        fifth, doubt5 = sub.linear(self.cos5, self.sin5, n[2] - self.rest5, 2, 1.0, prefer[4], disc, tangent)
        (c5, s5), m = fifth, self.m
        mx = arrays.add(arrays.mul(c5, m[0]), arrays.mul(s5, m[1]))
        my = arrays.sub(arrays.mul(c5, m[1]), arrays.mul(s5, m[0]))
        v = pose.turn_back(self.B, [mx, my, m[2]])
        return (fifth, doubt5), sub.rotation_between(n[0], n[1], v[0], v[1], 1.0, prefer[5], disc)


def _turned_back(c: Entry, s: Entry, v: Sequence[Entry]) -> list[Entry]:
    """``Rz(-q) v``."""
    return [c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]]
