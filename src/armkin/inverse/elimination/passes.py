"""One pass over poses: their answers by one pencil, and which of them it leaves open.

See `method` for what leaves a pose open, and why.
"""

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.elimination import roots
from armkin.inverse.elimination.closed_loop import Loop
from armkin.inverse.elimination.merge import Answers, difference, projection
from armkin.inverse.elimination.pencil import Pencil
from armkin.inverse.elimination.polish import Polished, pose_error, refine, tip
from armkin.inverse.numeric import tolerances as tol
from armkin.model.rotation import inverse

TILT = (0.02, 0.3)  # imaginary part [rad] of a root that is still tried: main pass, later passes
REGULAR = 1e3  # norm of inverse Jacobians up to which roots are as exact as those of a regular posture


def run_pass(loop: Loop, pencil: Pencil, goal: Array, number: int) -> tuple[Answers, Bool, Bool, Answers]:
    """Answers of one pass for goals (N, 4, 4), the poses it leaves open, those with touching roots, and guesses."""
    retry, shake = number > 0, tol.SHAKES[number]
    seed = roots.root_seeds(pencil, inverse(shaken_goal(goal, shake)), TILT[retry], part=retry or pencil.role.wide)
    if shake == 0:
        seed = _without_empty(loop, seed, goal, retry)
    target = goal[seed.pose]
    polished = refine(loop.chain, loop.prismatic, seed.q, target, 12 if retry else 4, damped=retry)
    # Later passes accept ten times that residual, for a double root: such poses are reported as near singular.
    valid = polished.residual < (10 * tol.GRAZING if retry else tol.ELIMINATED)
    is_open, touching = seed.badly_scaled, np.zeros(goal.shape[0], dtype=np.bool_)
    # Rounding turns two equal real roots into a complex pair, a shaken goal two close ones: a pair with a tilt below
    # this, whose steps end near the goal, may stand for real solutions, and the pose is left open.
    pair_tilt = tol.PAIRED_PART + 10 * np.sqrt(shake)
    may_be_pair = seed.tilt < pair_tilt
    near_answer = polished.residual < tol.STRAY_DISTANCE
    if retry:
        near_answer = (polished.residual < tol.CLOSE_RESIDUAL) & (seed.tilt < max(pair_tilt, tol.STRAY_DISTANCE))
    failed = ~valid & ((seed.tilt < tol.UPRIGHT) | near_answer | seed.torn)
    touch = valid & (seed.tilt > 0) & (seed.tilt < tol.UPRIGHT)
    doubtful = valid & (seed.tilt > 0) & may_be_pair
    own_root = _own_roots(loop, pencil, target, seed, polished, valid) if shake == 0 else np.zeros(len(valid), bool)
    # A real root that was far from the answer it led to may have stood for another one, if it is not the answer's own.
    stray = valid & (seed.tilt == 0) & (polished.guess > tol.STRAY_DISTANCE + 30 * shake) & ~own_root
    is_open[seed.pose[failed | doubtful | stray]] = True
    touching[seed.pose[touch | (polished.residual > tol.ELIMINATED) & (polished.residual < 10 * tol.GRAZING)]] = True
    answers = answers_of(loop, seed.pose, polished, valid)
    # Complex roots with a larger tilt tell nothing here: damped steps bring many to an answer that has its own root.
    is_open[_blurred_pairs(seed, polished, own_root, valid & may_be_pair, tol.BLURRED_ROOT + 10 * shake)] = True
    is_open[_met_twice(loop, rows_of(answers, seed.tilt[valid] == 0))] = True
    guesses = answers_of(loop, seed.pose, polished, ~valid & (polished.residual < tol.SEED_RESIDUAL))
    return answers, is_open, touching, guesses


def _own_roots(loop: Loop, pencil: Pencil, goal: Array, seed: roots.RootSeeds, polished: Polished, valid: Bool) -> Bool:
    """Which seeds led to an answer that has their own value of the hidden joint.

    Around a value there are as many solutions as roots at most, no two for one answer; not near singularities.
    """
    weakest = np.zeros(int(seed.pose.max(initial=-1)) + 1)
    np.maximum.at(weakest, seed.pose[valid], polished.weakness[valid])
    change = difference(loop.prismatic, polished.q, seed.q)[:, pencil.hidden_joint]
    own_root = (np.abs(change) < tol.OWN_ROOT) & (weakest < REGULAR)[seed.pose]
    # unless several solutions share the middle joints: these are one root
    strays = np.flatnonzero(valid & (seed.tilt == 0) & (polished.guess > tol.STRAY_DISTANCE) & own_root)
    if strays.size:
        own_root[strays] = roots.end_joints_follow(pencil, inverse(goal[strays]), polished.q[strays])
    return own_root


