"""From a closed chain to an eigenvalue problem: the equations of the middle joints, and what no pose changes.

The parts of joints and links are those of `closed_loop`.  From the loop

    (1)  Lb J1 L1 J2 L2 J3 L3 Je = Jb^-1 La^-1 Ja^-1 Le^-1.

Applied to the z axis of e (which must be revolute, so that Je drops out), (1) equates features of a line,
`line_features`, f0 being those of the axis itself:

    (2)  left  = Rep(Lb) U1 Rep(L1) U2 Rep(L2) U3 Rep(L3) f0        15 x 27, monomials of m1, m2, m3
    (3)  right = Ub' Rep(La^-1) Ua' Rep(Le^-1) f0                   15 x 9, monomials of b and a

With N, the left null space of (3) (`end_joints`), a and b are gone: N left = 0, six equations that are
trilinear in the (1, b1, b2) of the three middle joints, called hidden h, dialytic j and third k.  Multiplying
the six by cos(qj/2) and sin(qj/2) (by 1 and q if j is prismatic) gives twelve equations M(q_h) v = 0 in the
twelve products v = (cos 3f, sin 3f, cos f, sin f)(1, b1, b2), f = qj/2: the dialytic step of Raghavan and
Roth in a basis that knows no preferred angle.  With q_h = psi + 2 atan x (psi + 1/x if h is prismatic) M is
a quadratic M2 x^2 + M1 x + M0, whose eigenvalues and vectors contain all the solutions.

Deflation.  If the pose is carried by La, Lb or Le, M(i) has a null space K (12 x r) that depends on the arm
alone, and M(x) K = (x - i)(N1 x + N0) with N1 = M2 K, N0 = (M1 + i M2) K.  With W a real basis of the
complement of [Re K, Im K], M v = 0 for real x is the same as

    (4)  [Re N1, Im N1] x a + [Re N0, Im N0] a + (M2 x^2 + M1 x + M0) W w = 0,
    (5)  v = Re(K (a1 - i a2) / (x - i)) + W w,  a = [a1, a2],

a pencil of size 24 - 2 r: the spurious roots x = +-i of the classical 24 x 24 problem are gone.

Wide roles.  Two parallel pairs of axes in the loop, or two pairs that meet, make the twelve equations singular for
every choice of joints: M has two null vectors at every x.  Of an arm with parallel axes 2 and 3 the tool's pose makes
such a pair of axes 6 and 1 when its axis stands along the arm's first, tool up or down, or meets it.  A wide role
multiplies the six equations by the half angles of both other joints: 24 equations in the 16 products
v = (cos 3f, sin 3f, cos f, sin f)(cos 3g, sin 3g, cos g, sin g), f = qj/2, g = qk/2, of which a solution's is the only
null vector.  `mix` makes sixteen of them; what it adds are roots whose vector is no product.  Everything else is
as above with sixteen in the place of twelve, and a pencil of size 32 - 2 r.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.elimination import end_joints, line_features
from armkin.inverse.elimination.closed_loop import Role, links_by_part
from armkin.inverse.elimination.end_joints import Ends
from armkin.inverse.numeric import tolerances as tol

# Products of (1, cos q, sin q) with cos(q/2) and sin(q/2), in (cos 3f, sin 3f, cos f, sin f), f = q/2.
_HALF_ANGLE: Array = 0.5 * np.array(
    [[[0, 0, 2, 0], [1, 0, 1, 0], [0, 1, 0, 1]], [[0, 0, 0, 2], [0, 1, 0, -1], [-1, 0, 1, 0]]], dtype=float
)
# Products of (1, q, q^2) with 1 and q, in (1, q, q^2, q^3).
_POWERS: Array = np.array([np.eye(3, 4), np.eye(3, 4, k=1)])


@dataclass(frozen=True)
class Pencil:
    """Everything about an arm and a role that no pose changes; see the module's text for the symbols.

    prismatic: (6,) by part.  links: (6, 4, 4) by part; that of the pose is not used.
    left: what stands before the pose's Rep in N left, (m 3^i, 15); unused if the pose is at an end.
    right: what stands behind it, (15, 3^(3 - i)); unused in slots La, Lb, Le, where `columns` contains it.
    columns: (27 or 15, f c) from the monomials of (2), or from features, to the columns of (4), for each of f = 2
    dialytic multipliers, 4 of a wide role.
    mix: (p, f m) orthonormal rows, if there are more equations than products: p = 12, 16 of a wide role.
    K_re, K_im, W: (p, r), (p, r), (p, p - 2 r).
    """

    role: Role
    psi: float
    prismatic: Bool
    links: Array
    ends: Ends
    left: Array
    right: Array
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

    @property
    def products(self) -> int:
        """Number of products v."""
        return int(self.W.shape[0])


def build_pencil(role: Role, arm: Array, prismatic: Bool, psi: float) -> Pencil:
    """Prepare a role of the arm with the links ``arm`` (5, 4, 4) between its joints for the offset psi."""
    links, part = links_by_part(role, arm), prismatic[list(role.order)]
    cut = end_joints.prepare(role, part, links)
    left, right = _sides(role, part, links, cut.N)
    constant = role.slot in (0, 1, 5)
    p, factors = (16, 4) if role.wide else (12, 2)
    K = _spurious(role, part, right) if constant and not part[2 + role.hidden] else np.empty((p, 0))
    parts = np.concatenate([K.real, K.imag], axis=1)
    W = np.linalg.qr(parts, mode="complete")[0][:, parts.shape[1] :] if parts.size else np.eye(p)
    columns = _columns(role, part, psi, K, W)
    if constant:
        columns, right = right @ columns, np.empty((15, 0))
    rows, mix = factors * (15 - cut.rank), None
    if rows > p and role.wide:  # each with one of the others: a quarter of the entries is not zero
        mix = np.eye(p, rows)
        partner = np.arange(p)[:, None] % (rows - p) == np.arange(rows - p)
        mix[:, p:] = np.random.default_rng(1).standard_normal((p, rows - p)) * partner
    elif rows > p:
        mix = np.linalg.qr(np.random.default_rng(1).standard_normal((rows, p)))[0].T
    return Pencil(role, psi, part, links, cut, left, right, columns, mix, K.real, K.imag, W)


def _sides(role: Role, part: Bool, links: Array, N: Array) -> tuple[Array, Array]:
    """What stands before and behind the pose's Rep in N left; everything behind, if it is not in (2)."""
    reps = [line_features.rep(links[i]) for i in (1, 2, 3, 4)]
    joints = [line_features.joint_rep(bool(part[i])) for i in (2, 3, 4)]
    first = 0 if role.at_an_end else role.slot  # the first factor of (2) behind the pose
    right = line_features.Z_AXIS[:, None]
    for i in (3, 2, 1, 0):
        if i >= first:
            right = reps[i] @ right
        if i > 0 and i >= first:
            right = np.einsum("uij,jc->iuc", joints[i - 1], right).reshape(15, -1)
    left = N
    for i in range(first - 1):
        left = np.einsum("mi,uij->muj", left @ reps[i], joints[i]).reshape(-1, 15)
    return left, right


