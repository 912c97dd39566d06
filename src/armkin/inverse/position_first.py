"""Arms of four or five joints asked for a pose: the position exact, the rotation as near as it goes.

Over the postures within limits whose tool stands at the target's position, a family of one or two dimensions, the rows
are the local minima of the rotation angle. Minimised is f = 1 - cos(angle) = (3 - trace(R_target' R)) / 2, smooth up to
half a turn, by Newton's method in the null space of the position's Jacobian, with the exact second derivatives of the
chain and an active set of limits (Nocedal and Wright, Numerical Optimization, 2006, 16.5 and 18.1), from many
postures at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array, Bool
from armkin.forward import fk, position, tip_and_jacobian
from armkin.inverse.answers import closest
from armkin.inverse.answers.closest import Closest
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import (
    EQUAL,
    LEVEL_CURVATURE,
    ONE_MINIMUM,
    SAME,
    SOLUTION,
    STATIONARY,
    TINY,
    WEAK,
)
from armkin.inverse.solvers.recognise import solver
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import Task, read_near, read_targets
from armkin.keep_out.clearance import clear
from armkin.model.arm import actual
from armkin.model.limits import outside
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

POOL = 32_768  # postures within limits
NEAREST = 1024  # of them, those nearest to a target's position
STARTS = 144  # of these, those farthest from each other
STEPS = 80  # of one start
AT_ONCE = 64  # targets worked on together
METHOD = "position first"
Ik = Callable[..., Solutions]


def check(arm: Arm, task: str | None) -> None:
    """Raise UsageError where position first is not for this arm or task."""
    if task != "pose":
        raise UsageError(f"position first is for task pose, not {task or 'the default one'}", task=task)
    if arm.n not in (4, 5):
        raise UsageError(f"position first is for arms of 4 or 5 joints; {arm.name} has {arm.n}", joints=arm.n)


def position_first(ik: Ik, arm: Arm, targets: ArrayLike, *, near: ArrayLike | None = None) -> Solutions:
    """The postures within limits at the targets' positions whose rotation is nearest: (..., 4, 4) -> rows.

    Rows are local minima of the rotation angle, sorted by it (`Solutions.angle`), then by motion from near, (n,) or
    (..., n); where there are keep-outs free ones come first. status tells of the first: exact if it solves the pose,
    else position; unreachable where there is none. ik: what finds exact answers, called as `armkin.ik` is.
    Raises UsageError for arms of other than 4 or 5 joints.
    """
    check(arm, "pose")
    task = task_for(arm, "pose")
    goal, lead, rounding = read_targets(task, targets)
    close = read_near(arm, near, lead)
    each = np.broadcast_to(close.reshape(-1, arm.n), (len(goal), arm.n))
    true = actual(arm)
    found: list[Array] = []
    for start in range(0, len(goal), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        found += _of_chunk(ik, true, task, goal[rows], each[rows] * arm.ratio)
    if arm.keep_out:
        found = [minima[np.argsort(~clear(arm, minima / arm.ratio), kind="stable")] for minima in found]
    B = max(map(len, found), default=0)
    q = np.full((len(goal), B, arm.n), np.nan)
    for row, minima in zip(q, found, strict=True):
        row[: len(minima)] = minima / arm.ratio
    valid = ~np.isnan(q).any(axis=2)
    missing = residual(task, fk(arm, q.reshape(-1, arm.n)), q.reshape(-1, arm.n), np.repeat(goal, B, axis=0))
    angle = np.linalg.norm(missing[:, 3:], axis=1).reshape(valid.shape)
    solved = B > 0 and np.hypot(np.linalg.norm(missing[:, :3], axis=1) / arm.reach, angle.ravel()) <= SOLUTION
    status = np.full(len(goal), Status.UNREACHABLE, np.int8)
    if B:
        status[valid[:, 0]] = Status.POSITION
        status[valid[:, 0] & np.reshape(solved, valid.shape)[:, 0]] = Status.EXACT
    return Solutions(
        arm=arm,
        task=task,
        target=goal.reshape(*lead, 4, 4),
        near=np.broadcast_to(close.copy(), (*lead, arm.n)),
        q=q.reshape(*lead, B, arm.n),
        valid=valid.reshape(*lead, B),
        within_limits=valid.reshape(*lead, B).copy(),
        branch=np.where(valid, np.arange(B), -1).astype(np.int8).reshape(*lead, B),
        status=status.reshape(lead),
        free=np.zeros((*lead, arm.n), bool),
        names=tuple(f"minimum {i + 1}" for i in range(B)),
        method=METHOD,
        why=f"minima of the rotation angle at the position, from {STARTS} postures",
        complete=np.zeros(lead, bool),
        rounding=rounding.reshape(lead),
        angle=angle.reshape(*lead, B),
    )


def closest_each(arm: Arm, targets: Array, near: Array) -> list[Closest]:
    """The postures within limits nearest to the positions of targets (N, 4, 4); near: (n,)."""
    found = closest.closest_each(arm, targets[:, :3, 3], "xyz", near=near)
    q = np.array([one.q for one in found]).reshape(-1, arm.n)
    missing = residual(task_for(arm, "pose"), fk(arm, q), q, targets)
    return [replace(one, angle=float(np.linalg.norm(m[3:]))) for one, m in zip(found, missing, strict=True)]


def _of_chunk(ik: Ik, arm: Arm, task: Task, target: Array, near: Array) -> list[Array]:
    """The minima (B, n) of each of some targets, sorted."""
    box = _box(arm)
    q, row = _seeds(arm, box, target, near)
    state = _descend(arm, box, q, target[row])
    q, row = state.q[state.done], row[state.done]
    exact = _exact(ik, arm, target, near)
    out = []
    for k, goal in enumerate(target):
        some = np.concatenate([exact[k], nearest_row(arm, q[row == k], near[k][None])[0]])
        out.append(_sorted(arm, task, some, len(exact[k]), goal, near[k]))
    return out


def _exact(ik: Ik, arm: Arm, target: Array, near: Array) -> list[Array]:
    """The branches within limits that solve the poses, where the arm has a solver for them."""
    try:
        solver(arm, "pose")
    except UsageError:
        return [np.zeros((0, arm.n))] * len(target)
    s = ik(arm, target, "pose", near=near)
    return [q[keep] for q, keep in zip(s.q, s.valid & s.within_limits, strict=True)]


def _sorted(arm: Arm, task: Task, q: Array, exact: int, target: Array, near: Array) -> Array:
    """Minima (M, n) of one target, each once, by angle, then by motion from near (n,); the first ones are exact."""
    if not len(q):
        return q
    missing = residual(task, fk(arm, q), q, np.broadcast_to(target, (len(q), 4, 4)))
    angle, searched = np.linalg.norm(missing[:, 3:], axis=1), np.arange(len(q)) >= exact
    good = (np.linalg.norm(missing[:, :3], axis=1) <= SOLUTION * arm.reach) & ~outside(arm, q).any(axis=1)
    q, angle, searched = q[good], angle[good], searched[good]
    motion = (np.abs(q - near) * np.where(arm.prismatic, 1.0, 180 / np.pi)).sum(axis=1)
    by_angle = np.argsort(angle, kind="stable")
    level = np.empty(len(q), int)  # angles that differ by rounding are one
    level[by_angle] = np.cumsum(np.diff(angle[by_angle], prepend=0.0) > ONE_MINIMUM)
    order = np.lexsort((motion.round(EQUAL), searched, level))
    q, level = q[order], level[order]
    flat = _flat(arm, q, target)
    kept: list[int] = []
    for i in range(len(q)):
        same = [j for j in kept if level[j] == level[i]]
        apart = newton.wrapped_distance(arm, q[same], q[i])
        if not any(d <= ONE_MINIMUM or (flat[i] and flat[j]) for d, j in zip(apart, same, strict=True)):
            kept.append(i)
    return q[kept]


class _Box(NamedTuple):
    """Limits (n,) that can hold a minimum: those of joints that turn less than a whole turn."""

    lower: Array
    upper: Array
    unit: Array


def _box(arm: Arm) -> _Box:
    turns = ~arm.prismatic & (arm.upper - arm.lower >= 2 * np.pi)
    return _Box(
        np.where(turns, -np.inf, arm.lower), np.where(turns, np.inf, arm.upper), np.asarray(radian_or_reach(arm))
    )


@lru_cache(maxsize=16)
def _pool(arm: Arm) -> tuple[Array, Array]:
    """Postures spread within limits (P, n), and where the tool stands there (P, 3)."""
    rng = np.random.default_rng(12)
    span = np.where(arm.prismatic, arm.reach, np.pi)
    low = np.where(np.isfinite(arm.lower), arm.lower, np.minimum(-span, arm.home - span))
    high = np.where(np.isfinite(arm.upper), arm.upper, np.maximum(span, arm.home + span))
    q = rng.uniform(low, high, (POOL, arm.n))
    return q, position(arm, q)


def _seeds(arm: Arm, box: _Box, target: Array, near: Array) -> tuple[Array, NDArray[np.intp]]:
    """Postures (M, n) at the targets' positions, within limits, and whose target each is (M,)."""
    pool, tips = _pool(arm)
    point = target[:, :3, 3]
    apart = (tips * tips).sum(axis=1) - 2.0 * (point @ tips.T)
    nearest = pool[np.argpartition(apart, NEAREST, axis=1)[:, :NEAREST]]
    own = np.clip(near, arm.lower, arm.upper)[:, None]
    starts = np.concatenate([own, _spread(arm, nearest)], axis=1).reshape(-1, arm.n)
    row = np.repeat(np.arange(len(target)), STARTS + 1)
    q, missed = _to_position(arm, box, starts, point[row], 24)
    there = missed <= SOLUTION
    return q[there], row[there]


