"""Spherical wrists and shoulders: three joint axes that meet in one point at an end of the arm.

The three joints do not move that point: the other three place it (`Elbow` or `Position`), and the three turn the tool
(Pieper 1968; Siciliano et al., Robotics, 2.12.5). An arm whose first three axes meet is solved as the reversed chain.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.formula.pose import Pose
from armkin.inverse.closed.elbow import Elbow
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer, distance2, walked_back
from armkin.inverse.closed.three_joints import Position
from armkin.inverse.closed.wrist import Wrist, meeting_point
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, is_parallel, reverse_chain
from armkin.model.rotation import inverse

Place = Callable[..., tuple[list[Pair], Doubt]]


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Six joints and a full pose, axes 4, 5, 6 or 1, 2, 3 meeting in a point."""
    if task.name != "pose" or arm.n != 6:
        return None
    chain = Chain(arm.link, arm.prismatic)
    centre, shoulder = wrist_centre(chain, tolerance * arm.reach), False
    if centre is None:
        chain, shoulder = reverse_chain(chain), True
        centre = wrist_centre(chain, tolerance * arm.reach)
    if centre is None or (wrist := SphericalWrist(chain, *centre, tolerance)).close:
        return None
    if shoulder:
        why = f"axes 1, 2 and 3 meet in a point; walked from the tool, {wrist.why}"
        return Geometry("spherical shoulder", why, True, walked_back(wrist.solve), ordered=wrist.ordered)
    why = f"axes 4, 5 and 6 meet in a point; {wrist.why}"
    return Geometry("spherical wrist", why, True, wrist.solve, labels=wrist.labels, ordered=wrist.ordered)


def wrist_centre(chain: Chain, tolerance: float) -> tuple[Array, Array] | None:
    """Where axes 4, 5 and 6 meet: seen after joint 3 and after joint 6, (3,) each, or None."""
    met = None if chain.prismatic[3:].any() else meeting_point(chain.link[4], chain.link[5], tolerance)
    if met is None:
        return None
    L3 = chain.link[3]
    return L3[:3, :3] @ met[0] + L3[:3, 3], met[1]


class SphericalWrist:
    """Three joints that place the wrist's centre, then three that turn the tool about it."""

    def __init__(self, chain: Chain, after3: Array, after6: Array, tolerance: float) -> None:
        """after3, after6: (3,) the centre seen after joint 3 and after joint 6 [mm]; tolerance: as in `recognise`."""
        self.chain = chain
        self.labels: tuple[str, ...] = ()
        self.ordered = True
        self.elbow: Elbow | None = None
        self.close = False  # the first three joints are almost special: see `Position`
        if not chain.prismatic[1:3].any() and is_parallel(chain.link[2], tolerance) and not chain.prismatic[0]:
            elbow = Elbow(chain, after3)
            self.elbow = elbow if elbow.parallel else None
            self.place: Place = partial(elbow.solve, past=[0.0, 0.0, 0.0])
            self.why = "axes 2 and 3 are parallel"
            self.labels = ("shoulder", "elbow", "wrist")
        else:
            position = Position(chain, after3, tolerance)
            self.close, self.ordered = position.close, not position.regular
            self.place = position.solve
            self.why = f"of the other three, {position.why}"
        self.links = [pose.constant(L) for L in chain.link[:4]]
        self.reach = max(float(np.linalg.norm(chain.link[1:, :3, 3], axis=1).sum()), tol.NO_LENGTH)
        L3 = chain.link[3]
        self.height4 = float((L3[:3, :3].T @ (after3 - L3[:3, 3]))[2])  # the centre on axis 4
        end = inverse(chain.link[6])
        self.centre = [float(v) for v in end[:3, :3] @ after6 + end[:3, 3]]  # centre in the tool's frame
        self.end = pose.constant(end)
        self.wrist = Wrist(chain.link[4], chain.link[5])

    def solve(self, goal: Pose, prefer: Prefer) -> Candidates:
        """All joints for a pose, on branch axes (b0, b1, 2, N)."""
        centre = pose.apply(goal, self.centre)
        pairs, doubt = self.place(centre, prefer=prefer[:3])
        # N = Rz(q4) A Rz(q5) B Rz(q6), its first and last columns
        columns = [pose.turn_direction(goal, self.end[k : k + 3]) for k in (0, 6)]
        if self.elbow is not None:
            miss = self.elbow.miss(pairs, centre)
            x, z = (pose.turn_back(self.links[3], self.elbow.turned_back(pairs, v)) for v in columns)
        else:
            miss, x, z = self._carried_forward(pairs, centre, columns)
        turned, wrist_angles, doubt456, wrong = self.wrist.solve(x, z, prefer[3:])
        miss = arrays.mul(1.0 / self.reach**2, miss) + wrong
        angles = wrist_angles and [None, None, None, *wrist_angles]
        return Candidates([*pairs, *turned], doubt | doubt456, miss, angles)

    def _carried_forward(
        self, pairs: list[Pair], centre: list[Entry], columns: list[list[Entry]]
    ) -> tuple[Entry, list[Entry], list[Entry]]:
        """Squared distance of the wrist's centre from its target, and directions in the frame after joint 3."""
        P = self.links[0]
        for i, pair in enumerate(pairs):
            P = pose.slide(P, pair.c) if pair.s is None else pose.rotate(P, *pair)
            P = pose.compose(P, self.links[i + 1])
        reached = arrays.combine(1.0, P[9:12], self.height4, P[6:9])
        x, z = (pose.turn_back(P, v) for v in columns)
        return distance2(reached, centre), x, z
