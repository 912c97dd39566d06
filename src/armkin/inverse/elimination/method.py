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
self-motion is a curve of solutions of which only some points are given: such poses are reported as near singular.

Three prismatic joints leave the orientation to the three others: `three_prismatic`, in closed form.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool
from armkin.inverse.elimination import three_prismatic
from armkin.inverse.elimination.choose_variable import Elimination, Kind, pose_kinds, prepare, sample_poses
from armkin.inverse.elimination.closed_loop import Loop
from armkin.inverse.elimination.merge import Answers, best_answers, merge_equal, pack_by_pose
from armkin.inverse.elimination.passes import answers_of, no_answers, run_pass
from armkin.inverse.elimination.polish import refine
from armkin.inverse.numeric import tolerances as tol

__all__ = ["Branches", "Elimination", "left_open", "prepare", "solve"]


CHUNK = 512  # poses worked on at once: long enough to hide the calls, and in 13 MB
BLOCK_POSES = 12288  # poses whose answers are kept unmerged: enough to fill the chunks of later passes
GUESSES = 8  # postures close to answers that are kept of a pose


def left_open(elimination: Elimination, samples: int = 48) -> float:
    """Share of random poses that the first two passes leave open: near a special geometry both are ill-conditioned.

    What only the main pass leaves open costs one more: near the class of a Kinova Gen3 with joint 3 held 16 %.
    """
    loop = elimination.loop
    if not elimination.plans:
        return 0.0
    rng = np.random.default_rng(6)
    q = np.where(loop.prismatic, rng.uniform(-1, 1, (samples, 6)), rng.uniform(-np.pi, np.pi, (samples, 6)))
    goal, _ = sample_poses(loop, q)
    for number in range(2):
        if len(goal):
            goal = goal[run_pass(loop, elimination.plans[number], goal, number)[1]]
    return len(goal) / samples


class Branches(NamedTuple):
    """What `solve` returns; see there."""

    q: Array
    near_singular: Bool
    settled: Bool
    shaken: Bool
    guesses: Array


def solve(elimination: Elimination, T: Array, shake: bool = True) -> Branches:
    """All isolated branches of many targets.

    Args:
        elimination: from `prepare`.
        T: (N, 4, 4) targets [mm].
        shake: whether passes that move a pose follow where those that leave it where it is settle nothing.

    Returns:
        q: (N, B, 6) [rad in (-pi, pi] | mm], sorted by a fixed projection, NaN past a target's last branch;
        B is the largest number of branches, at most 16.
        near_singular: (N,), targets with an answer near a singularity (|J^-1| > 1e4, lengths scaled), with
        answers that were merged across more than rounding, or with two roots that just touch or just miss.
        settled: (N,), targets of which some pass showed none of the signs of (v): every isolated branch is listed.
        shaken: (N,), targets of which no pass that left them where they are did: a singular posture may be missing.
        guesses: (N, G, 6) postures close to answers of these, NaN past the last: to be corrected.
    """
    blocks = range(0, max(len(T), 1), BLOCK_POSES)
    return stack_rows([_solve_block(elimination, T[begin : begin + BLOCK_POSES], shake) for begin in blocks])


def _solve_block(elimination: Elimination, T: Array, shake: bool) -> Branches:
    """`solve` for as many targets as one should keep intermediate results of."""
    loop, count = elimination.loop, T.shape[0]
    finite: Bool = np.all(np.isfinite(T), axis=(1, 2))
    goal = loop.goal(np.where(finite[:, None, None], T, np.eye(4)))
    if not elimination.plans:
        answers, touching, settled = _solve_slides(loop, goal)
        shaken = ~settled
        near_answers = no_answers()
    else:
        answers, near_answers, touching, settled, shaken = _run_passes(elimination, goal, shake)
    answers = rows_of(answers, finite[answers.pose])
    answers, merged_poses = merge_equal(loop.chain, loop.prismatic, goal, answers)
    q, weak = pack_by_pose(answers, count)
    unit = np.where(loop.prismatic, loop.length, 1.0)
    guesses = best_answers(rows_of(near_answers, (finite & shaken)[near_answers.pose]), count, GUESSES)
    return Branches(q * unit, (weak | merged_poses | touching) & finite, settled, shaken & finite, guesses * unit)


def _run_passes(elimination: Elimination, goal: Array, shake: bool) -> tuple[Answers, Answers, Bool, Bool, Bool]:
    """Answers of all passes, each over the poses that the last one left open, and what is close to answers; then (N,)
    poses with touching pairs, settled ones, and those that went to a pass which moves them."""
    parts, guesses = [no_answers()], [no_answers()]
    touching, shaken = np.zeros((2, goal.shape[0]), dtype=np.bool_)
    settled = np.ones(goal.shape[0], dtype=np.bool_)
    kind = pose_kinds(elimination.loop, goal)
    for chosen_kind in Kind:
        open_poses = np.flatnonzero(kind == chosen_kind)
        for number, pencil in enumerate(elimination.pencils_of_kind(chosen_kind) if open_poses.size else ()):
            shaken[open_poses] |= tol.SHAKES[number] > 0
            if tol.SHAKES[number] > 0 and not shake:
                break
            is_open = np.zeros(open_poses.size, dtype=np.bool_)
            for begin in range(0, open_poses.size, CHUNK):
                part = open_poses[begin : begin + CHUNK]
                answers, open_part, touch, guess = run_pass(elimination.loop, pencil, goal[part], number)
                parts.append(answers._replace(pose=part[answers.pose]))
                if number > 0:
                    guesses.append(guess._replace(pose=part[guess.pose]))
                is_open[begin : begin + CHUNK] = open_part
                touching[part] |= touch
            open_poses = open_poses[is_open]
            if open_poses.size == 0:
                break
        settled[open_poses] = False
    return stack_rows(parts), stack_rows(guesses), touching, settled, shaken


def _solve_slides(loop: Loop, goal: Array) -> tuple[Answers, Bool, Bool]:
    """Both answers of a chain with three prismatic joints; and whether roots touch, and whether they are all, (N,)."""
    parts, touching, full = [no_answers()], np.zeros(len(goal), np.bool_), np.ones(len(goal), np.bool_)
    if np.sum(loop.prismatic) > 3:
        return parts[0], touching, full
    for begin in range(0, goal.shape[0], CHUNK):
        part = goal[begin : begin + CHUNK]
        q, full[begin : begin + CHUNK] = three_prismatic.branches(loop.chain, loop.prismatic, part)
        q = q.reshape(-1, 6)
        pose = np.repeat(np.arange(part.shape[0]), 2)
        polished = refine(loop.chain, loop.prismatic, q, part[pose], 4)
        # where the links are all but points the loop's unit is so small that slides are millions of it long
        scale = np.maximum(1.0, np.linalg.norm(part[pose, :3, 3], axis=1))
        valid = polished.residual < tol.GRAZING * scale
        touching[begin + pose[valid & (polished.residual > tol.ELIMINATED * scale)]] = True
        parts.append(answers_of(loop, begin + pose, polished, valid))
    return stack_rows(parts), touching, full
