"""The residual along the lost direction: whether a posture is isolated, a boundary or on a self-motion manifold.

At a posture J = U S V'. Where one singular value is small, the joints move along the last right singular vector v; all
that the other directions can take away of the residual they take away (Lyapunov-Schmidt reduction; Golubitsky and
Schaeffer, Singularities and Groups in Bifurcation Theory, 1985, ch. VII). What is left is a number g(t), t being the
way along v, and a curve x(t). The component of the solution set is the interval of |g| <= SOLUTION around t = 0
(docs/solution.md).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
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
SIGNS = np.array([1.0, -1.0])[:, None, None]  # senses of a curve: both ways
BACK = 5  # steps, at most, back onto the curve
SERIES = 0.04  # distance [rad, reaches], at most, at which a series of second order is compared with g
EXPONENTS = np.arange(NODES)
POWERS_OF_POINTS = POINTS[:, None] ** EXPONENTS  # (points, NODES)
FINE_GRID = np.linspace(0.0, 1.0, 33)[:, None]  # parameters of a component at which its slope is compared
FINER_GRID = np.linspace(0.0, 1.0, 129)[:, None]  # parameters of an interval where a component ends, or between two


class Structure(NamedTuple):
    """What is known of M postures.

    known: (M,) whether the curve was followed far enough to tell. manifold, boundary: (M,) what the component is, if
    neither, an isolated root. joints: (M, n) those that move along a manifold. low, high: (M,) ends of the component
    along v, at most `span` (M,) away, as far as the polynomials hold. least, most: (M, n) how far the joints' ways go
    between these. followed: (M,) whether the polynomials hold so far. longer: (M,) how many times as long a span is
    likely to hold. alone: (M,) no other curve crosses within the span. v: (M, n). second: (M,) the second smallest
    singular value. x: (NODES, M, n) coefficients of the joints' ways [rad, reaches] in powers of t / span, g: (NODES,
    M, k) of the residual.
    """

    known: Bool
    manifold: Bool
    boundary: Bool
    joints: Bool
    low: Array
    high: Array
    span: Array
    least: Array
    most: Array
    followed: Bool
    longer: Array
    alone: Bool
    v: Array
    second: Array
    x: Array
    g: Array


class Side(NamedTuple):
    """Nodes of a span and where it begins, as shares of it; from values at these to coefficients of the powers; and how
    many times as long a span ahead is as exact."""

    node: Array
    to_powers: Array
    low: float
    gain: float


def local_structure(arm: Arm, task: Task, q: Array, target: Array, known: newton.Linear | None = None) -> Structure:
    """The structure at postures (M, n) that solve their targets (M, m) or (M, 4, 4); at least n numbers a target.

    known: the residuals there and the Jacobians' singular values, if they are.
    """
    M, n = q.shape
    linear = known or newton.Linear.linearise(arm, task, q, target)
    (r, U, S, V), curve = linear, _structure_of_jacobians(linear)
    rows = r.shape[1]
    if rows < n:
        return curve
    w, full, short = np.zeros((M, n)), curve.span.copy(), np.zeros(M, bool)
    if rows == n > 1:
        w = _second_order(arm, task, q, target, r, U, S, V, curve)
        # the first span is twice as long as the component is by its second order
        ends = 2.0 * np.maximum(-curve.low, curve.high)
        short = ~curve.known & (ends > 0.0) & (2.0 * ends < full) & (curve.second > tol.HIGH)
        curve.span[short], w[~short] = ends[short], 0.0
    left = np.flatnonzero(~curve.known)
    for _ in range(SHRINKS + 2):
        if not len(left):
            break
        stays = _follow(arm, task, q, target, U, V, w, curve, left, BOTH_WAYS)
        # where two directions are all but lost no shorter span helps; what leaves a span leaves shorter ones
        left = left[~curve.known[left] & (curve.second[left] > tol.HIGH) & (short[left] | ~stays)]
        span, bend = curve.span[left], BEND * curve.second[left]
        shorter = np.where(2.0 * bend < span, bend, span / SHRINK)
        curve.span[left] = np.where(short[left], full[left], shorter)
        short[left], w[left] = False, 0.0
    return curve


def stretch(arm: Arm, task: Task, q: Array, target: Array, span: Array, ahead: Array) -> Structure:
    """The curves through postures (M, n), the way that ahead (M, n) points, as far as span (M,)."""
    linear = newton.Linear.linearise(arm, task, q, target)
    linear.V[(linear.V[:, -1] * ahead).sum(axis=1) < 0.0, -1] *= -1.0
    curve = _structure_of_jacobians(linear)
    curve.span[...] = span
    _follow(arm, task, q, target, linear.U, linear.V, np.zeros(q.shape), curve, np.arange(len(q)), ONE_WAY)
    return curve


def _structure_of_jacobians(linear: newton.Linear) -> Structure:
    """What Jacobians alone tell of their M postures."""
    r, _, S, V = linear
    M, n = len(r), V.shape[2]
    known, manifold, boundary, followed, alone = np.zeros((5, M), bool)
    joints, (low, high), (least, most) = np.zeros((M, n), bool), np.zeros((2, M)), np.zeros((2, M, n))
    v, second, longer = V[:, -1], S[:, n - 2] if n > 1 else np.ones(M), np.ones(M)
    span, lost = 1.2 * tol.REACH / np.abs(v).max(axis=1), r.shape[1] - n + 1  # fewer joints leave more out of reach
    x, g = np.zeros((NODES, M, n)), np.zeros((NODES, M, max(lost, 1)))
    ends = low, high, span, least, most, followed, longer
    return Structure(known, manifold, boundary, joints, *ends, alone, v, second, x, g)


def leave_spans(arm: Arm, structure: Structure, rows: Int, q: Array, ahead: Array) -> tuple[Array, Array]:
    """Where curves through q (m, n), those of rows (m,), leave their spans, and the way there, (m, n).

    ahead: (m, n) which way they are followed. nan where a curve comes to an end before.
    """
    way = np.sign((structure.v[rows] * ahead).sum(axis=1))
    end = np.where(way > 0.0, structure.high[rows], -structure.low[rows])
    x = _values(structure.x[:, rows], np.multiply.outer([0.9, 1.0], way))
    open_ = (end >= structure.span[rows])[:, None]
    return np.where(open_, q + x[1] * radian_or_reach(arm), np.nan), x[1] - x[0]


def _follow(
    arm: Arm, task: Task, q: Array, target: Array, U: Array, V: Array, w: Array, curve: Structure, rows: Int, side: Side
) -> Bool:
    """Follow the curves of some postures as far as their spans, and write what those tell that stay at hand (m,)."""
    n = q.shape[1]
    span, u = curve.span[rows], U[rows, :, n - 1 :]
    stays, longer, alone, x, g = _polynomials(arm, task, q[rows], target[rows], u, V[rows, -1], w[rows], span, side)
    # Newton's method may have found another curve close by: then x(0) is not the posture
    slack = tol.SOLUTION / np.maximum(curve.second[rows], tol.TINY)
    stays &= np.abs(x[0]).max(axis=1) <= 4.0 * (tol.SMOOTH * span + slack)
    held, curve.longer[rows], curve.followed[rows] = rows[stays], np.where(stays, longer, FAILED_RATIO), stays
    if len(held):
        curve.x[:, held], curve.g[:, held], curve.alone[held] = x[:, stays], g[:, stays], alone[stays]
        _decide(curve, held, side)
    return stays


def _second_order(
    arm: Arm, task: Task, q: Array, target: Array, r: Array, U: Array, S: Array, V: Array, out: Structure
) -> Array:
    """Decide those whose curvature does: g = sigma t + b t^2 / 2, as far as that tells, at most `SERIES`.

    x(t) = v t + w t^2 / 2 keeps what the other directions reach to second order; b and w follow from differences
    close by, third from g at the ends, after steps back onto the curve; what these still miss is counted, too.
    Where sigma^2 > 2 SOLUTION |g''| as far as 2 SOLUTION / sigma, |g| passes `SOLUTION` there without a turn; where
    sigma^2 < 2 SOLUTION |g''| as far as 4 sqrt(SOLUTION / b), it turns before, and passes it on both sides.
    Returns w (M, n).
    """
    n, unit, span = arm.n, radian_or_reach(arm), out.span
    v, sigma = V[:, -1], S[:, -1]

    def both_ways(away: Array) -> Array:
        """The pose's way f (2, M, rows) along away (2, M, n), in directions of U."""
        ends = (q + away * unit).reshape(-1, n)
        goals = np.concatenate([target, target])
        f = r - newton.residuals(arm, task, ends, goals).reshape(2, *r.shape)
        return np.asarray((f[..., None] * U).sum(axis=2))

    along = both_ways(SIGNS * tol.FOLD_WAY * v).sum(axis=0) / tol.FOLD_WAY**2
    b, size = along[:, -1], np.maximum(np.abs(along[:, -1]), tol.TINY)
    inverse = V[:, :-1] / np.maximum(S[:, :-1], tol.WEAK)[:, :, None]
    w = -(inverse * along[:, :-1, None]).sum(axis=1)
    turning = sigma**2 < 2.0 * tol.SOLUTION * size
    h = np.where(turning, 4.0 * np.sqrt(tol.SOLUTION / size), 2.0 * tol.SOLUTION / np.maximum(sigma, tol.TINY))
    # what solves the target beside the curve must not pass for its ends
    may = (h <= SERIES) & ((r * r).sum(axis=1) < tol.CLOSED**2) & (S[:, -2] * h > 4.0 * tol.SOLUTION)
    h = np.minimum(h, SERIES)
    more, before = np.zeros((2, *v.shape)), np.inf
    for _ in range(BACK):
        if not may.any():
            break
        rest = both_ways(0.5 * (h * h)[:, None] * w + SIGNS * h[:, None] * v + more)
        g, off = rest[:, :, -1], np.linalg.norm(rest[:, :, :-1], axis=2).max(axis=0) / np.maximum(S[:, -2], tol.TINY)
        cubic = np.abs(0.5 * (g[0] - g[1]) - sigma * h)
        quartic = np.abs(0.5 * (g[0] + g[1]) - 0.5 * b * h**2) + n * h * off
        change = (6.0 * cubic + 12.0 * quartic) / h**2  # of g'', at most
        turns = turning & (change < 0.2 * size) & (sigma**2 < 2.0 * tol.SOLUTION * (size - change))
        alone = ~turning & (sigma**2 > 2.0 * tol.SOLUTION * (size + change))
        bent = 0.5 * h**2 * np.linalg.norm(w, axis=1) + np.linalg.norm(more, axis=2).max(axis=0) + off
        new = may & (turns | alone) & (bent < 0.1 * h)
        out.followed[new], out.known[new], out.boundary[new] = True, True, turns[new]
        may &= ~new & (off < 0.5 * before)  # the next step must come closer to tell more
        before, more = off, more - (inverse * rest[:, :, :-1, None]).sum(axis=2)
    # where |g| is `SOLUTION` first: with the sign of b; and against it, or beyond the turn
    ahead = 2.0 * tol.SOLUTION / (sigma + np.sqrt(sigma**2 + 2.0 * tol.SOLUTION * size))
    rest = np.sqrt(np.maximum(sigma**2 - 2.0 * tol.SOLUTION * size, 0.0))
    beyond = 2.0 * tol.SOLUTION / np.maximum(sigma + rest, tol.TINY)
    back = np.where(turning, ahead + 2.0 * sigma / size, beyond)
    out.low[...], out.high[...] = np.where(b > 0.0, [-back, ahead], [-ahead, back])
    out.x[1], out.x[2] = v * span[:, None], 0.5 * w * (span**2)[:, None]
    out.g[1, :, 0], out.g[2, :, 0] = sigma * span, 0.5 * b * span**2
    return np.asarray(w)


