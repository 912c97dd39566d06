"""Arms that miss a class by a little: rounded tables, calibrated axes, links that were meant to be zero.

The closed form of the class that such an arm almost belongs to gives seeds, which Newton's method moves onto the true
arm. Branches continue each other as long as no singularity lies between the two arms: where those of the similar arm
move too much, appear or vanish as the target is moved by a few times the distance between the arms, the pose is in
doubt. Six joints then go to the elimination, which needs no special class; of three turning joints all roots are
eigenvalues (`position_pencil`). Of others both branches of a fold are found at once (`pairs`), and where that fails,
the similar arm's branches at the targets around give more seeds: there is no proof that nothing is lost in between,
hence `complete` is False. Where the elimination is healthy on the arm, as the share of poses that its first two passes
settle shows, six joints go straight to it, and the similar arm only names the branches.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from armkin.formula.array_tuples import stack_rows, widen_columns
from armkin.formula.arrays import Array, Bool, Int, slices
from armkin.forward import fk
from armkin.inverse.closed import elbow, newton_steps, planar, spherical, three_joints, three_parallel
from armkin.inverse.closed.candidates import Recorded, recorded_formula
from armkin.inverse.closed.geometry import Geometry, Rows
from armkin.inverse.elimination import method
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.solvers import general, pairs, position_pencil
from armkin.inverse.solvers.pairs import AROUND_FACTOR, targets_around
from armkin.inverse.tasks.choose_task import NEARLY_PARALLEL
from armkin.inverse.tasks.task import Task, distance, targets_of
from armkin.model.arm import Arm

CHUNK = 1024  # poses corrected at once
NAMED_AT_ONCE = 256  # targets whose branches are named at once: buffers of so many are kept
SICK_SHARE = 0.08  # share of poses that a healthy elimination leaves open in its first two passes
NAME_DISTANCE = 0.5  # distance [rad] of a branch from the similar arm's whose name it takes
RINGS = (1.0, 5.0, 25.0)  # factors on the distance from the class, for seeds on the other side of a singularity


def _nearest_class(arm: Arm, task: Task) -> tuple[float, Geometry] | None:
    """The class nearest to the arm, of those that would fit if its axes moved by `NEAR_DEFECT`, and its distance."""
    positions, poses = (planar, elbow, three_joints), (spherical, three_parallel)
    limit = tol.COUNTED_DEFECT if task.name == "xyz" else NEARLY_PARALLEL
    classes = [*((module, limit) for module in positions), *((module, tol.NEAR_DEFECT) for module in poses)]
    fitting = [ideal for module, limit in classes if (ideal := module.recognise(arm, task, limit)) is not None]
    return min(((_class_gap(arm, task, ideal), ideal) for ideal in fitting), key=lambda pair: pair[0], default=None)


def recognise(arm: Arm, task: Task) -> Geometry | None:
    """Arms that a closed form would fit if their axes moved by `NEAR_DEFECT`, or by more if nothing else fits."""
    # an axis is solved in `armkin.inverse.solvers.tool_axis`
    if task.orientation == "axis" or (nearest := _nearest_class(arm, task)) is None:
        return None
    gap, ideal = nearest
    elimination = cache(lambda: general.recognise(arm, task)) if task.name == "pose" and arm.n == 6 else None
    healthy = _by_elimination(arm, task, ideal, gap, elimination()) if elimination and gap > tol.BLUR_DEFECT else None
    if healthy is not None:
        return healthy

    def rows(target: Array) -> Rows:
        parts = slices(max(len(target), 1), CHUNK)
        result = stack_rows([_solve(source, gap, elimination, target[part]) for part in parts])
        complete = _has_four_roots(arm, result.q) if counts_roots else result.complete
        return result._replace(doubt=result.doubt & ~complete, complete=complete)  # four roots apart are simple ones

    source = recorded_formula(arm, task, ideal)
    steps = newton_steps.corrected_form(arm, task, gap, ideal.pairs) if ideal.pairs is not None else None
    corrected, counts_roots = steps or (None, False)
    why = f"{ideal.why}, but for {gap:.0e} of the reach: closed-form seeds, corrected on the true arm"
    name, width = f"near {ideal.name}", _named_columns(ideal)
    fallback = replace(ideal, name=name, why=why, complete=False, pairs=None, rows=rows, branches=width)
    if corrected is None:
        return fallback
    pencil = position_pencil.recognise(arm, task, ideal, why) if counts_roots else None
    return replace(ideal, name=name, why=why, complete=counts_roots, pairs=corrected, doubts=pencil or fallback)


def _named_columns(ideal: Geometry) -> int | None:
    """How many branches a class has names for; None of one that has no names."""
    return 1 << sum(bool(label) for label in ideal.labels) if ideal.labels else None


def _by_elimination(arm: Arm, task: Task, ideal: Geometry, gap: float, inner: Geometry | None) -> Geometry | None:
    """The elimination, its branches named after those of the similar arm; None if it is not healthy on this arm."""
    if inner is None or inner.elimination is None or inner.rows is None or not inner.complete:
        return None
    if method.left_open(inner.elimination) > SICK_SHARE:
        return None
    source = recorded_formula(arm, task, ideal)

    def places(q: Array, target: Array) -> Int:
        parts = slices(max(len(target), 1), NAMED_AT_ONCE)
        return np.concatenate([_branch_places(source, gap, q[part], target[part]) for part in parts])

    why = f"{ideal.why}, but for {gap:.0e} of the reach: numeric elimination, up to 16 branches, named after that class"
    geometry = replace(ideal, name=inner.name, why=why, pairs=None, branches=_named_columns(ideal), places=places)
    return replace(geometry, rows=name_branches(inner.rows, geometry))


def name_branches(solve: Callable[[Array], Rows], geometry: Geometry) -> Callable[[Array], Rows]:
    """The rows of an elimination, branches in the columns of the class that `geometry` names them after."""
    places = geometry.places
    assert places is not None

    def rows(target: Array) -> Rows:
        branches = solve(target)
        numbers = places(branches.q, target)
        row, column = np.nonzero(numbers >= 0)
        width = max(int(numbers.max(initial=-1)) + 1, geometry.branches or 1)
        q = np.full((len(target), width, branches.q.shape[2]), np.nan)
        q[row, numbers[row, column]] = branches.q[row, column]
        return branches._replace(q=q)

    return rows


def _branch_places(source: Recorded, gap: float, q: Array, target: Array) -> Int:
    """Indices (N, M) of branches (N, M, n): the similar arm's that each is nearest to, others count on, -1 of none."""
    seed, miss, _ = source.rows(target)
    B = seed.shape[1]
    present = ~np.isnan(q[:, :, 0])
    numbers = np.full(present.shape, -1)
    if q.size:
        distances = newton.distances(source.arm, seed, q)  # (N, B, M)
        real = miss < 9.0 * gap * np.maximum(1.0, distance(source.arm, source.task, target))[:, None]
        distances = np.where(real[:, :, None] & ~np.isnan(distances), distances, np.inf)
        nearest, nearest_seed = distances.argmin(axis=2), distances.argmin(axis=1)
        mutual = np.take_along_axis(nearest_seed, nearest, axis=1) == np.arange(B)
        row, place = np.nonzero(mutual & (distances.min(axis=2, initial=np.inf) < NAME_DISTANCE))
        numbers[row, nearest[row, place]] = place
    unnamed = present & (numbers < 0)
    return np.where(unnamed, B - 1 + unnamed.cumsum(axis=1), numbers)


