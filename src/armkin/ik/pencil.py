"""From a pose of the closed chain to an eigenvalue problem, and from its eigenvectors back to joints.

Names follow the closed chain.  The six joints around it are called, in order, a, b, m1, m2, m3, e and the
links after them La .. Le; one of the six links carries the pose:

    Ja La Jb Lb J1 L1 J2 L2 J3 L3 Je Le = I
    (1)  Lb J1 L1 J2 L2 J3 L3 Je = Jb^-1 La^-1 Ja^-1 Le^-1

Applied to the z axis of e (which must be revolute, so that Je drops out), (1) equates features of a line:

    (2)  left  = Rep(Lb) U1 Rep(L1) U2 Rep(L2) U3 Rep(L3) f0        15 x 27, monomials of m1, m2, m3
    (3)  right = Ub' Rep(La^-1) Ua' Rep(Le^-1) f0                   15 x 9, monomials of b and a

`N`, an orthonormal basis of the left null space of (3), removes a and b: N left = 0, six equations that are
trilinear in (1, b1, b2) of the three middle joints, which are called hidden h, dialytic j and third k.
Multiplying the six by cos(qj/2) and sin(qj/2) (by 1 and q if j is prismatic) gives twelve equations
M(q_h) v = 0 in twelve products v = (cos 3f, sin 3f, cos f, sin f)(1, b1, b2), f = qj/2: the dialytic step of
Raghavan and Roth in a basis that knows no preferred angle.  With q_h = psi + 2 atan x (psi + 1/x if h is
prismatic) M is a quadratic M2 x^2 + M1 x + M0, whose eigenvalues and vectors are all the solutions.

Deflation.  If the pose is carried by La, Lb or Le and h = m1, then M(i) has a null space K (12 x r) that
depends on the arm alone, and M(x) K = (x - i)(N1 x + N0) with N1 = M2 K, N0 = (M1 + i M2) K.  With W a real
basis of the complement of [Re K, Im K], M v = 0 for real x is the same as

    [Re N1, Im N1] x a + [Re N0, Im N0] a + (M2 x^2 + M1 x + M0) W w = 0,
    v = Re(K (a1 - i a2) / (x - i)) + W w,  a = [a1, a2],

a pencil of size 24 - 2 r: the spurious roots x = +-i of the classical 24 x 24 problem are gone.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armkin.ik import line_features
from armkin.ik.chain import inverse
from armkin.soa import Array

Bool = NDArray[np.bool_]

POSE_LINK = 5  # index of the link of the closed chain that carries the pose

# Columns of (3): the unknowns that back substitution reads come last, see `roots._eliminate_ends`.
_ENDS = [(1, 1), (1, 2), (2, 1), (2, 2), (0, 0), (1, 0), (2, 0), (0, 1), (0, 2)]  # (b, a)

# A few arbitrary poses, from turns about z, x and z: they show ranks that all poses share.
_SAMPLES: Array = np.stack(
    [
        line_features.joint_motion(False, 1.0 + i)
        @ np.array([[1, 0, 0, 0.3 - i], [0, 0.6, -0.8, 0.5 * i], [0, 0.8, 0.6, 0.7], [0, 0, 0, 1]])
        @ line_features.joint_motion(False, 2.0 - 0.7 * i)
        for i in range(3)
    ]
)

# Products of (1, cos q, sin q) with cos(q/2) and sin(q/2), in (cos 3f, sin 3f, cos f, sin f), f = q/2.
_HALF_ANGLE: Array = 0.5 * np.array(
    [[[0, 0, 2, 0], [1, 0, 1, 0], [0, 1, 0, 1]], [[0, 0, 0, 2], [0, 1, 0, -1], [-1, 0, 1, 0]]], dtype=float
)
# Products of (1, q, q^2) with 1 and q, in (1, q, q^2, q^3).
_POWERS: Array = np.array([np.eye(3, 4), np.eye(3, 4, k=1)])


@dataclass(frozen=True)
class Role:
    """One way to walk the closed chain: which joint plays which part.

    order: the joints (0..5) in the parts a, b, m1, m2, m3, e.
    backward: the chain is walked against its direction: links inverted, joint values negated.
    slot: which of the links La, Lb, L1, L2, L3, Le (0..5) carries the pose.
    hidden, dialytic: which of m1, m2, m3 (0..2) play h and j.
    """

    order: tuple[int, ...]
    backward: bool
    slot: int
    hidden: int
    dialytic: int

    @property
    def third(self) -> int:
        """Which of m1, m2, m3 plays k."""
        return 3 - self.hidden - self.dialytic


def roles(prismatic: Bool, slots: tuple[int, ...], hidden: tuple[int, ...]) -> list[Role]:
    """All roles with the pose in one of ``slots`` and one of ``hidden`` (0..2) hidden; e is revolute."""
    found = []
    for slot in slots:
        for backward in (False, True):
            order = tuple((slot - i) % 6 if backward else (POSE_LINK - slot + i) % 6 for i in range(6))
            if prismatic[order[5]]:
                continue
            for h in hidden:
                found += [Role(order, backward, slot, h, j) for j in range(3) if j != h]
    return found


@dataclass(frozen=True)
class Pencil:
    """Everything about an arm and a role that no pose changes; see the module's text for the symbols.

    prismatic: (6,) by part.  links: the six links by part, (4, 4); that of the pose is not used.
    left, right: N Rep(left part) and the rest of (2) if a middle link carries the pose; else left is unused.
    ends: constant (135, 15) or (45, 15), (15, 3) factors of (3) if an end link carries the pose.
    recover: (5, 15): features of e's axis to the end monomials, if (3) is constant.
    columns: (27, 2 c): monomials of (2) to the pencil's columns for both dialytic multipliers.
    mix: (12, 2 m) orthonormal rows if the arm has more than six equations.
    K_re, K_im, W: (12, r), (12, r), (12, 12 - 2 r).
    """

    role: Role
    psi: float
    prismatic: Bool
    links: Array
    left: Array
    right: Array
    ends: tuple[Array, ...]
    rank: int
    recover: Array
    columns: Array
    mix: Array | None
    K_re: Array
    K_im: Array
    W: Array

    @property
    def hidden_joint(self) -> int:
        """The arm's joint (0..5) that is the eigenvalue."""
        return self.role.order[2 + self.role.hidden]

    @property
    def size(self) -> int:
        """Number of eigenvalues."""
        return 2 * int(self.K_re.shape[1] + self.W.shape[1])


