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
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.solve import isolated as ik

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Int = NDArray[np.intp]
TURN = 2 * np.pi
LEAST_LEVER = 30.0  # [mm] of a turn that does not move the tip: the tool's direction counts, too
SHORTEST = 1e-9  # of the route: what is not linked there is a jump
ENDS = 0.002  # [mm] how finely the end of a branch, or the crossing of a limit, is found
_PARTS = (8, 32)  # of a step that is divided: with many such steps, and with few
_AT_ONCE = 1024  # samples that are solved at once, if the parts are no fewer
_MOST = 50_000  # samples added
_BLOCK = 16_384  # samples that are solved at once at most


@dataclass
class Columns:
    """Branches of samples along a route, and their links."""

    s: Array  # (N,) [mm]
    q: Array  # (N, B, n), principal values; nan where there is no branch
    name: NDArray[np.int16]  # (N, B) index into names, -1: none
    status: NDArray[np.int8]  # (N,)
    within: Bool  # (N, B) within limits, of some copy
    names: tuple[str, ...] = ()
    complete: bool = True
    partner: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))  # (N - 1, B) column, or -1

    @property
    def valid(self) -> Bool:
        """Where a branch is: (N, B)."""
        return np.asarray(~np.isnan(self.q[:, :, 0]))

    def rows(self, rows: Int) -> Columns:
        """Some samples, without their links."""
        parts = (self.s[rows], self.q[rows], self.name[rows], self.status[rows], self.within[rows])
        return Columns(*parts, self.names, self.complete)

    def wider(self, B: int) -> Columns:
        """The same with B columns of branches at least."""
        return Columns(
            self.s,
            _widened(self.q, B),
            _widened(self.name, B, -1),
            self.status,
            _widened(self.within, B, 0),
            self.names,
            self.complete,
            _widened(self.partner, B, -1),
        )

    def inserted(self, at: Int, new: Columns) -> Columns:
        """These samples with others before the rows `at`; the links of both stay, as far as they have any."""
        B = max(self.q.shape[1], new.q.shape[1])
        old, new = self.wider(B), new.wider(B)
        links = new.partner if len(new.partner) else np.full((len(new.s), B), -1, np.int16)
        return Columns(
            np.insert(old.s, at, new.s),
            np.insert(old.q, at, new.q, axis=0),
            np.insert(old.name, at, new.name, axis=0),
            np.insert(old.status, at, new.status),
            np.insert(old.within, at, new.within, axis=0),
            old.names,
            old.complete and new.complete,
            np.insert(old.partner, at, links, axis=0),
        )


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
    return np.asarray(out * np.outer(arm.ratio, arm.ratio))


def chord_bound(lever: Array, D: Array) -> Array:
    """How far the tip may leave its chord on straight joint steps D (..., n): (...) [mm]."""
    size = np.abs(D)
    return np.asarray(0.125 * np.einsum("...i,...i->...", size @ lever, size))


def largest_form(arm: Arm, lever: Array) -> tuple[Array | None, float]:
    """Scales of joints (n,) (None: all 1) and c, with `chord_bound` at most c |scaled D|^2: cheap to compute."""
    scale = np.where(arm.prismatic, 1.0 / arm.reach, 1.0)
    top = 0.125 * float(np.linalg.eigvalsh(lever / np.outer(scale, scale)).max())
    return (np.asarray(scale) if arm.prismatic.any() else None), top


def turns_of(arm: Arm) -> Array:
    """What a whole turn is in commanded values, for every joint: (n,) [rad]. A joint's ratio makes it more or less."""
    return np.asarray(TURN / arm.ratio)


def change(arm: Arm, a: Array, b: Array) -> Array:
    """From joint values to others, the shorter way round: (..., n)."""
    D: Array = b - a
    turn = turns_of(arm)
    turns = D * (~arm.prismatic / turn)
    np.rint(turns, out=turns)
    turns *= turn
    D -= turns
    return D


