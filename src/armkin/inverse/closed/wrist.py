"""Wrists: three axes that meet in a point and turn the tool (Siciliano et al., Robotics, 2.12.5)."""

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.subproblems import (
    Doubt,
    Pair,
    Prefer,
    distance2,
    linear,
    precision,
    rotation_between,
    signs,
    spin,
)
from armkin.inverse.numeric import tolerances as tol
from armkin.model.joint_chain import is_parallel
from armkin.model.rotation import inverse


def perpendicular_foot(L: Array) -> Array:
    """The foot, on the axis before a link, of its common perpendicular with the axis behind, not parallel: (3,)."""
    # the axis before is the z axis, the one behind the line t + s w
    t, w = L[:3, 3], L[:3, 2]
    return np.array([0.0, 0.0, t[2] - w[2] * (t[:2] @ w[:2]) / (w[:2] @ w[:2])])


def meeting_point(L4: Array, L5: Array, tolerance: float) -> tuple[Array, Array] | None:
    """The point where the axes around two links meet, before the first joint and after the last one, or None."""
    if is_parallel(L4, tol.PARALLEL_SINE) or is_parallel(L5, tol.PARALLEL_SINE):
        return None
    at4 = perpendicular_foot(L4)
    at5 = (inverse(L4) @ [*at4, 1.0])[:3]
    at6 = (inverse(L5) @ [*at5, 1.0])[:3]
    if np.hypot(*at5[:2]) > tolerance or np.hypot(*at6[:2]) > tolerance:
        return None
    return at4, at6


class Wrist:
    """``Rz(q4) A Rz(q5) B Rz(q6)``, two ways for every orientation; A, B: the rotations of two links."""

    def __init__(self, L4: Array, L5: Array) -> None:
        """L4, L5: (4, 4) the links between the joints."""
        self.A = pose.constant(L4)
        self.B = pose.constant(L5)
        A, b = L4[:3, :3], L5[:3, 2]
        # z . A Rz(q5) b = c5 (A20 b0 + A21 b1) + s5 (A21 b0 - A20 b1) + A22 b2
        self.cos5 = float(A[2, 0] * b[0] + A[2, 1] * b[1])
        self.sin5 = float(A[2, 1] * b[0] - A[2, 0] * b[1])
        self.rest5 = float(A[2, 2] * b[2])
        self.mirrored = max(abs(self.rest5), abs(self.sin5), abs(abs(self.cos5) - 1.0)) < tol.EXACT
        self.orthogonal = max(abs(self.rest5), abs(self.cos5**2 + self.sin5**2 - 1.0)) < tol.EXACT

    def solve(
        self, x: list[Entry], z: list[Entry], prefer: Prefer
    ) -> tuple[list[Pair], list[Entry | None], Doubt, Entry]:
        """The joints that turn the first and last column to x and z, both solutions on branch axis 2; their angles
        where no inverse function is needed; doubt; and the squared distance of these columns from x and z."""
        if self.mirrored:
            return self._solve_mirrored(x, z, prefer)
        disc = z[0] * z[0] + z[1] * z[1] if self.orthogonal else None
        thresholds = precision()
        # the two roots of an oblique wrist merge as a whole
        tangent = thresholds.sharp if self.orthogonal else thresholds.tangent
        fifth, doubt5 = linear(self.cos5, self.sin5, z[2] - self.rest5, 2, 1.0, prefer[1], disc, tangent)
        fourth, sixth, doubt4, miss = self._turn_about_middle(fifth, x, z, disc, prefer)
        return [fourth, fifth, sixth], [], doubt5 | doubt4, miss

    def _turn_about_middle(
        self, fifth: Pair, x: list[Entry], z: list[Entry], across: Entry | None, prefer: Prefer
    ) -> tuple[Pair, Pair, Doubt, Entry]:
        """Joints 4 and 6 for a joint 5, doubt, and how far the wrist's columns are from x and z.

        across: the square of z's part across joint 4, if the wrist can reach every z.
        """
        turn5 = pose.rotate(self.A, *fifth)
        u = pose.turn_direction(turn5, self.B[6:9])
        fourth, doubt4 = rotation_between(u[0], u[1], z[0], z[1], 1.0, prefer[0], across)
        c4, s4 = fourth
        # the rest is Rz(q6): its first column lies in the plane across joint 6
        back = pose.turn_back(turn5, [c4 * x[0] + s4 * x[1], c4 * x[1] - s4 * x[0], x[2]])
        c6, s6, out_of_plane = pose.turn_back(self.B, back)
        miss = distance2(spin(c4, s4, u), z) + out_of_plane * out_of_plane
        return fourth, Pair(c6, s6), doubt4, miss

    def _solve_mirrored(
        self, x: list[Entry], z: list[Entry], prefer: Prefer
    ) -> tuple[list[Pair], list[Entry | None], Doubt, Entry]:
        """A wrist of right angles, whose second solution is exactly q4 + pi, -q5, q6 + pi."""
        disc = z[0] * z[0] + z[1] * z[1]
        fifth = Pair(arrays.mul(self.cos5, z[2]), arrays.mul(self.cos5, arrays.sqrt(disc)))
        fourth, sixth, doubt4, miss = self._turn_about_middle(fifth, x, z, disc, prefer)
        sign = signs(2)
        flipped = 0.5 - 0.5 * sign
        q4, q6 = (arrays.arctan2(s, c) for c, s in (fourth, sixth))
        angles: list[Entry | None] = [
            q4 - flipped * arrays.copysign(np.pi, q4),
            sign * arrays.arctan2(fifth.s, fifth.c),
            q6 - flipped * arrays.copysign(np.pi, q6),
        ]
        return [fourth, fifth, sixth], angles, (disc < precision().sharp) | doubt4, miss