def closed_chain(role: Role, links: Array) -> Array:
    """Links by part (6, 4, 4), a place holder where the pose goes, from the arm's five links (5, 4, 4)."""
    around = np.concatenate([links, np.eye(4)[None]])
    if not role.backward:
        return around[list(role.order)]
    return inverse(around[[(i - 1) % 6 for i in role.order]])


def _middle(role: Role, prismatic: Bool, links: Array) -> tuple[list[Array], list[Array]]:
    """Reps of the links Lb, L1, L2, L3 and U's of the joints m1, m2, m3 of (2)."""
    return [line_features.rep(links[i]) for i in (1, 2, 3, 4)], [
        line_features.joint_rep(bool(prismatic[i])) for i in (2, 3, 4)
    ]


def build(role: Role, arm: Array, prismatic: Bool, psi: float) -> Pencil:
    """Prepare a role of the arm with the links ``arm`` (5, 4, 4) between its joints for the offset psi."""
    links = closed_chain(role, arm)
    part = prismatic[list(role.order)]
    reps, joints = _middle(role, part, links)
    # (2), from the right: f0 grows a factor 3 with every joint; it stops before a link with the pose.
    right = line_features.Z_AXIS[:, None]
    at = 3
    while True:
        if role.slot == at + 1:
            break
        right = reps[at] @ right
        if at == 0:
            break
        at -= 1
        right = np.einsum("uij,jc->iuc", joints[at], right).reshape(15, -1)
    U_b = line_features.joint_rep(bool(part[1]), inverse=True)
    U_a = line_features.joint_rep(bool(part[0]), inverse=True)
    ends: tuple[Array, ...] = ()
    rank, left, recover, rows = 9, np.empty((0, 15)), np.empty((0, 15)), 6
    if role.slot in (0, 5):
        if role.slot == 5:
            constant = np.einsum("bij,jk,akl->bail", U_b, line_features.rep(inverse(links[0])), U_a)
            ends = (np.concatenate([constant[b, a] for b, a in _ENDS]),)
        else:
            e_axis = line_features.rep(inverse(links[5])) @ line_features.Z_AXIS
            ends = (U_b.reshape(45, 15), np.einsum("aij,j->ia", U_a, e_axis))
        size = np.linalg.svd(end_monomials(role, ends, _SAMPLES), compute_uv=False)
        rank = int(np.sum(size > 1e-9 * size[:, :1], axis=1).max())
        rows = 15 - rank
    else:
        e_axis = line_features.rep(inverse(links[5])) @ line_features.Z_AXIS
        inner = line_features.rep(inverse(links[0])) @ np.einsum("aij,j->ia", U_a, e_axis)
        product = np.einsum("bij,ja->iba", U_b, inner)
        Q = np.stack([product[:, b, a] for b, a in _ENDS], axis=1)
        basis, size, _ = np.linalg.svd(Q)
        rank = int(np.sum(size > 1e-9 * size[0]))
        left = basis[:, rank:].T
        rows = left.shape[0]
        recover = np.linalg.pinv(Q, rcond=1e-9)[4:]
        for i in range(role.slot - 1):
            left = np.einsum("mi,uij->muj", left @ reps[i], joints[i]).reshape(-1, 15)
    K = _spurious(role, part, right) if role.slot in (0, 1, 5) and not part[2 + role.hidden] else None
    K_re, K_im, W = _split(K)
    mix = None
    if rows > 6:
        square = np.random.default_rng(1).standard_normal((2 * rows, 12))
        mix = np.linalg.qr(square)[0].T
    columns = _columns(role, part, psi, K_re, K_im, W)
    if role.slot in (0, 1, 5):
        columns, right = right @ columns, np.empty((15, 0))
    return Pencil(role, psi, part, links, left, right, ends, rank, recover, columns, mix, K_re, K_im, W)


