"""All branches along a route, linked from sample to sample by a certificate instead of a jump threshold.

On a straight step D in joint space the tip leaves its chord by at most 1/8 sum_jk |D_j| |D_k| r(j, k): the second
derivatives of the forward kinematics are levers, at most r, the reach beyond the later of the two joints. Two
solutions of neighbouring samples are one branch if that is within the tolerance. Steps where a branch finds no
such partner are divided, until it does or they are too short to mean anything: there it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.solutions import Solutions, Status
from armkin.inverse.solve import ik

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Int = NDArray[np.intp]
TURN = 2 * np.pi
LEAST_LEVER = 30.0  # [mm] of a turn that does not move the tip: the tool's direction counts, too
SHORTEST = 1e-9  # of the route: what is not linked there is a jump
ENDS = 0.002  # [mm] how finely the end of a branch, or the crossing of a limit, is found
_PARTS = 8  # of a step that is divided
_MOST = 50_000  # samples added


@dataclass
class Columns:
    """Branches of samples along a route, and their links."""

    s: Array  # (N,) [mm]
    q: Array  # (N, B, n), principal values; nan where there is no branch
    name: NDArray[np.int16]  # (N, B) index into names, -1: none
    status: NDArray[np.int8]  # (N,)
    names: tuple[str, ...] = ()
    complete: bool = True
    partner: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))  # (N - 1, B) column, or -1

    @property
    def valid(self) -> Bool:
        """Where a branch is: (N, B)."""
        return np.asarray(~np.isnan(self.q[:, :, 0]))


def levers(arm: Arm) -> Array:
    """Bounds of the second derivatives of the tip's position by two joints: (n, n) [mm/rad^2, ...]."""
    n = arm.n
    size = np.linalg.norm(arm.link[1:, :3, 3], axis=1)
    far = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    size = size + np.where(arm.prismatic, np.where(np.isfinite(far), far, arm.reach), 0.0)
    beyond = np.cumsum(size[::-1])[::-1]  # from each joint's axis to the tip, at most
    out = np.zeros((n, n))
    for j in range(n):
        for k in range(n):
            first, later = min(j, k), max(j, k)
            if arm.prismatic[first]:
                out[j, k] = 0.0
            else:
                out[j, k] = 1.0 if arm.prismatic[later] else max(beyond[later], LEAST_LEVER)
    return out


def chord_bound(lever: Array, D: Array) -> Array:
    """How far the tip may leave its chord on straight joint steps D (..., n): (...) [mm]."""
    size = np.abs(D)
    return np.asarray(0.125 * ((size @ lever) * size).sum(axis=-1))


def change(arm: Arm, a: Array, b: Array) -> Array:
    """From joint values to others, the shorter way round: (..., n)."""
    D = b - a
    return np.asarray(np.where(arm.prismatic, D, D - TURN * np.rint(D / TURN)))


def linked(
    arm: Arm, targets: Callable[[Array], Array], s: Array, *, task: str | None, tolerance: float, near: Array
) -> Columns:
    """All branches at samples s of a route, every step certified or divided as far as it makes sense.

    targets: lengths (N,) to targets; near: joint values for joints that are free.
    """
    work = _Linking(arm, targets, task, tolerance, near, float(s[-1]))
    work.start(s)
    while work.divide():
        pass
    return work.columns


