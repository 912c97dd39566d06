"""The residual along the lost direction: whether a posture is isolated, a boundary or on a self-motion manifold.

At a posture J = U S V'. Where one singular value is small, the joints move along the last right singular vector v; all
that the other directions can take away of the residual they take away (Lyapunov-Schmidt reduction; Golubitsky and
Schaeffer, Singularities and Groups in Bifurcation Theory, 1985, ch. VII). What is left is a number g(t), t being the
way along v, and a curve x(t). The component is the interval of |g| <= SOLUTION around t = 0 (docs/solution.md).
"""

from typing import Any, NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import second_order
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

NODES = 10  # values of t at which g and x are computed: polynomials of degree 9 are exact to rounding on `span`
NODE = np.cos(np.pi * (2 * np.arange(NODES) + 1) / (2 * NODES))  # Chebyshev nodes of a span
ITERATIONS = 8  # Newton steps onto the curve
BEND = 8.0  # length of a span, at most, in second smallest singular values, once a longer one did not hold
SHRINK = 8  # factor by which a span that is shorter still is shortened
SHRINKS = 3  # times that a span is shortened at most
FAILED_RATIO, MAX_RATIO = 0.35, 2.0  # length of a span relative to the last one, if that does not hold, and at most
USED_SHARE = 0.5  # share of a span by which what bounds the next one has come nearer
STEPS = 200  # equal steps of a span: what exceeds `SOLUTION` within one does so by less than a thousandth
# of a span, where |g| is compared
POINTS = np.concatenate([[0.0], np.geomspace(tol.FIRST_POINT, 1.0 / STEPS, 24), np.arange(2, STEPS + 1) / STEPS])
EXPONENTS = np.arange(NODES)
POWERS_OF_POINTS = POINTS[:, None] ** EXPONENTS  # (points, NODES)
FINE_GRID = np.linspace(0.0, 1.0, 33)[:, None]  # parameters of a component at which its slope is compared
FINER_GRID = np.linspace(0.0, 1.0, 129)[:, None]  # parameters of an interval where a component ends, or between two


class Structure(NamedTuple):
    """What is known of the components that M postures lie on; of shape (M,) where no other is given."""

    known: Bool  # whether the curve was followed far enough to tell what the component is
    manifold: Bool  # whether that is a self-motion manifold
    boundary: Bool  # whether it is a boundary; where it is neither, it is an isolated root
    joints: Bool  # (M, n) joints that move along a manifold
    low: Array  # end of the component along v, at -span or above, as far as the polynomials hold
    high: Array  # its other end, at span or below
    span: Array  # length [rad, reaches] of the polynomials along v
    least_way: Array  # (M, n) least value of each joint's way between low and high
    most_way: Array  # (M, n) greatest value
    followed: Bool  # whether the polynomials hold on the span
    span_ratio: Array  # length that the next span, ahead of this one, is likely to have, in spans
    uncrossed: Bool  # whether no other curve crosses within the span
    v: Array  # (M, n) direction that is lost
    second: Array  # second smallest singular value
    x: Array  # (NODES, M, n) coefficients of the joints' ways [rad, reaches] in powers of t / span
    g: Array  # (NODES, M, k) coefficients of the residual


class Side(NamedTuple):
    """Nodes of a span, both ways from a posture or ahead of it."""

    node: Array  # (NODES,) in spans
    to_powers: Array  # (NODES, NODES) from values at the nodes to coefficients of the powers
    low: float  # where the span begins, in spans
    gain: float  # length of a span ahead that is as exact, in spans


class _Start(NamedTuple):
    """Curves that begin at M postures and are to be followed."""

    q: Array  # (M, n)
    target: Array  # (M, m) or (M, 4, 4)
    u: Array  # (M, rows, k) directions out of reach
    v: Array  # (M, n) direction of the curve
    w: Array  # (M, n) its second derivative, as far as it is known
    span: Array  # (M,) how far it is followed