def _spread(arm: Arm, q: Array) -> Array:
    """STARTS of postures (N, K, n), each the one farthest from those taken before: small basins get one, too."""
    u = q / arm.reach * np.pi
    places = np.concatenate([np.where(arm.prismatic, u, np.cos(q)), np.where(arm.prismatic, 0.0, np.sin(q))], axis=2)
    rows = np.arange(len(q))
    taken = np.zeros((len(q), STARTS), int)
    apart = np.full(q.shape[:2], np.inf)
    for k in range(1, STARTS):
        off = places - places[rows, taken[:, k - 1]][:, None]
        apart = np.minimum(apart, np.einsum("nki,nki->nk", off, off))
        taken[:, k] = apart.argmax(axis=1)
    return np.asarray(q[rows[:, None], taken])


def _to_position(arm: Arm, box: _Box, q: Array, point: Array, steps: int) -> tuple[Array, Array]:
    """Projected Gauss-Newton of least norm onto positions (M, 3); also what is missed [reaches]."""
    q = q.copy()
    active = np.arange(len(q))
    missed = np.full(len(q), np.inf)
    for step in range(steps + 1):
        T, J = tip_and_jacobian(arm, q[active])
        c = (point[active] - T[:, :3, 3]) / arm.reach
        missed[active] = np.linalg.norm(c, axis=1)
        going = missed[active] > SOLUTION * SAME
        active, c, J = active[going], c[going], J[going, :3] * box.unit / arm.reach
        if step == steps or not len(active):
            break
        move, stuck = _least(J, c), np.zeros((len(c), arm.n), bool)
        for _ in range(2):  # joints that would go beyond a limit stay on it
            stuck |= ((q[active] <= box.lower) & (move < 0)) | ((q[active] >= box.upper) & (move > 0))
            move = _least(np.where(stuck[:, None], 0.0, J), c)
        move *= np.minimum(1.0, 0.5 / np.maximum(np.abs(move).max(axis=1), TINY))[:, None]
        q[active] = np.clip(q[active] + move * box.unit, box.lower, box.upper)
    return q, missed


