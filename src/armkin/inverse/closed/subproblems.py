"""The subproblems of all closed forms.

Angles are pairs of cosine and sine until the end: the algebra gives the pairs without inverse
functions, and they are enough to compute the residual of a branch.

The solutions of a subproblem are on branch axes of their own in front of the batch axis, as in shape (2, 2, 1, N), and
broadcast against quantities that do not depend on them. The argument `axis` chooses the axis (`signs`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Bool, Entry, Truth
from armkin.inverse.numeric import tolerances as tol


class Precision(NamedTuple):
    """Thresholds of `tolerances`, relative to the equation's own size, for the numbers that a formula is recorded for.

    A target counts as on an edge if it is so within the rounding of a pose: in float, the forward kinematics of a
    straight wrist give a pose some units of the last place beside the singular one.
    """

    tangent: float
    sharp: float
    one_root: float
    free: float
    nearly_free: float
    nearby: float  # largest squared residual of a possible branch


ULPS = 128 * 2.0**-23  # relative rounding of a float: a pose of six joints is off by ten to a hundred units
IN_DOUBLE = Precision(
    *(tol.TANGENT_DISCRIMINANT, tol.SHARP_DISCRIMINANT, tol.ONE_ROOT),
    *(tol.FREE_AMPLITUDE, tol.NEARLY_FREE_AMPLITUDE, tol.NEARBY**2),
)
IN_SINGLE = Precision(ULPS, ULPS**2, ULPS, ULPS**2, 4.0 * ULPS**2, ULPS**2)  # thresholds in single precision

_current = ContextVar("precision", default=IN_DOUBLE)


def precision() -> Precision:
    """Precision of the numbers that formulas are evaluated, or recorded, for."""
    return _current.get()


@contextmanager
def recorded_for(numbers: Precision) -> Iterator[None]:
    """Record the formulas inside for other numbers."""
    token = _current.set(numbers)
    try:
        yield
    finally:
        _current.reset(token)


class Pair(NamedTuple):
    """Cosine and sine of a joint's angle [rad], or the value [mm] of a prismatic joint and None."""

    c: Entry
    s: Any  # an Entry, or None for a prismatic joint


# The motion given to a joint that a target leaves free, or None.
Prefer = Sequence[Pair | None]
Conic = tuple[Entry, ...]  # a, b, u, v, w of the matrix [[a, b, u], [b, -a, v], [u, v, w]]; diag(1, 1, -1): circle


@dataclass(frozen=True, slots=True)
class Doubt:
    """Which branches are on an edge.

    edge: roots are about to merge, or a joint is free; free: a joint is free, so that the result holds for at most one
    of its values. Boolean entries, broadcastable to the branch axes.
    """

    edge: Bool
    free: Truth = False

    __array_ufunc__ = None  # an array on the left of | leaves it to this class

    def __or__(self, other: "Doubt | Bool") -> "Doubt":
        if isinstance(other, Doubt):
            return Doubt(self.edge | other.edge, self.free | other.free)
        return Doubt(self.edge | other, self.free)

    __ror__ = __or__

    def where(self, real: Truth) -> "Doubt":
        """This doubt, cleared where a branch is not real, as a free joint does not matter there."""
        return Doubt(self.edge & real, self.free & real)


class Candidates(NamedTuple):
    """The result of a closed form: candidate branches, some of which may be false.

    pairs: one a joint, on branch axes (b0, b1, b2, N). doubt: broadcastable to these. miss:
    squared residual of every branch (lengths in units of the reach), recomputed from the
    pairs, if the geometry has a shorter way than the whole chain; else None. angles: one a
    joint, its angle where the geometry knows it without an inverse function, else None.
    """

    pairs: list[Pair]
    doubt: Doubt
    miss: Entry | None = None
    angles: Sequence[Entry | None] = ()

    def values(self) -> list[Entry]:
        """Joint values [rad | mm]."""
        angles = self.angles or [None] * len(self.pairs)
        known = [c if s is None else angle for (c, s), angle in zip(self.pairs, angles, strict=True)]
        return [arrays.arctan2(s, c) if x is None else x for (c, s), x in zip(self.pairs, known, strict=True)]

    def reversed(self) -> "Candidates":
        """The candidates for the reversed chain."""
        return self._replace(pairs=self.pairs[::-1], angles=self.angles[::-1])