def local_structure(arm: Arm, task: Task, q: Array, target: Array, linear: newton.Linear | None = None) -> Structure:
    """The structure at postures (M, n) that solve their targets (M, m) or (M, 4, 4); at least n numbers a target.

    linear: the residuals there and the Jacobians' singular values, if they are known.
    """
    linear = linear or newton.Linear.linearise(arm, task, q, target)
    curve, rows = _blank_structure(linear), linear.r.shape[1]
    n, w = q.shape[1], np.zeros(q.shape)
    if rows < n:
        return curve
    full_span, is_short = curve.span.copy(), np.zeros(len(q), bool)
    if rows == n > 1:
        series = second_order.Series.at(arm, task, q, target, linear)
        curve.known[...], curve.boundary[...] = second_order.decide(arm, task, q, target, linear, series)
        curve.followed[...], (curve.low[...], curve.high[...]) = curve.known, series.ends()
        w, span = series.w, curve.span[:, None]
        curve.x[1], curve.x[2] = series.v * span, 0.5 * w * span**2
        curve.g[1], curve.g[2] = series.sigma[:, None] * span, 0.5 * series.b[:, None] * span**2
        # the first span is twice as long as the component is by its second order
        estimate = 2.0 * np.maximum(-curve.low, curve.high)
        is_short = ~curve.known & (estimate > 0.0) & (2.0 * estimate < full_span) & (curve.second > tol.HIGH_ORDER)
        curve.span[is_short], w[~is_short] = estimate[is_short], 0.0
    starts = _Start(q, target, linear.U[:, :, n - 1 :], linear.V[:, -1], w, curve.span)
    unknown = np.flatnonzero(~curve.known)
    for _ in range(SHRINKS + 2):
        if not len(unknown):
            break
        holds = _follow_spans(arm, task, starts, curve, unknown, BOTH_WAYS)
        # a shorter span helps neither where two directions are all but lost nor where the component leaves this one
        helped = ~curve.known[unknown] & (curve.second[unknown] > tol.HIGH_ORDER)
        unknown = unknown[helped & (is_short[unknown] | ~holds)]
        span, bend_span = curve.span[unknown], BEND * curve.second[unknown]
        shorter_span = np.where(2.0 * bend_span < span, bend_span, span / SHRINK)
        curve.span[unknown] = np.where(is_short[unknown], full_span[unknown], shorter_span)
        is_short[unknown], w[unknown] = False, 0.0
    return curve


def structure_ahead(arm: Arm, task: Task, q: Array, target: Array, span: Array, heading: Array) -> Structure:
    """The curves through postures (M, n), the way that heading (M, n) points, as far as span (M,)."""
    linear = newton.Linear.linearise(arm, task, q, target)
    linear.V[(linear.V[:, -1] * heading).sum(axis=1) < 0.0, -1] *= -1.0
    curve = _blank_structure(linear)
    curve.span[...] = span
    starts = _Start(q, target, linear.U[:, :, arm.n - 1 :], linear.V[:, -1], np.zeros(q.shape), curve.span)
    _follow_spans(arm, task, starts, curve, np.arange(len(q)), ONE_WAY)
    return curve


def _blank_structure(linear: newton.Linear) -> Structure:
    """What the Jacobians tell: the lost direction, and the longest span."""
    r, _, S, V = linear
    M, n = len(r), V.shape[2]
    known, manifold, boundary, followed, uncrossed = np.zeros((5, M), bool)
    joints, (low, high), (least_way, most_way) = np.zeros((M, n), bool), np.zeros((2, M)), np.zeros((2, M, n))
    v, second, span_ratio = V[:, -1], S[:, n - 2] if n > 1 else np.ones(M), np.ones(M)
    span, lost = 1.2 * tol.REACH / np.abs(v).max(axis=1), r.shape[1] - n + 1  # fewer joints leave more out of reach
    x, g = np.zeros((NODES, M, n)), np.zeros((NODES, M, max(lost, 1)))
    ends = low, high, span, least_way, most_way, followed, span_ratio
    return Structure(known, manifold, boundary, joints, *ends, uncrossed, v, second, x, g)


def leave_spans(arm: Arm, structure: Structure, rows: Int, q: Array, heading: Array) -> tuple[Array, Array]:
    """Where curves through q (m, n), those of rows (m,), leave their spans, and the way there, (m, n).

    heading: (m, n) which way they are followed. nan where a curve comes to an end before.
    """
    sense = np.sign((structure.v[rows] * heading).sum(axis=1))
    end = np.where(sense > 0.0, structure.high[rows], -structure.low[rows])
    x = _evaluate(structure.x[:, rows], np.multiply.outer([0.9, 1.0], sense))
    leaves = (end >= structure.span[rows])[:, None]
    return np.where(leaves, q + x[1] * radian_or_reach(arm), np.nan), x[1] - x[0]