def _polynomials(
    arm: Arm, task: Task, q: Array, target: Array, u: Array, v: Array, w: Array, span: Array, side: Side
) -> tuple[Bool, Array, Bool, Array, Array]:
    """Which curves (M,) stay at hand as far as their spans, how many times as long spans they may (M,), on which of
    these no other crosses, and coefficients of x (NODES, M, n) and g (NODES, M, k).

    q: (M, n) where they begin, along v (M, n); u: (M, rows, k) directions out of reach; w: (M, n) the second
    derivative, as far as it is known; span: (M,).
    """
    n, rows = q.shape[1], u.shape[1]
    on, x, along_u, inverse = _nodes(arm, task, q, target, u, v, w, span, side)
    # along the curve u turns: the inverse's last rows span what no motion across v reaches there
    g = _least_residual(inverse[:, :, n:, :rows], along_u)
    values = np.concatenate([x, g], axis=2)
    # the polynomials are exact on the span if the last coefficients of their Chebyshev series are small
    last = np.abs(np.tensordot(TO_LAST, values, axes=1)).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.maximum(last[:, :n].max(axis=1) / (tol.SMOOTH * span), last[:, n:].max(axis=1) / (0.01 * tol.SOLUTION))
        # the last coefficients grow with the span to that power
        longer = side.gain * np.minimum(0.9 * off ** (1.0 / (2 - NODES)), MAX_RATIO) - USED_SHARE
        on &= off < 1.0
    power = np.tensordot(side.to_powers, values, axes=1)
    alone = _crossed_by_none(inverse, np.multiply.outer(-np.diff(side.node), span))
    return np.asarray(on), longer, alone, power[:, :, :n], power[:, :, n:]


