"""The descent to the minima of the rotation angle at a position.

Minimised is f = 1 - cos(angle) = (3 - trace(R_target' R)) / 2, smooth up to half a turn, by Newton's method in the null
space of the position's Jacobian, with the exact second derivatives of the chain and an active set of limits (Nocedal
and Wright, Numerical Optimization, 2006, 16.5 and 18.1), from many postures at once.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.forward import fk, position, tip_and_jacobian
from armkin.inverse.numeric import tolerances as tol
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

STEPS = 80  # iterations, at most, of one start


class Box(NamedTuple):
    """Limits (n,) that can hold a minimum: those of joints that turn less than a whole turn."""

    lower: Array
    upper: Array
    unit: Array


def box_of(arm: Arm) -> Box:
    """The limits of an arm, inf where a joint has a whole turn or more."""
    free = ~arm.prismatic & (arm.upper - arm.lower >= 2 * np.pi)
    return Box(np.where(free, -np.inf, arm.lower), np.where(free, np.inf, arm.upper), np.asarray(radian_or_reach(arm)))


class _Local(NamedTuple):
    """f to second order at postures (M, n), joints in rad or reaches, and the position's Jacobian."""

    missed: Array  # (M, 3) [reaches]
    f: Array
    J: Array  # (M, 3, n)
    g: Array  # (M, n)
    H: Array  # (M, n, n)
    bend: Array  # (M, 3, n, n) second derivatives of the position


def _local(arm: Arm, box: Box, q: Array, target: Array) -> _Local:
    T, slopes = tip_and_jacobian(arm, q)
    p, w = slopes[:, :3] * (box.unit / arm.reach), slopes[:, 3:]
    C = T[:, :3, :3] @ target[:, :3, :3].swapaxes(1, 2)
    trace = np.trace(C, axis1=1, axis2=2)
    twist = np.stack([C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]], axis=1)
    g = 0.5 * np.einsum("mi,mij->mj", twist, w)
    # joints i <= j have d2R = [w_i][w_j] R, d2p = w_i x dp_j
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
    H: Array  # (M, n, n) of the Lagrangian
    slope: Array  # (M, n) of the Lagrangian


def _tangent(local: _Local, at_limit: Bool) -> _Tangent:
    n = at_limit.shape[1]
    J = np.where(at_limit[:, None, :], 0.0, local.J)
    U, S, Vt = np.linalg.svd(J, full_matrices=False)
    gain = np.where(S > tol.WEAK, 1.0 / np.maximum(S, tol.WEAK), 0.0)
    inverse_J = np.einsum("mkn,mk,mak->mna", Vt, gain, U)
    rows = Vt * (S > tol.WEAK)[:, :, None]
    P = np.eye(n) * ~at_limit[:, :, None] - rows.swapaxes(1, 2) @ rows
    multipliers = -np.einsum("mna,mn->ma", inverse_J, np.where(at_limit, 0.0, local.g))
    slope = local.g + np.einsum("man,ma->mn", local.J, multipliers)
    H = local.H + np.einsum("maij,ma->mij", local.bend, multipliers)
    return _Tangent(P, inverse_J, P @ H @ P, slope)


class _Move(NamedTuple):
    """A step (M, n) of each posture, and what is to be done with it."""

    step: Array
    back: Array  # (M, n, 3) of `_Tangent`
    pressed: Bool  # (M, n) joints that it would take beyond a limit
    flat: Bool  # (M,) nothing leads downhill
    rest: Bool  # (M,) a minimum
    leaves: Bool  # (M,) a limit lets go instead
    blocked: Bool  # (M,) a limit takes hold first


def _newton_step(box: Box, local: _Local, x: Array, at_limit: Bool) -> _Move:
    """Newton's step of postures x (M, n), some at_limit (M, n), which lets go of one of them where it is to."""
    low, high = x <= box.lower, x >= box.upper
    at_limit &= low | high
    tangent = _tangent(local, at_limit)
    gradient = np.einsum("mij,mj->mi", tangent.P, local.g)
    stationary = np.abs(gradient).max(axis=1) <= tol.STATIONARY_SLOPE
    # at a stationary point the limit whose multiplier points away from it most strongly is let go
    pull = np.where(at_limit & low, -tangent.slope, np.where(at_limit & high, tangent.slope, -np.inf))
    leaves = stationary & (pull.max(axis=1) > tol.STATIONARY_SLOPE)
    values, vectors = np.linalg.eigh(tangent.H)
    in_position = np.abs(local.missed).max(axis=1) <= tol.SOLUTION * tol.ROUNDING_DISTANCE * 10
    minimum = stationary & ~leaves & (values[:, 0] > -tol.LEVEL_CURVATURE) & in_position
    at_limit[leaves, pull.argmax(axis=1)[leaves]] = False
    saddle = stationary & ~leaves & ~minimum
    components = np.einsum("mij,mi->mj", vectors, -gradient)
    step = np.einsum("mij,mj->mi", vectors, components / np.maximum(np.abs(values), tol.LEVEL_CURVATURE))
    step[saddle] = vectors[saddle, :, 0] * 0.05
    step = np.where(at_limit, 0.0, step + np.einsum("mna,ma->mn", tangent.back, local.missed))
    pressed = ((low & (step < 0)) | (high & (step > 0))) & ~at_limit
    at_limit |= pressed
    return _Move(step, tangent.back, pressed, stationary, minimum, leaves, pressed.any(axis=1) & ~leaves)