def _class_gap(arm: Arm, task: Task, ideal: Geometry) -> float:
    """How far the arm is from its class: residual of the seeds for postures of its own, lengths in reaches."""
    q = np.random.default_rng(2).uniform(-2.5, 2.5, (64, arm.n)) * np.where(arm.prismatic, arm.reach / 5, 1.0)
    target = targets_of(task, fk(arm, q), q)
    seed, _, _ = recorded_formula(arm, task, ideal).rows(target)
    B = seed.shape[1]
    miss = newton.misses(arm, task, seed.reshape(-1, arm.n), np.repeat(target, B, axis=0)).reshape(-1, B)
    return float(np.quantile(miss.min(axis=1), 0.8)) + tol.NO_RESIDUAL


def _solve(source: Recorded, gap: float, elimination: Callable[[], Geometry | None] | None, target: Array) -> Rows:
    """What is found of some targets, none of them complete; the similar arm's branches keep their places."""
    # the error grows with the slide's extension
    gaps = gap * np.maximum(1.0, distance(source.arm, source.task, target))
    if elimination is None:
        result, is_open = pairs.settle_pairs(source, gaps, target)
        if len(rows := np.flatnonzero(is_open)):
            q, result.doubt[rows] = _by_neighbours(source, gap, gaps[rows], None, target[rows])
            result = result._replace(q=widen_columns(result.q, q.shape[1]))
            result.q[rows] = q
        return result
    return Rows(*_by_neighbours(source, gap, gaps, elimination, target), np.zeros(len(target), bool))


