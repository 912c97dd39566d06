"""Targets on an edge whose branches stand alone or meet in pairs, decided by two Jacobians for each pair.

Most targets that a closed form doubts have the two branches of a fold some 1e-4 rad apart. The residual along the lost
direction is a cubic between them, whose zeros are known, and whose slopes at them follow from the Jacobians bordered by
that direction. Where the cubic is conclusive, it agrees with `singular.local_structure`; `components` has the rest.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import branch_rows
from armkin.formula.arrays import Array, Bool, Int
from armkin.forward import tip_and_jacobian
from armkin.inverse.answers.batch import Batch, Goals, write_branches
from armkin.inverse.answers.solutions import Status
from armkin.inverse.closed.candidates import Recorded
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.residuals import task_jacobian
from armkin.model.units import radian_or_reach

SURE_FACTOR = 1.02  # results within this factor of SOLUTION are examined closely
SYMMETRIC = 0.2  # largest relative difference of the slopes at a pair's ends
PAIR_DISTANCE = 10.0 * tol.ROUNDING_DISTANCE  # closer branches [rad, reaches] are examined closely


class Doubted(NamedTuple):
    """K targets on an edge and their results from formulas."""

    rows: Int  # (K,) rows of the batch
    q: Array  # (K, B, n) candidates
    miss: Array  # (K, B) squared residuals
    edge: Bool  # (K, B) which candidates are on an edge
    plain: Bool  # (K,) whether no joint is free and `near` does not solve the target


def decide_folds(goals: Goals, runner: Recorded, batch: Batch, doubted: Doubted) -> Int:
    """Write the doubted targets that can be decided; returns the rows of the others.

    Branches that stand alone are in the batch already, except those with a small residual. Of two branches that meet
    the first is listed, with the values that it has for this target alone.
    """
    arm, task, target, near = goals
    solving = doubted.miss <= tol.SOLUTION**2
    to_correct = solving & (doubted.miss >= tol.ROUNDING_RESIDUAL**2)
    # a candidate with a slightly larger residual may be a branch
    is_wrong = doubted.miss > np.where(doubted.edge, tol.SEED_RESIDUAL**2, tol.NEARBY**2)
    decided: Bool = np.asarray(doubted.plain & solving.any(axis=1) & (solving | is_wrong).all(axis=1))
    k, b = np.nonzero(to_correct & decided[:, None])
    if len(k):
        doubted.q[k, b], size = newton.correct(arm, task, doubted.q[k, b], target[doubted.rows[k]], steps=3)
        decided[k[size >= tol.ROUNDING_RESIDUAL]] = False
    is_second = _second_of_pairs(goals, doubted, solving & (doubted.edge | (doubted.miss > tol.ACCEPTED**2)), decided)
    pairs: Bool = np.asarray(is_second.any(axis=1))
    listed = np.flatnonzero(decided & (pairs | (solving & (doubted.miss > tol.ACCEPTED**2)).any(axis=1)))
    if len(listed):
        rows, pairs, solving = doubted.rows[listed], pairs[listed], solving[listed] & ~is_second[listed]
        if pairs.any():
            doubted.q[listed[pairs]] = branch_rows(runner.in_numbers(target[rows[pairs]]), pairs.sum())[:, :, : arm.n]
        order = np.argsort(~solving, axis=1, kind="stable")
        valid = np.take_along_axis(solving, order, axis=1)
        q = np.where(valid[:, :, None], np.take_along_axis(doubted.q[listed], order[:, :, None], axis=1), np.nan)
        write_branches(arm, batch, rows, q, valid, order, near[rows])
        batch.status[rows] = np.where(pairs, Status.BOUNDARY, Status.EXACT)
    return doubted.rows[~decided]


def _second_of_pairs(goals: Goals, doubted: Doubted, near_roots: Bool, decided: Bool) -> Bool:
    """Which near roots (K, B) are the second of two that meet; clears `decided` (K,) where the curvature is vague."""
    is_second, near_roots = np.zeros(near_roots.shape, bool), near_roots & decided[:, None]
    k, b = np.nonzero(near_roots)
    if not len(k):
        return is_second
    q, index = doubted.q[k, b], np.empty(near_roots.shape, int)
    index[k, b] = np.arange(len(k))
    row, i, j = np.nonzero(np.triu(near_roots[:, :, None] & near_roots[:, None], 1))
    i, j = index[row, i], index[row, j]
    step = newton.difference(goals.arm, q[j], q[i])
    is_close = np.abs(step).max(axis=1) < tol.CLOSE_DISTANCE
    partners = np.bincount(np.concatenate([i[is_close], j[is_close]]), minlength=len(k))
    decided[k[partners > 1]] = False
    if not decided[k].all():  # without Jacobians of undecided targets
        return _second_of_pairs(goals, doubted, near_roots, decided)
    i, j, step = i[is_close], j[is_close], step[is_close]
    is_double = np.abs(step).max(axis=1) < PAIR_DISTANCE
    inverse, beside = _bordered_inverses(goals, q)
    is_weak = (inverse * inverse).sum(axis=(1, 2)) * tol.FOLD_VALUE**2 >= 1.0
    partners[i[is_double]], is_weak[i[is_double]] = 0, True  # the first root of a double one represents both
    single = np.flatnonzero(is_weak & (partners == 0) & decided[k])
    if len(single):
        isolated, turns = _by_curvature(goals, q[single], inverse[single], beside[single])
        decided[k[single[~np.where(np.isin(single, i[is_double]), turns, isolated)]]] = False
        is_second[k[j[is_double]], b[j[is_double]]] = True
        i, j, step = i[~is_double], j[~is_double], step[~is_double]
    if len(i):
        end_inverse = inverse[j] if not beside.shape[2] else _bordered_inverses(goals, q[j], beside[i])[0]
        stands_alone, meets = _decide_by_cubic(step, inverse[i], end_inverse)
        decided[k[i[~(stands_alone | meets)]]] = False
        is_second[k[j[meets]], b[j[meets]]] = True
    return is_second


def _bordered_inverses(goals: Goals, q: Array, beside: Array | None = None) -> tuple[Array, Array]:
    """Inverses (M, rows, rows) of the Jacobians at q (M, n), scaled as in `newton.scaled_residual_and_jacobian`.

    One row more than columns is completed by a column `beside` (M, rows, 1), by default what no joint reaches.
    """
    arm, task = goals.arm, goals.task
    T, slopes = tip_and_jacobian(arm, q)
    J = task_jacobian(task, slopes, T) * radian_or_reach(arm)
    J[:, : task.position] /= arm.reach
    M, rows, n = J.shape
    if rows == n:
        return newton.nudged(np.linalg.inv, J), np.empty((M, rows, 0))
    if beside is None:
        any_direction = np.broadcast_to(np.sqrt(np.arange(1.0, rows + 1))[:, None], (M, rows, 1))
        inverse = newton.nudged(np.linalg.inv, np.concatenate([J, any_direction], axis=2))
        beside = _unit_rows(inverse[:, n:]).swapaxes(1, 2)
    return newton.nudged(np.linalg.inv, np.concatenate([J, beside], axis=2)), beside


def _decide_by_cubic(offset: Array, inverse: Array, end_inverse: Array) -> tuple[Bool, Bool]:
    """Which of P pairs with an offset (P, n) stand alone, and which meet, (P,), by inverses of their Jacobians.

    The residual g along u is 0 at both ends; its slope on a curve that keeps all other numbers is 1 / (v' J^-1 u).
    """
    d = np.sqrt((offset * offset).sum(axis=1))
    v = _bordered_rows(offset / np.maximum(d, PAIR_DISTANCE)[:, None], inverse)
    u = _unit_rows(v @ inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        column, end_column = inverse @ u.swapaxes(1, 2), end_inverse @ u.swapaxes(1, 2)
        rise, fall = 1.0 / (v @ column)[:, 0, 0], 1.0 / (v @ end_column)[:, 0, 0]
        size, bend, asymmetry = np.abs(rise - fall), np.abs(fall - rise) / d, np.abs(rise + fall)
        # assume the fourth derivative of the sharpest fold
        is_conclusive = _one_direction_lost(inverse, column, u) & (d > PAIR_DISTANCE) & (asymmetry < SYMMETRIC * size)
        stands_alone = is_conclusive & (0.125 * d * size - tol.CURVATURE * d**4 / 384.0 > SURE_FACTOR * tol.SOLUTION)
        # where two branches that meet may have a residual of 2 SOLUTION
        reach = d + 2.0 * np.sqrt(tol.SOLUTION / bend)
        is_straight = 6.0 * asymmetry / d**2 * reach + 0.5 * tol.CURVATURE * reach**2 < SYMMETRIC * bend
        # the direction in which no joint moves the tool counts as well
        sideways = np.abs(end_column[:, offset.shape[1] :, 0] * fall[:, None]).sum(axis=1)
        meets = is_conclusive & is_straight & (0.125 * d * (size + sideways) < tol.SOLUTION / SURE_FACTOR)
    return np.asarray(stands_alone), np.asarray(meets)


def _by_curvature(goals: Goals, q: Array, inverse: Array, beside: Array) -> tuple[Bool, Bool]:
    """Which weak postures (M, n) without a neighbour are isolated roots, where g exceeds `SOLUTION` before an extremum,
    and which are boundaries, where the extremum comes first."""
    # the columns of J^-1 are nearly along the lost direction v, the longest one most
    joint_rows = inverse[:, : q.shape[1]]
    longest = (joint_rows * joint_rows).sum(axis=1).argmax(axis=1)
    v = np.take_along_axis(joint_rows, longest[:, None, None], axis=2)
    v = _unit_rows((joint_rows @ (joint_rows.swapaxes(1, 2) @ v)).swapaxes(1, 2))[:, 0]
    step = tol.FOLD_WAY * v * radian_or_reach(goals.arm)
    end_inverses, _ = _bordered_inverses(goals, np.concatenate([q + step, q - step]), np.concatenate([beside, beside]))
    v = _bordered_rows(v, inverse)
    u = _unit_rows(v @ inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        column, end_columns = inverse @ u.swapaxes(1, 2), end_inverses @ np.concatenate([u, u]).swapaxes(1, 2)
        slope = 1.0 / (v @ column)[:, 0, 0]
        rise, fall = (1.0 / (np.concatenate([v, v]) @ end_columns)[:, 0, 0]).reshape(2, -1)
        bend, exit_distance = np.abs(rise - fall) / (2.0 * tol.FOLD_WAY), 2.0 * tol.SOLUTION / np.abs(slope)
        third = np.abs(rise + fall - 2.0 * slope) / tol.FOLD_WAY**2
        bend_limit = bend + third * exit_distance + 0.5 * tol.CURVATURE * exit_distance**2
        is_root = slope**2 > SURE_FACTOR * 2.0 * tol.SOLUTION * bend_limit
        turn_distance = 4.0 * np.sqrt(tol.SOLUTION / bend)
        is_boundary = (np.abs(rise + fall) < SYMMETRIC * np.abs(rise - fall)) & (slope**2 < tol.SOLUTION * bend)
    loses_one, is_square = _one_direction_lost(inverse, column, u), beside.shape[2] == 0
    is_root &= loses_one & (exit_distance < tol.FOLD_WAY)
    return np.asarray(is_root), np.asarray(loses_one & (turn_distance < tol.FOLD_WAY) & is_boundary & is_square)


def _bordered_rows(v: Array, inverse: Array) -> Array:
    """Directions of joints (M, n) as rows (M, 1, rows), with 0 for the column beside the joints."""
    rows = np.zeros((len(v), 1, inverse.shape[1]))
    rows[:, 0, : v.shape[1]] = v
    return rows


def _unit_rows(rows: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(rows / np.sqrt((rows * rows).sum(axis=2, keepdims=True)))


def _one_direction_lost(inverse: Array, column: Array, u: Array) -> Bool:
    """Whether only one direction is lost, by an upper bound of the inverse in all others; column: J^-1 u."""
    remaining = inverse - column @ u
    return np.asarray((remaining * remaining).sum(axis=(1, 2)) * tol.HIGH_ORDER**2 < 1.0)
