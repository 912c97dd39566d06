"""Candidates of a closed form with their residuals, from code recorded once."""

from functools import cached_property, lru_cache

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.array_tuples import branch_rows
from armkin.formula.arrays import Array, Bool, Entry, Int
from armkin.formula.trace import StraightLineCode
from armkin.forward import fk
from armkin.inverse.closed import crossings, four_bars
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Pair, Prefer, distance2, spin
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task, shifted_targets
from armkin.model.arm import Arm

FEW_TARGETS = 8  # up to so many targets plain Python is faster than arrays
FREED = 24  # values tried for a free joint
REFINEMENTS = 7  # refinements of the best of these values by a factor of sixteen, to 1e-9 rad
# Offsets from `near` [rad] over a whole turn. None is a round value, at which a wrist may be straight: its joints would
# be free as well and jump to their preferred values.
ROUND = np.asarray((np.arange(FREED)[:, None] + 0.37) * (2.0 * np.pi / FREED) - np.pi, np.float64)
SHAKEN = 8  # shifted targets, at which nothing is free


class Recorded:
    """A geometry's formula and the residuals of its candidates, as recorded code."""

    def __init__(self, arm: Arm, task: Task, geometry: Geometry) -> None:
        self.arm, self.task, self.geometry = arm, task, geometry
        self.link = [pose.constant(L) for L in arm.link]

    @cached_property
    def code(self) -> StraightLineCode:
        """The candidates as straight-line code; recording it takes milliseconds."""
        inputs = 12 if self.task.orientation == "full" else len(self.task.labels)
        return StraightLineCode(lambda goal: self.candidates(goal, [None] * self.arm.n), inputs)

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """Lengths of the branch axes."""
        return np.broadcast_shapes((1, 1, 1), *self.code.axes()[:-3])

    def candidates(self, goal: list[Entry], prefer: Prefer) -> list[Entry]:
        """Joint values of all candidates, their squared residual, and `edge` and `free` of `Doubt`: n + 3 arrays."""
        assert self.geometry.pairs is not None
        return self._of(self.geometry.pairs(goal, prefer), goal)

    def _of(self, candidates: Candidates, goal: list[Entry]) -> list[Entry]:
        miss = candidates.miss
        if miss is None:
            miss, *turns = _squared_misses(self.arm, self.task, self.link, candidates.pairs, goal)
            for turn in turns:
                miss = miss + turn
        values = candidates.values()
        if len(self.task.sums):
            miss = arrays.maximum(miss, _sum_miss(self.task, values, goal))
        return [*values, miss, candidates.doubt.edge, candidates.doubt.free]

    def measured(self, goal: list[Entry], prefer: Prefer) -> list[Entry]:
        """The arrays of `candidates`; behind the residual, those of lengths [reaches] and small angles [rad]."""
        assert self.geometry.pairs is not None
        candidates = self.geometry.pairs(goal, prefer)
        *values, miss, edge, free = self._of(candidates, goal)
        length, *turns = _squared_misses(self.arm, self.task, self.link, candidates.pairs, goal, every=True)
        angle: Entry = 0.0
        for turn in turns:  # the three axes count the square of a rotation twice
            angle = arrays.add(angle, arrays.mul(1.0 / max(len(turns) - 1, 1), turn))
        if len(self.task.sums):
            angle = arrays.add(angle, _sum_miss(self.task, values, goal))
        return [*values, miss, length, angle, edge, free]

    @cached_property
    def _preferring(self) -> StraightLineCode:
        """The code for given values of free joints; inputs: the target's entries and the pairs of these values."""
        inputs = 12 if self.task.orientation == "full" else len(self.task.labels)
        slides = self.arm.prismatic.tolist()

        def formula(entries: list[Entry]) -> list[Entry]:
            motions = iter(entries[inputs:])
            pairs = [Pair(next(motions), None if slide else next(motions)) for slide in slides]
            return self.candidates(entries[:inputs], pairs)

        return StraightLineCode(formula, inputs + 2 * len(slides) - sum(slides))

    def with_values(self, target: Array, values: Array) -> Array:
        """Candidates (N, B, n + 1) of N targets for values (N, n) of the free joints; squared residuals come last."""
        flat = target_entries(self.task, target)
        for v, slides in zip(np.ascontiguousarray(values.T), self.arm.prismatic, strict=True):
            flat += [v] if slides else [np.cos(v), np.sin(v)]
        columns = list(self._preferring.run(flat, self._preferring.workspace(len(target))))
        return branch_rows(columns[: self.arm.n + 1], len(target))

    def in_numbers(self, target: Array) -> list[Array]:
        """`candidates` in numbers that do not depend on the other targets, to the last digit."""
        if len(target) > FEW_TARGETS:
            return self.code.run_exactly(target_entries(self.task, target))
        full = self.task.orientation == "full"
        return self.code.one_by_one([pose.read_one(row) if full else row.tolist() for row in target])

    def rows(self, target: Array) -> tuple[Array, Array, Bool]:
        """Candidates of targets as rows: values (N, B, n), real or not, their squared residual (N, B), doubt (N,)."""
        N = len(target)
        columns = list(self.code.run(target_entries(self.task, target), self.code.workspace(N)))
        *_, miss, edge, _ = rows = np.moveaxis(branch_rows(columns, N), 2, 0)
        return np.moveaxis(rows[:-3], 0, 2), miss, np.asarray((edge > 0).any(axis=1))

    def others(self, target: Array, near: Array, lost: Bool) -> tuple[Array, Int, Bool]:
        """Find further candidates of targets that have free joints or have lost branches (N,); near: (N, n).

        For lost branches the candidates have other values of free joints, or belong to slightly shifted targets without
        free joints. For all targets they include the places where two self-motions meet.

        Returns:
            Candidates (N, M, n) [rad | mm], nan for none or one far from the target; their branches (M,); and which
            targets (N,) may still lack branches.
        """
        q, miss = self._at_shifts(target, near, ROUND)
        if not (lost.any() or (q[:, 1:] != q[:, :1]).any()):  # no free joint, so no self-motion
            return q[:, 0, :0], np.zeros(0, np.int64), np.zeros_like(lost)
        exact = np.where((miss <= tol.ACCEPTED**2)[..., None], q, np.nan)
        chosen, held = four_bars.one_per_circuit(self.arm, exact, near)
        of_linkage: Bool = np.asarray(~np.isnan(held).all(axis=2) & (self.task.orientation == "full"))  # (N, B)
        linkage = np.asarray(of_linkage.any(axis=1))
        # others do not depend on the free joint and are known already
        chosen = np.where(linkage[:, None, None], chosen & of_linkage[:, None], miss < tol.HOPELESS**2)
        more = [_each_once(np.where((chosen & lost[:, None, None])[..., None], q, np.nan))]
        solving = np.where((miss < tol.SEED_RESIDUAL**2)[..., None], q, np.nan)
        meeting = crossings.postures_beside(self.arm, self.task, solving, target)
        apart = np.abs(newton.difference(self.arm, meeting[:, :, None], held[:, None]))  # (N, M, B, n)
        same = np.where(np.isnan(apart), 0.0, apart).max(axis=3) < tol.STILL_TURN
        # these lie on a self-motion whose circuits are all known
        meeting[np.any(same & of_linkage[:, None], axis=2)] = np.nan
        more.append(meeting)
        rows = np.flatnonzero(lost & ~linkage)
        if len(rows):
            random = np.full((len(q), (FREED + SHAKEN) * q.shape[2], self.arm.n), np.nan)
            random[rows] = self._at_random_values(target[rows], near[rows])
            more.append(random)
        branch = np.concatenate([np.arange(part.shape[1]) % q.shape[2] for part in more])
        return np.concatenate(more, axis=1), branch, lost if self.geometry.ends else np.zeros_like(lost)

    def samples(self, target: Array, near: Array) -> Array:
        """Candidates (N, FREED, B, n) with values of free joints over a whole turn; nan where one misses."""
        q, miss = self._at_shifts(target, near, ROUND)
        return np.where((miss <= tol.ACCEPTED**2)[..., None], q, np.nan)

    def best_shift(self, target: Array, near: Array, loose: Bool) -> tuple[Array, Bool]:
        """The offset from `near` of free joints at which targets are solved best: (N, 1), [rad, parts of the reach].

        If no value over a whole turn solves a target by a loose candidate (N, B), the search is refined around the best
        value; also returns which targets (N,) needed that.
        """
        shift, spacing = ROUND, 2.0 * np.pi / FREED
        best, pending, single = np.zeros((len(target), 1)), np.arange(len(target)), np.zeros(len(target), bool)
        for refinement in range(REFINEMENTS):
            single[pending] = refinement > 0
            _, miss = self._at_shifts(target[pending], near[pending], best[pending, None] + shift)
            size = np.where(loose[pending, None], miss, np.inf).min(axis=2)
            best[pending] += shift[size.argmin(axis=1)]
            pending = pending[~(size.min(axis=1) <= (tol.ROUNDING if refinement else tol.ACCEPTED) ** 2)]
            if not len(pending):
                break
            spacing /= 16
            shift = spacing * np.arange(-16.0, 17.0)[:, None]
        return best, single

    def _at_shifts(self, target: Array, near: Array, shift: Array) -> tuple[Array, Array]:
        """Candidates (N, S, B, n) with free joints shifted from `near`, (S, 1) or (N, S, 1); squared residuals."""
        values = near[:, None] + shift * np.where(self.arm.prismatic, self.arm.reach / np.pi, 1.0)
        return self._at_values(np.repeat(target[:, None], values.shape[1], axis=1), values)

    def _at_random_values(self, target: Array, near: Array) -> Array:
        """Candidates (N, M, n) with random values of free joints, and of shifted targets without free joints."""
        rng, n = np.random.default_rng(4), self.arm.n
        unit = np.where(self.arm.prismatic, self.arm.reach, np.pi)
        offsets = np.concatenate([rng.uniform(-1, 1, (FREED, n)) * unit, np.zeros((SHAKEN, n))])
        goals = np.repeat(target[:, None], len(offsets), axis=1)
        for k in range(FREED, len(offsets)):
            goals[:, k] = shifted_targets(self.arm, self.task, target, tol.SHAKE_DISTANCE * rng.uniform(-1, 1, 6))
        q, miss = self._at_values(goals, near[:, None] + offsets)
        return _each_once(np.where((miss < tol.HOPELESS**2)[..., None], q, np.nan))

    def _at_values(self, goals: Array, values: Array) -> tuple[Array, Array]:
        """Candidates (N, S, B, n) of targets (N, S, ...) with values (N, S, n) for free joints; squared residuals."""
        N, S = goals.shape[:2]
        rows = self.with_values(goals.reshape(-1, *goals.shape[2:]), values.reshape(-1, self.arm.n))
        rows = rows.reshape(N, S, *rows.shape[1:])
        return rows[..., :-1], rows[..., -1]


