"""Three parallel joints: a planar arm of three links, placed and turned in its plane."""

from __future__ import annotations

from armkin.formula import arrays
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.elbow import TwoLink, together
from armkin.inverse.closed.subproblems import Doubt, Pair, Prefer, distance2, spin


class ThreeLink:
    """``Z2 L2 Z3 L3 Z4`` with parallel axes: joints 2 and 3 place joint 4's frame, joint 4 turns it."""

    def __init__(self, L2: Array, L3: Array) -> None:
        """L2, L3: (4, 4) the links between the joints."""
        self.sense3 = 1.0 if L2[2, 2] > 0 else -1.0
        self.sense4 = self.sense3 * (1.0 if L3[2, 2] > 0 else -1.0)
        R23 = L2[:3, :3] @ L3[:3, :3]
        self.height4 = float((L2[:3, 3] + L2[:3, :3] @ L3[:3, 3])[2])
        self.turned = [float(R23[0, 0]), float(R23[1, 0])]
        fore = L2[:3, :3] @ L3[:3, 3]
        self.two_link = TwoLink(L2[:2, 3], fore[:2], self.sense3)

    def solve(
        self, p: list[Entry], x: list[Entry], prefer: Prefer, axis: int = 1
    ) -> tuple[list[Pair], list[Entry], Doubt]:
        """Joints 2, 3 and 4 for the place p and the first column x of joint 4's frame; their angles; and doubt.

        axis: the branch axis of the two elbows.
        """
        second, third, doubt = self.two_link.solve(p[0], p[1], prefer[0], prefer[1], axis=axis)
        # x = Rz(q2 +- q3 +- q4) turned
        tx, ty = self.turned
        c, s = tx * x[0] + ty * x[1], tx * x[1] - ty * x[0]
        c23, s23 = together(second, third, self.sense3)
        fourth = Pair(c * c23 + s * s23, arrays.mul(self.sense4, s * c23 - c * s23))
        # its angle is what is left of the sum: one arctangent for both elbows
        q2, q3 = (arrays.arctan2(pair.s, pair.c) for pair in (second, third))
        left = arrays.wrap_angle(arrays.sub(arrays.arctan2(s, c) - q2, arrays.mul(self.sense3, q3)))
        return [second, third, fourth], [q2, q3, arrays.mul(self.sense4, left)], doubt

    def miss(self, pairs: list[Pair], p: list[Entry]) -> tuple[Entry, Entry]:
        """Squared distance of joint 4's frame from p, in the plane and across it."""
        reached = spin(*pairs[0], self.two_link.reach(pairs[1]))
        return distance2(reached, p[:2]), (p[2] - self.height4) ** 2
