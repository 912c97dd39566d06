"""Three revolute and three prismatic joints in any order: the orientation first, then a linear system.

Prismatic joints do not turn anything.  With their links' rotations folded into their neighbours the
orientation is that of three revolute joints alone, A0 Rz(q1) A1 Rz(q2) A2 Rz(q3) A3 = R, hence for
B = A0^T R A3^T:

    (1)  e3^T A1 Rz(q2) A2 e3 = B33                    two values of q2
    (2)  Rz(q1) (A1 Rz(q2) A2 e3) = B e3               q1
    (3)  Rz(q3) = (Rz(q1) A1 Rz(q2) A2)^T B            q3

and the position is affine in the three prismatic values.  Both steps are closed forms, so both branches
are found; the pair is one where B33 is an extreme value of (1).

With u = e3^T A1, v = A2 e3 and b the first two entries of B e3, (1) is u3 v3 + k cos(q2 - phase) = B33, and
k^2 sin^2(q2 - phase) = |b|^2 (1 - v3^2) - (u3 - v3 B33)^2, which loses nothing where B e3 approaches e3. There
axes 1 and 3 are parallel and q1 is free: it gets a value at which the slides' directions are hardly ever coplanar.
Where these are coplanar, slides can move alone: of the values that place the tool those of least norm are given.
"""

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.model.rotation import joint_motion, rotation_about

FREE_ANGLE = 0.7321  # value [rad] at which a free joint is held
OTHER_ANGLES = (0.0, 1.3, 2.9)  # values [rad], beside FREE_ANGLE, at which the slides' directions are compared


def branches(chain: Array, prismatic: Bool, goal: Array) -> tuple[Array, Bool]:
    """Both solutions (N, 2, 6) of a chain (7, 4, 4) with three prismatic joints for goals (N, 4, 4).

    Unreachable orientations give the nearest value of q2; the caller checks the pose. Also whether they are all, (N,):
    not where joint 1 is free and the slides' directions turn with it, so that only some of its values may reach the
    goal, nor where the two values of q2 are one and these directions coplanar.
    """
    A = [np.eye(3)]
    for i in range(6):
        A[-1] = A[-1] @ chain[i, :3, :3]
        if not prismatic[i]:
            A.append(np.eye(3))
    A[-1] = A[-1] @ chain[6, :3, :3]
    B = A[0].T @ goal[:, :3, :3] @ A[3].T
    u, v = A[1][2], A[2][:, 2]
    k_cos, k_sin = u[0] * v[0] + u[1] * v[1], u[1] * v[0] - u[0] * v[1]
    b_norm = np.hypot(B[:, 0, 2], B[:, 1, 2])
    hypotenuse, leg = b_norm * np.hypot(v[0], v[1]), np.abs(u[2] - v[2] * B[:, 2, 2])
    square = (hypotenuse - leg) * (hypotenuse + leg)
    free = b_norm < tol.PARALLEL_SLIDES
    square[(square < tol.MERGED_SLIDES) & ~free] = 0.0
    half_angle = np.arctan2(np.sqrt(np.maximum(square, 0.0)), B[:, 2, 2] - u[2] * v[2])
    q2 = np.arctan2(k_sin, k_cos) + np.stack([half_angle, -half_angle], axis=1)
    middle = A[1] @ rotation_about(2, q2) @ A[2]
    q1 = np.arctan2(B[:, None, 1, 2], B[:, None, 0, 2]) - np.arctan2(middle[..., 1, 2], middle[..., 0, 2])
    q1[free] = FREE_ANGLE

    def solve(q1: Array, rows: Bool) -> tuple[Array, Array]:
        """Solutions (K, 2, 6) of some goals for values of q1 (K, 2), and the weakest of the slides' directions (K,)."""
        last = np.swapaxes(rotation_about(2, q1) @ middle[rows], -1, -2) @ B[rows, None]
        q3 = np.arctan2(last[..., 1, 0] - last[..., 0, 1], last[..., 0, 0] + last[..., 1, 1])
        return _with_slides(chain, prismatic, np.stack([q1, q2[rows], q3], axis=-1), goal[rows])

    q, weakest = solve(q1, np.ones(len(goal), bool))
    full = ~((square < tol.NEARLY_COPLANAR**2) & (weakest < tol.NEARLY_COPLANAR)) | free
    full[free] = weakest[free] > tol.NEARLY_COPLANAR
    for value in OTHER_ANGLES if free.any() else ():
        full[free] &= np.abs(solve(np.full_like(q1[free], value), free)[1] - weakest[free]) < tol.NEARLY_COPLANAR
    return q, full


def _with_slides(chain: Array, prismatic: Bool, revolute: Array, goal: Array) -> tuple[Array, Array]:
    """Joint values (N, 2, 6) from those that turn (N, 2, 3), and the slides' smallest singular value (N,)."""
    q = np.zeros((*revolute.shape[:2], 6))
    q[..., ~prismatic] = revolute
    frame = np.broadcast_to(chain[0], (*q.shape[:2], 4, 4))
    axes = []
    for i in range(6):
        if prismatic[i]:
            axes.append(frame[..., :3, 2])
            frame = frame @ chain[i + 1]
        else:
            frame = frame @ joint_motion(False, q[..., i]) @ chain[i + 1]
    offset = goal[:, None, :3, 3] - frame[..., :3, 3]
    # an explicit pseudoinverse would lose as many digits as the weakest direction has
    U, S, Vt = np.linalg.svd(np.stack(axes, axis=-1))
    components = np.swapaxes(U, -1, -2) @ offset[..., None]
    moves = np.divide(components, S[..., None], out=np.zeros_like(components), where=S[..., None] > tol.COPLANAR_VALUE)
    q[..., prismatic] = (np.swapaxes(Vt, -1, -2) @ moves)[..., 0]
    return q, S[..., -1].min(axis=1)