@cache
def _dialytic(hidden: int, dialytic: int, sliding: bool) -> Array:
    """Monomials of (2) to M_0, M_1, M_2 (the coefficients of 1, b1, b2 of h): (3, 27, 2, 12).

    sliding: the dialytic joint is prismatic.
    """
    multipliers = _POWERS if sliding else _HALF_ANGLE
    unit = np.eye(27).reshape(27, 3, 3, 3)
    unit = np.moveaxis(unit, (1 + hidden, 1 + dialytic, 4 - hidden - dialytic), (1, 2, 3))
    products: Array = np.einsum("xhjk,sjp->hxspk", unit, multipliers).reshape(3, 27, 2, 12)
    return products


def _spurious(role: Role, part: Bool, monomials: Array) -> Array:
    """Null space of M(x = i) that no pose changes, (12, r) complex orthonormal, from (2) as (15, 27)."""
    coefficients = _dialytic(role.hidden, role.dialytic, bool(part[2 + role.dialytic]))
    _, M_c, M_s = np.einsum("ix,hxsp->hisp", monomials, coefficients).reshape(3, 30, 12)
    _, size, vectors = np.linalg.svd(M_c + 1j * M_s)
    null: NDArray[np.complex128] = vectors[size < 1e-11 * size[0]].conj().T
    # Vectors of K that are (nearly) real would make [Re K, Im K] dependent: they stay in W.
    # The singular values of K^T K are the cosines between K and its conjugate.
    _, cosine, turned = np.linalg.svd(null.T @ null)
    return np.asarray(null @ turned.conj().T[:, cosine < 0.99])


def _split(K: Array | None) -> tuple[Array, Array, Array]:
    """Re K, Im K and a real orthonormal basis W of their complement."""
    if K is None or K.shape[1] == 0:
        return np.empty((12, 0)), np.empty((12, 0)), np.eye(12)
    both = np.concatenate([K.real, K.imag], axis=1)
    W = np.linalg.qr(both, mode="complete")[0][:, both.shape[1] :]
    return K.real, K.imag, W


def _columns(role: Role, part: Bool, psi: float, K_re: Array, K_im: Array, W: Array) -> Array:
    """Monomials of (2) to the columns [Re N1, Im N1, M2 W | Re N0, Im N0, M1 W, M0 W], (27, 2 c)."""
    A, B, C = _dialytic(role.hidden, role.dialytic, bool(part[2 + role.dialytic]))
    if part[2 + role.hidden]:
        M2, M1, M0 = A + B * psi + C * psi**2, B + 2 * psi * C, C
    else:
        cos_part = B * np.cos(psi) + C * np.sin(psi)
        sin_part = C * np.cos(psi) - B * np.sin(psi)
        M2, M1, M0 = A - cos_part, 2 * sin_part, A + cos_part
    blocks = [M2 @ K_re, M2 @ K_im, M2 @ W]
    blocks += [M1 @ K_re - M2 @ K_im, M1 @ K_im + M2 @ K_re, M1 @ W, M0 @ W]
    return np.concatenate(blocks, axis=2).reshape(27, -1)


def end_monomials(role: Role, ends: tuple[Array, ...], Y: Array) -> Array:
    """The matrices (3), (N, 15, 9), if the pose is carried by La or Le."""
    back = inverse(Y)
    if role.slot == 5:
        feature = line_features.features(back[:, :3, 3], back[:, :3, 2])
        return np.swapaxes((feature @ ends[0].T).reshape(-1, 9, 15), 1, 2)
    U_b, right = ends
    product = (U_b @ (line_features.rep(back) @ right)).reshape(-1, 3, 15, 3)
    return np.stack([product[:, b, :, a] for b, a in _ENDS], axis=2)