def walked_back(solve: Callable[[pose.Pose, Prefer], Candidates]) -> Callable[[pose.Pose, Prefer], Candidates]:
    """The closed form of an arm from that of its reversed chain."""
    return lambda goal, prefer: solve(pose.inverse(goal), prefer[::-1]).reversed()


def spin(c: Entry, s: Entry, v: Sequence[Entry]) -> list[Entry]:
    """``Rz(q) v``.

    >>> spin(0.0, 1.0, [2.0, 0.0, 5.0])
    [0.0, 2.0, 5.0]
    """
    x, y = v[0], v[1]
    return [arrays.sub(arrays.mul(c, x), arrays.mul(s, y)), arrays.add(arrays.mul(s, x), arrays.mul(c, y)), v[2]]


def distance2(u: Sequence[Entry], v: Sequence[Entry]) -> Entry:
    """Squared distance of two vectors."""
    total: Entry = 0.0
    for a, b in zip(u, v, strict=False):
        d = arrays.sub(a, b)
        total = arrays.add(total, d * d)
    return total


def signs(axis: int) -> Array:
    """[+1, -1] along branch axis 0, 1 or 2 of (b0, b1, b2, N)."""
    shape = [1, 1, 1, 1]
    shape[axis] = 2
    return np.array([1.0, -1.0]).reshape(shape)


def linear(
    a: Entry, b: Entry, c: Entry, axis: int, scale: Entry, prefer: Pair | None, disc: Entry | None = None,
    tangent: float | None = None,
) -> tuple[Pair, Doubt]:  # fmt: skip
    """Solve ``a cos(q) + b sin(q) = c`` for both roots (Siciliano et al., Robotics, eq. 2.A; IK-Geo subproblem 4).

    a, b, c: broadcastable entries; axis: the branch axis of the two roots; scale: the
    length that makes a and b dimensionless; prefer: the angle to give where the equation
    leaves it free, or None to do without (such targets are in doubt and looked at again); disc:
    ``a^2 + b^2 - c^2`` if the caller knows it without cancellation; tangent: of it, where roots are about to
    merge. Returns the pair and doubt: where the roots are about to merge or the angle is free.

    Without a real root the pair is that of the closest angle, not normalised; the caller finds by
    its residual that it is no solution, or normalises it where the residual would not show. Where a and b vanish and c
    does not there is none, whatever the angle.
    """
    sign = signs(axis)
    h2 = arrays.add(arrays.mul(a, a), arrays.mul(b, b))
    disc = h2 - c * c if disc is None else disc
    thresholds = precision()
    edge = arrays.absolute(disc) < (thresholds.tangent if tangent is None else tangent) * h2
    root = arrays.sqrt(arrays.maximum(disc, 0.0)) * sign
    least, nothing = thresholds.free * scale * scale, thresholds.nearly_free * scale * scale
    is_constant = isinstance(h2, float) and isinstance(least, float)
    inverse: Entry = 1.0 / (max(h2, least) if is_constant else arrays.maximum(h2, least))
    ci, ri = c * inverse, root * inverse
    cos = arrays.sub(arrays.mul(a, ci), arrays.mul(b, ri))
    sin = arrays.add(arrays.mul(b, ci), arrays.mul(a, ri))
    free, nearly = h2 < least, h2 < nothing
    pair = with_preferred(Pair(cos, sin), free, prefer)
    if np.any(nearly):
        has_roots = c * c < nothing
        free, nearly = free & has_roots, nearly & has_roots
    return pair, Doubt(edge | nearly, free)


