"""Postures in which several self-motions meet, replaced by a posture of each of these.

Two or more directions are lost where they meet, and a root there is known to the root of rounding only: it lies on all
of the self-motions and on none. A long step away on each of them one direction is lost, and the posture is exact.
"""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import OWN_LABEL, Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.self_motions import STEP, null_directions, on_surface, pull_back, push_along
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

BOW = 0.1  # distance of a curve from its chord, at most, relative to the chord's length
PLANE_DIRECTIONS = 256  # directions in a plane, each of which stands for its opposite, too
EDGE_POINTS = 64  # points along each edge of a cube whose sides hold directions in space
SAMPLE = 61  # stride of the directions asked first: most curves have one below what all must exceed
ALL_ROUND = 5.0 * tol.FOLD_BEND  # curvature [1/rad] in all directions: a residual has passed `SOLUTION` 1e-3 rad away
THIRD = 0.03  # singular value of the third direction, which bends the curves by its inverse
SPREAD = 5.0  # factor on that curvature in some direction: no surface of solutions, and the zeros are clear


def separate(
    goals: Goals, q: Array, label: Int, size: Array, lost: newton.LostDirections
) -> tuple[Array, Int, Array, Bool]:
    """Candidates (K, M, n) with their labels and residuals (K, M), and postures of self-motions for those that meet.

    The first of a target, `near`, stays where it is. Others that no self-motion leaves stay, too: roots of high order,
    and postures of surfaces. lost: what they lose. Also which (K, M) rest: no push takes them along a self-motion.
    """
    arm, task, target, _ = goals
    k, b = np.nonzero((size[:, 1:] <= tol.SOLUTION) & (lost.nullity[:, 1:] > 1))
    b += 1
    weak, nullity = rows_of(lost.weak, lost.place[k, b]), lost.nullity[k, b]
    rounded = np.rint(newton.difference(arm, q[k, b], np.zeros(arm.n)) / tol.HIGH_ORDER)
    _, first, group = np.unique(np.column_stack([k, rounded]), axis=0, return_index=True, return_inverse=True)
    row = k[first]
    most = np.maximum(tol.ACCEPTED, 2.0 * size[row, b[first]])
    meet, ends, rests = _step_out(arm, task, q[row, b[first]], rows_of(weak, first), nullity[first], target[row], most)
    size[k, b] = np.where(np.isin(group.reshape(-1), meet), np.inf, size[k, b])
    order = np.argsort(row[meet], kind="stable")
    meet, ends = meet[order], ends[order]
    label_of_end, row = label[k[first], b[first]][meet], row[meet]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    shape = len(q), int(place.max(initial=-1)) + 1
    added, labels, sizes = np.full((*shape, arm.n), np.nan), np.full(shape, OWN_LABEL), np.full(shape, np.inf)
    added[row, place], labels[row, place] = ends, label_of_end
    sizes[row, place] = newton.misses(arm, task, ends, target[row])
    resting = np.zeros((len(q), q.shape[1] + shape[1]), bool)
    resting[k, b] = rests[group.reshape(-1)]
    return np.concatenate([q, added], 1), np.concatenate([label, labels], 1), np.concatenate([size, sizes], 1), resting


@cache
def _sample_directions(k: int) -> tuple[Array, Array, float]:
    """Directions (P, k), products of their coordinates (k (k + 1) / 2, P), and how far [rad] any is from these."""
    if k == 2:
        angle = np.linspace(0.0, np.pi, PLANE_DIRECTIONS, endpoint=False)
        unit, spacing = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.pi / PLANE_DIRECTIONS
    else:
        side = np.linspace(-1.0, 1.0, EDGE_POINTS)
        face = np.stack([*np.meshgrid(side, side), np.ones((EDGE_POINTS, EDGE_POINTS))], axis=2).reshape(-1, 3)
        unit = np.concatenate([np.roll(face, i, axis=1) for i in range(3)])
        unit, spacing = unit / np.linalg.norm(unit, axis=1, keepdims=True), 2.0**0.5 / (EDGE_POINTS - 1)
    return unit, np.stack([unit[:, i] * unit[:, j] for i, j in combinations_with_replacement(range(k), 2)]), spacing


def _form_sizes(forms: Array, products: Array, spacing: float) -> tuple[Array, Array]:
    """Sizes (m, P) of forms (m, k, pairs) in directions of products (pairs, P), and by which none is zero: (m,).

    As far [rad] from the next of these directions a form differs by twice its largest value at most.
    """
    values = forms @ products  # (m, k, P)
    size = np.sqrt((values * values).sum(axis=1))
    return size, ALL_ROUND + 2.0 * spacing * size.max(axis=1)