def _follow_spans(arm: Arm, task: Task, starts: _Start, curve: Structure, rows: Int, side: Side) -> Bool:
    """Follow the curves of some postures along their spans; write to `curve` what those tell that stay at hand (m,)."""
    start, span = rows_of(starts, rows), curve.span[rows]
    holds, span_ratio, uncrossed, x, g = _fit_polynomials(arm, task, start, side)
    # Newton's method may have found another curve close by: then x(0) is not the posture
    slack = tol.SOLUTION / np.maximum(curve.second[rows], tol.TINY)
    holds &= np.abs(x[0]).max(axis=1) <= 4.0 * (tol.SMOOTH_ERROR * span + slack)
    curve.span_ratio[rows], curve.followed[rows] = np.where(holds, span_ratio, FAILED_RATIO), holds
    if len(rows := rows[holds]):
        curve.x[:, rows], curve.g[:, rows], curve.uncrossed[rows] = x[:, holds], g[:, holds], uncrossed[holds]
        _decide(curve, rows, side)
    return holds


def _fit_polynomials(arm: Arm, task: Task, start: _Start, side: Side) -> tuple[Bool, Array, Bool, Array, Array]:
    """Fit polynomials of degree `NODES` - 1 to M curves along their spans.

    Returns:
        For each curve (M,) whether it stays at hand as far as its span, the length of the next span in spans, and
        whether no other curve crosses it; then the coefficients of x (NODES, M, n) and g (NODES, M, k).
    """
    n, rows, span = start.q.shape[1], start.u.shape[1], start.span
    holds, x, along_u, inverse = _solve_nodes(arm, task, start, side)
    # along the curve u turns: the inverse's last rows span what no motion across v reaches there
    g = _least_residual(inverse[:, :, n:, :rows], along_u)
    values = np.concatenate([x, g], axis=2)
    # the polynomials are exact on the span if the last coefficients of their Chebyshev series are small
    last = np.abs(_combine_nodes(TO_LAST, values)).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.maximum(
            last[:, :n].max(axis=1) / (tol.SMOOTH_ERROR * span), last[:, n:].max(axis=1) / (0.01 * tol.SOLUTION)
        )
        # the last coefficients grow with the span to that power
        span_ratio = side.gain * np.minimum(0.9 * error ** (1.0 / (2 - NODES)), MAX_RATIO) - USED_SHARE
        holds &= error < 1.0
    power = _combine_nodes(side.to_powers, values)
    uncrossed = _crossed_by_none(inverse, np.multiply.outer(-np.diff(side.node), span))
    return np.asarray(holds), span_ratio, uncrossed, power[:, :, :n], power[:, :, n:]