def _nodes(
    arm: Arm, task: Task, q: Array, target: Array, u: Array, v: Array, w: Array, span: Array, side: Side
) -> tuple[Bool, Array, Array, Array]:
    """Nodes of the curves of `_polynomials`: which curves (M,) have all of them, the joints' ways (NODES, M, n),
    the residual along u (NODES, M, k), and the inverses of the bordered Jacobians.

    Each is Newton's method on the Jacobian bordered by u and v (Keller, Numerical solution of bifurcation problems,
    1977).
    """
    M, n = q.shape
    rows, k = u.shape[1:]
    t, unit = np.multiply.outer(side.node, span)[:, :, None], radian_or_reach(arm)
    x = t * (v + 0.5 * t * w)
    inverse, along_u = np.empty((NODES, M, rows + 1, rows + 1)), np.empty((NODES, M, k))
    bordered = np.zeros(inverse.shape)
    bordered[:, :, :rows, n:], bordered[:, :, rows, :n] = u, v
    # what does not fall to half of the last step from one to the next leads to no curve, or to another one
    on, going = np.zeros(M, bool), np.arange(M)
    before, most = np.zeros(M), span.copy()
    for _ in range(ITERATIONS):
        part = going if len(going) < M else slice(None)  # numbers cost copies
        at, goal = x[:, part], np.concatenate([target[part]] * NODES)
        r, J = newton.scaled(arm, task, (q[part] + at * unit).reshape(-1, n), goal)
        matrix = bordered[:, part]
        matrix[:, :, :rows, :n] = J.reshape(NODES, -1, rows, n)
        ahead = t[:, part] - (v[part] * at).sum(axis=2, keepdims=True)
        last = newton.nudged(np.linalg.inv, matrix.reshape(-1, rows + 1, rows + 1)).reshape(matrix.shape)
        step = (last @ np.concatenate([r.reshape(NODES, -1, rows), ahead], axis=2)[..., None])[..., 0]
        x[:, part], along_u[:, part], inverse[:, part] = at + step[:, :, :n], step[:, :, n:], last
        size = np.abs(step[:, :, :n]).max(axis=(0, 2))
        # the next step is about as many times smaller than this as this one's square than the last one's
        done = (size < tol.ARRIVED) | (size**3 < tol.ERROR * before[part] ** 2)
        near = (np.abs(x[:, part]).max(axis=2) < 3.0 * np.abs(t[:, part, 0])).all(axis=0) & (size < most[part])
        on[part], most[part], before[part] = done & near, 0.5 * size, size
        going = going[~done & near]
        if not len(going):
            break
    return on, x, along_u, inverse