def linked(
    arm: Arm, targets: Callable[[Array], Array], s: Array, *, task: str | None, tolerance: float, near: Array
) -> Columns:
    """All branches at samples s of a route, every step certified or divided as far as it makes sense.

    targets: lengths (N,) to targets; near: joint values for joints that are free.
    """
    work = _Linking(arm, targets, task, tolerance, near, float(s[-1]))
    work.start(s)
    work.settle()
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
        self.turn = turns_of(arm)
        self.scale, self.top = largest_form(arm, self.lever)
        self.length = length
        self.added = 0
        self.fresh = np.zeros(0, bool)  # samples that were added
        self.wide = [  # joints whose copies overlap: a run may end at a limit though another copy is legal
            j
            for j in range(arm.n)
            if not arm.prismatic[j]
            and arm.upper[j] - arm.lower[j] > self.turn[j] - 1e-6
            and np.isfinite(arm.upper[j] - arm.lower[j])
        ]

    def start(self, s: Array) -> None:
        """Solve the first samples and link them."""
        self.columns = self._solved(s)
        N, B = len(s), self.columns.q.shape[1]
        self.columns.partner = np.full((N - 1, B), -1, np.int16)
        self.open = np.ones(N - 1, bool)  # steps to look at
        self.torn = np.zeros(N - 1, bool)  # steps with a branch that has no partner
        self.both = np.zeros(N - 1, bool)  # steps with one at either end, which may be the same branch
        self.crossing = np.zeros(N - 1, bool)  # steps in which a joint passes a limit
        self._link()

    def settle(self) -> None:
        """Divide the steps that need it, apart from all the others, three samples around each."""
        c = self.columns
        steps = np.flatnonzero(self.torn | self.crossing)
        if not len(steps):
            return
        rows = np.stack([np.maximum(steps - 1, 0), steps, steps + 1], axis=1).ravel()
        part = _Linking(self.arm, self.targets, self.task, self.tolerance, self.near, self.length)
        part.columns = c.rows(rows)
        part.columns.partner = c.partner[rows[:-1]]
        part.columns.partner[2::3] = -1  # between the groups
        part.open = np.zeros(len(rows) - 1, bool)
        part.torn, part.both, part.crossing = part.open.copy(), part.open.copy(), part.open.copy()
        part.torn[1::3], part.both[1::3] = self.torn[steps], self.both[steps]
        part.crossing[1::3] = self.crossing[steps]
        part.fresh = np.zeros(len(rows), bool)
        group = np.repeat(np.arange(len(steps)), 3)
        while part.divide():
            group = np.insert(group, part.where, group[np.maximum(part.where - 1, 0)])
        self._put(part, steps, group)

    def _put(self, part: _Linking, steps: Int, group: Int) -> None:
        """Take over what was added to the steps, and their links."""
        B = max(self.columns.q.shape[1], part.columns.q.shape[1])
        c, p, new = self.columns.wider(B), part.columns.wider(B), part.fresh
        at = np.repeat(steps + 1, np.bincount(group[new], minlength=len(steps)))
        links = np.append(p.partner, np.full((1, B), -1, np.int16), axis=0)
        # the left end of each step is the second sample of its group
        second = np.flatnonzero(~new)[1::3]
        c.partner = c.partner.copy()
        c.partner[steps] = links[second]
        added = p.rows(np.flatnonzero(new))
        added.partner = links[new]
        self.columns = c.inserted(at, added)

    def divide(self) -> bool:
        """Divide what has no partner yet, or holds an end that is not known finely enough; False: all is done.

        A branch without a partner of which the step's other end knows nothing ends in that step, whatever is found
        inside: where it does is all that is asked.
        """
        c = self.columns
        h = np.diff(c.s)
        least = np.where(self.both, max(SHORTEST * self.length, 1e-9), ENDS)
        todo = np.flatnonzero((self.torn | self.crossing) & (h > 1.5 * least))
        # Ends need no more than the formulas; their samples on edges are dear to examine.
        singular = c.status == Status.SINGULAR
        plain = ~(self.both | singular[:-1] | singular[1:])[todo]
        quick = bool(plain.any())
        todo = todo[plain] if quick else todo
        if not len(todo) or self.added > _MOST:
            return False
        parts = int(np.clip(_AT_ONCE // len(todo), *_PARTS))
        f = np.arange(1, parts) / parts
        new = (c.s[todo, None] + h[todo, None] * f).ravel()
        found = self._solved(new, examine=not quick)
        self.where = where = np.repeat(todo + 1, parts - 1)
        self.fresh = np.insert(self.fresh, where, True)
        self.added += len(new)
        self.columns = c.inserted(where, found)
        fresh = np.zeros(len(c.s) - 1, bool)
        fresh[todo] = True
        self.open = np.insert(fresh, where, True)
        self.torn = np.insert(self.torn & ~fresh, where, False)
        self.both = np.insert(self.both & ~fresh, where, False)
        self.crossing = np.insert(self.crossing & ~fresh, where, False)
        self._link()
        return True

    def _solved(self, s: Array, examine: bool = True) -> Columns:
        """All branches at samples, not linked yet; of very many in parts, to bound the memory that takes."""
        parts = [self._solved_part(s[k : k + _BLOCK], examine) for k in range(0, len(s), _BLOCK)]
        if len(parts) == 1:
            return parts[0]
        B = max(part.q.shape[1] for part in parts)
        wide = [part.wider(B) for part in parts]
        return Columns(
            s,
            np.concatenate([part.q for part in wide]),
            np.concatenate([part.name for part in wide]),
            np.concatenate([part.status for part in wide]),
            np.concatenate([part.within for part in wide]),
            max((part.names for part in parts), key=len),
            all(part.complete for part in parts),
        )

    def _solved_part(self, s: Array, examine: bool) -> Columns:
        found = ik(self.arm, self.targets(s), self.task, near=self.near, examine=examine)
        q, name, within = found.q, found.branch.astype(np.int16), found.within_limits
        singular = np.flatnonzero(found.status == Status.SINGULAR)
        if len(singular):
            # Exactly on a singularity some joints are free: 1e-7 of the path's length beside it they are determined.
            aside = np.clip(s[singular] + 1e-7 * self.length, 0.0, self.length)
            aside = np.where(aside == s[singular], s[singular] - 1e-7 * self.length, aside)
            beside = ik(self.arm, self.targets(aside), self.task, near=self.near)
            # Where there is nothing beside it, a stretched arm's wrist for example, the posture there stays.
            good = (beside.status != Status.SINGULAR) & beside.valid.any(axis=1)
            B = max(q.shape[1], beside.q.shape[1])
            q, name, within = _widened(q, B).copy(), _widened(name, B, -1).copy(), _widened(within, B, 0).copy()
            within[singular[good]] = _widened(beside.within_limits, B, 0)[good]
            q[singular[good]] = _widened(beside.q, B)[good]
            name[singular[good]] = _widened(beside.branch.astype(np.int16), B, -1)[good]
        return _in_columns(found, s, q, name, within)

    def _link(self) -> None:
        """Find partners in the open steps."""
        rows, valid = np.flatnonzero(self.open), self.columns.valid
        for k in range(0, len(rows), _BLOCK):
            self._link_some(rows[k : k + _BLOCK], valid)
        self.open[:] = False

    def _link_some(self, rows: Int, valid: Bool) -> None:
        c, first, behind = self.columns, int(rows[0]), int(rows[-1]) + 1
        every = behind - first == len(rows)
        left, right = (slice(first, behind), slice(first + 1, behind + 1)) if every else (rows, rows + 1)
        good, wrapped = self._certified(c.q[left], c.q[right], valid[left] & valid[right])
        column = np.arange(c.q.shape[1], dtype=np.int16)
        c.partner[rows] = np.where(good, column, np.int16(-1))
        straight = (good == (valid[left] | valid[right])).all(axis=1)
        self.torn[rows], self.both[rows] = False, False
        flips = (c.within[left] != c.within[right]) & good
        if self.wide:
            flips |= self._crosses(c.q, left, right, wrapped) & good
        self.crossing[rows] = flips.any(axis=1)
        for i in rows[~straight]:
            self._match(int(i), valid)

    def _certified(self, a: Array, b: Array, there: Bool) -> tuple[Bool, Bool]:
        """Which branches (M, B, n) at steps' ends are one, by a cheap bound and where that is too coarse by the bound.

        there: (M, B). Returns that, and which of the cheaply refused ones go the other way round: (M, B) each.
        """
        D = b - a
        if self.scale is not None:
            D *= self.scale
        with np.errstate(invalid="ignore"):
            good = self.top * np.einsum("mbi,mbi->mb", D, D) <= self.tolerance
        k, j = np.nonzero(there & ~good)
        wrapped = np.zeros(good.shape, bool)
        if len(k):
            shorter = change(self.arm, a[k, j], b[k, j])
            good[k, j] = chord_bound(self.lever, shorter) <= self.tolerance
            wrapped[k, j] = np.abs(b[k, j] - a[k, j] - shorter).max(axis=1) > 1.0
        return good, wrapped

    def _match(self, i: int, valid: Bool) -> None:
        """Partners of one step, whatever their columns: certified pairs, the smoothest first."""
        c, arm = self.columns, self.arm
        left, right = np.flatnonzero(valid[i]), np.flatnonzero(valid[i + 1])
        D = change(arm, c.q[i, left][:, None], c.q[i + 1, right][None])
        ok = chord_bound(self.lever, D) <= self.tolerance
        guess = np.zeros((len(left), arm.n))
        if i > 0 and c.s[i] > c.s[i - 1]:
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
        self.both[i] = matched < min(len(left), len(right))

    def _crosses(self, q: Array, left: Int | slice, right: Int | slice, wrapped: Bool) -> Bool:
        """Which columns of steps have a wide joint that passes one of its limits, whole turns apart: (M, B)."""
        out = wrapped.copy()
        for j in self.wide:
            value = q[:, :, j]
            for limit in (self.arm.lower[j], self.arm.upper[j]):
                out |= np.floor((value[left] - limit) / self.turn[j]) != np.floor((value[right] - limit) / self.turn[j])
        k, b = np.nonzero(wrapped)  # these go the other way round
        if len(k):
            start, end = q[left][k, b], q[right][k, b]
            there = start + change(self.arm, start, end)
            out[k, b] = False
            for j in self.wide:
                for limit in (self.arm.lower[j], self.arm.upper[j]):
                    before, after = (np.floor((x[:, j] - limit) / self.turn[j]) for x in (start, there))
                    out[k, b] |= before != after
        return out


def _in_columns(found: Solutions, s: Array, q: Array, name: NDArray[np.int16], within: Bool) -> Columns:
    """Rows of solutions with every named branch in the column of its number."""
    B = q.shape[1]
    wide = max(B, int(name.max(initial=-1)) + 1)
    status, complete = found.status.astype(np.int8), bool(np.all(found.complete))
    moved = np.flatnonzero(((name >= 0) & (name != np.arange(B))).any(axis=1))
    q, name, within = (_widened(x, wide, fill) for x, fill in ((q, np.nan), (name, -1), (within, 0)))
    if len(moved):
        q, name, within = q.copy(), name.copy(), within.copy()
        old_q, old_name, old_within = q[moved], name[moved], within[moved]
        q[moved], name[moved], within[moved] = np.nan, -1, False
        row, column = np.nonzero((old_name >= 0) & ~np.isnan(old_q[:, :, 0]))
        place = old_name[row, column]
        q[moved[row], place] = old_q[row, column]
        name[moved[row], place] = place
        within[moved[row], place] = old_within[row, column]
    return Columns(s, q, name, status, within, found.names, complete)


def _widened(values: NDArray, B: int, fill: float = np.nan) -> NDArray:  # type: ignore[type-arg]
    """The same with B columns on axis 1."""
    missing = B - values.shape[1]
    if missing <= 0:
        return values
    more = np.full((values.shape[0], missing, *values.shape[2:]), fill, values.dtype)
    return np.concatenate([values, more], axis=1)