def _least(J: Array, c: Array) -> Array:
    """Damped steps of least norm (M, n) of J d = c, J (M, 3, n)."""
    size = np.einsum("mi,mi->m", c, c)[:, None, None]
    G = J @ J.swapaxes(1, 2) + (1e-2 * size + WEAK * WEAK) * np.eye(3)
    step: Array = (J.swapaxes(1, 2) @ np.linalg.solve(G, c[:, :, None]))[:, :, 0]
    return step


class _Local(NamedTuple):
    """f to second order at postures (M, n), joints in rad or reaches, and the position's Jacobian."""

    missed: Array  # (M, 3) [reaches]
    f: Array
    J: Array  # (M, 3, n)
    g: Array  # (M, n)
    H: Array  # (M, n, n)
    bend: Array  # (M, 3, n, n) second derivatives of the position


def _local(arm: Arm, box: _Box, q: Array, target: Array) -> _Local:
    T, slopes = tip_and_jacobian(arm, q)
    p, w = slopes[:, :3] * (box.unit / arm.reach), slopes[:, 3:]
    C = T[:, :3, :3] @ target[:, :3, :3].swapaxes(1, 2)
    trace = np.trace(C, axis1=1, axis2=2)
    twist = np.stack([C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]], axis=1)
    g = 0.5 * np.einsum("mi,mij->mj", twist, w)
    # of joints i <= j: d2R = [w_i][w_j] R, d2p = w_i x dp_j
    H = -0.5 * (np.einsum("mai,mab,mbj->mij", w, C, w) - np.einsum("mai,maj->mij", w, w) * trace[:, None, None])
    bend = np.cross(w.swapaxes(1, 2)[:, :, None], p.swapaxes(1, 2)[:, None]).transpose(0, 3, 1, 2)
    upper = np.triu(np.ones((arm.n, arm.n)))
    strict = np.triu(np.ones((arm.n, arm.n)), 1)
    H, bend = (np.where(upper > 0, A, 0.0) for A in (H, bend))
    H, bend = (A + (A * strict).swapaxes(-1, -2) for A in (H, bend))
    return _Local((target[:, :3, 3] - T[:, :3, 3]) / arm.reach, 0.5 * (3.0 - trace), p, g, H, bend)