def _crossed_by_none(inverse: Array, apart: Array) -> Bool:
    """Which curves (M,) no other one crosses within their spans.

    A crossing is a zero of the bordered Jacobian's smallest singular value, which no two nodes are as close to as it
    changes between any two; inverse: of these Jacobians at the nodes, which are apart (NODES - 1, M).
    """
    weakest = 1.0 / np.sqrt((inverse * inverse).sum(axis=(2, 3)))
    steepest = (np.abs(np.diff(weakest, axis=0)) / apart).max(axis=0)
    return np.asarray((weakest[1:] + weakest[:-1] > 2.0 * steepest * apart).all(axis=0))


def _least_residual(across: Array, left: Array) -> Array:
    """Vectors (..., k) as long as the least residual on the hyperplanes across v: it along across (..., k, rows)."""
    if left.shape[-1] == 1:
        return np.asarray(left / np.linalg.norm(across, axis=-1))
    L = np.asarray(np.linalg.cholesky(across @ across.swapaxes(-1, -2)), float).reshape(-1, *across.shape[-2:-1] * 2)
    return newton.nudged(np.linalg.solve, L, left.reshape(len(L), -1, 1)).reshape(left.shape)


_FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(NODE, NODES - 1))
_POWERS = np.array([
    np.pad(np.polynomial.chebyshev.cheb2poly([0.0] * k + [1.0]), (0, NODES))[:NODES] for k in range(NODES)
]).T  # fmt: skip
_SHIFT = np.array([np.pad(np.polynomial.polynomial.polypow([-1.0, 2.0], k), (0, NODES - 1 - k)) for k in range(NODES)])
BOTH_WAYS = Side(NODE, _POWERS @ _FIT, -1.0, 1.32)
ONE_WAY = Side(0.5 * (NODE + 1.0), _SHIFT.T @ _POWERS @ _FIT, 0.0, 1.0)
TO_LAST = _FIT[-2:]


