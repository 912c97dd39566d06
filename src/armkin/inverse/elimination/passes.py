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


def run_pass(closed: Loop, pencil: Pencil, goal: Array, number: int) -> tuple[Answers, Bool, Bool, Answers]:
    """Answers of one pass for goals (N, 4, 4), the poses it leaves open, those with touching roots, and guesses."""
    careful, shake = number > 0, tol.SHAKES[number]
    seed = roots.root_seeds(pencil, inverse(shaken_goal(goal, shake)), TILT[careful], part=careful or pencil.role.wide)
    if shake == 0:
        seed = _without_empty(closed, seed, goal, careful)
    target = goal[seed.pose]
    moved = refine(closed.chain, closed.prismatic, seed.q, target, 12 if careful else 4, damped=careful)
    # In later passes also what is nearly an answer, at a double root: such poses are said to be near singular.
    good = moved.residual < (10 * tol.GRAZING if careful else tol.ELIMINATED)
    unsettled, touching = seed.rough, np.zeros(goal.shape[0], dtype=np.bool_)
    # A complex pair that steps brought near the pose may be a real one, seen through rounding.
    # A move of the pose may turn two close real roots into such a pair.
    pair = tol.PAIRED + 10 * np.sqrt(shake)
    maybe = seed.tilt < pair
    almost = moved.residual < tol.STRAY
    if careful:
        almost = (moved.residual < tol.CLOSE_RESIDUAL) & (seed.tilt < max(pair, tol.STRAY))
    missed = ~good & ((seed.tilt < tol.UPRIGHT) | almost | seed.torn)
    touch = good & (seed.tilt > 0) & (seed.tilt < tol.UPRIGHT)
    unsure = good & (seed.tilt > 0) & maybe
    own_root = _own_roots(closed, pencil, target, seed, moved, good) if shake == 0 else np.zeros(len(good), bool)
    # A real root that was far from the answer it led to may have stood for another one, if it is not the answer's own.
    strayed = good & (seed.tilt == 0) & (moved.guess > tol.STRAY + 30 * shake) & ~own_root
    unsettled[seed.pose[missed | unsure | strayed]] = True
    touching[seed.pose[touch | (moved.residual > tol.ELIMINATED) & (moved.residual < 10 * tol.GRAZING)]] = True
    answers = answers_of(closed, seed.pose, moved, good)
    # Of complex roots damped steps bring many to an answer that has its own: they tell nothing here.
    unsettled[_blurred_pairs(seed, moved, own_root, good & maybe, tol.BLURRED_ROOT + 10 * shake)] = True
    unsettled[_met_twice(closed, rows_of(answers, seed.tilt[good] == 0))] = True
    guesses = answers_of(closed, seed.pose, moved, ~good & (moved.residual < tol.SEED))
    return answers, unsettled, touching, guesses


def _own_roots(closed: Loop, pencil: Pencil, target: Array, seed: roots.RootSeeds, moved: Polished, good: Bool) -> Bool:
    """Which seeds led to an answer that has their own value of the hidden joint.

    Around a value there are no more solutions than roots, and no two roots may have led to one answer. Near
    singularities roots are too far off to say so.
    """
    weakest = np.zeros(int(seed.pose.max(initial=-1)) + 1)
    np.maximum.at(weakest, seed.pose[good], moved.weakness[good])
    away = difference(closed.prismatic, moved.q, seed.q)[:, pencil.hidden_joint]
    own_root = (np.abs(away) < tol.OWN_ROOT) & (weakest < REGULAR)[seed.pose]
    # unless several solutions share the middle joints: these are one root
    strays = np.flatnonzero(good & (seed.tilt == 0) & (moved.guess > tol.STRAY) & own_root)
    if strays.size:
        own_root[strays] = roots.end_joints_follow(pencil, inverse(target[strays]), moved.q[strays])
    return own_root


def _blurred_pairs(seed: roots.RootSeeds, moved: Polished, own_root: Bool, stands: Bool, most: float) -> Int:
    """Poses with two roots that share the hidden joint, of those that stand for answers.

    Their vectors are good if both were near an answer at once, by at most `most`, and if the answers are not the same.
    """
    pose, hidden, blurred = seed.pose[stands], seed.hidden[stands], moved.guess[stands] > most
    order = np.lexsort((hidden, pose))
    close = (np.diff(pose[order]) == 0) & (np.diff(hidden[order]) < tol.SAME_ROOT)
    close &= blurred[order][1:] | blurred[order][:-1]
    close &= ~(own_root[stands][order][1:] & own_root[stands][order][:-1])
    return np.asarray(pose[order][1:][close])


def _met_twice(closed: Loop, real: Answers) -> Int:
    """Poses in which two real roots led to one answer: one of them stands for another."""
    key = projection(closed.prismatic, real.q)
    order = np.lexsort((key, real.pose))
    twice = (np.diff(real.pose[order]) == 0) & (np.diff(key[order]) < tol.SAME_KEY)
    pairs = np.flatnonzero(twice)  # different answers may have the same key: about one pose in 10,000
    step = difference(closed.prismatic, real.q[order[pairs + 1]], real.q[order[pairs]])
    return np.asarray(real.pose[order[pairs[np.abs(step).max(axis=1, initial=0.0) < tol.EXAMINED]]])


def _without_empty(closed: Loop, seed: roots.RootSeeds, goal: Array, careful: bool) -> roots.RootSeeds:
    """Seeds without roots that stand for nothing.

    A simple root, or a double one with one vector, is one if its vector is no product: a solution's vector is a
    product, and such a root has no other vector. Of a multiple root that was taken apart all products are known.
    One farther off the real line than a double one is stays in later passes alone: steps may lead it to an answer.
    """
    empty = (seed.defect > tol.NO_PRODUCT) & (seed.gap > tol.ALONE)
    upright = seed.tilt < tol.TWIN_ROOTS
    simple = np.flatnonzero(empty & upright)
    stays = ~empty | careful | upright
    if simple.size:
        target = np.ascontiguousarray(goal[seed.pose[simple], :3].transpose(1, 2, 0))
        frame, _ = tip(closed.chain, closed.prismatic, np.ascontiguousarray(seed.q[simple].T))
        stays[simple[pose_error(frame, target)[1] > tol.STRAY]] = False
    if stays.all():
        return seed
    pose, q, hidden, tilt, rough, defect, gap = seed
    return roots.RootSeeds(pose[stays], q[stays], hidden[stays], tilt[stays], rough, defect[stays], gap[stays])


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


def answers_of(closed: Loop, pose: Int, moved: Polished, good: Bool) -> Answers:
    """The good ones, their revolute joints wrapped to (-pi, pi]."""
    wrapped = np.where(closed.prismatic, moved.q, np.pi - np.mod(np.pi - moved.q, 2 * np.pi))
    return rows_of(Answers(pose, wrapped, moved.residual, moved.weakness), good)


def none() -> Answers:
    """No answers."""
    return Answers(np.empty(0, dtype=np.int64), np.empty((0, 6)), np.empty(0), np.empty(0))
