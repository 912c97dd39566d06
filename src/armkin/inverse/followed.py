"""Answers of an arm with a redundant joint at any of its values, followed along it by their branches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.branches.tracking import follow
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.closed.candidates import entries, recorded
from armkin.inverse.numeric.tolerances import ACCEPTED
from armkin.inverse.solvers.recognise import solver
from armkin.inverse.solvers.redundant import Redundancy, moved

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Ik = Callable[..., Solutions]
AT_A_TIME = 2_000  # targets of a formula: they stay in the cache


class Postures(NamedTuple):
    """Answers at values of the redundant joint: q (..., B, n), whether they are there and within limits (..., B)."""

    q: Array
    valid: Bool
    legal: Bool


class Follower(NamedTuple):
    """Answers of some targets (N, ...) at any value of the redundant joint; near: (N, n)."""

    ik: Ik
    arm: Arm
    free: Redundancy
    target: Array
    near: Array

    @property
    def labelled(self) -> bool:
        """Whether a branch keeps its index along the turn, as that of a closed form does."""
        return self.free.geometry.ordered and self.free.geometry.pairs is not None

    def at(self, rows: NDArray[np.intp], t: Array) -> Postures:
        """All branches of targets (M,) at values t (M,), each in the column of its index."""
        return self._legal(rows, self.found(rows, t))

    def found(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Branches (M, B, n), nan where there is none."""
        goal = moved(self.arm, self.free, self.target[rows], t)
        if self.labelled and self.free.geometry.doubts is None:
            return self._by_formula(goal, t)
        s = self.ik(self.free.rest, goal, self.free.task.name, examine=False)
        M, B, r = len(t), s.q.shape[1], self.free.joint
        number = s.branch if self.labelled else np.where(s.valid, np.arange(B), -1)
        out = np.full((M, B + 1, self.arm.n), np.nan)
        place = np.arange(M)[:, None], np.where(number < 0, B, number)
        out[*place, :r], out[*place, r], out[*place, r + 1 :] = s.q[:, :, :r], t[:, None], s.q[:, :, r:]
        return out[:, : max(B, 1)]  # a column, where no target of them has an answer

    def _by_formula(self, goal: Array, t: Array) -> Array:
        """The same of a closed form, by its recorded formula alone; one joint after another in memory."""
        rest, r, M = self.free.rest, self.free.joint, len(t)
        formula = recorded(rest, solver(rest, self.free.task.name)[0], self.free.geometry)
        joints = [j for j in range(self.arm.n) if j != r]
        out = np.empty((self.arm.n, math.prod(formula.axes), M))
        out[r] = t
        room: list[NDArray[Any]] = []
        for start in range(0, M, AT_A_TIME):
            some = slice(start, min(start + AT_A_TIME, M))
            shape = (*formula.axes, some.stop - start)
            if not room or some.stop - start != AT_A_TIME:
                room = formula.code.workspace(some.stop - start)
            *values, miss, _, _ = formula.code.run(entries(formula.task, goal[some]), room)
            for j, value in zip(joints, values, strict=True):
                out[j, :, some] = np.broadcast_to(value, shape).reshape(-1, shape[-1])
            missing = np.broadcast_to(miss > ACCEPTED**2, shape).reshape(-1, shape[-1])
            out[:, :, some][:, missing] = np.nan
        return out.transpose(2, 1, 0)

    def _legal(self, rows: NDArray[np.intp], q: Array) -> Postures:
        """Postures (M, B, n) at their nearest legal copies."""
        valid = ~np.isnan(q[:, :, 0])
        q, legal = nearest_row(self.arm, np.where(valid[:, :, None], q, 0.0), self.near[rows][:, None])
        q[~valid] = np.nan
        return Postures(q, valid, legal & valid)

    def along(self, t: Array) -> Postures:
        """Of every target at all of t (K,), linked along it: q (N, K, B, n)."""
        N, K = len(self.target), len(t)
        found = self.at(np.repeat(np.arange(N), K), np.tile(t, N))
        B = found.valid.shape[1]
        q, valid, legal = found.q.reshape(N, K, B, -1), found.valid.reshape(N, K, B), found.legal.reshape(N, K, B)
        if self.labelled:
            return Postures(q, valid, legal)
        kept = [i for i in range(self.arm.n) if i != self.free.joint]
        for k in range(N):
            goal = moved(self.arm, self.free, np.repeat(self.target[k : k + 1], K, axis=0), t)
            number = follow(self.free.rest, self.free.task, q[k][:, :, kept], goal)
            q[k] = in_columns(q[k], number)
            legal[k] = in_columns(legal[k][:, :, None].astype(float), number)[:, :, 0] == 1.0
        return Postures(q, ~np.isnan(q[..., 0]), legal)

    def one(self, rows: NDArray[np.intp], branch: NDArray[np.intp], t: Array, like: Array) -> Postures:
        """One branch each (M,): that of its index, or, of an elimination, the one nearest to postures like (M, n)."""
        q, each = self.found(rows, t), np.arange(len(rows))
        if not self.labelled:
            apart = np.abs(np.remainder(q - like[:, None] + np.pi, 2 * np.pi) - np.pi).max(axis=2)
            apart = np.where(apart < 0.5, apart, np.inf)
            branch = apart.argmin(axis=1)
            q[np.isinf(apart)] = np.nan
        one = self._legal(rows, q[each, branch][:, None])
        return Postures(one.q[:, 0], one.valid[:, 0], one.legal[:, 0])

    def motion(self, rows: NDArray[np.intp], q: Array) -> Array:
        """Sum of |change| from near [deg | mm]: q (M, ..., n) -> (M, ...); inf where there is no posture."""
        unit = np.where(self.arm.prismatic, 1.0, 180 / np.pi)
        near = self.near[rows].reshape(len(rows), *[1] * (q.ndim - 2), self.near.shape[1])
        total = (np.abs(q - near) * unit).sum(axis=-1)
        return np.where(np.isnan(total), np.inf, total)


def in_columns(q: Array, number: NDArray[np.integer]) -> Array:
    """Rows (M, B, n) in the columns of their numbers (M, B), nan where there is none; -1: left away."""
    M, B, n = q.shape
    out = np.full((M, B + 1, n), np.nan)
    out[np.arange(M)[:, None], np.where(number < 0, B, number)] = q
    return out[:, :B]
