"""Fifteen numbers of a line on which every rigid motion acts linearly.

For a point ``p`` and a unit direction ``l`` of a line let

    f(p, l) = [p, l, p.p, p.l, p x l, (p.p) l - 2 (p.l) p, 1].

The first fourteen are the functions whose equations Raghavan and Roth (1990, "Kinematic analysis of the 6R manipulator
of general geometry") equate; with the constant they span a space that rigid motions map to itself:

    f(R p + t, R l) = Rep(R, t) f(p, l),     Rep(X Y) = Rep(X) Rep(Y),

so that no trigonometric expansion ever has to be written down.  A joint's Rep is an affine function
of two numbers ``(b1, b2)``: ``(cos q, sin q)`` if it is revolute, ``(q, q^2)`` if it is prismatic:

    Rep(J(q)) = U0 + U1 b1(q) + U2 b2(q).
"""

from functools import cache

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.rotation import joint_motion

SIZE = 15  # features of a line
_P, _L = slice(0, 3), slice(3, 6)
_M, _W = slice(8, 11), slice(11, 14)
_PP, _PL, _CONSTANT = 6, 7, 14

Z_AXIS: Array = np.zeros(SIZE)
"""f(o, z): the features of a frame's own z axis (point 0, direction e3)."""
Z_AXIS[[5, _CONSTANT]] = 1.0


def features(p: Array, direction: Array) -> Array:
    """Features of the lines through ``p`` (..., 3) with unit ``direction`` (..., 3), as (..., 15).

    >>> features(np.array([1.0, 2, 3]), np.array([0.0, 0, 1]))[6:8]      # p.p and p.l
    array([14.,  3.])
    """
    numbers = np.empty((*p.shape[:-1], SIZE))
    p_p = np.sum(p * p, axis=-1)
    p_l = np.sum(p * direction, axis=-1)
    numbers[..., _P] = p
    numbers[..., _L] = direction
    numbers[..., _PP] = p_p
    numbers[..., _PL] = p_l
    for i, j, k in ((8, 1, 2), (9, 2, 0), (10, 0, 1)):  # p x l: np.cross takes ten times as long for one line
        numbers[..., i] = p[..., j] * direction[..., k] - p[..., k] * direction[..., j]
    numbers[..., _W] = p_p[..., None] * direction - 2 * p_l[..., None] * p
    numbers[..., _CONSTANT] = 1.0
    return numbers


def rep(motion: Array) -> Array:
    """The 15 x 15 matrices by which rigid motions (..., 4, 4) act on line features.

    The rows are the transformation laws of p, l, p.p, p.l, the moment m = p x l and
    w = (p.p) l - 2 (p.l) p:

        p.p' = p.p + 2 t.Rp + t.t        p.l' = p.l + t.Rl        m' = R m + t x R l
        w'   = R w - 2 t x R m + (t.t R - 2 t t^T R) l - 2 t (p.l)
    """
    R, t = motion[..., :3, :3], motion[..., :3, 3]
    matrix = np.zeros((*motion.shape[:-2], SIZE, SIZE))
    t_R = np.matmul(t[..., None, :], R)[..., 0, :]
    t_t = np.sum(t * t, axis=-1)
    cross_R = np.empty_like(R)  # [t]x R, row by row
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross_R[..., i, :] = t[..., j, None] * R[..., k, :] - t[..., k, None] * R[..., j, :]
    matrix[..., _P, _P] = matrix[..., _L, _L] = matrix[..., _M, _M] = matrix[..., _W, _W] = R
    matrix[..., _P, _CONSTANT] = t
    matrix[..., _PP, _P] = 2 * t_R
    matrix[..., _PP, _CONSTANT] = t_t
    matrix[..., _PP, _PP] = matrix[..., _PL, _PL] = matrix[..., _CONSTANT, _CONSTANT] = 1.0
    matrix[..., _PL, _L] = t_R
    matrix[..., _M, _L] = cross_R
    matrix[..., _W, _M] = -2 * cross_R
    matrix[..., _W, _L] = t_t[..., None, None] * R - 2 * t[..., :, None] * t_R[..., None, :]
    matrix[..., _W, _PL] = -2 * t
    return matrix


@cache
def joint_rep(prismatic: bool, inverse: bool = False) -> Array:
    """``[U0, U1, U2]`` (3, 15, 15) of a joint, or of its inverse motion, read-only.

    Found by sampling: a revolute joint at 0, 120 and 240 degrees, a prismatic one at -1, 0 and 1.
    """
    if prismatic:
        minus, zero, plus = (rep(joint_motion(True, q)) for q in (-1.0, 0.0, 1.0))
        U: Array = np.stack([zero, (plus - minus) / 2, (plus + minus) / 2 - zero])
        odd_term = 1  # the coefficient that changes its sign with q
    else:
        angles = 2 * np.pi / 3 * np.arange(3)
        samples = np.stack([rep(joint_motion(False, angle)) for angle in angles])
        weights = np.stack([np.full(3, 1 / 3), 2 / 3 * np.cos(angles), 2 / 3 * np.sin(angles)])
        U = np.einsum("uk,kij->uij", weights, samples)
        odd_term = 2
    if inverse:
        U[odd_term] *= -1
    U.flags.writeable = False
    return U
