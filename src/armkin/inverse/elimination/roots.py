"""The roots of a pose's pencil, and the six joint values that each of them stands for.

See `pencil` for the symbols.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.elimination import equal_roots, line_features
from armkin.inverse.elimination.end_joints import eliminate_ends
from armkin.inverse.elimination.pencil import Pencil
from armkin.inverse.elimination.polish import advance, turn
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.model.rotation import inverse

STEADY_ENTRY = 1e5  # size of a pencil's entries up to which its simple roots and their vectors are known well
ROUGH_ENTRY = 1e6  # size of a pencil's entries above which it is badly scaled
SINGULAR_ENTRY = 1e9  # size of a singular pencil's answer to a side that no arm is made for
DOUBLE_SLOPE = 1e3  # quotient of the sine between two roots' vectors and their distance, up to which they are one
_ANYWHERE: Array = np.random.default_rng(2).standard_normal(24)  # right-hand side that no arm is made for


class RootSeeds(NamedTuple):
    """Approximate real solutions of many poses, one row a candidate, poses ascending.

    pose: (M,) index of the pose.  q: (M, 6) joint values in the arm's order.  hidden: (M,) value of q_h.
    tilt: (M,) imaginary part of the root as an angle.  badly_scaled: (N,) poses whose pencil was badly scaled.
    defect: (M,) squared sine of the angle between the eigenvector and the product that a solution's is; 0 where slides
    move.  gap: (M,) distance from the pose's nearest other root but for a twin, see `_root_gaps`, as an angle; inf of a
    multiple root whose solutions are all known; 0 where the pencil is not well scaled.
    """

    pose: Int
    q: Array
    hidden: Array
    tilt: Array
    badly_scaled: Bool
    defect: Array
    gap: Array

    @property
    def torn(self) -> Bool:
        """(M,) What may be a part of a multiple root: rounding tears it apart and off the real line, but not far."""
        return (self.defect > tol.NO_PRODUCT) & (self.gap < tol.LONE_DISTANCE) & (self.tilt < tol.LONE_DISTANCE)


class _PencilRoots(NamedTuple):
    """Roots (M,) of poses, the number-th of each, as real x and tilt, and their vectors (M, size).

    multiple: (M,) of a multiple root, whose vectors are those of all that share it.
    """

    pose: Int
    number: Int
    x: Array
    tilt: Array
    u: Array
    multiple: Bool


def root_seeds(pencil: Pencil, X: Array, tolerance: float, part: bool = False) -> RootSeeds:
    """All roots of the pencil for the pose links ``X`` (N, 4, 4) whose tilt is below ``tolerance``.

    part: whether roots are taken apart that several solutions share.
    """
    Y = inverse(X) if pencil.role.backward else X
    equations, recover = _equations(pencil, Y)
    companion, badly_scaled, well_scaled = _companions(pencil, equations)
    roots, vectors = np.linalg.eig(companion)
    candidates = _nearly_real(roots, vectors, tolerance)
    if part and not pencil.prismatic[2:5].any():
        candidates = _part_equal_roots(pencil, candidates, vectors)
    middle, defect = _middle_joints(pencil, candidates.x, candidates.u)
    finite = np.flatnonzero((np.abs(middle) < tol.INFINITE_SLIDE).all(axis=0))
    if finite.size < len(defect):
        candidates, middle, defect = rows_of(candidates, finite), middle[:, finite], defect[finite]
    pose, index, _, tilt, _, multiple = candidates
    a, b, e = _other_joints(pencil, middle, Y, pose, recover)
    q = np.empty((pose.size, 6))
    for joint, value in zip(pencil.role.order, (a, b, *middle, e), strict=True):
        q[:, joint] = -value if pencil.role.backward else value
    gap = np.where(multiple & well_scaled[pose], np.inf, 0.0)
    doubtful = np.flatnonzero((defect > tol.NO_PRODUCT) & well_scaled[pose] & ~multiple)
    gap[doubtful] = _root_gaps(roots[pose[doubtful]], vectors[pose[doubtful]], index[doubtful])
    return RootSeeds(pose, q, middle[pencil.role.hidden], tilt, badly_scaled, defect, gap)


def _companions(pencil: Pencil, equations: Array) -> tuple[Array, Bool, Bool]:
    """Matrices (N, size, size) whose eigenvalues are the roots; whether they are badly scaled, and well (N,)."""
    lead = pencil.products
    count = equations.shape[2] - lead
    right = np.empty((len(equations), lead, count + 1))
    right[:, :, :count], right[:, :, count] = equations[:, :, lead:], _ANYWHERE[:lead]
    solution = nudged(np.linalg.solve, equations[:, :, :lead], right)
    G, side_answer = solution[:, :, :count], solution[:, :, count]
    size = np.abs(G).max(axis=(1, 2))
    # A singular pencil may hide itself: what it has in common on both sides cancels. No side of its own can.
    badly_scaled = (size > ROUGH_ENTRY) | (np.abs(side_answer).max(axis=1) > SINGULAR_ENTRY)
    r, w = pencil.K_re.shape[1], pencil.W.shape[1]
    companion = np.zeros((len(G), 2 * r + 2 * w, 2 * r + 2 * w))
    companion[:, :lead] = -G
    companion[:, lead:, 2 * r : lead] = np.eye(w)
    return companion, badly_scaled, size < STEADY_ENTRY


def _nearly_real(roots: NDArray[np.complex128], vectors: NDArray[np.complex128], tolerance: float) -> _PencilRoots:
    """The roots (N, size), with their vectors (N, size, size), whose tilt is below tolerance."""
    tilt = 2 * np.abs(roots.imag) / (1 + np.abs(roots) ** 2)
    pose, index = np.nonzero((roots.imag >= 0) & (tilt < tolerance))
    # LAPACK turns eigenvectors so that their largest entries are real: of roots that almost touch real parts are left
    x, u = roots[pose, index].real, vectors.real[pose, :, index]
    return _PencilRoots(pose, index, x, tilt[pose, index], u, np.zeros(len(pose), np.bool_))


def end_joints_follow(pencil: Pencil, X: Array, q: Array) -> Bool:
    """Whether the end joints of solutions q (M, 6) of pose links X (M, 4, 4) follow from their middle joints: (M,).

    Where they do not, solutions that differ in the end joints alone have one vector and count as one root.
    """
    Y = inverse(X) if pencil.role.backward else X
    sign = -1.0 if pencil.role.backward else 1.0
    part = sign * q[:, list(pencil.role.order)].T  # a, b, m1, m2, m3, e
    _, recover = eliminate_ends(pencil.ends, Y)
    a, b, e = _other_joints(pencil, part[2:5], Y, np.arange(len(q)), recover)
    change = np.stack([a, b, e]) - part[[0, 1, 5]]
    revolute = ~pencil.prismatic[[0, 1, 5]][:, None]
    return np.asarray((np.abs(np.where(revolute, np.angle(np.exp(1j * change)), change)) < tol.END_ERROR).all(axis=0))


def _part_equal_roots(pencil: Pencil, single: _PencilRoots, vectors: NDArray[np.complex128]) -> _PencilRoots:
    """The single roots, each that several solutions share with the vectors of these: see `equal_roots`."""
    count = len(single.pose)
    # rounding made a complex pair of some
    twin = np.flatnonzero((single.tilt > 0) & (single.tilt < tol.EQUAL_ROOTS))
    pose, index, x, tilt, u, multiple = (np.concatenate([part, part[twin]]) for part in single)
    u[count:] = vectors.imag[single.pose[twin], :, single.number[twin]]
    keep = np.arange(len(pose)) < count
    for rows in filter(len, equal_roots.groups(pose, x)):
        d = rows.shape[1]
        span = u[rows] / np.linalg.norm(u[rows], axis=2, keepdims=True)
        _, size, basis = np.linalg.svd(span, full_matrices=False)
        middle = np.repeat(x[rows].mean(axis=1), d)
        of_products = _vector(pencil, middle, basis.reshape(-1, basis.shape[2])).reshape(-1, d, 4, pencil.products // 4)
        weights, real, complete = equal_roots.products(of_products)
        complete &= size[:, -1] > tol.APART_VECTORS * size[:, 0]
        part = rows[complete].ravel()
        u[part] = (weights[complete] @ basis[complete]).reshape(len(part), u.shape[1])
        tilt[part], multiple[part], keep[part] = 0.0, True, real[complete].ravel()
    order = np.flatnonzero(keep)
    order = order[np.argsort(pose[order], kind="stable")]
    return _PencilRoots(pose[order], index[order], x[order], tilt[order], u[order], multiple[order])


def _root_gaps(roots: NDArray[np.complex128], vectors: NDArray[np.complex128], index: Int) -> Array:
    """Distance (M,) of one of each row's roots (M, size) from the others, on the sphere of complex numbers.

    Not from its twin, the other half of a double root that has one vector (M, size, size): rounding parts the two. Nor
    from that of a complex pair whose vectors point elsewhere: it is farther off the real line than rounding takes it.
    """
    if not index.size:
        return np.empty(0)
    size = 1 + np.abs(roots) ** 2
    row = np.arange(index.size)
    x, v = roots[row, index][:, None], vectors[row, :, index]
    distances = 2 * np.abs(roots - x) / np.sqrt(size * (1 + np.abs(x) ** 2))
    distances[row, index] = np.inf
    twin = distances.argmin(axis=1)
    gap = distances[row, twin]
    twin_vectors = vectors[row, :, twin]
    sine = np.linalg.norm(twin_vectors - v * (v.conj() * twin_vectors).sum(axis=1, keepdims=True), axis=1)
    double = (gap < tol.TWIN_ROOTS) & (sine < DOUBLE_SLOPE * gap)
    pair = (roots[row, twin] == x[:, 0].conj()) & (roots[row, index].imag != 0) & (sine * gap > tol.REAL_PAIR)
    distances[row, twin] = np.where(double | pair, np.inf, gap)
    return np.asarray(distances.min(axis=1))


def _equations(pencil: Pencil, Y: Array) -> tuple[Array, Array]:
    """The rows of (4), (N, p, c), and the factors (N or 1, 5, 15) of back substitution."""
    N, recover = eliminate_ends(pencil.ends, Y)
    if pencil.role.at_an_end:
        rows = N @ pencil.columns
    else:
        rows = pencil.left @ line_features.rep(Y)
        if pencil.right.size:
            rows = (rows @ pencil.right).reshape(Y.shape[0], -1, 27)
        rows = rows @ pencil.columns
    factors = 4 if pencil.role.wide else 2
    rows = rows.reshape(Y.shape[0], factors * rows.shape[1], -1)
    return (rows if pencil.mix is None else pencil.mix @ rows), recover


def _vector(pencil: Pencil, x: Array, u: Array) -> Array:
    """The products v, (M, 4, 3) or (M, 4, 4), of the roots x (M,) and the pencil's eigenvectors (M, size)."""
    r, w = pencil.K_re.shape[1], pencil.W.shape[1]
    a1, a2, y, low = np.split(u, (r, 2 * r, 2 * r + w), axis=1)
    x = x[:, None]
    large = np.abs(x) > 1
    w_vector = np.where(large, y / np.where(large, x, 1.0), low)  # y = x w: take the safer one
    v = w_vector @ pencil.W.T
    if r:
        square = x * x + 1
        v += ((a1 * x + a2) / square) @ pencil.K_re.T - ((a1 - a2 * x) / square) @ pencil.K_im.T
    return v.reshape(-1, 4, pencil.products // 4)


def _middle_joints(pencil: Pencil, x: Array, u: Array) -> tuple[Array, Array]:
    """Values (3, M) of m1, m2, m3 from the roots (M,) and the eigenvectors (M, size); and `RootSeeds.defect`."""
    v = _vector(pencil, x, u)
    row = np.arange(v.shape[0])
    size = v * v
    four = v[row, :, size.sum(axis=1).argmax(axis=1)]
    three = v[row, size.sum(axis=2).argmax(axis=1)]
    hidden, dialytic, third = (2 + i for i in (pencil.role.hidden, pencil.role.dialytic, pencil.role.third))
    value = np.empty((3, v.shape[0]))
    if pencil.prismatic[hidden]:
        value[pencil.role.hidden] = pencil.psi + 1 / np.where(np.abs(x) < tol.UNDERFLOW, tol.UNDERFLOW, x)
    else:
        value[pencil.role.hidden] = pencil.psi + 2 * np.arctan(x)
    value[pencil.role.dialytic] = _ratio(four) if pencil.prismatic[dialytic] else 2 * np.arctan2(four[:, 3], four[:, 2])
    if pencil.prismatic[third]:
        value[pencil.role.third] = _ratio(three)
    elif pencil.role.wide:
        value[pencil.role.third] = 2 * np.arctan2(three[:, 3], three[:, 2])
    else:
        sign = np.where(three[:, 0] < 0, -1.0, 1.0)
        value[pencil.role.third] = np.arctan2(sign * three[:, 2], sign * three[:, 1])
    if pencil.prismatic[dialytic] or pencil.prismatic[third]:
        return value, np.zeros(v.shape[0])
    k = value[pencil.role.third]
    third_powers = _half_powers(k) if pencil.role.wide else np.stack([np.ones_like(k), np.cos(k), np.sin(k)], axis=1)
    inner = (v * third_powers[:, None, :]).sum(axis=2)
    # a product's square is 2 x 2: of the powers of either joint, and of (1, cos, sin)
    projection = (inner * _half_powers(value[pencil.role.dialytic])).sum(axis=1) ** 2
    return value, np.maximum(1.0 - projection / (4.0 * np.maximum(size.sum(axis=(1, 2)), tol.TINY)), 0.0)


def _half_powers(q: Array) -> Array:
    """(cos 3f, sin 3f, cos f, sin f) of f = q/2: (M,) -> (M, 4)."""
    return np.stack([np.cos(1.5 * q), np.sin(1.5 * q), np.cos(0.5 * q), np.sin(0.5 * q)], axis=1)


def _ratio(powers: Array) -> Array:
    """q from multiples of (1, q, q^2, ..) (M, k): the least-squares quotient of neighbours."""
    below = powers[:, :-1]
    return np.asarray(np.sum(below * powers[:, 1:], axis=1) / np.maximum(np.sum(below * below, axis=1), tol.TINY))


def _other_joints(pencil: Pencil, middle: Array, Y: Array, pose: Int, recover: Array) -> tuple[Array, Array, Array]:
    """Values of a, b and e once the middle joints (3, M) are known."""
    links: list[Array] = list(pencil.links)
    links[pencil.role.slot] = np.ascontiguousarray(Y[pose].transpose(1, 2, 0))
    is_a, is_b = bool(pencil.prismatic[0]), bool(pencil.prismatic[1])
    start = np.repeat(np.eye(3, 4)[:, :, None], pose.size, axis=2)
    A = advance(start, links[1])
    for i in range(3):
        A = advance(turn(A, middle[i], bool(pencil.prismatic[2 + i])), links[2 + i])
    feature = line_features.features(A[:, 3].T, A[:, 2].T)
    factors = recover[pose] if recover.shape[0] > 1 else recover
    scale, b1, b2, a1, a2 = np.matmul(factors, feature[:, :, None])[:, :, 0].T
    sign = np.where(scale < 0, -1.0, 1.0)
    divisor = np.where(np.abs(scale) < tol.TINY, 1.0, scale)
    a = a1 / divisor if is_a else np.arctan2(sign * a2, sign * a1)
    b = b1 / divisor if is_b else np.arctan2(sign * b2, sign * b1)
    frame = turn(advance(turn(advance(start, links[5]), a, is_a), links[0]), b, is_b)
    # frame @ A = Je^-1, a turn by -e about z
    sine = np.sum(frame[0, :3] * A[:, 1] - frame[1, :3] * A[:, 0], axis=0)
    cosine = np.sum(frame[0, :3] * A[:, 0] + frame[1, :3] * A[:, 1], axis=0)
    return a, b, np.arctan2(sine, cosine)
