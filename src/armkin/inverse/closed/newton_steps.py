"""Arms close to a class, in straight-line code: the class's roots are seeds of Newton's method on the arm.

Three revolute joints have at most four roots for a point, whatever their axes (Pieper, The Kinematics of Manipulators
under Computer Control, 1968, gives the quartic): if four seeds lead to four roots, none is missing. Other targets are
in doubt and need a slower solver.
"""

import math

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry, Truth
from armkin.inverse.closed.elbow import added_angles
from armkin.inverse.closed.geometry import ClosedForm
from armkin.inverse.closed.subproblems import Candidates, Pair, precision, spin
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.rotation import joint_motion, rotation_about
from armkin.model.units import radian_or_reach

MAX_STEPS = 5  # most Newton steps from a candidate
SLOPE = 48.0  # error of the first step per distance from the class, away from singularities
SENSES = {-1.0, 0.0, 1.0}  # factors of a joint in a sum
ABSENT = 90.0  # squared residual of a root that is not real, in distances from the class: 9 on each side of it


class NewtonSteps:
    """Newton's method for an arm whose task is a point, with or without sums of joint values.

    The sums are linear: the last joints follow from the first ones, whose equations are those of the point alone.
    """

    def __init__(self, arm: Arm, task: Task, distance: float) -> None:
        """distance: how far the arm is from the class whose roots are the seeds, lengths in units of the reach."""
        self.arm, self.size = arm, task.position  # equations and unknowns: 2 or 3
        link, offset = _links_without_turns(arm)
        self.base: pose.Pose | None = None
        if self.size == 3:  # residuals are in the first joint's frame
            self.base, link[0] = pose.inverse(pose.constant(link[0])), np.eye(4)
        self.link = [pose.constant(L) for L in link]
        self.offset = [Pair(math.cos(v), math.sin(v)) for v in offset]
        self.unit = [float(v) for v in radian_or_reach(arm)]
        first_sums, last_sums = task.sums[:, : self.size], task.sums[:, self.size :]
        follow = -np.linalg.solve(last_sums, first_sums) if len(task.sums) else np.zeros((0, self.size))
        self.follow: list[list[float]] = follow.tolist()  # derivatives of the last joints by the first ones
        error = min(SLOPE * distance, 0.5)  # each step squares the error
        least = max(math.ceil(math.log2(math.log(tol.LAST_ERROR) / math.log(error))), 1)
        # with one step more two thirds of the targets near a singularity need no other way
        self.steps = min(least + 1, MAX_STEPS)
        self.counted = task.name == "xyz" and not arm.prismatic.any()
        # seeds with a larger squared residual need not converge; a slide's error grows with its extension
        self.absent = None if self.counted or arm.prismatic.any() else ABSENT * distance

    def correct_seeds(self, seeds: Candidates, goal: list[Entry]) -> Candidates:
        """Seeds corrected to roots of the arm, and which of them are in doubt.

        If roots are counted, all four must exist and be distinct, else all that may be real.
        """
        point = goal[: self.size] if self.base is None else pose.apply(self.base, goal[:3])
        pairs, first = self._turn_links(seeds.pairs, 1.0), None
        for _ in range(self.steps):
            residual, columns = self._linear(pairs, point)
            adjugate, det = _adjugate(columns)
            inverse = det / (det * det + tol.NO_DETERMINANT)
            pairs = self._take_step(pairs, [arrays.mul(inverse, arrays.dot(row, residual)) for row in adjugate])
            first = residual if first is None else first
        assert first is not None
        miss = arrays.dot(residual := self._linear(pairs, point)[0], residual)
        solving = miss < precision().nearby
        unsolved: Truth = miss >= precision().nearby
        pairs = self._turn_links(pairs, -1.0)
        if self.absent is not None:
            unsolved = unsolved & (arrays.dot(first, first) < self.absent)
        return Candidates(pairs, seeds.doubt | (_merged_branches(pairs, self.unit) & solving) | unsolved, miss)

    def _turn_links(self, pairs: list[Pair], sense: float) -> list[Pair]:
        """Joints as the links without their turns have them, or with sense -1 back."""
        joints = zip(pairs, self.offset, strict=True)
        return [pair if pair.s is None else added_angles(pair, offset, sense) for pair, offset in joints]

    def _linear(self, pairs: list[Pair], point: list[Entry]) -> tuple[list[Entry], list[list[Entry]]]:
        """The residual of the point, and its derivatives by the first joints [reaches a radian or reach].

        All is carried from the tool back to the base; in joint i's own frame its slope is ``z x p``.
        """
        p = self.link[-1][9:12]
        slopes: list[list[Entry]] = []
        slope: list[Entry]
        for i in range(self.arm.n - 1, -1, -1):
            c, s = pairs[i]
            if s is None:
                p, slope = [p[0], p[1], arrays.add(p[2], c)], [0.0, 0.0, self.unit[i]]
            else:
                p, slopes = spin(c, s, p), [spin(c, s, v) for v in slopes]
                slope = [arrays.mul(-1.0, p[1]), p[0], 0.0]
            slopes = [pose.turn_direction(self.link[i], v) for v in [slope, *slopes]]
            p = pose.apply(self.link[i], p)
        scale = 1.0 / self.arm.reach
        columns = []
        for j in range(self.size):
            column = slopes[j]
            for k, row in enumerate(self.follow):
                column = arrays.combine(1.0, column, row[j], slopes[self.size + k])
            columns.append([arrays.mul(scale, v) for v in column[: self.size]])
        return [arrays.mul(scale, arrays.sub(w, v)) for w, v in zip(point, p, strict=False)], columns

    def _take_step(self, pairs: list[Pair], step: list[Entry]) -> list[Pair]:
        """Joints after a step of the first ones [rad, reaches]; the others turn by as much, so that their sums stay.

        A turn by ``2 atan(t / 2)`` instead of t needs no sine; the difference is of the third power.
        """
        turns = []
        for t in step:
            half = 0.5 * t
            square = half * half
            scale = 1.0 / (1.0 + square)
            turns.append(Pair((1.0 - square) * scale, (half + half) * scale))
        moved = []
        for i, (c, s) in enumerate(pairs):
            if s is None:
                moved.append(Pair(arrays.add(c, arrays.mul(self.unit[i], step[i])), None))
                continue
            turned = Pair(c, s)
            for k, turn in enumerate(turns):
                sense = float(k == i) if i < self.size else self.follow[i - self.size][k]
                if sense:
                    turned = added_angles(turned, turn, sense)
            moved.append(turned)
        return moved


