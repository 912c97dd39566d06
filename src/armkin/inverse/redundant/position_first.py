"""Arms of four or five joints asked for a pose: the position exact, the rotation as near as it goes.

Over the postures within limits whose tool stands at the target's position, a family of one or two dimensions, the rows
are the local minima of the rotation angle: `least_rotation` descends to them from many postures at once.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array, Int, slices
from armkin.forward import fk, position, tip_and_jacobian
from armkin.inverse.answers import closest
from armkin.inverse.answers.batch import Goals, as_solutions, empty_batch
from armkin.inverse.answers.closest import Closest
from armkin.inverse.answers.solutions import Ik, Solutions, Status
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.least_rotation import Box, box_of, descend, flat_minima
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import Task, read_near, read_targets
from armkin.keep_out.clearance import hits_nothing
from armkin.model.arm import Arm
from armkin.model.limits import outside_limits

POOL = 32_768  # postures within limits that starts are chosen from
ON_LIMIT = 0.25  # share of the pool's joints that are on a limit
NEAREST_POSTURES = 1024  # postures of the pool that are nearest to a target's position
STARTS = 256  # starts of a target: those of the nearest postures that are farthest from each other
AT_ONCE = 64  # targets worked on together
METHOD = "position first"


def check_arm(arm: Arm, task: str | None) -> None:
    """Raise UsageError where position first is not for this arm or task."""
    if task != "pose":
        raise UsageError(f"position first is for task pose, not {task or 'the default'}", task=task, needs="task pose")
    if arm.n not in (4, 5):
        raise UsageError(f"position first is for arms of 4 or 5 joints; {arm.name} has {arm.n}", joints=arm.n)


def solve_position_first(ik: Ik, arm: Arm, name: str | None, targets: ArrayLike, near: ArrayLike | None) -> Solutions:
    """The postures within limits at the targets' positions whose rotation is nearest: (..., 4, 4) -> rows.

    Rows are local minima of the rotation angle, sorted by it (`Solutions.angle`), then by motion from near, (n,) or
    (..., n); where there are keep-outs free ones come first. status tells of the first: exact if it solves the pose,
    else position; unreachable where there is none. ik: what finds exact answers, called as `armkin.ik` is.
    Raises UsageError for arms of other than 4 or 5 joints, and for a task of another name.
    """
    check_arm(arm, name)
    task = task_for(arm, "pose")
    goal, lead, rounding = read_targets(task, targets)
    reference = read_near(arm, near, lead)
    nears = np.broadcast_to(reference.reshape(-1, arm.n), (len(goal), arm.n))
    lists: list[Array] = []
    for rows in slices(len(goal), AT_ONCE):
        lists += _of_chunk(ik, arm, task, goal[rows], nears[rows])
    if arm.keep_out:
        lists = [minima[np.argsort(~hits_nothing(arm, minima), kind="stable")] for minima in lists]
    B = max(map(len, lists), default=0)
    batch = empty_batch(len(goal), B, arm.n)
    batch.q[...], batch.branch[...] = np.nan, -1
    batch.status[...], batch.complete[...] = Status.UNREACHABLE, False
    for row, branch, minima in zip(batch.q, batch.branch, lists, strict=True):
        row[: len(minima)], branch[: len(minima)] = minima, np.arange(len(minima))
    batch.valid[...] = batch.within[...] = batch.branch >= 0
    q = batch.q.reshape(-1, arm.n)
    residuals = residual(task, fk(arm, q), q, np.repeat(goal, B, axis=0)).reshape(len(goal), B, 6)
    angle = np.linalg.norm(residuals[:, :, 3:], axis=2)
    if B:
        batch.status[batch.valid[:, 0]] = Status.POSITION
        miss = np.hypot(np.linalg.norm(residuals[:, 0, :3], axis=1) / arm.reach, angle[:, 0])
        batch.status[miss <= tol.SOLUTION] = Status.EXACT
    names = tuple(f"minimum {i + 1}" for i in range(B))
    text = names, METHOD, f"minima of the rotation angle at the position, from {STARTS} postures"
    s = as_solutions(Goals(arm, task, goal, nears), reference, lead, batch, rounding, text)
    return replace(s, angle=angle.reshape(s.valid.shape))


def closest_positions(arm: Arm, targets: Array, near: Array) -> list[Closest]:
    """The postures within limits nearest to the positions of targets (N, 4, 4); near: (n,)."""
    poses = closest.closest_each(arm, targets[:, :3, 3], "xyz", near=near)
    q = np.array([pose.q for pose in poses]).reshape(-1, arm.n)
    residuals = residual(task_for(arm, "pose"), fk(arm, q), q, targets)
    return [replace(pose, angle=float(np.linalg.norm(m[3:]))) for pose, m in zip(poses, residuals, strict=True)]


def _of_chunk(ik: Ik, arm: Arm, task: Task, target: Array, near: Array) -> list[Array]:
    """The minima (B, n) of each of some targets, sorted."""
    box = box_of(arm)
    q, row = _seeds(arm, box, target, near)
    q, arrived = descend(arm, box, q, target[row])
    q, row = q[arrived], row[arrived]
    exact = _exact_branches(ik, arm, target, near)
    minima = []
    for k, goal in enumerate(target):
        postures = np.concatenate([exact[k], nearest_row(arm, q[row == k], near[k][None])[0]])
        minima.append(_sorted_minima(arm, task, postures, len(exact[k]), goal, near[k]))
    return minima


def _exact_branches(ik: Ik, arm: Arm, target: Array, near: Array) -> list[Array]:
    """The branches within limits that solve the poses, where the arm has a solver for them."""
    try:
        solver(arm, "pose")
    except UsageError:
        return [np.zeros((0, arm.n))] * len(target)
    s = ik(arm, target, "pose", near=near)
    return [q[keep] for q, keep in zip(s.q, s.valid & s.within_limits, strict=True)]


def _sorted_minima(arm: Arm, task: Task, q: Array, exact: int, target: Array, near: Array) -> Array:
    """Minima (M, n) of one target, each once, by angle, then by motion from near (n,); the first ones are exact."""
    if not len(q):
        return q
    residuals = residual(task, fk(arm, q), q, np.broadcast_to(target, (len(q), 4, 4)))
    angle, searched = np.linalg.norm(residuals[:, 3:], axis=1), np.arange(len(q)) >= exact
    valid = (np.linalg.norm(residuals[:, :3], axis=1) <= tol.SOLUTION * arm.reach) & ~outside_limits(arm, q).any(axis=1)
    q, angle, searched = q[valid], angle[valid], searched[valid]
    motion = (np.abs(q - near) * np.where(arm.prismatic, 1.0, 180 / np.pi)).sum(axis=1)
    by_angle = np.argsort(angle, kind="stable")
    level = np.empty(len(q), int)  # angles that differ by rounding are one
    level[by_angle] = np.cumsum(np.diff(angle[by_angle], prepend=0.0) > tol.ONE_MINIMUM)
    order = np.lexsort((motion.round(tol.EQUAL_DECIMALS), searched, level))
    q, level = q[order], level[order]
    flat = flat_minima(arm, q, target)
    picked: list[int] = []
    for i in range(len(q)):
        equal = [j for j in picked if level[j] == level[i]]
        gaps = newton.wrapped_distance(arm, q[equal], q[i])
        if not any(d <= tol.ONE_MINIMUM or (flat[i] and flat[j]) for d, j in zip(gaps, equal, strict=True)):
            picked.append(i)
    return q[picked]


@lru_cache(maxsize=16)
def _pool(arm: Arm) -> tuple[Array, Array]:
    """Postures spread within limits (P, n), and where the tool stands there (P, 3).

    A joint in four is on a limit: so are those of many minima.
    """
    rng = np.random.default_rng(12)
    q = closest.random_postures(arm, rng, POOL)
    limit = np.where(rng.random(q.shape) < 0.5, arm.lower, arm.upper)
    q = np.where((rng.random(q.shape) < ON_LIMIT) & np.isfinite(limit), limit, q)
    return q, position(arm, q)


def _seeds(arm: Arm, box: Box, target: Array, near: Array) -> tuple[Array, Int]:
    """Postures (M, n) at the targets' positions, within limits, and whose target each is (M,)."""
    pool, tips = _pool(arm)
    point = target[:, :3, 3]
    distances = (tips * tips).sum(axis=1) - 2.0 * (point @ tips.T)
    nearest = pool[np.argpartition(distances, NEAREST_POSTURES, axis=1)[:, :NEAREST_POSTURES]]
    clipped = np.clip(near, arm.lower, arm.upper)[:, None]
    starts = np.concatenate([clipped, _farthest_apart(arm, nearest)], axis=1).reshape(-1, arm.n)
    row = np.repeat(np.arange(len(target)), STARTS + 1)
    q, misses = _to_position(arm, box, starts, point[row], 24)
    in_position = misses <= tol.SOLUTION
    return q[in_position], row[in_position]