class _Tangent(NamedTuple):
    """What the constraints leave: P (M, n, n) projects onto it, `back` (M, n, 3) undoes what the position misses."""

    P: Array
    back: Array
    multipliers: Array  # (M, 3) of the position
    H: Array  # (M, n, n) of the Lagrangian
    slope: Array  # (M, n) of the Lagrangian


def _tangent(at: _Local, held: Bool) -> _Tangent:
    n = held.shape[1]
    J = np.where(held[:, None, :], 0.0, at.J)
    U, S, Vt = np.linalg.svd(J, full_matrices=False)
    gain = np.where(S > WEAK, 1.0 / np.maximum(S, WEAK), 0.0)
    back = np.einsum("mkn,mk,mak->mna", Vt, gain, U)
    rows = Vt * (S > WEAK)[:, :, None]
    P = np.eye(n) * ~held[:, :, None] - rows.swapaxes(1, 2) @ rows
    multipliers = -np.einsum("mna,mn->ma", back, np.where(held, 0.0, at.g))
    slope = at.g + np.einsum("man,ma->mn", at.J, multipliers)
    H = at.H + np.einsum("maij,ma->mij", at.bend, multipliers)
    return _Tangent(P, back, multipliers, P @ H @ P, slope)


class _State(NamedTuple):
    q: Array
    done: Bool


