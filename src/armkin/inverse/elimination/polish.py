"""Newton and Levenberg-Marquardt on the full pose, for many candidates at once.

Candidates live in the last axis (structure of arrays): a frame is a (3, 4, M) block of its rotation's
columns and its origin, so that a constant link is one matrix product and a joint six vector operations.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged

LARGEST_STEP = 0.5  # Newton step [rad, scaled length], at most: a longer one leaves the region it was made for
SLOW_STEPS = 3  # further Newton steps for candidates that are close but have not converged


class Polished(NamedTuple):
    """What `refine` returns.

    q: (M, 6) best points met.  residual: (M,) there, guess: (M,) at the start.
    weakness: (M,) Frobenius norm of the last inverse Jacobian, about 1 / its smallest singular value.
    """

    q: Array
    residual: Array
    guess: Array
    weakness: Array


def turn(frame: Array, q: Array, prismatic: bool) -> Array:
    """``frame @ Z(q)`` for blocks (3, 4, M) and joint values (M,)."""
    return _moved_frame(frame, q, np.cos(q), _with_both_signs(np.sin(q)), prismatic)


def _with_both_signs(sine: Array) -> Array:
    """Sines (..., M) as `_moved_frame` takes them: with both signs, (..., 2, M)."""
    both_signs = np.empty((*sine.shape[:-1], 2, sine.shape[-1]))
    both_signs[..., 0, :] = sine
    np.negative(sine, out=both_signs[..., 1, :])
    return both_signs


def _moved_frame(frame: Array, q: Array, cosine: Array, sine: Array, prismatic: bool) -> Array:
    """`turn` by angles of which the cosines (M,) and the sines with both signs (2, M) are known."""
    new_frame = np.empty_like(frame)
    if prismatic:
        new_frame[:, :3] = frame[:, :3]
        new_frame[:, 3] = frame[:, 3] + q * frame[:, 2]
        return new_frame
    np.multiply(frame[:, :2], cosine, out=new_frame[:, :2])
    new_frame[:, :2] += frame[:, 1::-1] * sine  # c x + s y, c y - s x
    new_frame[:, 2:] = frame[:, 2:]
    return new_frame


def advance(frame: Array, link: Array) -> Array:
    """``frame @ link`` for blocks (3, 4, M) and one (4, 4) link, or one link a candidate (4, 4, M)."""
    return np.asarray(np.matmul(link.T, frame) if link.ndim == 2 else np.einsum("ikm,kjm->ijm", frame, link))


def tip(link: Array, prismatic: Bool, q: Array) -> tuple[Array, Array]:
    """The last frame (3, 4, M) for joint values (n, M), and every joint's frame before it turns, (n, 3, 4, M)."""
    cosine, sine = np.cos(q), _with_both_signs(np.sin(q))
    joints = np.empty((q.shape[0], 3, 4, q.shape[1]))
    frame = np.repeat(link[0, :3, :, None], q.shape[1], axis=2)
    for i in range(q.shape[0]):
        joints[i] = frame
        frame = advance(_moved_frame(frame, q[i], cosine[i], sine[i], bool(prismatic[i])), link[i + 1])
    return frame, joints


def pose_error(frame: Array, goal: Array) -> tuple[Array, Array]:
    """What leads from frames (3, 4, M) to goals: (6, M) linear rows first; and the Frobenius norm (M,).

    The rotation vector is half the sum of the columns' cross products (Luh, Walker & Paul 1980).
    """
    difference = goal - frame
    error = np.empty((6, frame.shape[2]))
    error[:3] = difference[:, 3]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        error[3 + i] = 0.5 * (frame[j, :3] * goal[k, :3] - frame[k, :3] * goal[j, :3]).sum(axis=0)
    return error, np.sqrt(np.einsum("ijm,ijm->m", difference, difference))


def jacobian(frame: Array, joints: Array, prismatic: Bool) -> Array:
    """Jacobians (M, 6, n) in the base's axes, from the frames that `tip` returns."""
    axis, arm = joints[:, :, 2], frame[:, 3] - joints[:, :, 3]  # (n, 3, M)
    J = np.empty((frame.shape[2], 6, len(joints)))
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        J[:, x] = (axis[:, y] * arm[:, z] - axis[:, z] * arm[:, y]).T
    J[:, 3:] = axis.transpose(2, 1, 0)
    if prismatic.any():
        J[:, :3, prismatic], J[:, 3:, prismatic] = axis[prismatic].transpose(2, 1, 0), 0.0
    return J


def _damped_inverse(J: Array, size: Array) -> Array:
    """What gives Levenberg-Marquardt steps of Jacobians J (M, 6, 6), damped by what is missed (M,): (M, 6, 6)."""
    transposed, damping = np.swapaxes(J, 1, 2), size * np.minimum(size, 1.0)
    normal = np.matmul(transposed, J) + damping[:, None, None] * np.eye(6)
    return np.asarray(np.matmul(nudged(np.linalg.inv, normal), transposed))


def refine(link: Array, prismatic: Bool, q: Array, goal: Array, steps: int, damped: bool = False) -> Polished:
    """Newton steps (Levenberg-Marquardt ones if ``damped``), keeping the best point met.

    Args:
        link, prismatic: the chain, scaled to about unit length.
        q: (M, 6) first guesses, scaled.
        goal: (M, 4, 4), scaled.
        steps: at most so many, and `SLOW_STEPS` undamped ones on slow ways to an answer; what has converged drops out.
        damped: damp all but the last two steps by the residual, for poor guesses and weak Jacobians.
    """
    count = q.shape[0]
    value = np.ascontiguousarray(q.T)
    target = np.ascontiguousarray(goal[:, :3].transpose(1, 2, 0))
    best_q, residual = value.copy(), np.full(count, np.inf)
    weakness, inverse = np.full(count, np.inf), np.empty((count, 6, 6))
    active, last = np.arange(count), np.zeros(count)
    max_steps = steps if damped else steps + SLOW_STEPS
    for step in range(max_steps + 1):
        frame, joints = tip(link, prismatic, value)
        error, size = pose_error(frame, target)
        if step == 0:
            guess = size
        is_better = size < residual[active]
        index = active[is_better]
        best_q[:, index], residual[index] = value[:, is_better], size[is_better]
        # While the residual falls steeply the last inverse Jacobian is good for one more step.
        stale = np.flatnonzero((size > tol.STALE_SHARE * last) & (size > tol.CONVERGED)) if step else active
        last = size
        if stale.size:
            rows = slice(None) if stale.size == active.size else stale
            square = jacobian(frame[..., rows], joints[..., rows], prismatic)
            index = active[rows]
            inverse[index] = nudged(np.linalg.inv, square)
            weakness[index] = np.sqrt(np.einsum("mij,mij->m", inverse[index], inverse[index]))
            if damped and step < steps - 2:
                inverse[index] = _damped_inverse(square, size[rows])
        is_open = size > tol.CONVERGED if step < steps else (size > 10 * tol.CONVERGED) & (size < tol.SLOW_DISTANCE)
        pending = np.flatnonzero(is_open)
        if step == max_steps or pending.size == 0:
            break
        if pending.size < active.size:
            active, value, target = active[pending], value[:, pending], target[..., pending]
            error, last = error[:, pending], last[pending]
        move = np.matmul(inverse[active], error.T[:, :, None])[:, :, 0].T
        longest = np.abs(move).max(axis=0)
        move[:, ~np.isfinite(longest)] = 0.0  # the inverse of an all but singular Jacobian has overflown
        value = value + move * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, LARGEST_STEP))
    return Polished(best_q.T, residual, guess, weakness)
