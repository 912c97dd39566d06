"""One joint, then two parallel revolute joints: the arm under most wrists, in closed form.

The tip's distance along the parallel axes is the same for all angles of the two parallel joints, which gives the first
joint; what remains is a planar two-link arm (Siciliano et al., Robotics, 2.12.2 and 2.12.4).
"""

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.geometry import ClosedForm, Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer, distance2, linear, rotation_between, spin
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, is_parallel
from armkin.model.rotation import FLIP, inverse


class Elbow:
    """``link[0] Z1 link[1] Z2 link[2] Z3 tip``: joints 2 and 3 revolute and parallel.

    All quantities inside are in the frame of joint 2, in whose x-y plane the arm bends.
    """

    def __init__(self, chain: Chain, tip: Array) -> None:
        """chain: its first three joints are used; tip: (3,) the point after joint 3 to be placed [mm]."""
        L2 = chain.link[2]
        self.parallel = is_parallel(L2, tol.ROUNDING)  # to rounding, so that `miss` and `turned_back` are exact
        sense3 = 1.0 if L2[2, 2] > 0 else -1.0
        if sense3 < 0:
            L2, tip = L2 @ FLIP, FLIP[:3, :3] @ tip
        self.prismatic1 = bool(chain.prismatic[0])
        self.from_base = pose.constant(inverse(chain.link[0]))
        self.shoulder = pose.constant(chain.link[1])  # frame of joint 2 seen from joint 1
        upper, fore = L2[:3, 3], L2[:3, :3] @ tip  # upper arm, forearm at q3 = 0
        self.rise, self.to_fore = float(upper[2]), pose.constant(L2 @ FLIP if sense3 < 0 else L2)
        self.along = float(upper[2] + fore[2])
        self.two_link = TwoLink(upper[:2], fore[:2], sense3)
        self.scale = max(float(np.abs(chain.link[:, :3, 3]).max()), float(np.abs(tip).max()), tol.NO_LENGTH)

    def solve(
        self, p: list[Entry], past: list[Entry], prefer: Prefer, tip: list[Entry] | None = None
    ) -> tuple[list[Pair], Doubt]:
        """Angles of the three joints that bring the tip to p.

        p: position in the base, entries (N,); past: the offset from the tip to the target in
        the final direction of joint 2's frame (the part past joint 3 with a known direction),
        else zeros; prefer: values for joints that a target leaves free; tip: the point after
        joint 3 if it depends on the target.
        Returns three pairs on branch axes (shoulder, elbow, 1, N), and doubt.
        """
        x, y, z = pose.apply(self.from_base, p)
        n, o = self.shoulder[6:9], self.shoulder[9:12]
        fore = None if tip is None else pose.turn_direction(self.to_fore, tip)
        along = arrays.add(self.along if fore is None else arrays.add(self.rise, fore[2]), past[2])
        if self.prismatic1:
            ahead = arrays.sub(arrays.dot(n, [x, y, z]), along + arrays.dot(n, o))
            first, doubt1 = Pair(ahead / n[2], None), Doubt(np.zeros(1, bool))
        else:
            a = arrays.combine(n[0], [x], n[1], [y])[0]
            b = arrays.combine(n[0], [y], -n[1], [x])[0]
            right = arrays.sub(along + arrays.dot(n, o), arrays.mul(n[2], z))
            first, doubt1 = linear(a, b, right, 0, self.scale, prefer[0])
        rx, ry, _ = self._in_frame_of_joint2(first, [x, y, z])
        rx, ry = arrays.sub(rx, past[0]), arrays.sub(ry, past[1])
        second, third, doubt23 = self.two_link.solve(rx, ry, prefer[1], prefer[2], fore)
        return [first, second, third], doubt1 | doubt23

    def _in_frame_of_joint2(self, first: Pair, p: list[Entry]) -> list[Entry]:
        """A point p from the frame before joint 1, in the frame of joint 2."""
        turned = [p[0], p[1], p[2] - first.c] if first.s is None else spin(first.c, -first.s, p)
        lever = [arrays.sub(v, o) for v, o in zip(turned, self.shoulder[9:12], strict=True)]
        return [arrays.dot(self.shoulder[k : k + 3], lever) for k in (0, 3, 6)]

    def miss(self, pairs: list[Pair], p: list[Entry]) -> Entry:
        """Squared distance of the tip from p, both in the frame of joint 2."""
        first, second, third = pairs
        before = pose.apply(self.from_base, p)
        x, y, z = self._in_frame_of_joint2(first, before)
        total = (z - self.along) ** 2
        if first.s is not None:
            # a pair off the unit circle scales p, so its excess counts as a miss
            stretched = first.c * first.c + first.s * first.s - 1.0
            total = total + stretched * stretched * (before[0] * before[0] + before[1] * before[1])
        return distance2(spin(*second, self.two_link.reach(third)), [x, y]) + total

    def turned_back(self, pairs: list[Pair], v: list[Entry]) -> list[Entry]:
        """A direction in the base, in the frame that joint 3 turns behind link 2."""
        first, second, third = pairs
        v = pose.turn_direction(self.from_base, v)
        v = pose.turn_back(self.shoulder, v if first.s is None else spin(first.c, -first.s, v))
        c, s = added_angles(second, third, self.two_link.sense)
        return pose.turn_back(self.to_fore, spin(c, -s, v))