def _links_without_turns(arm: Arm) -> tuple[Array, list[float]]:
    """The links without their turns about joints that turn, and these turns [rad], joint by joint.

    Between two such joints a link is a turn about x and a translation: half of the products of a step.
    """
    link, turns = arm.link.copy(), [0.0] * arm.n
    slides = arm.prismatic.tolist()
    for i in range(arm.n + 1):
        front, back = i > 0 and not slides[i - 1], i < arm.n and not slides[i]
        if front:
            x, y = link[i, :2, 3] if i == arm.n else (-link[i, 1, 2], link[i, 0, 2])
            turn = math.atan2(y, x) if math.hypot(x, y) > tol.NO_SIZE else 0.0
            turns[i - 1] += turn
            link[i] = joint_motion(False, -turn) @ link[i]
        if back and i > 0:
            x, y = (link[i, 0, 0], -link[i, 0, 1]) if front else (link[i, 2, 1], link[i, 2, 0])
            turns[i] += (turn := math.atan2(y, x))
            link[i] = link[i] @ joint_motion(False, -turn)
        if front and back:
            link[i, :3, :3] = rotation_about(0, math.atan2(link[i, 2, 1], link[i, 2, 2]))
        elif i == arm.n and front:
            link[i, 1, 3] = 0.0
    return link, turns


def corrected_form(arm: Arm, task: Task, distance: float, seeds: ClosedForm) -> tuple[ClosedForm, bool] | None:
    """A closed form of an arm that misses a class by so much, and whether it counts all roots; None where it has none.

    seeds: the closed form of the class.
    """
    if task.orientation != "none" or len(task.sums) != arm.n - task.position:
        return None
    last = task.sums[:, task.position :]
    if len(last) and (abs(np.linalg.det(last)) < 0.5 or not set(np.unique(np.linalg.solve(last, task.sums))) <= SENSES):
        return None  # sums without the last joints, or of parts of turns
    newton = NewtonSteps(arm, task, distance)
    return (lambda goal, prefer: newton.correct_seeds(seeds(goal, prefer), goal)), newton.counted


def _merged_branches(pairs: list[Pair], unit: list[float]) -> Truth:
    """Whether a branch is one with another, on any of the branch axes."""
    merged: Truth = False
    for axes in ((0,), (1,), (0, 1)):
        away: Entry = 0.0
        for (c, s), size in zip(pairs, unit, strict=True):
            for v, scale in ((c, 1.0 / size), (s, 1.0)):
                if v is None or isinstance(v, float) or (isinstance(v, np.ndarray) and v.ndim < 4):
                    continue  # it is one for all branches
                flipped = v
                for axis in axes:
                    flipped = arrays.flip(flipped, axis)
                d = arrays.mul(scale, v - flipped)
                away = arrays.add(away, d * d)
        if not isinstance(away, float):
            merged = merged | (away < tol.APART_ROOTS**2)
    return merged


def _adjugate(columns: list[list[Entry]]) -> tuple[list[list[Entry]], Entry]:
    """The adjugate of a matrix of two or three columns, by rows, and its determinant."""
    if len(columns) == 2:
        (a, b), (c, d) = columns
        rows = [[d, arrays.mul(-1.0, c)], [arrays.mul(-1.0, b), a]]
    else:
        u, v, w = columns
        rows = [arrays.cross(v, w), arrays.cross(w, u), arrays.cross(u, v)]
    return rows, arrays.dot(rows[0], columns[0])
