"""Solutions that share the hidden joint: their root is multiple, and its vectors are any mixtures of theirs.

A solution's vector is a product of (cos 3f, sin 3f, cos f, sin f) with the same of another joint or with
(1, cos k, sin k), see `pencil`. In (c^3, c^2 s, c s^2, s^3) of c = cos f, s = sin f, the last three entries are
tan f times the first three, so that the mixtures' last entries are a matrix times their first ones, whose eigenvectors
mix the solutions back and whose eigenvalues are tan f: the rotational invariance of ESPRIT (Roy & Kailath 1989).
"""

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol

# (cos 3f, sin 3f, cos f, sin f) to (c^3, c^2 s, c s^2, s^3) of c = cos f, s = sin f
_CUBIC: Array = 0.25 * np.array([[1, 0, 3, 0], [0, 1, 0, 1], [-1, 0, 1, 0], [0, -1, 0, 3]], dtype=float)
_SHIFT_ANGLE = 0.4137  # angle [rad] by which f is turned: no joint stands where tan f is infinite then
_SECOND = 0.6180  # weight of the second joint: solutions that have the first one alike are told apart by it


def groups(pose: Int, x: Array) -> list[Int]:
    """Rows of candidates whose roots x are equal, and close to no other, (G, d) for each number d > 1 of them."""
    angle = 2 * np.arctan(x)
    order = np.lexsort((angle, pose))
    gaps = np.where(np.diff(pose[order]) == 0, np.diff(angle[order]), np.inf)
    gaps = np.concatenate([[np.inf], gaps, [np.inf]])[: len(pose) + 1]
    first = np.flatnonzero(gaps[:-1] >= tol.EQUAL_ROOTS)
    size = np.diff(np.append(first, len(pose)))
    isolated = (gaps[first] > tol.TWIN_ROOTS) & (gaps[first + size] > tol.TWIN_ROOTS)
    return [order[first[isolated & (size == d)][:, None] + np.arange(d)] for d in np.unique(size[size > 1]).tolist()]


def products(v: Array) -> tuple[Array, Bool, Bool]:
    """Products among mixtures v (G, d, 4, 3 or 4), orthonormal in the pencil's own vectors, whose linear maps they are:

    weights (G, d, d), a row for each vector that may be a product; (G, d) which are real; (G,) whether these are all.
    """
    cubic = np.einsum("ij,gdjk->gdik", _CUBIC, v)
    first, first_fit = _quotient(cubic[:, :, :3], cubic[:, :, 1:])
    if v.shape[3] == 4:
        cubic = np.einsum("ij,gdkj->gdik", _CUBIC, v)
        second, second_fit = _quotient(cubic[:, :, :3], cubic[:, :, 1:])
    else:  # (1 + cos, sin) and (sin, 1 - cos): tan k/2 leads from one to the other
        unit, cosine, sine = np.moveaxis(v, 3, 0)
        second, second_fit = _quotient(np.stack([unit + cosine, sine], axis=2), np.stack([sine, unit - cosine], axis=2))
    complete = first_fit & second_fit
    tangent, vectors = np.linalg.eig(np.where(complete[:, None, None], first + _SECOND * second, np.eye(v.shape[1])))
    slant = np.abs(tangent.imag) / (1 + np.abs(tangent) ** 2)
    separation = np.abs(tangent[:, :, None] - tangent[:, None, :]) + np.eye(v.shape[1])
    complete &= (separation > tol.UPRIGHT).all(axis=(1, 2)) & ~((slant > 0) & (slant < tol.UPRIGHT)).any(axis=1)
    return np.ascontiguousarray(vectors.real.swapaxes(1, 2)), np.asarray(slant == 0), np.asarray(complete)


def _quotient(low: Array, high: Array) -> tuple[Array, Bool]:
    """X' (G, d, d) of high = X low for mixtures' rows (G, d, ...) turned by `_SHIFT_ANGLE`; whether X is determined."""
    shape = (*low.shape[:2], low.shape[2] * low.shape[3])
    c, s = np.cos(_SHIFT_ANGLE), np.sin(_SHIFT_ANGLE)
    base, shifted = (c * low - s * high).reshape(shape), (s * low + c * high).reshape(shape)
    square = base @ base.swapaxes(1, 2)
    size = np.linalg.eigvalsh(square)
    full_rank = size[:, 0] > tol.APART_VECTORS**2 * size[:, -1]
    square = np.where(full_rank[:, None, None], square, np.eye(low.shape[1]))
    return np.linalg.solve(square, base @ shifted.swapaxes(1, 2)), full_rank
