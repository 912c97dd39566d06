"""Rotations as matrices, roll, pitch, yaw and quaternions; rigid transforms."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from armkin.formula.arrays import Array

BLOCK_ROWS = 2_048  # rows computed together, so that their arrays fit the cache
SMALL_TURN = 1e-8  # largest difference of a small rotation's trace from 3
HALF_TURN = 1e-6  # a rotation by nearly half a turn has a smaller sine
LEAST_DIVISOR = 1e-300  # keeps quotients finite
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # half a turn about x, which reverses a joint's axis by conjugation


def rpy(R: ArrayLike) -> Array:
    """Roll, pitch, yaw of rotations: R = Rz(yaw) Ry(pitch) Rx(roll).

    R: (..., 3, 3). Returns (..., 3) [rad], pitch in [-pi/2, pi/2]. If the pitch is a quarter turn, only
    yaw - roll or yaw + roll is determined, and roll is set to 0 (Craig, Introduction to Robotics, eq. 2.67).

    >>> rpy([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).round(6).tolist()
    [0.0, 0.0, 1.570796]
    """
    R = np.asarray(R, dtype=float)
    cos_pitch = np.hypot(R[..., 0, 0], R[..., 1, 0])
    pitch = np.arctan2(-R[..., 2, 0], cos_pitch)
    # below 1e-9, roll and yaw would be rounding noise
    is_singular = cos_pitch < 1e-9
    roll = np.where(is_singular, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(is_singular, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1) + 0.0  # no negative zeros


def quaternion(R: ArrayLike) -> Array:
    """Unit quaternions w, x, y, z of rotations, w >= 0.

    R: (..., 3, 3). Returns (..., 4). The largest of the four components comes from the diagonal and
    divides the others, so that no digits are lost near half a turn (Shepperd, Quaternion from rotation
    matrix, 1978).

    >>> quaternion([[1, 0, 0], [0, -1, 0], [0, 0, -1]]).tolist()
    [0.0, 1.0, 0.0, 0.0]
    """
    R = np.asarray(R, dtype=float)
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, yz, zx = R[..., 0, 1] + R[..., 1, 0], R[..., 1, 2] + R[..., 2, 1], R[..., 2, 0] + R[..., 0, 2]
    # 4 q q^T: each row is the quaternion times one of its own components
    outer_products = np.stack(
        [
            np.stack([1 + xx + yy + zz, x, y, z], axis=-1),
            np.stack([x, 1 + xx - yy - zz, xy, zx], axis=-1),
            np.stack([y, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([z, zx, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.einsum("...ii->...i", outer_products), axis=-1)
    row = np.take_along_axis(outer_products, largest[..., None, None], axis=-2)[..., 0, :]
    row = row * np.where(row[..., :1] < 0, -1.0, 1.0)
    return np.asarray(row / np.linalg.norm(row, axis=-1, keepdims=True) + 0.0)


def rotation_about(axis: int, angle: ArrayLike) -> Array:
    """Rotations (..., 3, 3) by angles (...) [rad] about the x, y or z axis (0, 1, 2).

    >>> rotation_about(2, np.pi / 2).round(6).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((*np.shape(angle), 3, 3)) + np.eye(3)
    R[..., i, i] = R[..., j, j] = np.cos(angle)
    R[..., i, j], R[..., j, i] = -np.sin(angle), np.sin(angle)
    return R


def joint_motion(prismatic: bool, q: ArrayLike) -> Array:
    """The motion Z(q) (..., 4, 4): turns by q (...) [rad] about z, or shifts by q along z."""
    Z = np.zeros((*np.shape(q), 4, 4)) + np.eye(4)
    if prismatic:
        Z[..., 2, 3] = q
    else:
        Z[..., :3, :3] = rotation_about(2, q)
    return Z


def shrink_translations(motion: Array, length: float) -> Array:
    """Motions (..., 4, 4) with their translations divided by a length."""
    motions = np.array(motion, float)
    motions[..., :3, 3] /= length
    return motions


def inverse(T: Array) -> Array:
    """Inverse of rigid transforms (..., 4, 4)."""
    inverses = np.zeros(T.shape)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    inverses[..., :3, :3] = Rt
    inverses[..., :3, 3] = -(Rt @ T[..., :3, 3:])[..., 0]
    inverses[..., 3, 3] = 1.0
    return inverses


def transform(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """4 x 4 transform from a position [mm] and roll, pitch, yaw [deg]: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = cos_sin_deg(rpy[0])
    cp, sp = cos_sin_deg(rpy[1])
    cy, sy = cos_sin_deg(rpy[2])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def transforms(xyz: Array, rpy: Array) -> Array:
    """The `transform` of each row, with identical results: (..., 3) [mm], (..., 3) [deg] -> (..., 4, 4)."""
    matrices = np.zeros((*xyz.shape[:-1], 4, 4))
    all_rows, positions, angles = matrices.reshape(-1, 4, 4), xyz.reshape(-1, 3), rpy.reshape(-1, 3)
    for start in range(0, len(all_rows), BLOCK_ROWS):
        block = slice(start, start + BLOCK_ROWS)
        T = all_rows[block]
        (cr, cp, cy), (sr, sp, sy) = _cos_sin_deg(np.ascontiguousarray(angles[block].T))
        cysp, sysp = cy * sp, sy * sp
        T[:, 0, 0], T[:, 0, 1], T[:, 0, 2] = cy * cp, cysp * sr - sy * cr, cysp * cr + sy * sr
        T[:, 1, 0], T[:, 1, 1], T[:, 1, 2] = sy * cp, sysp * sr + cy * cr, sysp * cr - cy * sr
        T[:, 2, 0], T[:, 2, 1], T[:, 2, 2] = -sp, cp * sr, cp * cr
        T[:, :3, 3], T[:, 3, 3] = positions[block], 1.0
    return matrices


def _cos_sin_deg(angles: Array) -> tuple[Array, Array]:
    """`cos_sin_deg` of arrays, through the C library, as numpy's functions differ in the last bit."""
    exponent = np.zeros(angles.shape, complex)
    exponent.imag = angles * (math.pi / 180)
    np.exp(exponent, out=exponent)  # exp of an imaginary number uses the C library's cosine and sine
    cosine, sine = exponent.real.copy(), exponent.imag.copy()
    quarter = np.rint(angles / 90.0)
    is_multiple = 90.0 * quarter == angles
    if is_multiple.any():
        turns = quarter[is_multiple].astype(np.int64) % 4
        cosine[is_multiple] = np.array([1.0, 0.0, -1.0, 0.0])[turns]
        sine[is_multiple] = np.array([0.0, 1.0, 0.0, -1.0])[turns]
    return cosine, sine


def cos_sin_deg(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at multiples of 90."""
    quarter, remainder = divmod(angle, 90.0)
    if remainder == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return math.cos(math.radians(angle)), math.sin(math.radians(angle))


def rotation_vectors_of_sines(w: Array, trace: Array, C: Array) -> Array:
    """Rotation vectors (M, 3) of matrices C' (M, 9), accurate also near half a turn.

    w: (M, 3) axes as long as the sines, which this changes; trace: (M,) of the matrices.
    """
    s = np.sqrt((w * w).sum(axis=1))
    angle = np.arctan2(s, 0.5 * (trace - 1.0))
    near_half = (s < HALF_TURN) & (trace < 0.0)
    if near_half.any():
        B = C[near_half].reshape(-1, 3, 3) + np.eye(3)
        k = np.argmax(np.einsum("mji,mji->mj", B, B), axis=1)
        axis = B[np.arange(len(B)), k]
        w[near_half] = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), LEAST_DIVISOR)
        s[near_half] = 1.0
    return np.asarray(w * np.where(trace < 3.0 - SMALL_TURN, angle / np.maximum(s, LEAST_DIVISOR), 1.0)[:, None])
