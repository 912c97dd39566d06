"""Self-motions: whether the joints can move while the target is kept, and which postures lie on one.

A posture is pushed along each direction that its Jacobian loses, and pulled back onto the target. What then lies on
a self-motion that is listed already is dropped: `armkin.inverse.singular.groups` lists one posture of each.
"""

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
    that do not move along the one direction that it loses: a curve that moves one is another. `near`, the first, stays.
    """
    arm, task, target, _ = goals
    pairs: list[tuple[int, int, int]] = []  # a target, a posture of it and one of a self-motion beside
    for k in np.flatnonzero((chosen & curve.any(axis=2)).any(axis=1)):
        moving = np.flatnonzero(chosen[k] & curve[k].any(axis=1))
        narrow = curve[k, moving].sum(axis=1) <= arm.n // 2
        for i in np.flatnonzero(chosen[k] & (sigma[k] < tol.HIGH_ORDER) & ~curve[k].any(axis=1)):
            offset = np.where(curve[k, moving], 0.0, np.abs(newton.difference(arm, q[k, moving], q[k, i]))).max(axis=1)
            pairs += [(int(k), int(i), int(j)) for j in moving[(offset < tol.CLOSE_DISTANCE) & narrow]]
        moving = moving[sigma[k, moving] < tol.SOLUTION]  # a double root's listed posture may be off it
        for i in moving[moving > 0]:
            wider = [j for j in moving if (curve[k, j] > curve[k, i]).any() and not (curve[k, i] > curve[k, j]).any()]
            wider = [j for j in wider if not (curve[k, j] & resting[k, i] & ~curve[k, i]).any()]
            offset = np.abs(newton.difference(arm, q[k, wider], q[k, i]))
            if len(wider) and (np.where(curve[k, wider], 0.0, offset).max(axis=1) < tol.STILL_TURN).any():
                chosen[k, i] = False
    if pairs:
        row, root, mate = np.array(pairs).T
        same = _joins_motion(arm, task, q[row, root], q[row, mate], curve[row, mate], target[row]) & (root > 0)
        chosen[row[same], root[same]] = False


def _joins_motion(arm: Arm, task: Task, q: Array, motions: Array, curve: Bool, target: Array) -> Bool:
    """Whether q (M, n) are one with self-motions: with the postures that have their values of the joints that move.

    motions: (M, n) postures of self-motions, curve: (M, n) the joints that these move. Two are one if the posture
    between them solves the target, too. The other is sought beside q, and in the direction that q loses: where two
    directions are lost a curve of small residuals leaves the self-motion, off which the residual grows.
    """
    unit = radian_or_reach(arm)
    offset = np.where(curve, 0.0, newton.difference(arm, motions, q))
    sigma, V, _ = newton.null_space(arm, task, q, target)
    held_v = np.where(curve, 0.0, V[:, -1])
    t = (offset * held_v).sum(axis=1) / np.maximum((held_v * held_v).sum(axis=1), tol.TINY)
    tilted = offset + np.where(curve, V[:, -1] * np.clip(t, -tol.CLOSE_DISTANCE, tol.CLOSE_DISTANCE)[:, None], 0.0)
    q, goal, sigma = np.concatenate([q, q]), np.concatenate([target, target]), np.concatenate([sigma, sigma])
    start = q + np.concatenate([offset, tilted]) * unit
    landed, size = newton.correct(arm, task, start, goal, steps=6, least=tol.WEAK)
    step = newton.difference(arm, landed, q)
    close = np.flatnonzero((size <= tol.SOLUTION) & (np.abs(step).max(axis=1) < tol.CLOSE_DISTANCE))
    miss, is_one = newton.misses(arm, task, q[close], goal[close]), np.zeros(len(q), bool)
    is_one[close] = high_order_roots.solves_between(arm, task, q[close], step[close], miss, sigma[close], goal[close])
    return np.asarray(is_one.reshape(2, -1).any(axis=0))


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
    start, offset, unit = q[k, i], newton.difference(arm, q[k, j], q[k, i]), radian_or_reach(arm)
    is_one, distance = linked[k, i, j], np.abs(offset)
    # one of the two postures may be where its own self-motion meets the other's
    turned = np.where(curve[k, i], 0.0, distance).max(axis=1)
    width = np.maximum(tol.STILL_TURN, tube[k, i] + tube[k, j])
    is_close = (turned < width) & ((distance > width[:, None]).sum(axis=1) <= LINE_JOINTS)
    # at one of the two postures a joint may move too slowly to be called free
    most_turned = np.maximum(turned, np.where(curve[k, j], 0.0, distance).max(axis=1))
    is_slow = ~is_close & (most_turned > tol.STILL_TURN) & (most_turned < tol.DRIFT)
    is_close |= np.equal(j, 0)  # `near` stands for all that meet there
    unsure = np.flatnonzero(is_close & ~is_one)
    is_one[unsure] = _moves_straight(arm, task, start[unsure], offset[unsure], target[k[unsure]])
    slow = np.flatnonzero(is_slow & ~is_one)
    if len(slow):  # whether the self-motion of the one goes round to the other
        joints = curve[k[slow], i[slow]] | (distance[slow] > tol.ROUNDING_DISTANCE)
        end, compared = (start[slow] + offset[slow] * unit)[:, None], np.ones((len(slow), 1), bool)
        is_one[slow] = curves.share_circuit(arm, task, start[slow], joints, end, compared, target[k[slow]])[:, 0]
    k, i, j = k[is_one], i[is_one], j[is_one]
    motion = np.abs(newton.difference(arm, q, near[:, None])).sum(axis=2)
    nearer = motion[k, i] < motion[k, j] - tol.ROUNDING_DISTANCE
    i, j = np.where(nearer, j, i), np.where(nearer, i, j)
    for p in np.argsort(motion[k, i], kind="stable"):
        chosen[k[p], i[p]] &= not chosen[k[p], j[p]]


def _moves_straight(arm: Arm, task: Task, q: Array, offset: Array, target: Array) -> Bool:
    """Whether the joints can move from q (M, n) to q + offset, each at a constant pace, and keep the target: (M,).

    A quarter, half and three quarters of it are asked, each way round for joints that turn by about 180 degrees.
    They may be off by as much as roots of high order are.
    """
    reached = np.zeros(len(q), bool)
    if not len(q):
        return reached
    offsets = [_both_ways(arm, single) for single in offset]
    index = np.repeat(np.arange(len(q)), [len(choices) for choices in offsets])
    start = q[index] + np.array([0.25, 0.5, 0.75])[:, None, None] * np.concatenate(offsets) * radian_or_reach(arm)
    goal = np.concatenate([target[index]] * 3)
    landed, size = newton.correct(arm, task, start.reshape(-1, arm.n), goal, steps=3, least=tol.WEAK)
    deviation = np.abs(newton.difference(arm, landed, start.reshape(-1, arm.n))).max(axis=1)
    keeps_target = (size <= tol.SOLUTION) & (deviation < 10 * tol.STILL_TURN)
    reached[index[keeps_target.reshape(3, -1).all(axis=0)]] = True
    return reached


def _both_ways(arm: Arm, offset: Array) -> Array:
    """An offset (n,) each way round for joints that turn by about 180 degrees: (m, n)."""
    half_turns = np.flatnonzero(~arm.prismatic & (np.pi - np.abs(offset) < tol.REACH))
    flips = np.array(list(itertools.product((0.0, 1.0), repeat=len(half_turns))))
    offsets = np.tile(offset, (len(flips), 1))
    offsets[:, half_turns] -= 2.0 * np.pi * flips * np.sign(offset[half_turns])
    return offsets


def pull_back(arm: Arm, task: Task, q: Array, target: Array, steps: int = 6) -> tuple[Array, Array]:
    """Postures (M, n) beside a self-motion pulled back onto it, and what they miss: see `newton.correct`."""
    return newton.correct(arm, task, q, target, steps=steps, least=tol.WEAK, patience=1, stalled=tol.STALLED_RESIDUAL)


def push_along(arm: Arm, task: Task, q: Array, step: Array, push: Array, target: Array) -> tuple[Array, Array, Array]:
    """Postures (M, n), a step (M,) away along push (M, n), pulled back: they, what they miss, and how much more than
    q that is a step's length; infinite for those that fell back.
    """
    unit = radian_or_reach(arm)
    landed, size = pull_back(arm, task, q + step[:, None] * push * unit, target)
    went_far = (np.abs(landed - q) / unit).max(axis=1) > 0.3 * step * np.abs(push).max(axis=1)
    return landed, size, np.where(went_far, size - newton.misses(arm, task, q, target), np.inf) / step


def _equally_long(offsets: Array, push: Array) -> Bool:
    """Whether motions (2, 2, M, n), by a short step and a long one, both ways along push (M, n), are about as long."""
    least_length = 0.3 * STEPS * np.abs(push).max(axis=1)  # (2, M)
    all_far = (np.abs(offsets).max(axis=3) > least_length[:, None]).all(axis=1)
    return np.asarray(all_far & (np.abs(offsets[:, 0] - offsets[:, 1]).max(axis=2) > 0.3 * least_length))


def self_motion(arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array) -> tuple[Bool, Bool]:
    """Whether postures (M, n) can move along any direction that they lose, pulled back by steps of least norm."""
    unit = radian_or_reach(arm)
    moving, joints = np.zeros(len(q), bool), np.zeros(q.shape, bool)
    row, push = null_directions(arm.n, V, nullity)
    # The first pass decides which candidates do not move, most: their residual grows by more than `GROWTH`. Where
    # several directions are lost, its step is long: a short one would be drawn back to the meeting.
    loses_several = nullity[row] > 1
    step = np.where(loses_several, 10 * STEP, STEP)
    _, _, growth = push_along(arm, task, q[row], step, push, target[row])
    movable = np.flatnonzero(growth <= tol.GROWTH)
    # The second pass decides this of those that lose one direction and miss by more than rounding, by a longer step.
    loses_one = ~loses_several[movable] & (growth[movable] * step[movable] > tol.ROUNDING_RESIDUAL)
    if loses_one.any():
        tried = movable[loses_one]
        _, _, growth = push_along(arm, task, q[row[tried]], 10 * step[tried], push[tried], target[row[tried]])
        loses_one[loses_one] = ~(growth <= tol.GROWTH)
        movable = movable[~loses_one]
    if not len(movable):
        return moving, joints
    row, push, loses_several = row[movable], push[movable], loses_several[movable]
    # Each posture takes a short and a long step, whole and in part, both ways, in one call: (2, 2, 2, m, n); a joint
    # that rests at a double root comes half the way back in each.
    step_lengths = np.multiply.outer(STEPS[:, 0], [[1.0, 0.6], [-1.0, -0.6]])[..., None, None]
    start = q[row] + step_lengths * push * unit
    landed, size = pull_back(arm, task, start.reshape(-1, arm.n), np.concatenate([target[row]] * 8), steps=20)
    offsets, size = (landed.reshape(start.shape)[:, :, 0] - q[row]) / unit, size.reshape(start.shape[:4])
    growth = size.max(axis=(1, 2)) - newton.misses(arm, task, q, target)[row]  # (2, m)
    short_holds, long_holds = (growth <= tol.GROWTH * STEPS) & _equally_long(offsets, push)
    # A residual above rounding must stay small up to the long step: a fold's first tenth of a radian shows nothing.
    is_motion = (short_holds & ((growth[0] <= tol.ROUNDING_RESIDUAL) | long_holds)) | (long_holds & loses_several)
    np.logical_or.at(moving, row, is_motion)
    # roots of high order are off by up to 10 `STILL_TURN`, short ways drawn back to a meeting end nearby: no motions
    short_way, long_way = np.abs(offsets).max(axis=1)
    moves = np.where(long_holds[:, None], long_way > tol.MOVED * 10 * STEP, short_way > 10 * tol.STILL_TURN)
    np.logical_or.at(joints, row, is_motion[:, None] & moves)
    return moving, joints


def on_surface(
    arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array
) -> tuple[Bool, Int, tuple[Array, Array, Array]]:
    """Which postures (M, n) that lose two directions still do a long step off, by both ways at once: (M,).

    Those lie on a self-motion of two dimensions, or on one of double roots. V: (M, n, n) right singular vectors. Where
    more directions are lost surfaces meet, and rounding chooses the vectors: there any of `null_directions` tells.
    Also whose the long steps are, and what `push_along` says of these.
    """
    pairs, several = np.flatnonzero(nullity < 3), np.flatnonzero(nullity > 2)
    row, push = pairs, V[pairs, arm.n - 1] + 0.7 * V[pairs, arm.n - 2]
    if len(several):
        more_rows, more_push = null_directions(arm.n, V[several], nullity[several])
        row, push = np.concatenate([row, several[more_rows]]), np.concatenate([push, more_push])
    pushed = landed, size, _ = push_along(arm, task, q[row], np.full(len(row), 10 * STEP), push, target[row])
    nullity_there = newton.null_space(arm, task, landed, target[row])[2]
    distance = np.abs(newton.difference(arm, landed, q[row])).max(axis=1)
    surface = np.zeros(len(q), bool)
    np.logical_or.at(surface, row, (size <= tol.SOLUTION) & (nullity_there > 1) & (distance > 3 * STEP))
    return surface, row, pushed


def null_directions(n: int, V: Array, nullity: Int) -> tuple[Int, Array]:
    """Which postures to push, of M that lose as many directions as nullity (M,) says, and where: (m,), (m, n).

    V: (M, n, n) right singular vectors. Each direction is there once, whichever sign it has.
    """
    pushes = list(_null_directions(n, V, nullity))
    row, push = np.concatenate([w for w, _ in pushes]), np.concatenate([p for _, p in pushes])
    lead = (np.abs(push) > 0.1).argmax(axis=1)
    sign = np.sign(np.take_along_axis(push, lead[:, None], axis=1))
    _, unique_rows = np.unique(np.column_stack([row, np.rint(1e6 * push * sign)]), axis=0, return_index=True)
    unique_rows.sort()
    return row[unique_rows], push[unique_rows]


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
        fixed = list(itertools.combinations(range(n), k - 1))
        columns = np.moveaxis(basis[:, :, fixed], 2, 0)  # (C, m, k, k - 1), and what is at right angles to them
        normals = np.stack([(-1) ** i * np.linalg.det(np.delete(columns, i, axis=-2)) for i in range(k)], axis=-1)
        yield _long_directions(rows, np.einsum("cmk,mkn->cmn", normals, basis))
    several = np.flatnonzero(nullity > 1)
    in_null = (np.arange(n) >= n - nullity[several][:, None])[:, :, None]
    yield _long_directions(several, np.moveaxis(V[several].swapaxes(1, 2) @ np.where(in_null, V[several], 0.0), 1, 0))


def _long_directions(row: Int, push: Array) -> tuple[Int, Array]:
    """The directions (C, m, n) of postures (m,) that are long enough, made of length one, and whose they are."""
    size = np.linalg.norm(push, axis=2)
    is_long = size > 0.1
    return np.broadcast_to(row, size.shape)[is_long], push[is_long] / size[is_long][:, None]
