"""Candidates of a closed form with their residuals, from code recorded once."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Bool, Entry
from armkin.formula.trace import OncePaid
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Pair, Prefer, distance2, spin
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm


class Recorded:
    """A geometry's formula and the residual of what it finds."""

    def __init__(self, arm: Arm, task: Task, geometry: Geometry) -> None:
        self.arm, self.task, self.geometry = arm, task, geometry
        self.link = [pose.constant(L) for L in arm.link]
        inputs = 12 if task.orientation == "full" else len(task.labels)
        self.code = OncePaid(lambda goal: self.candidates(goal, [None] * arm.n), inputs)
        self.axes: tuple[int, ...] | None = None  # lengths of the branch axes

    def candidates(self, goal: list[Entry], prefer: Prefer) -> list[Entry]:
        """Joint values of all candidates, their squared residual and doubt: n + 2 arrays on branch axes."""
        assert self.geometry.pairs is not None
        found = self.geometry.pairs(goal, prefer)
        miss = _miss(self.arm, self.task, self.link, found.pairs, goal) if found.miss is None else found.miss
        values = found.values()
        if len(self.task.sums):
            miss = np.maximum(miss, _sum_miss(self.task, values, goal))
        return [*values, miss, found.doubt]

    def rows(self, target: Array) -> tuple[Array, Array, Bool]:
        """Candidates of targets as rows: values (N, B, n), real or not, their squared residual (N, B), doubt (N,)."""
        N = len(target)
        straight = self.code.get(N)
        if straight is None:
            found = self.candidates(entries(self.task, target), [None] * self.arm.n)
        else:
            found = list(straight.run(entries(self.task, target), straight.workspace(N)))
        shape = np.broadcast_shapes((1, 1, 1, N), *(np.shape(v) for v in found))
        *values, miss, doubt = (np.broadcast_to(v, shape).reshape(math.prod(shape[:-1]), N).T for v in found)
        return np.stack(values, axis=2), miss, np.asarray(doubt.any(axis=1))


@lru_cache(maxsize=64)
def recorded(arm: Arm, task: Task, geometry: Geometry) -> Recorded:
    """The same for all calls of one solver."""
    return Recorded(arm, task, geometry)


def entries(task: Task, goal: Array) -> list[Entry]:
    """Targets (N, m) or (N, 4, 4) as arrays of length N."""
    return pose.read(goal) if task.orientation == "full" else list(np.ascontiguousarray(goal.T))


def _miss(arm: Arm, task: Task, link: list[pose.Pose], pairs: list[Pair], goal: list[Entry]) -> Entry:
    """Squared residual of every branch, from its pairs, lengths in units of the reach.

    The tool's point, and for orientations its x and z axes (two columns of a rotation
    determine the third), carried from the tool back to the base.
    """
    p, axes = link[-1][9:12], {"none": (), "axis": (6,), "full": (0, 6)}[task.orientation]
    columns = [link[-1][k : k + 3] for k in axes]
    for i in range(arm.n - 1, -1, -1):
        c, s = pairs[i]
        if s is None:
            p = [p[0], p[1], arrays.add(p[2], c)]
        else:
            p = spin(c, s, p)
            columns = [spin(c, s, v) for v in columns]
        p = pose.apply(link[i], p)
        columns = [pose.turn(link[i], v) for v in columns]
    full = task.orientation == "full"
    where = goal[9:12] if full else goal[: task.position]
    total = arrays.mul(1.0 / arm.reach**2, distance2(p, where))
    wanted = [goal[0:3], goal[6:9]] if full else [goal[3:6]]
    for v, w in zip(columns, wanted, strict=False):
        total = total + distance2(v, w)
    return total


def _sum_miss(task: Task, values: list[Array], goal: list[Entry]) -> Entry:
    """Squared residual of the sums of joint values, modulo whole turns."""
    total: Entry = 0.0
    for k, weights in enumerate(task.sums):
        angle = goal[task.position + k] - task.offsets[k]
        for w, value in zip(weights, values, strict=True):
            angle = arrays.sub(angle, arrays.mul(float(w), value))
        angle = arrays.wrapped(angle)
        total = arrays.add(total, angle * angle)
    return total