def _each_once(q: Array) -> Array:
    """Candidates (N, S, B, n) as (N, S B, n); nan where a branch repeats its first one, as no joint is free."""
    q = q.copy()
    q[:, 1:][(q[:, 1:] == q[:, :1]).all(axis=3)] = np.nan
    return q.reshape(len(q), -1, q.shape[3])


def is_sound(arm: Arm, task: Task, geometry: Geometry) -> bool:
    """Whether a closed form reproduces random postures without a correction; its quartic may be ill-conditioned."""
    q = np.random.default_rng(6).uniform(-np.pi, np.pi, (16, arm.n)) * np.where(arm.prismatic, arm.reach / 8, 1.0)
    _, miss, _ = recorded_formula(arm, task, geometry).rows(fk(arm, q))
    return int((miss.min(axis=1) <= tol.ACCEPTED**2).sum()) >= 15


@lru_cache(maxsize=256)
def recorded_formula(arm: Arm, task: Task, geometry: Geometry) -> Recorded:
    """The recorded formula, shared by all calls of a solver."""
    return Recorded(arm, task, geometry)


def target_entries(task: Task, goal: Array) -> list[Entry]:
    """Targets (N, m) or (N, 4, 4) as arrays of length N."""
    return pose.read_pose(goal) if task.orientation == "full" else list(np.ascontiguousarray(goal.T))


