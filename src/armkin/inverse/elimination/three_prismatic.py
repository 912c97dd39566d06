"""Three revolute and three prismatic joints in any order: the orientation first, then a linear system.

Prismatic joints do not turn anything.  With their links' rotations folded into their neighbours the
orientation is that of three revolute joints alone, A0 Rz(q1) A1 Rz(q2) A2 Rz(q3) A3 = R, hence for
B = A0^T R A3^T:

    (1)  e3^T A1 Rz(q2) A2 e3 = B33                    two values of q2
    (2)  Rz(q1) (A1 Rz(q2) A2 e3) = B e3               q1
    (3)  (e3^T A1 Rz(q2) A2) Rz(q3) = e3^T B           q3

and the position is affine in the three prismatic values.  Both steps are closed forms, so both branches
are found; the pair is one where B33 is an extreme value of (1).
"""

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.elimination.line_features import joint_motion


def branches(chain: Array, prismatic: Bool, goal: Array) -> Array:
    """Both solutions (N, 2, 6) of a chain (7, 4, 4) with three prismatic joints for goals (N, 4, 4).

    Unreachable orientations give the nearest value of q2; the caller checks the pose.
    """
    turning, sliding = np.flatnonzero(~prismatic), np.flatnonzero(prismatic)
    A = [np.eye(3)]
    for i in range(6):
        A[-1] = A[-1] @ chain[i, :3, :3]
        if not prismatic[i]:
            A.append(np.eye(3))
    A[-1] = A[-1] @ chain[6, :3, :3]
    B = A[0].T @ goal[:, :3, :3] @ A[3].T
    u, v = A[1][2], A[2][:, 2]
    even, odd = u[0] * v[0] + u[1] * v[1], u[1] * v[0] - u[0] * v[1]
    size = max(float(np.hypot(even, odd)), 1e-300)
    half = np.arccos(np.clip((B[:, 2, 2] - u[2] * v[2]) / size, -1, 1))
    q2 = np.arctan2(odd, even) + np.stack([half, -half], axis=1)
    c, s = np.cos(q2), np.sin(q2)
    Rz_v = np.stack([c * v[0] - s * v[1], s * v[0] + c * v[1], np.full_like(c, v[2])], axis=-1)
    u_Rz = np.stack([c * u[0] + s * u[1], c * u[1] - s * u[0], np.full_like(c, u[2])], axis=-1)
    left, right = Rz_v @ A[1].T, u_Rz @ A[2]
    q1 = np.arctan2(B[:, None, 1, 2], B[:, None, 0, 2]) - np.arctan2(left[..., 1], left[..., 0])
    q3 = np.arctan2(right[..., 1], right[..., 0]) - np.arctan2(B[:, None, 2, 1], B[:, None, 2, 0])
    q = np.zeros((goal.shape[0], 2, 6))
    q[..., turning] = np.stack([q1, q2, q3], axis=-1)
    frame = np.broadcast_to(chain[0], (*q.shape[:2], 4, 4))
    axes = []
    for i in range(6):
        if prismatic[i]:
            axes.append(frame[..., :3, 2])
            frame = frame @ chain[i + 1]
        else:
            frame = frame @ _turns(q[..., i]) @ chain[i + 1]
    rest = goal[:, None, :3, 3] - frame[..., :3, 3]
    q[..., sliding] = (np.linalg.pinv(np.stack(axes, axis=-1)) @ rest[..., None])[..., 0]
    return q


def _turns(q: Array) -> Array:
    """Rz(q) as (..., 4, 4)."""
    out = np.zeros((*q.shape, 4, 4)) + joint_motion(False, 0.0)
    out[..., 0, 0] = out[..., 1, 1] = np.cos(q)
    out[..., 1, 0] = np.sin(q)
    out[..., 0, 1] = -out[..., 1, 0]
    return out