def one_root(a: Entry, b: Entry, c: Entry) -> Entry:
    """``a^2 + b^2 - c^2`` for `linear`, zero where rounding alone parts the two roots."""
    h2 = arrays.add(arrays.mul(a, a), arrays.mul(b, b))
    disc = h2 - c * c
    return arrays.where(arrays.absolute(disc) < precision().one_root * h2, 0.0, disc)


def on_unit_circle(pair: Pair) -> Pair:
    """The pair on the unit circle: the closest angle where `linear` found no real root."""
    size = arrays.sqrt(arrays.maximum(pair.c * pair.c + pair.s * pair.s, tol.TINY))
    return Pair(pair.c / size, pair.s / size)


def rotation_between(
    ux: Entry, uy: Entry, vx: Entry, vy: Entry, scale: Entry, prefer: Pair | None, length2: Entry | None = None
) -> tuple[Pair, Doubt]:
    """The planar rotation that turns u's direction into v's (IK-Geo subproblem 1).

    length2: the product of the lengths of u and v, if the caller knows it, or their common square if the target is
    reached; the pair of another target is then not normalised.
    Returns the pair and doubt: where u or v vanishes, so that the angle is free.
    """
    thresholds = precision()
    least = thresholds.free * scale * scale
    if length2 is not None:
        free, nearly = length2 < least, length2 < thresholds.nearly_free * scale * scale
        inverse = 1.0 / arrays.maximum(length2, least)
        vx, vy = arrays.mul(inverse, vx), arrays.mul(inverse, vy)
    c = arrays.add(arrays.mul(ux, vx), arrays.mul(uy, vy))
    s = arrays.sub(arrays.mul(ux, vy), arrays.mul(uy, vx))
    if length2 is None:
        h2 = arrays.add(arrays.mul(c, c), arrays.mul(s, s))
        free, nearly = h2 < least * least, h2 < (thresholds.nearly_free * scale * scale) ** 2
        inverse = 1.0 / arrays.sqrt(arrays.maximum(h2, least * least))
        c, s = c * inverse, s * inverse
    return with_preferred(Pair(c, s), free, prefer), Doubt(nearly, free)


def with_preferred(pair: Pair, free: Bool, prefer: Pair | None) -> Pair:
    """The pair, with the preferred angle where it is free."""
    if prefer is None or not np.any(free):
        return pair
    return Pair(arrays.where(free, prefer.c, pair.c), arrays.where(free, prefer.s, pair.s))


def quadratic(
    a: Entry, b: Entry, c: Entry, axis: int, scale: Entry, least: Entry, prefer: Pair | None
) -> tuple[Entry, Doubt]:
    """Solve ``a d^2 + b d + c = 0`` for both roots d.

    scale: a length of the size of d; least: the size of c below which, if all three are, the equation says nothing;
    prefer: the d to give then. With d = scale tan(q/2) it is `linear`: where a vanishes its root goes to infinity.
    """
    a, b = arrays.mul(a, scale * scale), arrays.mul(b, scale)
    size = _absolute_sum((a, b, c))
    free = size < least
    inverse = 1.0 / arrays.maximum(size, least)
    a, b, c = a * inverse, b * inverse, c * inverse
    pair, doubt = linear(c - a, b, -(a + c), axis, 1.0, None)
    d = scale * half_tangent(pair)
    if prefer is not None and np.any(free):
        d = arrays.where(free, prefer.c, d)
    return d, doubt | Doubt(free, free)


def half_tangent(pair: Pair) -> Entry:
    """``tan(q/2)``, 1e9 where it is infinite, since inf would become nan later."""
    # s / (1 + c) = (1 - c) / s: the form without cancellation
    ahead = pair.c > 0.0
    below = arrays.where(ahead, 1.0 + pair.c, pair.s)
    above = arrays.where(ahead, pair.s, 1.0 - pair.c)
    far = arrays.absolute(below) < tol.AT_INFINITY
    return arrays.where(far, 1e9, above / arrays.where(far, 1.0, below))