def _values(coefficients: Array, s: Array) -> Array:
    """Polynomials (NODES, M, k) at s (..., M): (..., M, k), Horner's way."""
    values, s = np.zeros((*s.shape, coefficients.shape[2])), s[..., None]
    for c in coefficients[::-1]:
        values *= s
        values += c
    return values


def _ends_of_components(g: Array, side: Side) -> tuple[Array, Bool]:
    """Where |g| (NODES, M, k) first exceeds `SOLUTION` [spans], and whether: (1, M) ahead, or (2, M) both ways."""
    M = g.shape[1]
    if side.low < 0.0:
        g = np.concatenate([g * ((-1.0) ** EXPONENTS)[:, None, None], g], axis=1)
    shares, ends = np.ones(g.shape[1]), np.zeros(g.shape[1], bool)
    # the sum of the coefficients' sizes bounds the polynomial on all of the span
    rows = np.flatnonzero(np.linalg.norm(np.abs(g).sum(axis=0), axis=1) > tol.SOLUTION)
    over: Bool = np.linalg.norm(np.tensordot(POWERS_OF_POINTS, g[:, rows], axes=1), axis=2) > tol.SOLUTION
    first, passes = over.argmax(axis=0), over.any(axis=0)
    rows, first = rows[passes], first[passes]
    ends[rows] = True
    low, high = POINTS[np.maximum(first - 1, 0)], POINTS[first]
    for _ in range(2 if len(rows) else 0):
        between = low + FINER_GRID * (high - low)
        beyond = np.linalg.norm(_values(g[:, rows], between[1:]), axis=2) > tol.SOLUTION
        beyond[-1] = True
        first = beyond.argmax(axis=0)
        low, high = between[first, np.arange(len(rows))], between[first + 1, np.arange(len(rows))]
    shares[rows] = low
    return shares.reshape(-1, M), ends.reshape(-1, M)


def _decide(curve: Structure, rows: Int, side: Side) -> None:
    """Write what the polynomials of some postures tell: of a component that leaves a shortened span, nothing."""
    g, x, span = curve.g[:, rows], curve.x[:, rows], curve.span[rows]
    shares, ends = _ends_of_components(g, side)
    low, high = side.low * shares[0], shares[-1]
    s = low + FINE_GRID * (high - low)  # (points, M)
    way = _values(x, s)
    curve.least[rows], curve.most[rows] = way.min(axis=0), way.max(axis=0)
    extent = curve.most[rows] - curve.least[rows]
    long = extent.max(axis=1) >= tol.REACH
    curve.known[rows], curve.manifold[rows], short = long | ends.all(axis=0), long, np.flatnonzero(~long)
    if len(short):
        slope = _values(g[1:, short] * np.arange(1, NODES)[:, None, None], s[:, short]) / span[short, None]
        steepest = np.linalg.norm(slope, axis=2).argmax(axis=0)
        up = slope[steepest, np.arange(len(short))]
        along = (slope * up).sum(axis=2) / np.maximum(np.linalg.norm(up, axis=1), tol.TINY)
        curve.boundary[rows[short]] = along.min(axis=0) <= tol.SOLUTION
    curve.joints[rows] = long[:, None] & (extent > tol.MOVED * extent.max(axis=1)[:, None])
    curve.low[rows], curve.high[rows] = low * span, high * span


def members(structure: Structure, rows: Int, way: Array) -> Bool:
    """Which postures, way (m, M, n) [rad, reaches] from those of rows (m,), lie on their components: (m, M).

    As far as the curve is known; one that solves its target lies as close to it as the directions that are not lost
    let it.
    """
    t = (way * structure.v[rows, None]).sum(axis=2)  # (m, M)
    span, slack = structure.span[rows], 4.0 * tol.SOLUTION / structure.second[rows]
    x = _values(structure.x[:, rows], np.clip(t / span[:, None], -1.0, 1.0).T).swapaxes(0, 1)
    beside = np.abs(way - x).max(axis=2)
    inside = (t >= (structure.low[rows] - slack)[:, None]) & (t <= (structure.high[rows] + slack)[:, None])
    return np.asarray(structure.followed[rows, None] & inside & (beside <= (4.0 * tol.SMOOTH * span + slack)[:, None]))