def _farthest_apart(arm: Arm, q: Array) -> Array:
    """Choose STARTS of postures (N, K, n), each the farthest from those before, so that small basins get one, too."""
    u = q / arm.reach * np.pi
    places = np.concatenate([np.where(arm.prismatic, u, np.cos(q)), np.where(arm.prismatic, 0.0, np.sin(q))], axis=2)
    rows = np.arange(len(q))
    picked = np.zeros((len(q), STARTS), int)
    distances = np.full(q.shape[:2], np.inf)
    for k in range(1, STARTS):
        change = places - places[rows, picked[:, k - 1]][:, None]
        distances = np.minimum(distances, np.einsum("nki,nki->nk", change, change))
        picked[:, k] = distances.argmax(axis=1)
    return np.asarray(q[rows[:, None], picked])


def _to_position(arm: Arm, box: Box, q: Array, point: Array, steps: int) -> tuple[Array, Array]:
    """Projected Gauss-Newton of least norm onto positions (M, 3); also what is missed [reaches]."""
    q = q.copy()
    active = np.arange(len(q))
    misses = np.full(len(q), np.inf)
    for step in range(steps + 1):
        T, J = tip_and_jacobian(arm, q[active])
        c = (point[active] - T[:, :3, 3]) / arm.reach
        misses[active] = np.linalg.norm(c, axis=1)
        is_open = misses[active] > tol.SOLUTION * tol.ROUNDING_DISTANCE
        active, c, J = active[is_open], c[is_open], J[is_open, :3] * box.unit / arm.reach
        if step == steps or not len(active):
            break
        move, stalled = _least_norm_steps(J, c), np.zeros((len(c), arm.n), bool)
        for _ in range(2):  # joints that would go beyond a limit stay on it
            stalled |= ((q[active] <= box.lower) & (move < 0)) | ((q[active] >= box.upper) & (move > 0))
            move = _least_norm_steps(np.where(stalled[:, None], 0.0, J), c)
        move *= np.minimum(1.0, 0.5 / np.maximum(np.abs(move).max(axis=1), tol.TINY))[:, None]
        q[active] = np.clip(q[active] + move * box.unit, box.lower, box.upper)
    return q, misses


def _least_norm_steps(J: Array, c: Array) -> Array:
    """Damped steps of least norm (M, n) of J d = c, J (M, 3, n)."""
    size = np.einsum("mi,mi->m", c, c)[:, None, None]
    G = J @ J.swapaxes(1, 2) + (1e-2 * size + tol.WEAK * tol.WEAK) * np.eye(3)
    return np.asarray((J.swapaxes(1, 2) @ np.linalg.solve(G, c[:, :, None]))[:, :, 0])