def _blurred_pairs(seed: roots.RootSeeds, polished: Polished, own_root: Bool, valid: Bool, limit: float) -> Int:
    """Poses with two roots that share the hidden joint, of those that stand for answers.

    Their vectors are good if both were near an answer at once, by at most `limit`, and if the answers are not the same.
    """
    pose, hidden, blurred = seed.pose[valid], seed.hidden[valid], polished.guess[valid] > limit
    order = np.lexsort((hidden, pose))
    same_root = (np.diff(pose[order]) == 0) & (np.diff(hidden[order]) < tol.SAME_ROOT)
    same_root &= blurred[order][1:] | blurred[order][:-1]
    same_root &= ~(own_root[valid][order][1:] & own_root[valid][order][:-1])
    return np.asarray(pose[order][1:][same_root])


def _met_twice(loop: Loop, real: Answers) -> Int:
    """Poses in which two real roots led to one answer: one of them stands for another."""
    key = projection(loop.prismatic, real.q)
    order = np.lexsort((key, real.pose))
    same_key = (np.diff(real.pose[order]) == 0) & (np.diff(key[order]) < tol.SAME_KEY)
    pairs = np.flatnonzero(same_key)  # different answers may have the same key: about one pose in 10,000
    step = difference(loop.prismatic, real.q[order[pairs + 1]], real.q[order[pairs]])
    return np.asarray(real.pose[order[pairs[np.abs(step).max(axis=1, initial=0.0) < tol.EXAMINED_DISTANCE]]])


def _without_empty(loop: Loop, seed: roots.RootSeeds, goal: Array, retry: bool) -> roots.RootSeeds:
    """Seeds without roots that stand for nothing.

    A simple root, or a double one with one vector, is one if its vector is no product: a solution's vector is a
    product, and such a root has no other vector. Of a multiple root that was taken apart all products are known.
    One farther off the real line than a double one is stays in later passes alone: steps may lead it to an answer.
    """
    empty = (seed.defect > tol.NO_PRODUCT) & (seed.gap > tol.LONE_DISTANCE)
    upright = seed.tilt < tol.TWIN_ROOTS
    simple = np.flatnonzero(empty & upright)
    keep = ~empty | retry | upright
    if simple.size:
        target = np.ascontiguousarray(goal[seed.pose[simple], :3].transpose(1, 2, 0))
        frame, _ = tip(loop.chain, loop.prismatic, np.ascontiguousarray(seed.q[simple].T))
        keep[simple[pose_error(frame, target)[1] > tol.STRAY_DISTANCE]] = False
    if keep.all():
        return seed
    pose, q, hidden, tilt, badly_scaled, defect, gap = seed
    return roots.RootSeeds(pose[keep], q[keep], hidden[keep], tilt[keep], badly_scaled, defect[keep], gap[keep])


def shaken_goal(goal: Array, size: float) -> Array:
    """Goals (N, 4, 4) moved a little, in a direction that no arm is made for."""
    if size == 0:
        return goal
    x, y, z = size * np.array([0.61, -0.49, 0.63])
    spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    move = np.eye(4)
    move[:3, :3] = np.linalg.solve(np.eye(3) - spin / 2, np.eye(3) + spin / 2)  # Cayley: a rotation
    move[:3, 3] = size * np.array([-0.53, 0.57, 0.47])
    return np.asarray(move @ goal)


def answers_of(loop: Loop, pose: Int, polished: Polished, valid: Bool) -> Answers:
    """The valid ones, their revolute joints wrapped to (-pi, pi]."""
    wrapped = np.where(loop.prismatic, polished.q, np.pi - np.mod(np.pi - polished.q, 2 * np.pi))
    return rows_of(Answers(pose, wrapped, polished.residual, polished.weakness), valid)


def no_answers() -> Answers:
    """No answers."""
    return Answers(np.empty(0, dtype=np.int64), np.empty((0, 6)), np.empty(0), np.empty(0))
