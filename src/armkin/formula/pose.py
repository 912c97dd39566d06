"""Poses as structures of arrays: twelve entries, each an array over the batch or a plain number.

Storing a batch of homogeneous transforms entry by entry lets numpy work on long contiguous
arrays. Constants, such as the many zeros and ones of DH tables, stay Python floats, so that
operations on them cost nothing. The same code runs for a single pose, with floats only.

A `Pose` is a list of twelve entries ``[r00, r10, r20, r01, r11, r21, r02, r12, r22, x, y, z]``:
the x, y and z columns of the rotation, then the position.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from armkin.formula.arrays import Array, Entry, combine, dot, mul

Pose = list[Entry]


def constant(T: Array) -> Pose:
    """A constant 4 x 4 transform as a pose of floats."""
    return [float(T[row, column]) for column in range(4) for row in range(3)]


def rotate(P: Pose, c: Entry, s: Entry) -> Pose:
    """``P Rz(q)``, q given by its cosine and sine."""
    x, y = P[0:3], P[3:6]
    return [*combine(c, x, s, y), *combine(c, y, mul(-1.0, s), x), *P[6:]]


def slide(P: Pose, d: Entry) -> Pose:
    """``P Tz(d)``."""
    return [*P[:9], *combine(d, P[6:9], 1.0, P[9:12])]


def compose(P: Pose, Q: Pose) -> Pose:
    """``P Q``."""
    x, y, z = P[0:3], P[3:6], P[6:9]
    product: Pose = []
    for k in (0, 3, 6, 9):
        column = combine(Q[k], x, Q[k + 1], y)
        column = combine(1.0, column, Q[k + 2], z)
        if k == 9:
            column = combine(1.0, column, 1.0, P[9:12])
        product += column
    return product


def apply(P: Pose, v: Sequence[Entry]) -> list[Entry]:
    """``P v`` for a point v."""
    return combine(1.0, turn_direction(P, v), 1.0, P[9:12])


def turn_direction(P: Pose, v: Sequence[Entry]) -> list[Entry]:
    """``R v`` for a direction v, R the rotation of P."""
    return combine(1.0, combine(v[0], P[0:3], v[1], P[3:6]), v[2], P[6:9])


def turn_back(P: Pose, v: Sequence[Entry]) -> list[Entry]:
    """``R^T v`` for a direction v, R the rotation of P."""
    return [dot(P[0:3], v), dot(P[3:6], v), dot(P[6:9], v)]


def inverse(P: Pose) -> Pose:
    """The inverse of a rigid transform."""
    t = turn_back(P, P[9:12])
    return [P[0], P[3], P[6], P[1], P[4], P[7], P[2], P[5], P[8], *(mul(-1.0, entry) for entry in t)]


def write_pose(P: Pose, matrices: Array) -> None:
    """Write a pose into ``matrices (..., 4, 4)``; entries broadcast."""
    entry: Any  # numpy takes any
    for k, entry in enumerate(P):
        matrices[..., k % 3, k // 3] = entry
    matrices[..., 3, :3] = 0.0
    matrices[..., 3, 3] = 1.0


def read_one(T: Array) -> list[float]:
    """The entries of one pose (4, 4) as floats."""
    rows: list[list[float]] = T.tolist()
    return [rows[row][column] for column in range(4) for row in range(3)]


def read_pose(T: Array) -> Pose:
    """The entries of ``T (N, 4, 4)`` as contiguous arrays of length N."""
    entries = np.ascontiguousarray(T[:, :3, :].reshape(len(T), 12).T)
    return [entries[row * 4 + column] for column in range(4) for row in range(3)]