def _try_step(arm: Arm, box: Box, x: Array, goal: Array, move: _Move, trust: Array) -> tuple[Array, Bool]:
    """Where the steps of at most trust (M,) lead, to the first limit at most; joints (M, n) that come onto one."""
    step = move.step * np.minimum(1.0, trust / np.maximum(np.abs(move.step).max(axis=1), tol.TINY))[:, None]
    room = np.where(step > 0, (box.upper - x) / box.unit, (x - box.lower) / box.unit)
    share = np.where(np.abs(step) > tol.TINY, room / np.maximum(np.abs(step), tol.TINY), np.inf)
    share[move.pressed] = np.inf
    reach = np.minimum(1.0, share.min(axis=1))
    hit = (share <= reach[:, None]) & (share < 1.0)
    trial = np.clip(x + np.where(move.pressed, 0.0, step * reach[:, None]) * box.unit, box.lower, box.upper)
    trial = np.where(hit & (step > 0), box.upper, np.where(hit & (step < 0), box.lower, trial))
    for _ in range(2):  # back onto the position, with the Jacobian of before
        offset = (goal[:, :3, 3] - position(arm, trial)) / arm.reach
        trial = np.clip(trial + np.einsum("mna,ma->mn", move.back, offset) * box.unit, box.lower, box.upper)
    return trial, hit


def descend(arm: Arm, box: Box, q: Array, target: Array) -> tuple[Array, Bool]:
    """Newton's method along the postures at a position, from each (M, n) to a local minimum; which got there (M,)."""
    q, M = q.copy(), len(q)
    at_limit = np.zeros(q.shape, bool)
    trust = np.full(M, 0.5)
    arrived = np.zeros(M, bool)
    active = np.arange(M)
    for _ in range(STEPS):
        if not len(active):
            break
        x, goal, hold = q[active], target[active], at_limit[active]
        local = _local(arm, box, x, goal)
        move = _newton_step(box, local, x, hold)
        arrived[active[move.rest]] = True
        at_limit[active] = hold
        trial, hit = _try_step(arm, box, x, goal, move, trust[active])
        T = fk(arm, trial)
        miss = np.linalg.norm(goal[:, :3, 3] - T[:, :3, 3], axis=1) / arm.reach
        f = 0.5 * (3.0 - np.einsum("mij,mij->m", T[:, :3, :3], goal[:, :3, :3]))
        last_merit = local.f + 10.0 * np.linalg.norm(local.missed, axis=1)
        is_better = (f + 10.0 * miss <= last_merit + tol.SOLUTION * tol.ROUNDING_DISTANCE) & ~move.rest & ~move.leaves
        is_better &= ~(move.blocked & move.flat)
        go = active[is_better]
        q[go] = trial[is_better]
        at_limit[go] |= hit[is_better]
        trust[go] = np.minimum(2.0 * trust[go], 0.5)
        refused = active[~is_better & ~move.rest & ~move.blocked & ~move.leaves]
        trust[refused] *= 0.25
        active = active[~move.rest & (trust[active] > tol.SOLUTION)]
    return q, arrived


def flat_minima(arm: Arm, q: Array, target: Array) -> Bool:
    """Whether minima (M, n) of one target lie on a curve of such."""
    box = box_of(arm)
    local = _local(arm, box, q, np.broadcast_to(target, (len(q), 4, 4)))
    tangent = _tangent(local, (q <= box.lower) | (q >= box.upper))
    values, vectors = np.linalg.eigh(tangent.H)
    in_tangent = np.linalg.norm(tangent.P @ vectors, axis=1) > 0.5
    return np.asarray((in_tangent & (np.abs(values) <= tol.LEVEL_CURVATURE)).any(axis=1))