def trig_quadratic(e: list[Entry], scale: Entry, prefer: Pair | None = None) -> tuple[Pair, Doubt]:
    """All real roots of ``e0 + ec c + es s + ecc c^2 + ecs c s + ess s^2 = 0``, c = cos q, s = sin q.

    e: [e0, ec, es, ecc, ecs, ess], entries (N,); scale: the size that they have; prefer: the angle to give where
    the equation holds for all. Returns the four roots on branch axes (2, 2, 1, N), and doubt: roots that touch,
    complex ones that miss the real line by less than `TOUCHING_DISTANCE`, or an equation that says nothing: one that
    vanishes or, as cos^2 + sin^2 - 1, does so on the circle. Without a real root the pair is
    that of the closest angle, not normalised, as in `linear`.

    The unit circle and a conic meet where the circle meets a pair of lines, a degenerate conic of
    the pencil of the two (Richter-Gebert, Perspectives on Projective Geometry, 11.4). The pencil's cubic
    always has a root between -sqrt(h) and sqrt(h), whose lines are real.
    """
    e0, ec, es, ecc, ecs, ess = e
    size = _absolute_sum((ecc, ess, e0, ec, es, ecs))
    inverse = 1.0 / arrays.maximum(size, tol.NO_SIZE * scale)
    a, b = 0.5 * (ecc - ess) * inverse, 0.5 * ecs * inverse
    u, v = 0.5 * ec * inverse, 0.5 * es * inverse
    conic = a, b, u, v, (e0 + 0.5 * (ecc + ess)) * inverse
    conic_size = _absolute_sum(conic)
    x, triple = _line_pair(conic)
    lines = _lines_of_conic(conic, x)
    lx, ly, lz = (arrays.where(signs(0) > 0.0, *entries) for entries in zip(*lines, strict=True))
    lx = lx + tol.UNDERFLOW  # a line at infinity has no direction
    h2 = lx * lx + ly * ly
    disc = h2 - lz * lz
    pair, _ = linear(lx, ly, -lz, 1, tol.UNDERFLOW_SQUARED, None, disc)
    real = disc > -(tol.TOUCHING_DISTANCE**2) * h2
    root, slope = _on_conic(pair, real, conic)
    touching = (disc < 0.0) & (-disc < tol.TOUCHING_DISTANCE**2 * h2)
    merging = (real & (arrays.absolute(slope) < tol.MERGING_SLOPE)) | touching
    free = conic_size * size < tol.NO_SIZE * scale
    return with_preferred(root, free, prefer), Doubt(merging | triple | free, free)


def _absolute_sum(values: Sequence[Entry]) -> Entry:
    total = abs(values[0])
    for value in values[1:]:
        total = arrays.add(total, abs(value))
    return total


def _lines_of_conic(conic: Conic, x: Entry) -> tuple[list[Entry], ...]:
    """The two lines lx cos q + ly sin q + lz = 0 that make up a conic plus x times the unit circle: (lx, ly, lz)."""
    a, b, u, v, w = conic
    M = [[x + a, b, u], [b, x - a, v], [u, v, w - x]]
    # M + [p] = l m^T, of rank one, with p p^T = -adj(M) (p is where the lines l and m meet)
    columns = [
        [v * v - M[1][1] * M[2][2], b * M[2][2] - u * v, u * M[1][1] - b * v],
        [b * M[2][2] - u * v, u * u - M[0][0] * M[2][2], M[0][0] * v - b * u],
        [u * M[1][1] - b * v, M[0][0] * v - b * u, b * b - M[0][0] * M[1][1]],
    ]
    squares = [columns[i][i] for i in range(3)]
    column = _longest_vector(squares, columns)
    largest = arrays.maximum(squares[0], arrays.maximum(squares[1], squares[2]))
    down = 1.0 / arrays.sqrt(arrays.maximum(largest, tol.ROUNDING))
    px, py, pz = (down * value for value in column)
    rows = [[M[0][0], b - pz, u + py], [b + pz, M[1][1], v - px], [u - py, v + px, M[2][2]]]
    flipped = [list(row) for row in zip(*rows, strict=True)]
    return tuple(_longest_vector([arrays.dot(v, v) for v in vectors], vectors) for vectors in (rows, flipped))


