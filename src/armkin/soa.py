"""Poses as structures of arrays: twelve entries, each an array over the batch or a plain number.

A batch of homogeneous transforms kept entry by entry lets numpy work on long contiguous
arrays, and lets what is known to be constant (the zeros and ones that most DH tables are
full of) stay a Python float and cost nothing. A single pose is the same code with
nothing but floats.

A `Pose` is a list of twelve entries ``[r00, r10, r20, r01, r11, r21, r02, r12, r22, x, y, z]``:
the x, y and z columns of the rotation, then the position.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Entry = Any  # float | Array: numpy arithmetic accepts both, and the type checker cannot tell them apart
Pose = list[Entry]

CHUNK = 4096  # poses worked on at once: long enough to hide the calls, short enough for a core's cache


def real(values: ArrayLike, what: str) -> Array:
    """Values from outside as an array of floats; what: their name, for the message.

    Raises UsageError for text, dates, complex numbers and lists of unequal lengths. nan and infinity pass.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind in "biufO":  # O: numbers that numpy does not know, such as fractions
            return array.astype(np.float64)
        found = f"an array of {array.dtype}"
    except (TypeError, ValueError):
        found = type(values).__name__
    raise UsageError(f"{what}: expected an array of real numbers, got {found}")


def mul(a: Entry, b: Entry) -> Entry:
    """Product that skips known zeros and ones.

    >>> mul(0.0, np.array([1.0, 2.0])), mul(-1.0, 3.0)
    (0.0, -3.0)
    """
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    if isinstance(b, float):
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
        if b == -1.0:
            return -a
    return a * b


def add(a: Entry, b: Entry) -> Entry:
    """Sum that skips known zeros."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def sub(a: Entry, b: Entry) -> Entry:
    """Difference that skips known zeros."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def dot(u: list[Entry], v: list[Entry]) -> Entry:
    """Scalar product of two vectors of entries."""
    total: Entry = 0.0
    for a, b in zip(u, v, strict=True):
        total = add(total, mul(a, b))
    return total


def combine(a: Entry, u: list[Entry], b: Entry, v: list[Entry]) -> list[Entry]:
    """The vector ``a u + b v``."""
    return [add(mul(a, x), mul(b, y)) for x, y in zip(u, v, strict=True)]


def cross(u: list[Entry], v: list[Entry]) -> list[Entry]:
    """Vector product of two vectors of entries."""
    return [
        sub(mul(u[1], v[2]), mul(u[2], v[1])),
        sub(mul(u[2], v[0]), mul(u[0], v[2])),
        sub(mul(u[0], v[1]), mul(u[1], v[0])),
    ]


def cos_sin(angle: Entry) -> tuple[Entry, Entry]:
    """Cosine and sine of an angle [rad].

    For arrays through the tangent of the half angle: numpy has a vectorised tangent and
    no vectorised double precision sine; the result differs from the library's by at most
    2.3e-16 over several turns.
    """
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
    t = np.tan(0.5 * angle)
    t2 = t * t
    scale = 1.0 / (1.0 + t2)
    return (1.0 - t2) * scale, (t + t) * scale


def wrapped(angle: Entry) -> Entry:
    """An angle [rad] less its whole turns, in [-pi, pi].

    >>> round(float(wrapped(7.0)), 6)
    0.716815
    """
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))


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


def times(P: Pose, Q: Pose) -> Pose:
    """``P Q``."""
    x, y, z, p = P[0:3], P[3:6], P[6:9], P[9:12]
    out: Pose = []
    for k in (0, 3, 6, 9):
        column = combine(Q[k], x, Q[k + 1], y)
        column = combine(1.0, column, Q[k + 2], z)
        if k == 9:
            column = combine(1.0, column, 1.0, p)
        out += column
    return out


def apply(P: Pose, v: list[Entry]) -> list[Entry]:
    """``P v`` for a point v."""
    return combine(1.0, turn(P, v), 1.0, P[9:12])


def turn(P: Pose, v: list[Entry]) -> list[Entry]:
    """``R v`` for a direction v, R the rotation of P."""
    return combine(1.0, combine(v[0], P[0:3], v[1], P[3:6]), v[2], P[6:9])


def turn_back(P: Pose, v: list[Entry]) -> list[Entry]:
    """``R^T v`` for a direction v, R the rotation of P."""
    return [dot(P[0:3], v), dot(P[3:6], v), dot(P[6:9], v)]


def inverse(P: Pose) -> Pose:
    """The inverse of a rigid transform."""
    t = turn_back(P, P[9:12])
    return [P[0], P[3], P[6], P[1], P[4], P[7], P[2], P[5], P[8], *(mul(-1.0, e) for e in t)]


def write(P: Pose, out: Array) -> None:
    """Write a pose into ``out (..., 4, 4)``; entries broadcast."""
    for k, entry in enumerate(P):
        out[..., k % 3, k // 3] = entry
    out[..., 3, :3] = 0.0
    out[..., 3, 3] = 1.0


def read_one(T: Array) -> Pose:
    """The entries of one pose (4, 4) as floats."""
    rows = T.tolist()
    return [rows[row][column] for column in range(4) for row in range(3)]


def read(T: Array) -> Pose:
    """The entries of ``T (N, 4, 4)`` as contiguous arrays of length N."""
    flat = np.ascontiguousarray(T[:, :3, :].reshape(len(T), 12).T)
    return [flat[row * 4 + column] for column in range(4) for row in range(3)]
