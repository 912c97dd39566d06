"""General 6-joint inverse kinematics by numeric elimination: every isolated branch of any 6R, 5R1P, 4R2P.

The method.  Closing the chain over the pose and cutting it at two joints gives fourteen equations that are
linear in products of the joints' sines and cosines (Raghavan and Roth 1990, "Kinematic analysis of the 6R
manipulator of general geometry"; here by the features of `line_features`, in which rigid motions
are matrices).  Two joints are eliminated by a null space, two by the dialytic step, and the last one is the
eigenvalue of a matrix pencil (Manocha and Canny 1994, "Efficient inverse kinematics for general 6R
manipulators") of size 12 to 32: `pencil`.  Every candidate is then moved onto the true chain by
Newton's method; what does not close the chain to 1e-10 is no answer.

Why the answers are complete.
(i) Every solution satisfies (2) = (3) of `pencil`, for these are features of the same line.
(ii) N left = 0, the dialytic products and the linearisation are consequences of that: they may add roots but
lose none, so every solution is a real eigenvalue x with its v as eigenvector, whatever the offset psi, unless
x is infinite.
(iii) If the pencil is regular all its eigenvalues are computed, backward stably; each gives its joints if its
eigenspace has dimension one.
(iv) Regularity depends on the arm: a pair of parallel axes makes most roles identically singular.  `prepare`
measures it on random poses, and only roles that give their generating joints back are used.  Where the pose makes
axes 6 and 1 parallel, or lets them meet, it is measured on such poses, and wide roles are tried, too: these are
regular with two such pairs in the loop.
(v) There remain poses on which (iii) fails: roots at infinity, equal roots of different solutions, roots that
rounding turned into complex pairs, poses on which the pencil is singular.  They show: entries above 1e6,
roots closer than 1e-4 with rough vectors, two roots that lead to one answer, real roots that lead to none, or
to one whose value of the hidden joint is not theirs; but not roots at a distance from all others whose vector is no
product v: by (ii) they stand for nothing.  Nor double ones with one vector, nor complex pairs off the real line by
more than rounding: `roots`.  A root that several solutions share gives all of them, `equal_roots`.
Such a pose is solved again, with another offset and other hidden joints, then moved by 1e-6 to 1e-3: an isolated
solution moves along with its pose and Newton's method leads it back, while what was degenerate is so no
longer.  This goes on until a pass shows none of these, or nine are done; all passes' answers count.  A self-motion
goes when the pose is moved, so that of a pose settled by none of the first four passes nothing is claimed.
Hence every isolated solution whose Jacobian's smallest singular value is above about 1e-7 (lengths scaled by
the arm) is listed.  Below that, neighbouring roots cannot be told apart in double precision, and a
self-motion is a curve of solutions of which only some points are given: such poses are reported as doubtful.

Three prismatic joints leave the orientation to the three others: `slides`, in closed form.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.elimination import roots, three_prismatic
from armkin.inverse.elimination.closed_loop import Loop
from armkin.inverse.elimination.merge import Answers, best, concatenate, difference, merge, pack, projection
from armkin.inverse.elimination.pencil import Pencil
from armkin.inverse.elimination.plans import TILT, Elimination, Kind, kinds, prepare
from armkin.inverse.elimination.polish import Polished, pose_error, refine, tip
from armkin.inverse.numeric.tolerances import (
    ALONE,
    BLURRED_ROOT,
    CLOSE_RESIDUAL,
    ELIMINATED,
    EXAMINED,
    GRAZING,
    NO_PRODUCT,
    OWN_ROOT,
    PAIRED,
    SAME_KEY,
    SAME_ROOT,
    SEED,
    SHAKES,
    STRAY,
    UPRIGHT,
)
from armkin.model.rotation import inverse

__all__ = ["Branches", "Elimination", "left_open", "prepare", "solve"]

Int = NDArray[np.int64]

CHUNK = 512  # poses worked on at once: long enough to hide the calls, and in 13 MB
BLOCK = 12288  # poses whose answers are kept unmerged: enough to fill the chunks of later passes
REGULAR = 1e3  # norm of inverse Jacobians up to which roots are that exact
GUESSES = 8  # postures close to answers that are kept of a pose


def left_open(elimination: Elimination, samples: int = 48) -> float:
    """Share of random poses that the first two passes leave open: near a special geometry both are ill-conditioned.

    What only the main pass leaves open costs one more: near the class of a Kinova Gen3 with joint 3 held 16 %.
    """
    closed = elimination.loop
    if not elimination.plans:
        return 0.0
    rng = np.random.default_rng(6)
    q = np.where(closed.prismatic, rng.uniform(-1, 1, (samples, 6)), rng.uniform(-np.pi, np.pi, (samples, 6)))
    frame, _ = tip(closed.chain, closed.prismatic, np.ascontiguousarray(q.T))
    goal = np.tile(np.eye(4), (samples, 1, 1))
    goal[:, :3] = np.moveaxis(frame, -1, 0)
    for number in range(2):
        if len(goal):
            goal = goal[_attempt(closed, elimination.plans[number], goal, number)[1]]
    return len(goal) / samples


class Branches(NamedTuple):
    """What `solve` returns; see there."""

    q: Array
    doubtful: Bool
    settled: Bool
    shaken: Bool
    guesses: Array


def solve(elimination: Elimination, T: Array) -> Branches:
    """All isolated branches of many targets.

    Args:
        elimination: from `prepare`.
        T: (N, 4, 4) targets [mm].

    Returns:
        q: (N, B, 6) [rad in (-pi, pi] | mm], sorted by a fixed projection, NaN past a target's last branch;
        B is the largest number of branches, at most 16.
        doubtful: (N,), targets with an answer near a singularity (|J^-1| > 1e4, lengths scaled), with
        answers that were merged across more than rounding, or with two roots that just touch or just miss.
        settled: (N,), targets of which some pass showed none of the signs of (v): every isolated branch is listed.
        shaken: (N,), targets of which no pass that left them where they are did: a singular posture may be missing.
        guesses: (N, G, 6) postures close to answers of these, NaN past the last: to be corrected.
    """
    count = T.shape[0]
    parts = [_solve_block(elimination, T[begin : begin + BLOCK]) for begin in range(0, count, BLOCK)]
    q = np.full((count, max((part.q.shape[1] for part in parts), default=0), 6), np.nan)
    doubtful, settled, shaken = np.zeros((3, count), dtype=np.bool_)
    guesses = np.full((count, max((part.guesses.shape[1] for part in parts), default=0), 6), np.nan)
    for number, part in enumerate(parts):
        rows = slice(number * BLOCK, number * BLOCK + len(part.doubtful))
        q[rows, : part.q.shape[1]], doubtful[rows], settled[rows], shaken[rows] = part[:4]
        guesses[rows, : part.guesses.shape[1]] = part.guesses
    return Branches(q, doubtful, settled, shaken, guesses)


def _solve_block(elimination: Elimination, T: Array) -> Branches:
    """`solve` for as many targets as one should keep intermediate results of."""
    closed, count = elimination.loop, T.shape[0]
    finite: Bool = np.all(np.isfinite(T), axis=(1, 2))
    goal = closed.goal(np.where(finite[:, None, None], T, np.eye(4)))
    if not elimination.plans:
        answers, touching, settled = _slides(closed, goal)
        shaken = ~settled
        near = _none()
    else:
        answers, near, touching, settled, shaken = _passes(elimination, goal)
    answers = answers.take(finite[answers.pose])
    answers, merged = merge(closed.chain, closed.prismatic, goal, answers)
    q, weak = pack(answers, count)
    unit = np.where(closed.prismatic, closed.length, 1.0)
    guesses = best(near.take((finite & shaken)[near.pose]), count, GUESSES)
    return Branches(q * unit, (weak | merged | touching) & finite, settled, shaken & finite, guesses * unit)


def _passes(elimination: Elimination, goal: Array) -> tuple[Answers, Answers, Bool, Bool, Bool]:
    """Answers of all passes, each over the poses that the last one left open, and what is close to answers; then (N,)
    poses with touching pairs, settled ones, and those that went to a pass which moves them."""
    found, guesses = [_none()], [_none()]
    touching, shaken = np.zeros((2, goal.shape[0]), dtype=np.bool_)
    settled = np.ones(goal.shape[0], dtype=np.bool_)
    kind = kinds(elimination.loop, goal)
    for one in Kind:
        open_poses = np.flatnonzero(kind == one)
        for number, pencil in enumerate(elimination.of_kind(one) if open_poses.size else ()):
            shaken[open_poses] |= SHAKES[number] > 0
            still = np.zeros(open_poses.size, dtype=np.bool_)
            for begin in range(0, open_poses.size, CHUNK):
                part = open_poses[begin : begin + CHUNK]
                answers, unsettled, touch, near = _attempt(elimination.loop, pencil, goal[part], number)
                found.append(answers._replace(pose=part[answers.pose]))
                if number > 0:
                    guesses.append(near._replace(pose=part[near.pose]))
                still[begin : begin + CHUNK] = unsettled
                touching[part] |= touch
            open_poses = open_poses[still]
            if open_poses.size == 0:
                break
        settled[open_poses] = False
    return concatenate(found), concatenate(guesses), touching, settled, shaken


def _attempt(closed: Loop, pencil: Pencil, goal: Array, number: int) -> tuple[Answers, Bool, Bool, Answers]:
    """Answers of one pass for goals (N, 4, 4), the poses it leaves open, those with touching roots, and guesses."""
    careful, shake = number > 0, SHAKES[number]
    seed = roots.seeds(pencil, inverse(_shaken(goal, shake)), TILT[careful], part=careful or pencil.role.wide)
    if shake == 0:
        seed = _without_empty(closed, seed, goal)
    target = goal[seed.pose]
    if careful:
        done = refine(closed.chain, closed.prismatic, seed.q, target, 12, damped=True)
    else:
        done = refine(closed.chain, closed.prismatic, seed.q, target, 4)
    # In later passes also what is nearly an answer, at a double root: such poses are said to be doubtful.
    good = done.residual < (10 * GRAZING if careful else ELIMINATED)
    unsettled, touching = seed.rough, np.zeros(goal.shape[0], dtype=np.bool_)
    # A complex pair that steps brought near the pose may be a real one, seen through rounding.
    # A move of the pose may turn two close real roots into such a pair.
    pair = PAIRED + 10 * np.sqrt(shake)
    maybe = seed.tilt < pair
    near = (done.residual < CLOSE_RESIDUAL) & (seed.tilt < max(pair, STRAY)) if careful else done.residual < STRAY
    missed = ~good & ((seed.tilt < UPRIGHT) | near)
    touch = good & (seed.tilt > 0) & (seed.tilt < UPRIGHT)
    unsure = good & (seed.tilt > 0) & maybe
    # A real root that was far from the answer it led to may have stood for another one.
    strayed = good & (seed.tilt == 0) & (done.guess > STRAY + 30 * shake)
    # It has not if it has the root's own value of the hidden joint: around a value there are no more solutions than
    # roots, and no two roots may have led to one answer. Near singularities roots are too far off to say so.
    weakest = np.zeros(goal.shape[0])
    np.maximum.at(weakest, seed.pose[good], done.weakness[good])
    away = difference(closed.prismatic, done.q, seed.q)[:, pencil.hidden_joint]
    own = (np.abs(away) < OWN_ROOT) & (weakest < REGULAR)[seed.pose] & (shake == 0)
    # unless several solutions share the middle joints: these are one root
    some = np.flatnonzero(strayed & own)
    own[some] = roots.end_joints_follow(pencil, inverse(target[some]), done.q[some])
    strayed &= ~own
    unsettled[seed.pose[missed | unsure | strayed]] = True
    touching[seed.pose[touch | (done.residual > ELIMINATED) & (done.residual < 10 * GRAZING)]] = True
    # Two roots that share the hidden joint: their vectors are good if both were near an answer at once,
    # and if the two answers are not the same.
    answers = _answers(closed, seed.pose, done, good)
    # Of complex roots damped steps bring many to an answer that has its own: they tell nothing here.
    stands = good & maybe
    pose, hidden, blurred = seed.pose[stands], seed.hidden[stands], done.guess[stands] > BLURRED_ROOT + 10 * shake
    order = np.lexsort((hidden, pose))
    close = (np.diff(pose[order]) == 0) & (np.diff(hidden[order]) < SAME_ROOT)
    close &= blurred[order][1:] | blurred[order][:-1]
    close &= ~(own[stands][order][1:] & own[stands][order][:-1])
    unsettled[pose[order][1:][close]] = True
    # Two real roots that led to one answer: one of them stands for another.
    real = answers.take(seed.tilt[good] == 0)
    key = projection(closed.prismatic, real.q)
    order = np.lexsort((key, real.pose))
    twice = (np.diff(real.pose[order]) == 0) & (np.diff(key[order]) < SAME_KEY)
    if twice.any():  # different answers may have the same key: about one pose in 10,000
        pairs = np.flatnonzero(twice)
        step = difference(closed.prismatic, real.q[order[pairs + 1]], real.q[order[pairs]])
        twice[pairs] = np.abs(step).max(axis=1) < EXAMINED
    unsettled[real.pose[order][1:][twice]] = True
    guesses = _answers(closed, seed.pose, done, ~good & (done.residual < SEED))
    return answers, unsettled, touching, guesses


def _without_empty(closed: Loop, seed: roots.Seeds, goal: Array) -> roots.Seeds:
    """Seeds without roots that stand for nothing.

    A simple root, or a double one with one vector, is one if its vector is no product: a solution's vector is a
    product, and such a root has no other vector. Of a multiple root that was taken apart all products are known.
    """
    some = np.flatnonzero((seed.defect > NO_PRODUCT) & (seed.gap > ALONE))
    target = np.ascontiguousarray(np.moveaxis(goal[seed.pose[some], :3], 0, -1))
    frame, _ = tip(closed.chain, closed.prismatic, np.ascontiguousarray(seed.q[some].T))
    kept = np.ones(len(seed.pose), np.bool_)
    kept[some[pose_error(frame, target)[1] > STRAY]] = False
    pose, q, hidden, tilt, rough, defect, gap = seed
    return roots.Seeds(pose[kept], q[kept], hidden[kept], tilt[kept], rough, defect[kept], gap[kept])


def _shaken(goal: Array, size: float) -> Array:
    """Goals (N, 4, 4) moved a little, in a direction that no arm is made for."""
    if size == 0:
        return goal
    x, y, z = size * np.array([0.61, -0.49, 0.63])
    spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    move = np.eye(4)
    move[:3, :3] = np.linalg.solve(np.eye(3) - spin / 2, np.eye(3) + spin / 2)  # Cayley: a rotation
    move[:3, 3] = size * np.array([-0.53, 0.57, 0.47])
    return np.asarray(move @ goal)


def _slides(closed: Loop, goal: Array) -> tuple[Answers, Bool, Bool]:
    """Both answers of a chain with three prismatic joints; and whether roots touch, and whether they are all, (N,)."""
    found, touching, all_ = [_none()], np.zeros(goal.shape[0], dtype=np.bool_), np.ones(goal.shape[0], dtype=np.bool_)
    if np.sum(closed.prismatic) > 3:
        return found[0], touching, all_
    for begin in range(0, goal.shape[0], CHUNK):
        part = goal[begin : begin + CHUNK]
        q, all_[begin : begin + CHUNK] = three_prismatic.branches(closed.chain, closed.prismatic, part)
        q = q.reshape(-1, 6)
        pose = np.repeat(np.arange(part.shape[0]), 2)
        done = refine(closed.chain, closed.prismatic, q, part[pose], 4)
        good = done.residual < GRAZING
        touching[begin + pose[good & (done.residual > ELIMINATED)]] = True
        found.append(_answers(closed, begin + pose, done, good))
    return concatenate(found), touching, all_


def _answers(closed: Loop, pose: Int, done: Polished, good: Bool) -> Answers:
    """The good ones, their revolute joints wrapped to (-pi, pi]."""
    wrapped = np.where(closed.prismatic, done.q, np.pi - np.mod(np.pi - done.q, 2 * np.pi))
    return Answers(pose, wrapped, done.residual, done.weakness).take(good)


def _none() -> Answers:
    """No answers."""
    return Answers(np.empty(0, dtype=np.int64), np.empty((0, 6)), np.empty(0), np.empty(0))
