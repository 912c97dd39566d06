"""Self-motions: whether the joints can move while the target is kept, and which postures lie on one.

A posture is pushed along each direction that its Jacobian loses, and pulled back onto the target. What then lies on
a self-motion that is listed already is dropped: `armkin.inverse.singular.components` lists one posture of each.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import curves, high_order_roots
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

LINE_JOINTS = 3  # joints that move at constant paces: about one line, or two of three lines that are parallel
STEP = 0.03  # distance [rad] along a null direction up to which a self-motion is followed
STEPS = np.array([[STEP], [10 * STEP]])  # steps [rad] along a null direction: a short one and a long one


def drop_contained(goals: Goals, q: Array, sigma: Array, resting: Bool, chosen: Bool, curve: Bool) -> None:
    """Keep the one of more joints of self-motions through each other, and no root of high order beside or on one.

    Changes chosen (K, M); curve: (K, M, n) the joints that a posture's self-motion moves; resting: (K, M, n) joints
    that do not move along the one direction that it loses: a curve that moves such a joint is another. `near`, the
    first, stays.
    """
    arm, task, target, _ = goals
    pairs: list[tuple[int, int, int]] = []  # a target, a posture of it and one of a self-motion beside
    for k in np.flatnonzero((chosen & curve.any(axis=2)).any(axis=1)):
        mine = np.flatnonzero(chosen[k] & curve[k].any(axis=1))
        narrow = curve[k, mine].sum(axis=1) <= arm.n // 2
        for i in np.flatnonzero(chosen[k] & (sigma[k] < tol.HIGH) & ~curve[k].any(axis=1)):
            away = np.where(curve[k, mine], 0.0, np.abs(newton.difference(arm, q[k, mine], q[k, i]))).max(axis=1)
            pairs += [(int(k), int(i), int(j)) for j in mine[(away < tol.CLOSE_BY) & narrow]]
        mine = mine[sigma[k, mine] < tol.SOLUTION]  # a double root's listed posture may be off it
        for i in mine[mine > 0]:
            wider = [j for j in mine if (curve[k, j] > curve[k, i]).any() and not (curve[k, i] > curve[k, j]).any()]
            wider = [j for j in wider if not (curve[k, j] & resting[k, i] & ~curve[k, i]).any()]
            away = np.abs(newton.difference(arm, q[k, wider], q[k, i]))
            if len(wider) and (np.where(curve[k, wider], 0.0, away).max(axis=1) < tol.TURNED).any():
                chosen[k, i] = False
    if pairs:
        row, mid, beside = np.array(pairs).T
        grows = _grows_from(arm, task, q[row, mid], q[row, beside], curve[row, beside], target[row]) & (mid > 0)
        chosen[row[grows], mid[grows]] = False


def _grows_from(arm: Arm, task: Task, q: Array, motions: Array, curve: Bool, target: Array) -> Bool:
    """Whether q (M, n) are one with self-motions: with the postures that have their values of the joints that move.

    motions: (M, n) postures of self-motions, curve: (M, n) the joints that these move. Two are one if the posture
    between them solves the target, too. The other is sought beside q, and in the direction that q loses: where two
    directions are lost a curve of small residuals leaves the self-motion, off which the residual grows.
    """
    unit = radian_or_reach(arm)
    apart = np.where(curve, 0.0, newton.difference(arm, motions, q))
    sigma, V, _ = newton.null_space(arm, task, q, target)
    held = np.where(curve, 0.0, V[:, -1])
    far = (apart * held).sum(axis=1) / np.maximum((held * held).sum(axis=1), tol.TINY)
    ahead = apart + np.where(curve, V[:, -1] * np.clip(far, -tol.CLOSE_BY, tol.CLOSE_BY)[:, None], 0.0)
    q, goal, sigma = np.concatenate([q, q]), np.concatenate([target, target]), np.concatenate([sigma, sigma])
    landed, size = newton.correct(arm, task, q + np.concatenate([apart, ahead]) * unit, goal, steps=6, least=tol.WEAK)
    way = newton.difference(arm, landed, q)
    close = np.flatnonzero((size <= tol.SOLUTION) & (np.abs(way).max(axis=1) < tol.CLOSE_BY))
    miss, joined = newton.misses(arm, task, q[close], goal[close]), np.zeros(len(q), bool)
    joined[close] = high_order_roots.solves_between(arm, task, q[close], way[close], miss, sigma[close], goal[close])
    return np.asarray(joined.reshape(2, -1).any(axis=0))


def drop_twins(goals: Goals, q: Array, chosen: Bool, curve: Bool, ended: Bool, linked: Bool, tube: Array) -> None:
    """Keep the posture nearest to `near` of those chosen (K, M) whose self-motions are the same: change chosen.

    q: (K, M, n); curve: (K, M, n) the joints that a posture's self-motion moves; ended: (K, M) those of which both ends
    are known, and all that is between; linked: (K, M, M) which others, not followed to their ends, are on each one's;
    tube: (K, M) how far postures may be off their curve. One group's posture may be close to another's; where a
    self-motion consists of double roots, known to the root of rounding, its postures were taken for many.
    """
    arm, task, target, near = goals
    moving = np.asarray(curve.any(axis=2))
    moving[:, 0] = True  # `near`, the first: nothing is said to move where three directions are lost at once
    listed = chosen & moving & ~ended  # what else were on one of these would be one with it
    linked = (linked | linked.swapaxes(1, 2)) & chosen[:, :, None] & chosen[:, None]
    k, i, j = np.nonzero((linked | listed[:, :, None] & listed[:, None]) & np.tri(q.shape[1], k=-1, dtype=bool))
    if not len(k):
        return
    start, apart, unit = q[k, i], newton.difference(arm, q[k, j], q[k, i]), radian_or_reach(arm)
    same, size = linked[k, i, j], np.abs(apart)
    # one of the two postures may be where its own self-motion meets the other's
    turned = np.where(curve[k, i], 0.0, size).max(axis=1)
    thick = np.maximum(tol.TURNED, tube[k, i] + tube[k, j])
    held = (turned < thick) & ((size > thick[:, None]).sum(axis=1) <= LINE_JOINTS)
    # at one of the two postures a joint may move too slowly to be called free
    most = np.maximum(turned, np.where(curve[k, j], 0.0, size).max(axis=1))
    slow = ~held & (most > tol.TURNED) & (most < tol.DRIFT)
    held |= np.equal(j, 0)  # `near` stands for all that meet there
    open_ = np.flatnonzero(held & ~same)
    same[open_] = _reached_straight(arm, task, start[open_], apart[open_], target[k[open_]])
    left = np.flatnonzero(slow & ~same)
    if len(left):  # whether the self-motion of the one goes round to the other
        joints = curve[k[left], i[left]] | (size[left] > tol.SAME)
        end, compared = (start[left] + apart[left] * unit)[:, None], np.ones((len(left), 1), bool)
        same[left] = curves.share_circuit(arm, task, start[left], joints, end, compared, target[k[left]])[:, 0]
    k, i, j = k[same], i[same], j[same]
    motion = np.abs(newton.difference(arm, q, near[:, None])).sum(axis=2)
    nearer = motion[k, i] < motion[k, j] - tol.SAME
    i, j = np.where(nearer, j, i), np.where(nearer, i, j)
    for p in np.argsort(motion[k, i], kind="stable"):
        chosen[k[p], i[p]] &= not chosen[k[p], j[p]]


def _reached_straight(arm: Arm, task: Task, q: Array, way: Array, target: Array) -> Bool:
    """Whether the joints can move from q (M, n) to q + way while they keep the target, each at a constant pace: (M,).

    A quarter, half and three quarters of the way are asked, each way round for joints that turn by about 180 degrees.
    They may be off by as much as roots of high order are.
    """
    reached = np.zeros(len(q), bool)
    if not len(q):
        return reached
    ways = [_both_ways(arm, single) for single in way]
    index = np.repeat(np.arange(len(q)), [len(choices) for choices in ways])
    start = q[index] + np.array([0.25, 0.5, 0.75])[:, None, None] * np.concatenate(ways) * radian_or_reach(arm)
    goal = np.concatenate([target[index]] * 3)
    landed, size = newton.correct(arm, task, start.reshape(-1, arm.n), goal, steps=3, least=tol.WEAK)
    moved = np.abs(newton.difference(arm, landed, start.reshape(-1, arm.n))).max(axis=1)
    good = (size <= tol.SOLUTION) & (moved < 10 * tol.TURNED)
    reached[index[good.reshape(3, -1).all(axis=0)]] = True
    return reached


def _both_ways(arm: Arm, way: Array) -> Array:
    """A way (n,) each way round for joints that turn by about 180 degrees: (m, n)."""
    half = np.flatnonzero(~arm.prismatic & (np.pi - np.abs(way) < tol.REACH))
    flips = np.array(list(itertools.product((0.0, 1.0), repeat=len(half))))
    ways = np.tile(way, (len(flips), 1))
    ways[:, half] -= 2.0 * np.pi * flips * np.sign(way[half])
    return ways


def pull_back(arm: Arm, task: Task, q: Array, target: Array, steps: int = 6) -> tuple[Array, Array]:
    """Postures (M, n) beside a self-motion pulled back onto it, and what they miss: see `newton.correct`."""
    return newton.correct(arm, task, q, target, steps=steps, least=tol.WEAK, patience=1, stalled=tol.STALLED)


def push_along(arm: Arm, task: Task, q: Array, step: Array, push: Array, target: Array) -> tuple[Array, Array, Array]:
    """Postures (M, n), a step (M,) away along push (M, n), pulled back: they, what they miss, and how much more than
    q that is a step's length; infinite for those that fell back.
    """
    unit = radian_or_reach(arm)
    landed, size = pull_back(arm, task, q + step[:, None] * push * unit, target)
    far = (np.abs(landed - q) / unit).max(axis=1) > 0.3 * step * np.abs(push).max(axis=1)
    return landed, size, np.where(far, size - newton.misses(arm, task, q, target), np.inf) / step


def _equally_long(away: Array, push: Array) -> Bool:
    """Whether motions (2, 2, M, n), by a short step and a long one, both ways along push (M, n), are about as long."""
    least = 0.3 * STEPS * np.abs(push).max(axis=1)  # (2, M)
    far = (np.abs(away).max(axis=3) > least[:, None]).all(axis=1)
    return np.asarray(far & (np.abs(away[:, 0] - away[:, 1]).max(axis=2) > 0.3 * least))


def _moving_joints(away: Array, long: Bool) -> Bool:
    """Joints (M, n) that move at all on the long ways (2, 2, M, n), or on the short ones where it is no motion (M,).

    Roots of high order are off by up to 10 `TURNED`, and a short way that is drawn back to a meeting ends anywhere
    nearby: neither is motion of a joint.
    """
    most = np.abs(away).max(axis=1)
    return np.asarray(np.where(long[:, None], most[1] > tol.MOVED * 10 * STEP, most[0] > 10 * tol.TURNED))


def self_motion(arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array) -> tuple[Bool, Bool]:
    """Whether postures (M, n) can move along any direction that they lose, pulled back by steps of least norm."""
    unit = radian_or_reach(arm)
    moving, joints = np.zeros(len(q), bool), np.zeros(q.shape, bool)
    row, push = null_directions(arm.n, V, nullity)
    # The first pass decides which candidates do not move, most: their residual grows by more than `GROWTH`. Where
    # several directions are lost, its step is long: a short one would be drawn back to the meeting.
    several = nullity[row] > 1
    first = np.where(several, 10 * STEP, STEP)
    _, _, growth = push_along(arm, task, q[row], first, push, target[row])
    going = np.flatnonzero(growth <= tol.GROWTH)
    # The second pass decides this of those that lose one direction and miss by more than rounding, by a longer step.
    alone = ~several[going] & (growth[going] * first[going] > tol.CLOSED)
    if alone.any():
        tried = going[alone]
        _, _, growth = push_along(arm, task, q[row[tried]], 10 * first[tried], push[tried], target[row[tried]])
        alone[alone] = ~(growth <= tol.GROWTH)
        going = going[~alone]
    if not len(going):
        return moving, joints
    row, push, several = row[going], push[going], several[going]
    # Each posture takes a short and a long step, whole and in part, both ways, in one call: (2, 2, 2, m, n); a joint
    # that rests at a double root comes half the way back in each.
    ways = np.multiply.outer(STEPS[:, 0], [[1.0, 0.6], [-1.0, -0.6]])[..., None, None]
    start = q[row] + ways * push * unit
    landed, size = pull_back(arm, task, start.reshape(-1, arm.n), np.concatenate([target[row]] * 8), steps=20)
    away, size = (landed.reshape(start.shape)[:, :, 0] - q[row]) / unit, size.reshape(start.shape[:4])
    growth = size.max(axis=(1, 2)) - newton.misses(arm, task, q, target)[row]  # (2, m)
    short, long = (growth <= tol.GROWTH * STEPS) & _equally_long(away, push)
    # A residual above rounding must stay small up to the long step: a fold's first tenth of a radian shows nothing.
    along = (short & ((growth[0] <= tol.CLOSED) | long)) | (long & several)
    np.logical_or.at(moving, row, along)
    np.logical_or.at(joints, row, along[:, None] & _moving_joints(away, long))
    return moving, joints


def on_surface(
    arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array
) -> tuple[Bool, Int, tuple[Array, Array, Array]]:
    """Which postures (M, n) that lose two directions still do a long step off, by both ways at once: (M,).

    Those lie on a self-motion of two dimensions, or on one of double roots. V: (M, n, n) right singular vectors. Where
    more directions are lost surfaces meet, and rounding chooses the vectors: there any of `null_directions` tells.
    Also whose the long steps are, and what `push_along` says of these.
    """
    two, more = np.flatnonzero(nullity < 3), np.flatnonzero(nullity > 2)
    row, push = two, V[two, arm.n - 1] + 0.7 * V[two, arm.n - 2]
    if len(more):
        more_rows, further = null_directions(arm.n, V[more], nullity[more])
        row, push = np.concatenate([row, more[more_rows]]), np.concatenate([push, further])
    pushed = landed, size, _ = push_along(arm, task, q[row], np.full(len(row), 10 * STEP), push, target[row])
    lost = newton.null_space(arm, task, landed, target[row])[2]
    away = np.abs(newton.difference(arm, landed, q[row])).max(axis=1)
    surface = np.zeros(len(q), bool)
    np.logical_or.at(surface, row, (size <= tol.SOLUTION) & (lost > 1) & (away > 3 * STEP))
    return surface, row, pushed


def null_directions(n: int, V: Array, nullity: Int) -> tuple[Int, Array]:
    """Which postures to push, of M that lose as many directions as nullity (M,) says, and where: (m,), (m, n).

    V: (M, n, n) right singular vectors. Each direction is there once, whichever sign it has.
    """
    pushes = list(_null_directions(n, V, nullity))
    row, push = np.concatenate([w for w, _ in pushes]), np.concatenate([p for _, p in pushes])
    first = (np.abs(push) > 0.1).argmax(axis=1)
    ahead = np.sign(np.take_along_axis(push, first[:, None], axis=1))
    _, once = np.unique(np.column_stack([row, np.rint(1e6 * push * ahead)]), axis=0, return_index=True)
    once.sort()
    return row[once], push[once]


def _normals(held: Array) -> Array:
    """Vectors (..., k) at right angles to the k - 1 columns of (..., k, k - 1): of three, the cross product."""
    k = held.shape[-2]
    return np.stack([(-1) ** i * np.linalg.det(np.delete(held, i, axis=-2)) for i in range(k)], axis=-1)


def _null_directions(n: int, V: Array, nullity: Int) -> Iterator[tuple[Int, Array]]:
    """What `null_directions` returns, in parts, some directions several times.

    In a null space of several dimensions a self-motion may hide between the basis vectors: there every joint
    is pushed as far as the null space lets it, and of k dimensions any k - 1 joints are held.
    """
    for index in range(int(nullity.max())):
        row = np.flatnonzero(nullity > index)
        yield row, V[row, n - 1 - index]
    for k in range(2, int(nullity.max()) + 1):
        rows = np.flatnonzero(nullity == k)
        basis = V[rows, ::-1][:, :k]
        held = list(itertools.combinations(range(n), k - 1))
        yield _long_directions(rows, np.einsum("cmk,mkn->cmn", _normals(np.moveaxis(basis[:, :, held], 2, 0)), basis))
    several = np.flatnonzero(nullity > 1)
    in_null = (np.arange(n) >= n - nullity[several][:, None])[:, :, None]
    yield _long_directions(several, np.moveaxis(V[several].swapaxes(1, 2) @ np.where(in_null, V[several], 0.0), 1, 0))


def _long_directions(row: Int, push: Array) -> tuple[Int, Array]:
    """The directions (C, m, n) of postures (m,) that are long enough, made of length one, and whose they are."""
    size = np.linalg.norm(push, axis=2)
    far = size > 0.1
    return np.broadcast_to(row, size.shape)[far], push[far] / size[far][:, None]