class _Linking:
    """The samples so far, and which steps are still open."""

    def __init__(
        self,
        arm: Arm,
        targets: Callable[[Array], Array],
        task: str | None,
        tolerance: float,
        near: Array,
        length: float,
    ) -> None:
        self.arm, self.targets, self.task, self.tolerance, self.near = arm, targets, task, tolerance, near
        self.lever = levers(arm)
        self.length = length
        self.added = 0

    def start(self, s: Array) -> None:
        """Solve the first samples and link them."""
        self.columns = self._solved(s)
        N, B = len(s), self.columns.q.shape[1]
        self.columns.partner = np.full((N - 1, B), -1, np.int16)
        self.open = np.ones(N - 1, bool)  # steps to look at
        self.torn = np.zeros(N - 1, bool)  # steps with a branch that has no partner
        self.crossing = np.zeros(N - 1, bool)  # steps in which a joint passes a limit
        self._link()

    def divide(self) -> bool:
        """Divide what has no partner yet, or holds an end that is not known finely enough; False: all is done."""
        c = self.columns
        h = np.diff(c.s)
        least = np.where(self.torn, max(SHORTEST * self.length, 1e-9), ENDS)
        todo = np.flatnonzero((self.torn | self.crossing) & (h > 1.5 * least))
        if not len(todo) or self.added > _MOST:
            return False
        f = np.arange(1, _PARTS) / _PARTS
        new = (c.s[todo, None] + h[todo, None] * f).ravel()
        found = self._solved(new)
        where = np.repeat(todo + 1, _PARTS - 1)
        self.added += len(new)
        B = max(c.q.shape[1], found.q.shape[1])
        q, name = _widened(c.q, B), _widened(c.name, B, -1)
        self.columns = Columns(
            np.insert(c.s, where, new),
            np.insert(q, where, _widened(found.q, B), axis=0),
            np.insert(name, where, _widened(found.name, B, -1), axis=0),
            np.insert(c.status, where, found.status),
            c.names,
            c.complete and found.complete,
            np.insert(_widened(c.partner, B, -1), where, -1, axis=0),
        )
        fresh = np.zeros(len(c.s) - 1, bool)
        fresh[todo] = True
        self.open = np.insert(fresh, where, True)
        self.torn = np.insert(self.torn & ~fresh, where, False)
        self.crossing = np.insert(self.crossing & ~fresh, where, False)
        self._link()
        return True

    def _solved(self, s: Array) -> Columns:
        found = ik(self.arm, self.targets(s), self.task, near=self.near)
        q, name = found.q, found.branch.astype(np.int16)
        singular = np.flatnonzero(found.status == Status.SINGULAR)
        if len(singular):
            # Exactly on a singularity some joints are free: a hair beside it they are not.
            aside = np.clip(s[singular] + 1e-7 * self.length, 0.0, self.length)
            aside = np.where(aside == s[singular], s[singular] - 1e-7 * self.length, aside)
            beside = ik(self.arm, self.targets(aside), self.task, near=self.near)
            good = beside.status != Status.SINGULAR
            B = max(q.shape[1], beside.q.shape[1])
            q, name = _widened(q, B).copy(), _widened(name, B, -1).copy()
            q[singular[good]] = _widened(beside.q, B)[good]
            name[singular[good]] = _widened(beside.branch.astype(np.int16), B, -1)[good]
        return _in_columns(found, s, q, name)

    def _link(self) -> None:
        """Find partners in the open steps."""
        c, arm = self.columns, self.arm
        rows = np.flatnonzero(self.open)
        valid = c.valid
        here, there = valid[rows], valid[rows + 1]
        D = change(arm, c.q[rows], c.q[rows + 1])
        with np.errstate(invalid="ignore"):
            good = chord_bound(self.lever, D) <= self.tolerance
        column = np.arange(c.q.shape[1], dtype=np.int16)
        c.partner[rows] = np.where(good, column, -1)
        straight = np.all(good | ~(here | there), axis=1)
        self.torn[rows] = False
        self.crossing[rows] = self._crosses(c.q[rows], D, good).any(axis=1)
        for i in rows[~straight]:
            self._match(int(i), valid)
        self.open[:] = False

    def _match(self, i: int, valid: Bool) -> None:
        """Partners of one step, whatever their columns: certified pairs, the smoothest first."""
        c, arm = self.columns, self.arm
        left, right = np.flatnonzero(valid[i]), np.flatnonzero(valid[i + 1])
        D = change(arm, c.q[i, left][:, None], c.q[i + 1, right][None])
        ok = chord_bound(self.lever, D) <= self.tolerance
        guess = np.zeros((len(left), arm.n))
        if i > 0:
            ratio = (c.s[i + 1] - c.s[i]) / (c.s[i] - c.s[i - 1])
            for k, b in enumerate(left):
                before = np.flatnonzero(c.partner[i - 1] == b)
                if len(before):
                    guess[k] = change(arm, c.q[i - 1, before[0]], c.q[i, b]) * min(ratio, 10.0)
        cost = np.where(ok, np.linalg.norm(D - guess[:, None], axis=2), np.inf)
        c.partner[i] = -1
        matched = 0
        while np.isfinite(cost).any():
            a, b = np.unravel_index(int(cost.argmin()), cost.shape)
            c.partner[i, left[a]] = right[b]
            cost[a, :], cost[:, b] = np.inf, np.inf
            matched += 1
        self.torn[i] = matched < max(len(left), len(right))

    def _crosses(self, q: Array, D: Array, good: Bool) -> Bool:
        """Which linked columns of steps have a joint that passes one of its limits, whole turns apart: (M, B)."""
        out = np.zeros(good.shape, bool)
        for j in range(self.arm.n):
            for limit in (self.arm.lower[j], self.arm.upper[j]):
                if not np.isfinite(limit):
                    continue
                a, b = q[..., j] - limit, q[..., j] + D[..., j] - limit
                with np.errstate(invalid="ignore"):
                    apart = a * b < 0 if self.arm.prismatic[j] else np.floor(a / TURN) != np.floor(b / TURN)
                out |= apart & good
        return out


def _in_columns(found: Solutions, s: Array, q: Array, name: NDArray[np.int16]) -> Columns:
    """Rows of solutions with every named branch in the column of its number."""
    N, B, n = q.shape
    wide = max(B, int(name.max(initial=-1)) + 1)
    place = np.where(name >= 0, name, 0).astype(np.intp)
    out, labels = np.full((N, wide, n), np.nan), np.full((N, wide), -1, np.int16)
    row, column = np.nonzero((name >= 0) & ~np.isnan(q[:, :, 0]))
    out[row, place[row, column]] = q[row, column]
    labels[row, place[row, column]] = name[row, column]
    return Columns(s, out, labels, found.status.astype(np.int8), found.names, bool(np.all(found.complete)))


def _widened(values: NDArray, B: int, fill: float = np.nan) -> NDArray:  # type: ignore[type-arg]
    """The same with B columns on axis 1."""
    missing = B - values.shape[1]
    if missing <= 0:
        return values
    more = np.full((values.shape[0], missing, *values.shape[2:]), fill, values.dtype)
    return np.concatenate([values, more], axis=1)