def _solve_nodes(arm: Arm, task: Task, start: _Start, side: Side) -> tuple[Bool, Array, Array, Array]:
    """Solve M curves at their nodes by Newton's method on the Jacobian bordered by u and v.

    The method is that of Keller, Numerical solution of bifurcation problems, 1977.

    Returns:
        Whether all nodes of a curve are solved (M,), the joints' ways (NODES, M, n) [rad, reaches], the residual
        along u (NODES, M, k), and the inverses of the bordered Jacobians (NODES, M, rows + 1, rows + 1).
    """
    q, target, u, v, w, span = start
    M, n = q.shape
    rows, k = u.shape[1:]
    t, unit = np.multiply.outer(side.node, span)[:, :, None], radian_or_reach(arm)
    x = t * (v + 0.5 * t * w)
    bordered, along_u = np.zeros((NODES, M, rows + 1, rows + 1)), np.empty((NODES, M, k))
    bordered[:, :, :rows, n:], bordered[:, :, rows, :n] = u, v
    # steps that do not halve from one to the next lead to no curve, or to another one
    holds, active, farthest = np.zeros(M, bool), np.arange(M), 3.0 * np.abs(t)
    last_size, size_limit = np.zeros(M), span.copy()
    for _ in range(ITERATIONS):
        part = active if len(active) < M else slice(None)  # numbers cost copies
        way, goal = x[:, part], np.concatenate([target[part]] * NODES)
        r, J = newton.scaled_residual_and_jacobian(arm, task, (q[part] + way * unit).reshape(-1, n), goal)
        bordered[:, part, :rows, :n] = J.reshape(NODES, -1, rows, n)
        t_error = t[:, part] - (v[part] * way).sum(axis=2, keepdims=True)
        missing = np.concatenate([r.reshape(NODES, -1, rows), t_error], axis=2)
        matrix = bordered[:, part].reshape(-1, rows + 1, rows + 1)
        step = newton.nudged(np.linalg.solve, matrix, missing.reshape(-1, rows + 1, 1)).reshape(missing.shape)
        x[:, part], along_u[:, part] = way + step[:, :, :n], step[:, :, n:]
        size = np.abs(step[:, :, :n]).max(axis=(0, 2))
        # Newton's method squares the error: the next step is about size^3 / last_size^2 long
        arrived = (size < tol.ARRIVED_STEP) | (size**3 < tol.ERROR * last_size[part] ** 2)
        at_hand = (np.abs(x[:, part]) < farthest[:, part]).all(axis=(0, 2)) & (size < size_limit[part])
        holds[part], size_limit[part], last_size[part] = arrived & at_hand, 0.5 * size, size
        active = active[~arrived & at_hand]
        if not len(active):
            break
    inverse = newton.nudged(np.linalg.inv, bordered.reshape(-1, rows + 1, rows + 1)).reshape(bordered.shape)
    return holds, x, along_u, inverse


def _crossed_by_none(inverse: Array, spacing: Array) -> Bool:
    """Which curves (M,) no other one crosses within their spans.

    A crossing is a zero of the bordered Jacobian's smallest singular value. Between two nodes there is none if it
    changes by less than it is there. inverse: of these Jacobians at the nodes; spacing: of these (NODES - 1, M).
    """
    weakest = 1.0 / np.sqrt((inverse * inverse).sum(axis=(2, 3)))
    steepest = (np.abs(np.diff(weakest, axis=0)) / spacing).max(axis=0)
    return np.asarray((weakest[1:] + weakest[:-1] > 2.0 * steepest * spacing).all(axis=0))


def _least_residual(across: Array, parts: Array) -> Array:
    """Vectors as long as the least residual across v: its parts (..., k) along across (..., k, rows)."""
    if parts.shape[-1] == 1:
        return np.asarray(parts / np.sqrt((across * across).sum(axis=-1)))
    L = np.asarray(np.linalg.cholesky(across @ across.swapaxes(-1, -2)), float).reshape(-1, *across.shape[-2:-1] * 2)
    return newton.nudged(np.linalg.solve, L, parts.reshape(len(L), -1, 1)).reshape(parts.shape)


_FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(NODE, NODES - 1))
_POWERS = np.array([
    np.pad(np.polynomial.chebyshev.cheb2poly([0.0] * k + [1.0]), (0, NODES))[:NODES] for k in range(NODES)
]).T  # fmt: skip
_SHIFT = np.array([np.pad(np.polynomial.polynomial.polypow([-1.0, 2.0], k), (0, NODES - 1 - k)) for k in range(NODES)])
BOTH_WAYS = Side(NODE, _POWERS @ _FIT, -1.0, 1.32)
ONE_WAY = Side(0.5 * (NODE + 1.0), _SHIFT.T @ _POWERS @ _FIT, 0.0, 1.0)
TO_LAST = _FIT[-2:]


def _evaluate(coefficients: Array, s: Array) -> Array:
    """Polynomials (NODES, M, k) at s (..., M): (..., M, k)."""
    powers = np.ones((len(coefficients), *s.shape))
    for k in range(1, len(powers)):
        np.multiply(powers[k - 1], s, out=powers[k])
    weights = powers.reshape(len(powers), -1, s.shape[-1]).transpose(2, 1, 0)  # (M, points, NODES)
    values = (weights @ coefficients.swapaxes(0, 1)).swapaxes(0, 1)
    return np.asarray(values.reshape(*s.shape, coefficients.shape[2]))


def _combine_nodes(weights: Any, values: Array) -> Array:
    """Sums of values (NODES, M, k) by weights (S, NODES): (S, M, k)."""
    return np.asarray((weights @ values.reshape(len(values), -1)).reshape(len(weights), *values.shape[1:]))


