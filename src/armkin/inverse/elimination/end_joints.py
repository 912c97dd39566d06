"""The end joints a and b: their side of the equations, what removes them, and what gives them back.

The right-hand side of (1) in `pencil`, applied to the axis of e, is

    (3)  Q m,  Q = Ub' Rep(La^-1) Ua' Rep(Le^-1) f0    15 x 9,  m = (1, b1, b2)(1, a1, a2),

U' being the joint_rep of inverse motions.  An orthonormal basis N of Q's left null space removes both joints
from the equations; the pseudo-inverse of Q turns the features of e's axis back into m.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.elimination import line_features
from armkin.inverse.elimination.closed_loop import Role
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.model.rotation import inverse, joint_motion

# The columns of Q as (b, a).  The five that give the joints back come last: with Q = (orthonormal)(triangle)
# they follow from the last five rows of the triangle alone.
_MONOMIALS = [(1, 1), (1, 2), (2, 1), (2, 2), (0, 0), (1, 0), (2, 0), (0, 1), (0, 2)]
_READ = 4  # number of the first of the five columns from which the joints are read

# A few arbitrary poses, from turns about z, x and z: they show ranks that all poses share.
_SAMPLES: Array = np.stack(
    [
        joint_motion(False, 1.0 + i)
        @ np.array([[1, 0, 0, 0.3 - i], [0, 0.6, -0.8, 0.5 * i], [0, 0.8, 0.6, 0.7], [0, 0, 0, 1]])
        @ joint_motion(False, 2.0 - 0.7 * i)
        for i in range(3)
    ]
)


class Ends(NamedTuple):
    """What no pose changes about (3).

    slot: of the pose, see `Role`.  rank: of Q, generically.
    factors: of Q, if the pose is in it: (135, 15) for slot Le; (45, 15) and (15, 3) for slot La.
    N, recover: (15 - rank, 15) and (5, 15), if the pose is not in it.
    """

    slot: int
    rank: int
    factors: tuple[Array, ...]
    N: Array
    recover: Array


def prepare(role: Role, part: Bool, links: Array) -> Ends:
    """For links by part (6, 4, 4) and joint types by part (6,)."""
    U_b = line_features.joint_rep(bool(part[1]), inverse=True)
    U_a = line_features.joint_rep(bool(part[0]), inverse=True)
    axis = line_features.rep(inverse(links[5])) @ line_features.Z_AXIS
    axis_features = np.einsum("aij,j->ia", U_a, axis)
    middle = line_features.rep(inverse(links[0]))
    nothing = np.empty((0, 15))
    if role.at_an_end:
        factors: tuple[Array, ...] = (U_b.reshape(45, 15), axis_features)
        if role.slot == 5:
            product = np.einsum("bij,jk,akl->bail", U_b, middle, U_a)
            factors = (np.concatenate([product[b, a] for b, a in _MONOMIALS]),)
        size = np.linalg.svd(_monomials(role.slot, factors, _SAMPLES), compute_uv=False)
        rank = int(np.sum(size > tol.RANK_VALUE * size[:, :1], axis=1).max())
        return Ends(role.slot, rank, factors, nothing, nothing)
    product = np.einsum("bij,ja->iba", U_b, middle @ axis_features)
    Q = np.stack([product[:, b, a] for b, a in _MONOMIALS], axis=1)
    basis, size, _ = np.linalg.svd(Q)
    rank = int(np.sum(size > tol.RANK_VALUE * size[0]))
    return Ends(role.slot, rank, (), basis[:, rank:].T, np.linalg.pinv(Q, rcond=tol.RANK_VALUE)[_READ:])


def eliminate_ends(ends: Ends, Y: Array) -> tuple[Array, Array]:
    """N (n or 1, 15 - rank, 15) and recover (n or 1, 5, 15) for the links Y (n, 4, 4) that carry the pose."""
    if not ends.factors:
        return ends.N[None], ends.recover[None]
    Q = _monomials(ends.slot, ends.factors, Y)
    if ends.rank < 9:
        basis, size, vectors = np.linalg.svd(Q)
        sizes = np.maximum(size[:, : ends.rank, None], tol.TINY)
        inverse_factor = np.swapaxes(vectors[:, : ends.rank] / sizes, 1, 2)
        transposed = np.swapaxes(basis, 1, 2)
        return transposed[:, ends.rank :], (inverse_factor @ transposed[:, : ends.rank])[:, _READ:]
    basis, triangle = np.linalg.qr(Q, mode="complete")
    transposed = np.swapaxes(basis, 1, 2)
    return transposed[:, 9:], nudged(np.linalg.solve, triangle[:, _READ:9, _READ:], transposed[:, _READ:9])


def _monomials(slot: int, factors: tuple[Array, ...], Y: Array) -> Array:
    """Q (n, 15, 9) if the pose is in it."""
    motion = inverse(Y)
    if slot == 5:
        feature = line_features.features(motion[:, :3, 3], motion[:, :3, 2])
        return np.swapaxes((feature @ factors[0].T).reshape(-1, 9, 15), 1, 2)
    U_b, axis_features = factors
    product = (U_b @ (line_features.rep(motion) @ axis_features)).reshape(-1, 3, 15, 3)
    return np.stack([product[:, b, :, a] for b, a in _MONOMIALS], axis=2)