def _by_neighbours(
    source: Recorded, gap: float, gaps: Array, elimination: Callable[[], Geometry | None] | None, target: Array
) -> tuple[Array, Bool]:
    """Branches and doubts by the elimination, or by the similar arm's branches at targets around."""
    arm, task = source.arm, source.task
    seeds, valid, doubt = _correct_seeds(source, gap, gaps, target)
    q = np.where(valid[:, :, None], seeds, np.nan)
    rows = np.flatnonzero(doubt)
    if not len(rows):
        return q, doubt
    goals = target[rows]
    if elimination is not None:
        solver = elimination()
        assert solver is not None
        assert solver.rows is not None
        seeds_around = [solver.rows(goals).q]
    else:
        rings = (targets_around(arm, task, goals, size * gaps[rows]) for size in RINGS)
        seeds_around = [source.rows(goal)[0] for ring in rings for goal in ring]
    branches = _corrected_seeds(arm, task, np.concatenate([seeds[rows], *seeds_around], axis=1), goals, seeds.shape[1])
    filled = widen_columns(q, branches.shape[1])
    filled[rows] = branches
    return filled, doubt


def _corrected_seeds(arm: Arm, task: Task, q: Array, target: Array, places: int) -> Array:
    """Correct seeds (N, B, n) [rad | mm]; failed and repeated ones are nan in columns up to `places`, else left out."""
    N, B, n = q.shape
    seeds, goals = q.reshape(-1, n).copy(), np.repeat(target, B, axis=0)
    hopeful = np.flatnonzero(newton.misses(arm, task, seeds, goals) < tol.HOPELESS)
    size = np.full(len(seeds), np.inf)
    seeds[hopeful], size[hopeful] = newton.correct(arm, task, seeds[hopeful], goals[hopeful], steps=20, patience=4)
    seeds[size > tol.SOLUTION] = np.nan
    q = _filled_columns(seeds.reshape(N, B, n), places)
    for i in range(1, q.shape[1]):
        equal = newton.wrapped_distance(arm, q[:, :i], q[:, i : i + 1]) < tol.SAME_ANSWER
        q[equal.any(axis=1), i] = np.nan
    return _filled_columns(q, places)


def _has_four_roots(arm: Arm, q: Array) -> Bool:
    """Whether branches (N, B, 3), nan where there is none, hold four roots, each apart from the others: all, (N,)."""
    equal = newton.distances(arm, q, q) < tol.APART_ROOTS
    present = ~np.isnan(q[:, :, 0])
    return np.asarray((present.sum(axis=1) == 4) & (equal.sum(axis=(1, 2)) == 4))


def _filled_columns(q: Array, places: int) -> Array:
    """Rows (N, B, n) without the columns that are nan, but for the first `places`."""
    present = ~np.isnan(q[:, places:, 0])
    order = places + np.argsort(~present, axis=1, kind="stable")[:, : int(present.sum(axis=1).max(initial=0))]
    return np.concatenate([q[:, :places], np.take_along_axis(q, order[:, :, None], axis=1)], axis=1)


def _correct_seeds(source: Recorded, gap: float, gaps: Array, target: Array) -> tuple[Array, Bool, Bool]:
    """Seeds moved onto the arm (N, B, n), which are branches (N, B), and for which poses (N,) that may not be all.

    gaps: `gap` at each target (N,). The true arm reaches a target as the similar one, `source`, reaches
    another, not much more than that away. Hence a pose is sure only if the similar arm's branches hardly move
    all around it: where one comes or goes, it moves with the square root of the distance.
    """
    arm, task = source.arm, source.task
    seed, miss, doubt = source.rows(target)
    N, B, n = seed.shape
    weak = min(tol.STEADY_VALUE, 1.5 * np.sqrt(gap)) + tol.MIN_VALUE
    limit = 9.0 * gaps[:, None]  # bound of a squared residual: a pair that just misses being real misses by a root
    real = miss < limit
    for goal in targets_around(arm, task, target, AROUND_FACTOR * gaps):
        q, miss, doubt_there = source.rows(goal)
        near_seed = newton.wrapped_distance(arm, q, seed) < AROUND_FACTOR * gaps[:, None] / weak
        doubt = doubt | doubt_there | (((miss < limit) | real) & ~near_seed).any(axis=1)
    goals = np.repeat(target, B, axis=0)
    seeds = seed.reshape(-1, n)
    rows = np.flatnonzero(newton.misses(arm, task, seeds, goals) < tol.HOPELESS)
    q, size = seeds.copy(), np.full(N * B, np.inf)
    q[rows], size[rows] = newton.correct(arm, task, seeds[rows], goals[rows])
    branch, valid = q.reshape(N, B, n), (size <= tol.ANSWERED).reshape(N, B)
    # what is unreachable for the similar arm may yet be reached
    doubt = doubt | (real & ~valid).any(axis=1) | ~valid.any(axis=1)
    for i in range(B):
        for j in range(i):
            equal = newton.wrapped_distance(arm, branch[:, i], branch[:, j]) < tol.SAME_ANSWER
            doubt |= equal & valid[:, i] & valid[:, j]
    return branch, valid, doubt
