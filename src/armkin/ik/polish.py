"""Newton and Levenberg-Marquardt on the full pose, for many candidates at once.

Candidates live in the last axis (structure of arrays): a frame is a (3, 4, M) block of its rotation's
columns and its origin, so that a constant link is one matrix product and a joint six vector operations.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

LARGEST_STEP = 0.5  # rad or scaled length: a longer Newton step leaves the region it was made for
CONVERGED = 3e-15  # a residual that further steps cannot be expected to lower


class Polished(NamedTuple):
    """What `refine` returns: ``q`` (M, 6), ``residual`` (M,) and ``weakness`` (M,) = |J^-1| there."""

    q: Array
    residual: Array
    weakness: Array


def turn(frame: Array, q: Array, prismatic: bool) -> Array:
    """``frame @ Z(q)`` for blocks (3, 4, M) and joint values (M,)."""
    out = np.empty_like(frame)
    if prismatic:
        out[:, :3] = frame[:, :3]
        out[:, 3] = frame[:, 3] + q * frame[:, 2]
        return out
    c, s = np.cos(q), np.sin(q)
    x, y = frame[:, 0], frame[:, 1]
    out[:, 0] = c * x + s * y
    out[:, 1] = c * y - s * x
    out[:, 2:] = frame[:, 2:]
    return out


def advance(frame: Array, link: Array) -> Array:
    """``frame @ link`` for blocks (3, 4, M) and one (4, 4) link, or one link a candidate (4, 4, M)."""
    if link.ndim == 2:
        return np.matmul(link.T, frame)
    return np.einsum("ikm,kjm->ijm", frame, link)


def pose_error(link: Array, prismatic: Bool, q: Array, goal: Array) -> tuple[Array, Array, Array]:
    """How far ``T(q)`` is from the goals, and the Jacobian there.

    Args:
        link: (7, 4, 4), scaled to about unit length.
        prismatic: (6,).
        q: (6, M).
        goal: (3, 4, M).

    Returns:
        error: (6, M), position and rotation vector that lead to the goal, linear rows first;
        size: (M,), the Frobenius norm of the pose difference;
        jacobian: (6, 6, M) in the base's axes.
    """
    n, count = q.shape
    axis, origin = np.empty((3, n, count)), np.empty((3, n, count))
    frame = np.repeat(link[0, :3, :, None], count, axis=2)
    for i in range(n):
        axis[:, i], origin[:, i] = frame[:, 2], frame[:, 3]
        frame = advance(turn(frame, q[i], bool(prismatic[i])), link[i + 1])
    difference = goal - frame
    size = np.sqrt(np.einsum("ijm,ijm->m", difference, difference))
    error = np.empty((6, count))
    error[:3] = difference[:, 3]
    jacobian = np.empty((6, n, count))
    arm = frame[:, 3][:, None] - origin
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        error[3 + i] = 0.5 * np.sum(frame[j, :3] * goal[k, :3] - frame[k, :3] * goal[j, :3], axis=0)
        jacobian[i] = axis[j] * arm[k] - axis[k] * arm[j]
    jacobian[3:] = axis
    for i in np.flatnonzero(prismatic):
        jacobian[:3, i], jacobian[3:, i] = axis[:, i], 0.0
    return error, size, jacobian


def _inverse(matrix: Array) -> Array:
    """Inverses of (M, k, k); exactly singular members are moved off by rounding-sized noise."""
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        noise = np.random.default_rng(0).standard_normal(matrix.shape[1:])
        return np.linalg.inv(matrix + 1e-13 * (1 + np.abs(matrix).max()) * noise)


def refine(
    link: Array, prismatic: Bool, q: Array, goal: Array, steps: int, damped: bool = False
) -> Polished:
    """Newton steps (Levenberg-Marquardt ones if ``damped``), keeping the best point met.

    Args:
        link, prismatic: the chain, scaled to about unit length.
        q: (M, 6) first guesses, scaled.
        goal: (M, 4, 4), scaled.
        steps: at most so many steps; candidates that have converged drop out.
        damped: damp all but the last two steps by the residual, for poor guesses and weak Jacobians.
    """
    value = np.ascontiguousarray(q.T)
    target = np.ascontiguousarray(np.moveaxis(goal[:, :3], 0, -1))
    best, residual = value.copy(), np.full(q.shape[0], np.inf)
    weakness = np.full(q.shape[0], np.inf)
    active = np.arange(q.shape[0])
    for step in range(steps + 1):
        error, size, jacobian = pose_error(link, prismatic, value, target)
        square = np.ascontiguousarray(np.moveaxis(jacobian, -1, 0))
        inverse = _inverse(square)
        better = size < residual[active]
        index = active[better]
        best[:, index], residual[index] = value[:, better], size[better]
        weakness[index] = np.sqrt(np.einsum("mij,mij->m", inverse, inverse))[better]
        going = np.flatnonzero(size > CONVERGED)
        if step == steps or going.size == 0:
            break
        if going.size < 0.7 * active.size:
            active, value, target = active[going], value[:, going], target[..., going]
            error, size, square, inverse = error[:, going], size[going], square[going], inverse[going]
        if damped and step < steps - 2:
            transposed = np.swapaxes(square, 1, 2)
            normal = np.matmul(transposed, square) + (size * np.minimum(size, 1.0))[:, None, None] * np.eye(6)
            inverse = np.matmul(_inverse(normal), transposed)
        move = np.matmul(inverse, error.T[:, :, None])[:, :, 0].T
        longest = np.abs(move).max(axis=0)
        value = value + move * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-300))
    return Polished(best.T, residual, weakness)


def polish(
    link: Array, prismatic: Bool, q: Array, T: Array, steps: int, damped: bool = False
) -> tuple[Array, Array]:
    """Move approximate solutions of a 6-joint chain onto their targets.

    Args:
        link: (7, 4, 4) the chain ``link[0] Z1(q1) link[1] ... Z6(q6) link[6]`` [mm].
        prismatic: (6,).
        q: (M, 6) first guesses [rad | mm].
        T: (M, 4, 4) targets [mm].
        steps: at most so many Newton steps.
        damped: Levenberg-Marquardt instead, for guesses that are far away or near a singularity.

    Returns:
        The best point met by each guess, (M, 6) [rad | mm, not wrapped], and its residual (M,): the
        Frobenius norm of the pose difference, lengths divided by the sum of the links' lengths.
    """
    length = reach(link)
    unit = np.where(prismatic, length, 1.0)
    found = refine(shrink(link, length), prismatic, q / unit, shrink(T, length), steps, damped)
    return found.q * unit, found.residual


def reach(link: Array) -> float:
    """Sum of the lengths of the links between and after the joints [mm], 300 if all are zero."""
    total = float(np.linalg.norm(link[1:, :3, 3], axis=1).sum())
    return total if total > 0 else 300.0


def shrink(motion: Array, length: float) -> Array:
    """Motions (..., 4, 4) with their translations divided by ``length``."""
    out = motion.copy()
    out[..., :3, 3] /= length
    return out