class TwoLink:
    """``Rz(q2) (l + Rz(q3) m) = r`` in a plane: the elbow of two parallel joints."""

    def __init__(self, upper: Array, fore: Array, sense: float) -> None:
        """upper, fore: l and m, (2,) [mm]; sense: -1 if joint 3 turns against joint 2."""
        (self.lx, self.ly), (self.mx, self.my) = upper.tolist(), fore.tolist()
        self.sense = sense
        self.scale = max(float(np.abs(upper).max()), float(np.abs(fore).max()), tol.NO_LENGTH)

    def solve(
        self, rx: Entry, ry: Entry, prefer2: Pair | None, prefer3: Pair | None, fore: list[Entry] | None = None,
        axis: int = 1,
    ) -> tuple[Pair, Pair, Doubt]:  # fmt: skip
        """Both elbows on a branch axis: pairs of joints 2 and 3, and doubt; fore: m, if it depends on the target."""
        lx, ly, (mx, my) = self.lx, self.ly, (self.mx, self.my) if fore is None else fore[:2]
        upper2, fore2, across2 = lx * lx + ly * ly, mx * mx + my * my, rx * rx + ry * ry
        # |r|^2 = |l + Rz(q3) m|^2, halved: the product of both lengths and the cosine of the angle between them
        dot_lm, cross_lm, right = lx * mx + ly * my, ly * mx - lx * my, 0.5 * (across2 - (upper2 + fore2))
        third, doubt3 = linear(dot_lm, cross_lm, right, axis, self.scale**2, prefer3)
        third = third if self.sense > 0 else Pair(third.c, -third.s)
        ux, uy, _ = self.reach(third, fore)
        # |l + Rz(q3) m| is the same for both elbows: once for both the pair below is normalised
        sine2 = np.maximum(upper2 * fore2 - right * right, 0.0)
        reached2 = ((upper2 + right) ** 2 + sine2) / upper2 if upper2 > 0.0 else None
        length2 = None if reached2 is None else np.sqrt(reached2 * across2)
        second, doubt2 = rotation_between(ux, uy, rx, ry, self.scale, prefer2, length2)
        return second, third, doubt2 | doubt3

    def reach(self, third: Pair, fore: list[Entry] | None = None) -> list[Entry]:
        """``l + Rz(q3) m``, before joint 2 turns it."""
        x, y, _ = spin(third.c, arrays.mul(self.sense, third.s), [self.mx, self.my, 0.0] if fore is None else fore)
        return [arrays.add(self.lx, x), arrays.add(self.ly, y), 0.0]


def added_angles(first: Pair, second: Pair, sense: float) -> Pair:
    """Two angles about one direction: their sum, or with sense -1 their difference."""
    s2 = arrays.mul(sense, second.s)
    return Pair(first.c * second.c - first.s * s2, first.s * second.c + first.c * s2)


