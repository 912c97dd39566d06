"""Self-motions in closed form, decided all at once: two joints about one line, and linkages of four bars.

Two joints about one line (a straight wrist, a wrist over the shoulder) move at the same pace, so the tool's pose is a
trigonometric polynomial of second degree in the way: it keeps its target everywhere if it does at five places. Four
bars move as `closed.four_bars` says. One posture of each goes to `singular.groups`, with what else these targets
have; what is closer, or loses more than one direction, goes there as it is.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.inverse.answers.batch import Goals
from armkin.inverse.closed import four_bars
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.model.arm import Arm

PLACES = np.arange(1.0, 5.0)[:, None]  # places [rad] along a line; zero is the fifth


class Linkages(NamedTuple):
    """What is known of K targets."""

    known: Bool  # (K,) whether all self-motions of loose candidates are
    lacking: Bool  # (K,) whether more candidates may tell
    q: Array  # (K, M, n) a posture of each self-motion, else nan
    joints: Bool  # (K, M, n) those that they move


class _Motions(NamedTuple):
    """Self-motions that columns of candidates (K, B) lie on."""

    line: Bool  # (K, B) whether two joints are about one line; else four bars
    d: Array  # (K, B, n) how the joints of a line move, of four bars 1 where they do
    base: Array  # (K, B, n) a posture
    joint: Int  # (K, B) joint whose sine tells two circuits of four bars apart, or -1


def decide_self_motions(goals: Goals, q: Array, loose: Bool) -> Linkages:
    """Candidates q (K, S, B, n) of full poses for S values of the joints that are free; loose: (K, B) those that these
    change.

    The first value is that of `near`, the second 1 rad more.
    """
    arm, task, target, near = goals
    K, S, B, n = q.shape
    solving, near_miss = ~np.isnan(q[..., 0]) & loose[:, None], newton.misses(arm, task, near, target)
    tried = np.repeat(target, solving.sum(axis=(1, 2)), axis=0)
    solving[solving] = newton.misses(arm, task, q[solving], tried) < tol.ROUNDING_RESIDUAL
    decided, motions = _find_motions(goals, q, solving, loose)
    leader, is_apart = _first_columns(arm, motions, loose)
    lacking = np.asarray((loose & (solving.sum(axis=1) < 2)).any(axis=1))
    decided &= is_apart & ~lacking & ~((near_miss > tol.ROUNDING_RESIDUAL) & (near_miss <= tol.SOLUTION))
    circuit = np.zeros(solving.shape, bool)
    k, s, b = np.nonzero(solving & (decided[:, None] & (motions.joint >= 0))[:, None])
    if len(k):
        circuit[k, s, b] = four_bars.sides(arm, q[k, s, b], motions.d[k, b] != 0.0, motions.joint[k, b])
    solving[:, 1:] &= ~motions.line[:, None]  # a line's posture at the first value is the nearest
    key = np.where(solving, 2 * leader[:, None] + circuit, 2 * B).reshape(K, -1)
    # a self-motion of two circuits may have candidates on one of them alone
    on_circuit = (key[:, :, None] == np.arange(2 * B)).any(axis=1).reshape(-1, B, 2)
    lacks_circuit = decided & ((motions.joint >= 0) & (on_circuit.sum(axis=2) == 1)).any(axis=1)
    decided &= ~lacks_circuit
    postures = q.reshape(K, -1, n).copy()
    # of candidates with one key that of the least motion is listed
    order = np.lexsort((np.abs(newton.difference(arm, postures, near[:, None])).sum(axis=2), key))
    leads, listed = np.diff(np.take_along_axis(key, order, axis=1), axis=1, prepend=-1) != 0, np.zeros(key.shape, bool)
    np.put_along_axis(listed, order, leads, axis=1)
    listed &= key < 2 * B
    if (stands := decided & (near_miss <= tol.ROUNDING_RESIDUAL)).any():
        decided &= _list_near(goals, postures, listed, key, motions, leader, loose, stands)
    decided &= _one_direction(goals, postures, listed & decided[:, None], key)
    listed &= decided[:, None]
    postures[~listed] = np.nan
    joints = listed[:, :, None] & np.tile(motions.d != 0.0, (1, S, 1))
    return Linkages(decided, lacking | lacks_circuit, postures, joints)


def _find_motions(goals: Goals, q: Array, solving: Bool, loose: Bool) -> tuple[Bool, _Motions]:
    """What the loose candidates solving (K, S, B) their targets move on; known: (K,) if it is all known."""
    arm, task, target, _ = goals
    base = np.take_along_axis(q, solving.argmax(axis=1)[:, None, :, None], axis=1)[:, 0]
    moved = np.abs(newton.difference(arm, q, base[:, None])) > tol.ROUNDING_DISTANCE
    moving: Bool = np.asarray((moved & solving[..., None]).any(axis=1))
    step = newton.difference(arm, q[:, 1], q[:, 0])
    same_pace = ((np.abs(np.abs(step) - 1.0) < tol.ROUNDING_DISTANCE) & ~arm.prismatic | ~moving).all(axis=2)
    first, last, count = moving.argmax(axis=2), arm.n - 1 - moving[:, :, ::-1].argmax(axis=2), moving.sum(axis=2)
    line: Bool = np.asarray(loose & solving[:, 0] & solving[:, 1] & same_pace & (count == 2) & (last - first == 2))
    d = np.where(line[:, :, None], np.where(moving, np.sign(step), 0.0), moving)
    k, b = np.nonzero(line)
    if len(k):
        places = (q[k, 0, b][:, None] + PLACES * d[k, b][:, None]).reshape(-1, arm.n)
        miss = newton.misses(arm, task, places, np.repeat(target[k], len(PLACES), axis=0)).reshape(-1, len(PLACES))
        line[k, b] = (miss < tol.ROUNDING_RESIDUAL).all(axis=1)
    joint = np.full(line.shape, -1)
    k, b = np.nonzero(loose & (count == 4))
    bars = np.zeros_like(line)
    if len(k):
        bars[k, b], joint[k, b] = four_bars.dead_points(arm, base[k, b], moving[k, b])
    return np.asarray((line | bars | ~loose).all(axis=1)), _Motions(line, d, base, joint)


def _held_difference(arm: Arm, a: Array, b: Array, d: Array, line: Bool) -> Array:
    """How far postures (..., n) differ besides a way along self-motions d (..., n), lines or four bars: (...)."""
    offset = newton.difference(arm, a, b)
    held_offset = np.abs(np.where(d != 0.0, 0.0, offset)).max(axis=-1)
    if line.any():
        # along a line one joint turns back what the other turns: what is left of both turns is no way along it
        first = (np.cumsum(np.abs(d), axis=-1) == 1.0) & (d != 0.0)
        turn_difference = np.abs(wrap_angle(np.where(first, d * offset, -d * offset).sum(axis=-1)))
        held_offset = np.where(line, np.maximum(held_offset, turn_difference), held_offset)
    return np.asarray(held_offset)


def _first_columns(arm: Arm, motions: _Motions, loose: Bool) -> tuple[Int, Bool]:
    """The first column (K, B) on the same self-motion as each; and whether all others are clearly apart (K,)."""
    B, base, d = loose.shape[1], motions.base, motions.d[:, :, None]
    held_offset = _held_difference(arm, base[:, None], base[:, :, None], d, motions.line[:, :, None])  # (K, B, B)
    alike = ((d != 0.0) == (motions.d[:, None] != 0.0)).all(axis=3)
    sense = motions.d.prod(axis=2, where=motions.d != 0.0)
    alike &= sense[:, :, None] == sense[:, None]
    pair = loose[:, :, None] & loose[:, None] & ~np.eye(B, dtype=bool)
    shared = pair & alike & (held_offset < tol.STILL_TURN)
    is_apart = ~(pair & ~shared & ~(held_offset > tol.APART_ROOTS)).any(axis=(1, 2))
    return np.where(shared, np.arange(B), B).min(axis=2, initial=B).clip(max=np.arange(B)), np.asarray(is_apart)


def _one_direction(goals: Goals, q: Array, listed: Bool, key: Int) -> Bool:
    """For which targets (K,) every listed self-motion has a posture that loses one direction alone."""
    k, m = np.nonzero(listed)
    for _ in range(2):  # the posture that is listed; else, for it may be where bars are in one line, all others
        if not len(k):
            break
        row, column = np.nonzero(listed[k] & (key[k] == key[k, m][:, None]))
        _, J = newton.scaled_residual_and_jacobian(goals.arm, goals.task, q[k[row], column], goals.target[k[row]])
        is_regular = np.bincount(row[np.linalg.svd(J, compute_uv=False)[:, -2] > tol.FOLD_VALUE], minlength=len(k)) > 0
        k, m, listed = k[~is_regular], m[~is_regular], np.ones_like(listed)
    regular = np.ones(len(q), bool)
    regular[k] = False
    return regular


def _list_near(
    goals: Goals, q: Array, listed: Bool, key: Int, motions: _Motions, leader: Int, loose: Bool, stands: Bool
) -> Bool:
    """Put `near` in place of what is listed of the self-motion that it is on; (K,) False where it may be on another.

    stands: (K,) targets that `near` solves.
    """
    arm, _, _, near = goals
    k = np.flatnonzero(stands)
    decided = np.ones(len(q), bool)
    held_offset = _held_difference(arm, near[k, None], motions.base[k], motions.d[k], motions.line[k])
    held_offset = np.where(loose[k], held_offset, np.inf)
    b, least_offset = held_offset.argmin(axis=1), held_offset.min(axis=1)
    decided[k[(least_offset >= tol.STILL_TURN) & (least_offset < tol.APART_ROOTS)]] = False
    k, b = k[least_offset < tol.STILL_TURN], b[least_offset < tol.STILL_TURN]
    own_key = 2 * leader[k, b]
    if len(p := np.flatnonzero(motions.joint[k, b] >= 0)):
        own_key[p] += four_bars.sides(arm, near[k[p]], motions.d[k[p], b[p]] != 0.0, motions.joint[k[p], b[p]])
    row, m = np.nonzero(listed[k] & (key[k] == own_key[:, None]))
    q[k[row], m] = near[k[row]]
    return decided