def _on_conic(pair: Pair, real: Truth, conic: Conic) -> tuple[Pair, Entry]:
    """Real roots after two Newton steps along the circle, and the slope there; see `trig_quadratic`."""
    (c, s), (a, b, u, v, w) = pair, conic
    for _ in range(2):
        value = w + 2.0 * (u * c + v * s) + a * (c * c - s * s) + 2.0 * b * c * s
        slope = 2.0 * (v * c - u * s) + 2.0 * b * (c * c - s * s) - 4.0 * a * c * s
        step = arrays.where(real, value * slope / (slope * slope + tol.NO_SLOPE), 0.0)
        step = arrays.minimum(arrays.maximum(step, -0.01), 0.01)
        c, s = c + s * step, s - c * step
        shorter = arrays.where(real, 1.0 / arrays.sqrt(arrays.maximum(c * c + s * s, 0.5)), 1.0)
        c, s = c * shorter, s * shorter
    return Pair(c, s), slope


def _line_pair(conic: Conic) -> tuple[Entry, Bool]:
    """The x in [-sqrt(h), sqrt(h)] farthest from being double for which the conic plus x times the circle degenerates.

    And whether it is about to be triple: the circle and the conic touch in three or four points at once.

    ``x^3 - w x^2 + (r - h) x + rest = 0`` with h = a^2 + b^2 and r = u^2 + v^2 is not positive at
    -sqrt(h) and not negative at sqrt(h).
    """
    a, b, u, v, w = conic
    h, r = a * a + b * b, u * u + v * v
    rest = w * h + a * (v * v - u * u) - 2.0 * b * u * v
    linear_ = r - h
    third = w / 3.0
    p = linear_ - w * third
    q = 0.5 * (rest + third * linear_ - 2.0 * third * third * third)
    p3 = p / 3.0
    disc = q * q + p3 * p3 * p3
    alone, most, least = _cubic_roots(p3, q, disc)
    # where two roots are double at an end, rounding must not choose the double one
    span = arrays.sqrt(h) + tol.NO_SIZE
    above = arrays.maximum(most + third - span, 0.0)
    below = arrays.maximum(-span - least - third, 0.0)
    # the middle root is -(most + least): the wider gap is at the largest if most + least > 0 ... and the reverse
    upper = (above < below) | ((above <= below) & (most + least > 0.0))
    x = third + arrays.where(disc > 0.0, alone, arrays.where(upper, most, least))
    for _ in range(2):
        value = ((x - w) * x + linear_) * x + rest
        slope = (3.0 * x - 2.0 * w) * x + linear_
        x = x - value * slope / (slope * slope + tol.NO_CUBIC_SLOPE)
    return x, arrays.absolute(slope) < tol.LEVEL_ROOT


def _cubic_roots(p: Entry, q: Entry, disc: Entry) -> tuple[Entry, Entry, Entry]:
    """Roots of x^3 + 3 p x + 2 q, disc = p^3 + q^2: the only one (Cardano), largest and smallest of three (Viete)."""
    root = arrays.sqrt(arrays.absolute(disc))
    A = arrays.cbrt(arrays.absolute(q) + root + tol.TINY)
    alone = arrays.copysign(A - p / A, -q)
    size = 2.0 * arrays.sqrt(arrays.maximum(-p, 0.0))
    c, s = arrays.cos_sin(arrays.arctan2(root, -q) / 3.0)
    return alone, size * c, -0.5 * size * (c + np.sqrt(3.0) * s)


def _longest_vector(sizes: Sequence[Entry], vectors: Sequence[Sequence[Entry]]) -> list[Entry]:
    """The one of three vectors with the largest size."""
    later = sizes[1] > sizes[0]
    size = arrays.maximum(sizes[0], sizes[1])
    last = sizes[2] > size
    return [arrays.where(last, z, arrays.where(later, y, x)) for x, y, z in zip(*vectors, strict=True)]