class ThreeLink:
    """Three parallel joints, ``Z2 L2 Z3 L3 Z4``: joints 2 and 3 place joint 4's frame, joint 4 turns it."""

    def __init__(self, L2: Array, L3: Array) -> None:
        """L2, L3: (4, 4) the links between the joints."""
        self.sense3 = 1.0 if L2[2, 2] > 0 else -1.0
        self.sense4 = self.sense3 * (1.0 if L3[2, 2] > 0 else -1.0)
        R23 = L2[:3, :3] @ L3[:3, :3]
        self.height4 = float((L2[:3, 3] + L2[:3, :3] @ L3[:3, 3])[2])
        self.turned = [float(R23[0, 0]), float(R23[1, 0])]
        self.two_link = TwoLink(L2[:2, 3], (L2[:3, :3] @ L3[:3, 3])[:2], self.sense3)

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
        c23, s23 = added_angles(second, third, self.sense3)
        fourth = Pair(c * c23 + s * s23, arrays.mul(self.sense4, s * c23 - c * s23))
        # joint 4's angle is the rest of the sum, so one arctangent serves both elbows
        q2, q3 = (arrays.arctan2(pair.s, pair.c) for pair in (second, third))
        rest = arrays.wrap_angle(arrays.sub(arrays.arctan2(s, c) - q2, arrays.mul(self.sense3, q3)))
        return [second, third, fourth], [q2, q3, arrays.mul(self.sense4, rest)], doubt

    def miss(self, pairs: list[Pair], p: list[Entry]) -> tuple[Entry, Entry]:
        """Squared distance of joint 4's frame from p, in the plane and across it."""
        reached = spin(*pairs[0], self.two_link.reach(pairs[1]))
        return distance2(reached, p[:2]), (p[2] - self.height4) ** 2


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Arms whose joints 2 and 3 (for pitch tasks also 4) are parallel: xyz, xyz_roll, xyz_pitch, xyz_pitch_roll."""
    n = {"xyz": 3, "xyz_roll": 4, "xyz_pitch": 4, "xyz_pitch_roll": 5}.get(task.name)
    if n != arm.n or arm.prismatic[1:].any():
        return None
    parallels = 2 if task.name in ("xyz", "xyz_roll") else 3
    if not all(is_parallel(L, tolerance) for L in arm.link[2 : parallels + 1]):
        return None
    if arm.prismatic[0] and abs(arm.link[1][2, 2]) < tol.PARALLEL_SINE:
        return None  # the slide moves within the arm's plane
    why = "joints 2 and 3 are parallel" if parallels == 2 else "joints 2, 3 and 4 are parallel"
    labels = ("" if arm.prismatic[0] else "shoulder", "elbow", "")
    elbow = Elbow(Chain(arm.link, arm.prismatic), arm.link[3][:3, 3])
    if n == 3:

        def xyz(goal: list[Entry], prefer: Prefer) -> Candidates:
            pairs, doubt = elbow.solve(goal, [0.0, 0.0, 0.0], prefer)
            miss = arrays.mul(1.0 / arm.reach**2, elbow.miss(pairs, goal)) if elbow.parallel else None
            return Candidates(pairs, doubt, miss)

        return Geometry("elbow", why, True, xyz, labels=labels)
    if task.name == "xyz_roll":
        return Geometry("elbow with roll", f"{why}, joint 4 is the roll", True, _roll(arm, task, elbow), labels=labels)
    return Geometry("elbow with pitch", why, True, _pitch(arm, task, elbow), labels=labels)


def _pitch(arm: Arm, task: Task, elbow: Elbow) -> ClosedForm:
    """Joint 4 is the rest of the pitch after joints 2 and 3; joint 5, if there is one, is the roll."""
    link = arm.link
    # the tool point in the frame of joint 4, which a roll joint may move
    past = pose.constant(link[4])
    # Rz(q2) R2 Rz(q3) R3 Rz(q4) = Rz(q2 +- q3 +- q4) R2 R3, the signs those of antiparallel axes
    sense = [float(v) for v in task.sums[0][1:4] / task.sums[0][1]]
    turned = pose.constant(link[2] @ link[3])

    def pitch(goal: list[Entry], prefer: Prefer) -> Candidates:
        c, s = arrays.cos_sin((goal[3] - task.offsets[0]) / task.sums[0][1])
        if arm.n == 5:
            fifth = Pair(*arrays.cos_sin((goal[4] - task.offsets[1]) / task.sums[1][4]))
            P = pose.compose(pose.rotate(past, *fifth), pose.constant(link[5]))
        else:
            fifth, P = None, past
        offset = spin(c, s, pose.turn_direction(turned, P[9:12]))
        pairs, doubt = elbow.solve(goal[:3], offset, prefer)
        # joint 4 is the rest of the sum
        c4, s4 = c, s
        for pair, g in zip(pairs[1:], sense[:2], strict=True):
            c4, s4 = c4 * pair.c + g * s4 * pair.s, s4 * pair.c - g * c4 * pair.s
        fourth = Pair(c4, sense[2] * s4)
        return Candidates([*pairs, fourth] if fifth is None else [*pairs, fourth, fifth], doubt)

    return pitch


def _roll(arm: Arm, task: Task, elbow: Elbow) -> ClosedForm:
    """Joint 4 follows from the target, and shifts the tip that the three joints before it place."""
    weight, after3, end = float(task.sums[0][3]), pose.constant(arm.link[3]), pose.constant(arm.link[4])

    def roll(goal: list[Entry], prefer: Prefer) -> Candidates:
        fourth = Pair(*arrays.cos_sin((goal[3] - task.offsets[0]) / weight))
        tip = pose.compose(pose.rotate(after3, *fourth), end)[9:12]
        pairs, doubt = elbow.solve(goal[:3], [0.0, 0.0, 0.0], prefer, tip)
        return Candidates([*pairs, fourth], doubt)

    return roll