def _curve_tangents(
    arm: Arm, task: Task, q: Array, linear: newton.Linear, nullity: Int, target: Array
) -> tuple[Bool, Int, Array]:
    """For which postures (M, n) the directions of curves are known, and these: whose (m,), and which (m, n).

    As far as t along a lost direction v the residual is t^2 / 2 times u . f''(v, v), for all lost left vectors u:
    quadratic forms of v (docs/solution.md). Curves leave along their common zeros; where there is none, it grows all
    round, and where they are nothing but zero they do not tell. Three lost directions tell whether there is none.
    """
    n, decided = arm.n, np.zeros(len(q), bool)
    meetings, directions = [np.zeros(0, np.intp)], [np.zeros((0, n))]
    for k in (2, 3):
        rows = np.flatnonzero(nullity == k)
        rows = rows[linear.S[rows, n - k - 1] > THIRD] if linear.r.shape[1] == n > k else rows[:0]
        if not len(rows):
            continue
        unit, products, spacing = _sample_directions(k)
        pairs, V = list(combinations_with_replacement(range(k), 2)), linear.V[rows, n - k :]
        push = np.stack([V[:, i] if i == j else V[:, i] + V[:, j] for i, j in pairs])
        ends = (q[rows] + np.multiply.outer([tol.FOLD_WAY, -tol.FOLD_WAY], push * radian_or_reach(arm))).reshape(-1, n)
        goal = np.concatenate([target[rows]] * (2 * len(pairs)))
        r = newton.residuals(arm, task, ends, goal).reshape(2, len(pairs), len(rows), n)
        bends = ((r.sum(axis=0) - 2.0 * linear.r[rows])[..., None] * linear.U[rows][:, :, n - k :]).sum(axis=2)
        bends /= tol.FOLD_WAY**2
        squares = {i: b for b, (i, j) in zip(bends, pairs, strict=True) if i == j}
        columns = [b if i == j else b - squares[i] - squares[j] for b, (i, j) in zip(bends, pairs, strict=True)]
        forms = np.stack(columns, axis=2)  # (m, k, pairs)
        if k == 3:
            for sample in (products[:, ::SAMPLE], products):
                size, least = _form_sizes(forms, sample, spacing)
                all_grow = size.min(axis=1) > least
                rows, forms = rows[all_grow], forms[all_grow]
            decided[rows] = True
            continue
        size, least = _form_sizes(forms, products, spacing)
        decided[rows] = size.max(axis=1) > SPREAD * ALL_ROUND
        is_zero = (size <= least[:, None]) & decided[rows, None]
        is_zero &= (size <= np.roll(size, 1, axis=1)) & (size < np.roll(size, -1, axis=1))
        place, row = np.nonzero(is_zero.T)
        meetings.append(rows[row])
        directions.append((unit[place][:, :, None] * V[row]).sum(axis=1))
    return decided, np.concatenate(meetings), np.concatenate(directions)


def _step_out(
    arm: Arm, task: Task, q: Array, linear: newton.Linear, nullity: Int, target: Array, limit: Array
) -> tuple[Int, Array, Bool]:
    """Postures (m, n) on self-motions that leave meetings (M, n), a long step off, and whose: (m,).

    limit: (M,) residual of what counts as on one: beside double roots it is more. Also which (M,) all pushes end at.
    """
    decided, meeting, push = _curve_tangents(arm, task, q, linear, nullity, target)
    rests, unsure = decided.copy(), np.flatnonzero(~decided)
    surface, row, pushed = on_surface(arm, task, q[unsure], linear.V[unsure], nullity[unsure], target[unsure])
    rests[unsure] = ~surface
    searched = np.flatnonzero(rests[unsure[row]] & (nullity[unsure[row]] > 2))  # pushed all ways they may go
    rows = np.flatnonzero(rests & ~decided & (nullity < 3))
    if len(rows):
        more_rows, more_push = null_directions(arm.n, linear.V[rows], nullity[rows])
        meeting, push = np.concatenate([meeting, rows[more_rows]]), np.concatenate([push, more_push])
    first_push = push_along(arm, task, q[meeting], np.full(len(meeting), 10 * STEP), push, target[meeting])
    postures, size, growth = (np.concatenate([a, b[searched]]) for a, b in zip(first_push, pushed, strict=True))
    meeting = np.concatenate([meeting, unsure[row[searched]]])
    if not len(meeting):
        return meeting, postures, rests
    rests[meeting[growth <= tol.GROWTH]] = False
    unit, offset = radian_or_reach(arm), newton.difference(arm, postures, q[meeting])
    reached = np.flatnonzero((size <= limit[meeting]) & (np.abs(offset).max(axis=1) > 3 * STEP))
    reached = reached[newton.null_space(arm, task, postures[reached], target[meeting[reached]])[2] == 1]
    # a posture is on a self-motion through the meeting if the middle of the way is no farther off it than a curve bows
    start = q[meeting[reached]] + 0.5 * offset[reached] * unit
    between, size = pull_back(arm, task, start, target[meeting[reached]])
    deviation = np.abs(newton.difference(arm, between, start)).max(axis=1)
    reached = reached[(size <= tol.SOLUTION) & (deviation < BOW * np.abs(offset[reached]).max(axis=1))]
    return meeting[reached], postures[reached], rests