def _exceeds(residual: Array) -> Bool:
    """Where residuals (..., k) are larger than `SOLUTION`: (...)."""
    return np.asarray((residual * residual).sum(axis=-1) > tol.SOLUTION**2)


def _ends_of_components(g: Array, side: Side) -> tuple[Array, Bool]:
    """Where |g| (NODES, M, k) first exceeds `SOLUTION` [spans], and whether: (1, M) ahead, or (2, M) both ways."""
    M = g.shape[1]
    if side.low < 0.0:
        g = np.concatenate([g * ((-1.0) ** EXPONENTS)[:, None, None], g], axis=1)
    distance, ended = np.ones(g.shape[1]), np.zeros(g.shape[1], bool)
    # the sum of the coefficients' sizes bounds the polynomial on all of the span
    rows = np.flatnonzero(np.linalg.norm(np.abs(g).sum(axis=0), axis=1) > tol.SOLUTION)
    exceeds: Bool = _exceeds(_combine_nodes(POWERS_OF_POINTS, g[:, rows]))
    point, passes = exceeds.argmax(axis=0), exceeds.any(axis=0)
    rows, point = rows[passes], point[passes]
    ended[rows] = True
    low, high = POINTS[np.maximum(point - 1, 0)], POINTS[point]
    for _ in range(2 if len(rows) else 0):
        between = low + FINER_GRID * (high - low)
        exceeds = _exceeds(_evaluate(g[:, rows], between[1:]))
        exceeds[-1] = True
        point = exceeds.argmax(axis=0)
        low, high = between[point, np.arange(len(rows))], between[point + 1, np.arange(len(rows))]
    distance[rows] = low
    return distance.reshape(-1, M), ended.reshape(-1, M)


def _decide(curve: Structure, rows: Int, side: Side) -> None:
    """Write what the polynomials of some postures tell: of a component that leaves a shortened span, nothing."""
    g, x, span = curve.g[:, rows], curve.x[:, rows], curve.span[rows]
    distance, ended = _ends_of_components(g, side)
    low, high = side.low * distance[0], distance[-1]
    s = low + FINE_GRID * (high - low)  # (points, M)
    way = _evaluate(x, s)
    curve.least_way[rows], curve.most_way[rows] = way.min(axis=0), way.max(axis=0)
    extent = curve.most_way[rows] - curve.least_way[rows]
    is_long = extent.max(axis=1) >= tol.REACH
    curve.known[rows], curve.manifold[rows] = is_long | ended.all(axis=0), is_long
    if len(short := np.flatnonzero(~is_long)):
        slope = _evaluate(g[1:, short] * np.arange(1, NODES)[:, None, None], s[:, short]) / span[short, None]
        place = np.linalg.norm(slope, axis=2).argmax(axis=0)
        steepest = slope[place, np.arange(len(short))]
        along = (slope * steepest).sum(axis=2) / np.maximum(np.linalg.norm(steepest, axis=1), tol.TINY)
        curve.boundary[rows[short]] = along.min(axis=0) <= tol.SOLUTION
    curve.joints[rows] = is_long[:, None] & (extent > tol.MOVED * extent.max(axis=1)[:, None])
    curve.low[rows], curve.high[rows] = low * span, high * span


def members(structure: Structure, rows: Int, way: Array) -> Bool:
    """Which postures, way (m, M, n) [rad, reaches] from those of rows (m,), lie on their components: (m, M).

    As far as the curve is known; one that solves its target lies as close to it as the second singular value lets it.
    """
    t = (way * structure.v[rows, None]).sum(axis=2)  # (m, M)
    span, slack = structure.span[rows], 4.0 * tol.SOLUTION / structure.second[rows]
    x = _evaluate(structure.x[:, rows], np.clip(t / span[:, None], -1.0, 1.0).T).swapaxes(0, 1)
    offset = np.abs(way - x).max(axis=2)
    in_range = (t >= (structure.low[rows] - slack)[:, None]) & (t <= (structure.high[rows] + slack)[:, None])
    return np.asarray(
        structure.followed[rows, None] & in_range & (offset <= (4.0 * tol.SMOOTH_ERROR * span + slack)[:, None])
    )