@cache
def _dialytic(hidden: int, dialytic: int, slides: bool, wide: bool, third_slides: bool) -> Array:
    """Monomials of (2) to M_0, M_1, M_2 (the coefficients of 1, b1, b2 of h): (3, 27, 2, 12), wide (3, 27, 4, 16).

    slides, third_slides: the dialytic joint, the third one is prismatic.
    """
    multipliers = _POWERS if slides else _HALF_ANGLE
    third_multipliers = _POWERS if third_slides else _HALF_ANGLE
    third = third_multipliers if wide else np.eye(3)[None]
    unit = np.eye(27).reshape(27, 3, 3, 3)
    unit = np.moveaxis(unit, (1 + hidden, 1 + dialytic, 4 - hidden - dialytic), (1, 2, 3))
    products: Array = np.einsum("xhjk,sjp,tkr->hxstpr", unit, multipliers, third)
    products = products.reshape(3, 27, 2 * len(third), 4 * third.shape[2])
    products.flags.writeable = False
    return products


def _coefficients(role: Role, part: Bool) -> Array:
    """`_dialytic` of a role and the joint types by part (6,)."""
    slides, third_slides = bool(part[2 + role.dialytic]), bool(part[2 + role.third])
    return _dialytic(role.hidden, role.dialytic, slides, role.wide, third_slides)


def _spurious(role: Role, part: Bool, monomials: Array) -> NDArray[np.complex128]:
    """K, the null space of M(i) that no pose changes, (p, r) orthonormal, from (2) as (15, 27)."""
    coefficients = _coefficients(role, part)
    _, M_c, M_s = np.einsum("ix,hxsp->hisp", monomials, coefficients).reshape(3, -1, coefficients.shape[3])
    _, size, vectors = np.linalg.svd(M_c + 1j * M_s)  # M(i) but for a factor, whatever psi
    null = vectors[size < tol.NULL_VALUE * size[0]].conj().T
    # Vectors of K that are (nearly) real would make [Re K, Im K] dependent: they stay in W.
    # The singular values of K^T K are the cosines between K and its conjugate.
    _, cosine, mixing = np.linalg.svd(null.T @ null)
    return np.asarray(null @ mixing.conj().T[:, cosine < 0.99])


def _columns(role: Role, part: Bool, psi: float, K: NDArray[np.complex128] | Array, W: Array) -> Array:
    """Monomials of (2) to the columns [Re N1, Im N1, M2 W | Re N0, Im N0, M1 W, M0 W] of (4), (27, f c)."""
    A, B, C = _coefficients(role, part)
    if part[2 + role.hidden]:
        M2, M1, M0 = A + B * psi + C * psi**2, B + 2 * psi * C, C
    else:
        cos_part = B * np.cos(psi) + C * np.sin(psi)
        sin_part = C * np.cos(psi) - B * np.sin(psi)
        M2, M1, M0 = A - cos_part, 2 * sin_part, A + cos_part
    N1, N0 = M2 @ K, (M1 + 1j * M2) @ K
    blocks = [N1.real, N1.imag, M2 @ W, N0.real, N0.imag, M1 @ W, M0 @ W]
    return np.concatenate(blocks, axis=2).reshape(27, -1)