def _descend(arm: Arm, box: _Box, q: Array, target: Array) -> _State:
    """Newton's method along the postures at a position, from each of them to its local minimum."""
    q, M = q.copy(), len(q)
    held = np.zeros(q.shape, bool)
    trust = np.full(M, 0.5)
    done = np.zeros(M, bool)
    active = np.arange(M)
    for _ in range(STEPS):
        if not len(active):
            break
        x, goal = q[active], target[active]
        at = _local(arm, box, x, goal)
        low, high = x <= box.lower, x >= box.upper
        hold = held[active] & (low | high)
        tangent = _tangent(at, hold)
        across = np.einsum("mij,mj->mi", tangent.P, at.g)
        flat = np.abs(across).max(axis=1) <= STATIONARY
        # at rest: a limit whose multiplier pulls away from it lets go, the strongest first
        pull = np.where(hold & low, -tangent.slope, np.where(hold & high, tangent.slope, -np.inf))
        worst = pull.argmax(axis=1)
        leaves = flat & (pull.max(axis=1) > STATIONARY)
        values, vectors = np.linalg.eigh(tangent.H)
        least = values[:, 0]
        rest = flat & ~leaves & (least > -LEVEL_CURVATURE) & (np.abs(at.missed).max(axis=1) <= SOLUTION * SAME * 10)
        done[active[rest]] = True
        hold[leaves, worst[leaves]] = False
        held[active] = hold
        saddle = flat & ~leaves & ~rest
        along = np.einsum("mij,mi->mj", vectors, -across)
        step = np.einsum("mij,mj->mi", vectors, along / np.maximum(np.abs(values), LEVEL_CURVATURE))
        step[saddle] = vectors[saddle, :, 0] * 0.05
        step += np.einsum("mna,ma->mn", tangent.back, at.missed)
        step = np.where(hold, 0.0, step)
        pressed = ((low & (step < 0)) | (high & (step > 0))) & ~hold
        blocked = pressed.any(axis=1) & ~leaves
        held[active] |= pressed
        step *= np.minimum(1.0, trust[active] / np.maximum(np.abs(step).max(axis=1), TINY))[:, None]
        room = np.where(step > 0, (box.upper - x) / box.unit, (x - box.lower) / box.unit)
        share = np.where(np.abs(step) > TINY, room / np.maximum(np.abs(step), TINY), np.inf)
        share[pressed] = np.inf
        reach = np.minimum(1.0, share.min(axis=1))
        hit = (share <= reach[:, None]) & (share < 1.0)
        trial = np.clip(x + np.where(pressed, 0.0, step * reach[:, None]) * box.unit, box.lower, box.upper)
        trial = np.where(hit & (step > 0), box.upper, np.where(hit & (step < 0), box.lower, trial))
        trial = _back(arm, box, trial, goal, tangent)
        T = fk(arm, trial)
        missed = np.linalg.norm(goal[:, :3, 3] - T[:, :3, 3], axis=1) / arm.reach
        f = 0.5 * (3.0 - np.einsum("mij,mij->m", T[:, :3, :3], goal[:, :3, :3]))
        before = at.f + 10.0 * np.linalg.norm(at.missed, axis=1)
        better = (f + 10.0 * missed <= before + SOLUTION * SAME) & ~rest & ~(blocked & flat)
        better &= ~leaves
        go = active[better]
        q[go] = trial[better]
        held[go] |= hit[better]
        trust[go] = np.minimum(2.0 * trust[go], 0.5)
        refused = active[~better & ~rest & ~blocked & ~leaves]
        trust[refused] *= 0.25
        active = active[~rest & (trust[active] > SOLUTION)]
    return _State(q, done)


def _back(arm: Arm, box: _Box, q: Array, target: Array, tangent: _Tangent) -> Array:
    """Postures (M, n) moved back onto their positions, with the Jacobian of before."""
    for _ in range(2):
        missed = (target[:, :3, 3] - fk(arm, q)[:, :3, 3]) / arm.reach
        q = np.clip(q + np.einsum("mna,ma->mn", tangent.back, missed) * box.unit, box.lower, box.upper)
    return q


def _flat(arm: Arm, q: Array, target: Array) -> Bool:
    """Whether minima (M, n) of one target lie on a curve of such."""
    if not len(q):
        return np.zeros(0, bool)
    box = _box(arm)
    at = _local(arm, box, q, np.broadcast_to(target, (len(q), 4, 4)))
    held = (q <= box.lower) | (q >= box.upper)
    tangent = _tangent(at, held)
    values, vectors = np.linalg.eigh(tangent.H)
    inside = np.linalg.norm(tangent.P @ vectors, axis=1) > 0.5
    flat: Bool = (inside & (np.abs(values) <= LEVEL_CURVATURE)).any(axis=1)
    return flat