def _squared_misses(
    arm: Arm, task: Task, link: list[pose.Pose], pairs: list[Pair], goal: list[Entry], every: bool = False
) -> list[Entry]:
    """Squared distances of every branch: of the tool's point, in units of the reach, and of its axes.

    For orientations the tool's x and z axes (two columns of a rotation determine the third; `every`: that one, too) are
    carried from the tool back to the base.
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
        columns = [pose.turn_direction(link[i], v) for v in columns]
    full = task.orientation == "full"
    point = goal[9:12] if full else goal[: task.position]
    goals = [goal[0:3], goal[6:9]] if full else [goal[3:6]]
    if full and every:
        columns, goals = [*columns, arrays.cross(columns[1], columns[0])], [*goals, goal[3:6]]
    length = arrays.mul(1.0 / arm.reach**2, distance2(p, point))
    return [length, *(distance2(v, w) for v, w in zip(columns, goals, strict=False))]


def _sum_miss(task: Task, values: list[Entry], goal: list[Entry]) -> Entry:
    """Squared residual of the sums of joint values, modulo whole turns."""
    total: Entry = 0.0
    for k, weights in enumerate(task.sums):
        angle = goal[task.position + k] - task.offsets[k]
        for w, value in zip(weights, values, strict=True):
            angle = arrays.sub(angle, arrays.mul(float(w), value))
        angle = arrays.wrap_angle(angle)
        total = arrays.add(total, angle * angle)
    return total
