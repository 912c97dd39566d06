"""Crossings: places of a self-motion at which another one branches off.

The second smallest singular value vanishes there. It shows between the steps along the self-motion as a minimum of that
value. For square Jacobians the product of all singular values but the smallest changes its sign, which is the
determinant of the Jacobian bordered by its null vectors (Keller, Numerical solution of bifurcation problems, 1977).
"""

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

MEETING = 0.1  # steps with a larger second smallest singular value are far from crossings
MAX_PLACES = 12  # most places examined for each target
OTHER_SIDE = 0.4  # distance [rad, reaches] from a crossing to a posture on the other self-motion
SAME_PLACE = 0.13  # closer places [rad, reaches] are the same: half a step of a revolute joint
STEP = 1.0  # steps farther apart [rad, reaches] are on different curves


def postures_beside(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Postures (N, M, n) near the crossings of B self-motions with steps q (N, steps, B, n) all round; nan for none.

    They are a step away in the plane of the two null directions, which leads onto the other self-motion.
    """
    N, steps, B, n = q.shape
    flat = q.reshape(-1, n)
    rows = np.flatnonzero(~np.isnan(flat).any(axis=1))
    _, J = newton.scaled_residual_and_jacobian(arm, task, flat[rows], np.repeat(target, steps * B, axis=0)[rows])
    rank = min(task.constraints, n)
    U, S, V = np.linalg.svd(J)
    size = np.full(len(flat), np.inf)
    size[rows] = S[:, rank - 2]
    second, place, unit = size.reshape(N, steps, B), q.copy(), radian_or_reach(arm)
    meets = _least_steps(second)
    if J.shape[1] == n == rank:
        bordered = np.full((len(flat), 2 * n + 1), np.nan)
        product = np.linalg.det(U) * np.linalg.det(V) * S[:, :-1].prod(axis=1)
        bordered[rows] = np.concatenate([product[:, None], U[:, :, -1], V[:, -1]], axis=1)
        way, share = _sign_changes(arm, q, bordered.reshape(N, steps, B, -1))
        changes = ~np.isnan(share)
        place[changes] += share[changes][:, None] * way[changes] * unit
        meets |= changes
        second[changes] *= tol.SIGN_FACTOR  # prefer the crossing between two steps to the steps
    for b in range(1, B):  # double roots occur twice
        twin = np.abs(newton.difference(arm, q[:, :, :b], q[:, :, b, None])).max(axis=3) < tol.ROUNDING_DISTANCE
        meets[:, :, b] &= ~twin.any(axis=2)
    spot = _distinct_places(arm, place.reshape(N, -1, n), np.where(meets, second, np.inf).reshape(N, -1)).reshape(-1, n)
    postures = np.full((len(spot), 8, n), np.nan)
    rows = np.flatnonzero(~np.isnan(spot).any(axis=1))
    _, V, _ = newton.null_space(arm, task, spot[rows], np.repeat(target, MAX_PLACES, axis=0)[rows])
    along, across = V[:, rank - 1], V[:, rank - 2]
    ways = np.stack([along, across, (along + across) / 2**0.5, (along - across) / 2**0.5], axis=1)
    start = (spot[rows, None] + OTHER_SIDE * unit * np.concatenate([ways, -ways], axis=1)).reshape(-1, n)
    goal = np.repeat(target, MAX_PLACES, axis=0)[np.repeat(rows, 8)]
    landed, size = newton.correct(arm, task, start, goal, steps=10)
    # A posture that is corrected to where it began lies on both self-motions, nearly, and tells of neither.
    back = np.abs(newton.difference(arm, landed, np.repeat(spot[rows], 8, axis=0))).max(axis=1) < 0.5 * OTHER_SIDE
    postures[rows] = np.where((back | (size > tol.SEED_RESIDUAL))[:, None], np.nan, landed).reshape(-1, 8, n)
    return postures.reshape(N, -1, n)


def _distinct_places(arm: Arm, place: Array, second: Array) -> Array:
    """`MAX_PLACES` of places (N, P, n) with the least second singular values (N, P), each crossing once; else nan."""
    distinct = np.full((len(place), MAX_PLACES, arm.n), np.nan)
    for k in np.flatnonzero(np.isfinite(second).any(axis=1)):
        crossing = np.flatnonzero(np.isfinite(second[k]))
        count = 0
        for centre in place[k, crossing[np.argsort(second[k, crossing], kind="stable")]]:
            if not (np.abs(newton.difference(arm, distinct[k, :count], centre)).max(axis=1) < SAME_PLACE).any():
                distinct[k, count], count = centre, count + 1
                if count == MAX_PLACES:
                    break
    return distinct


def _least_steps(second: Array) -> Bool:
    """Steps (N, steps, B) nearest to a zero of the second smallest singular value."""
    before, after = np.roll(second, 1, axis=1), np.roll(second, -1, axis=1)
    near, far = np.minimum(before, after), np.maximum(before, after)
    with np.errstate(invalid="ignore"):  # a zero in between: |x| falls as fast on one side as it rises on the other
        falls = (second <= before) & (second < after) & (near + second < 3.0 * (far - second))
    return np.asarray(falls & (second < MEETING))


def _sign_changes(arm: Arm, q: Array, bordered: Array) -> tuple[Array, Array]:
    """The way to the next step (N, steps, B, n), and the share of it after which the product changes its sign.

    bordered: (N, steps, B, 1 + 2 n) the product and the null vectors, left and right, whose own signs mean nothing: one
    that turns round turns the product's. The share is nan where the sign stays, or no posture of the next step is near.
    """
    n = q.shape[3]
    ways = newton.difference(arm, np.roll(q, -1, axis=1)[:, :, None], q[:, :, :, None])  # (N, steps, B, B, n)
    far = np.nan_to_num(np.abs(ways).max(axis=4), nan=np.inf)
    nearest = far.argmin(axis=3)[..., None]  # a closed form's branches change places where a wrist is straight
    way = np.take_along_axis(ways, nearest[..., None], axis=3)[:, :, :, 0]
    after = np.take_along_axis(np.roll(bordered, -1, axis=1), nearest, axis=2)
    turned = (bordered[..., 1:] * after[..., 1:]).reshape(*q.shape[:3], 2, n).sum(axis=4).prod(axis=3)
    product, then = bordered[..., 0], after[..., 0] * np.sign(turned)
    with np.errstate(invalid="ignore", divide="ignore"):
        changes = (product * then < 0.0) & (far.min(axis=3) < STEP)
        return way, np.where(changes, product / (product - then), np.nan)
