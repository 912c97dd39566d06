"""The subproblems that every closed form is made of.

Angles are carried as cosine and sine pairs and become angles only at the very end: the
pairs come out of the algebra without any inverse function, and the residual of a branch
can be checked with them directly.

Branch axes: the solutions of a subproblem stand on axes of their own in front of the
batch axis, as in shape (2, 2, 1, N), and broadcast against what does not depend on them.
The caller says which axis by the shape of `signs`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from armkin import soa
from armkin.soa import Array, Bool, Entry

TANGENT = 1e-13  # relative discriminant below which two roots may be one: 6e-7 rad apart
TOUCHING = 1e-4  # [rad] complex roots this close to the real line may be a double root seen through rounding
FREE = 1e-18  # relative squared amplitude below which an equation says nothing about its angle


class Pair(NamedTuple):
    """Cosine and sine of a joint's angle [rad], or the value [mm] of a prismatic joint and None."""

    c: Entry
    s: Entry


# What to give a joint that a target leaves free, or None.
Prefer = Sequence[Pair | None]


class Candidates(NamedTuple):
    """What a closed form returns: candidate branches, not yet told from false ones.

    pairs: one a joint, on branch axes (b0, b1, b2, N). doubt: broadcastable to these, branches on an edge. miss:
    squared residual of every branch (lengths in units of the reach), recomputed from the
    pairs, if the geometry has a shorter way than the whole chain; else None. angles: one a
    joint, its angle where the geometry knows it without an inverse function, else None.
    """

    pairs: list[Pair]
    doubt: Bool
    miss: Entry | None = None
    angles: Sequence[Entry | None] = ()

    def values(self) -> list[Entry]:
        """Joint values [rad | mm]."""
        angles = self.angles or [None] * len(self.pairs)
        return [
            c if s is None else np.arctan2(s, c) if angle is None else angle
            for (c, s), angle in zip(self.pairs, angles, strict=True)
        ]

    def reversed(self) -> Candidates:
        """The same for the chain walked the other way."""
        return self._replace(pairs=self.pairs[::-1], angles=self.angles[::-1])


def spin(c: Entry, s: Entry, v: list[Entry]) -> list[Entry]:
    """``Rz(q) v``.

    >>> spin(0.0, 1.0, [2.0, 0.0, 5.0])
    [0.0, 2.0, 5.0]
    """
    x, y = v[0], v[1]
    return [soa.sub(soa.mul(c, x), soa.mul(s, y)), soa.add(soa.mul(s, x), soa.mul(c, y)), v[2]]


def distance2(u: list[Entry], v: list[Entry]) -> Entry:
    """Squared distance of two vectors."""
    total: Entry = 0.0
    for a, b in zip(u, v, strict=False):
        d = soa.sub(a, b)
        total = soa.add(total, d * d)
    return total


def signs(axis: int) -> Array:
    """[+1, -1] along branch axis 0, 1 or 2 of (b0, b1, b2, N)."""
    shape = [1, 1, 1, 1]
    shape[axis] = 2
    return np.array([1.0, -1.0]).reshape(shape)


def linear(
    a: Entry, b: Entry, c: Entry, axis: int, scale: float, prefer: Pair | None, disc: Entry | None = None
) -> tuple[Pair, Bool]:
    """Solve ``a cos(q) + b sin(q) = c`` for both roots (Siciliano et al., Robotics, eq. 2.A; IK-Geo subproblem 4).

    a, b, c: broadcastable entries; axis: the branch axis of the two roots; scale: the
    length that makes a and b dimensionless; prefer: the angle to give where the equation
    leaves it free, or None to do without (such targets are in doubt and looked at again); disc:
    ``a^2 + b^2 - c^2`` if the caller knows it without cancellation. Returns the pair and doubt, a
    boolean array: True where the roots are about to merge or the angle is free.

    Without a real root the pair is that of the closest angle, not normalised; the caller finds by
    its residual that it is no solution, or normalises it where the residual would not show.
    """
    sign = signs(axis)
    h2 = soa.add(soa.mul(a, a), soa.mul(b, b))
    if disc is None:
        disc = h2 - c * c
    doubt = np.abs(disc) < TANGENT * h2
    root = np.sqrt(np.maximum(disc, 0.0)) * sign
    least = FREE * scale * scale
    if isinstance(h2, float):
        if h2 < least:
            doubt = (c == c) | doubt  # the equation says nothing about the angle, whatever the target
        inverse: Entry = 1.0 / max(h2, least)
    else:
        doubt = doubt | (h2 < least)
        inverse = 1.0 / np.maximum(h2, least)
    ci, ri = c * inverse, root * inverse
    cos = soa.sub(soa.mul(a, ci), soa.mul(b, ri))
    sin = soa.add(soa.mul(b, ci), soa.mul(a, ri))
    return _prefer(Pair(cos, sin), h2 < least, prefer), doubt


def normalised(pair: Pair) -> Pair:
    """The pair on the unit circle: the closest angle where `linear` found no real root."""
    size = np.sqrt(np.maximum(pair.c * pair.c + pair.s * pair.s, 1e-300))
    return Pair(pair.c / size, pair.s / size)


def rotation_between(
    ux: Entry,
    uy: Entry,
    vx: Entry,
    vy: Entry,
    scale: float,
    prefer: Pair | None,
    length2: Entry | None = None,
) -> tuple[Pair, Bool]:
    """The planar rotation that turns u's direction into v's (IK-Geo subproblem 1).

    length2: the squared length that u and v both have if the target is reached, where the
    caller knows it; the pair of a target that is not is then not normalised.
    Returns the pair and doubt: True where u or v vanishes, so that the angle is free.
    """
    c = soa.add(soa.mul(ux, vx), soa.mul(uy, vy))
    s = soa.sub(soa.mul(ux, vy), soa.mul(uy, vx))
    least = FREE * scale * scale
    if length2 is None:
        h2 = soa.add(soa.mul(c, c), soa.mul(s, s))
        free = h2 < least * least
        inverse = 1.0 / np.sqrt(np.maximum(h2, least * least))
    else:
        free = length2 < least
        inverse = 1.0 / np.maximum(length2, least)
    return _prefer(Pair(c * inverse, s * inverse), free, prefer), free


def _prefer(pair: Pair, free: Bool, prefer: Pair | None) -> Pair:
    """The pair, with the preferred angle where it is free."""
    if prefer is None or not np.any(free):
        return pair
    return Pair(np.where(free, prefer.c, pair.c), np.where(free, prefer.s, pair.s))


def quadratic(a: Entry, b: Entry, c: Entry, axis: int, scale: float) -> tuple[Array, Bool]:
    """Solve ``a d^2 + b d + c = 0`` for both roots d; scale: a length of the size of d.

    With d = scale tan(q/2) this is a `linear` problem, in which a vanishing a is no special
    case: its root goes to infinity.
    """
    a, b = soa.mul(a, scale * scale), soa.mul(b, scale)
    size = soa.add(soa.add(abs(a), abs(b)), abs(c))
    inverse = 1.0 / np.maximum(size, 1e-300)
    a, b, c = a * inverse, b * inverse, c * inverse
    pair, doubt = linear(c - a, b, -(a + c), axis, 1.0, None)
    with np.errstate(divide="ignore", invalid="ignore"):
        # tan(q/2) = s / (1 + c) = (1 - c) / s: the form without cancellation
        t = np.where(pair.c > 0.0, pair.s / (1.0 + pair.c), (1.0 - pair.c) / pair.s)
    # a root at infinity is no answer, but inf would turn into nan on its way
    return scale * np.where(np.abs(t) < 1e9, t, 1e9), doubt


def trig_quadratic(e: list[Entry], near: float = TOUCHING) -> tuple[Array, Bool]:
    """All real roots of ``e0 + ec c + es s + ecc c^2 + ecs c s + ess s^2 = 0``, c = cos q, s = sin q.

    e: [e0, ec, es, ecc, ecs, ess], entries broadcastable to (N,). Returns q (4, N) [rad],
    nan where a root is not real, and doubt (N,): roots that touch, complex ones that miss the
    real line by less than `near` [rad], or a vanishing equation.
    A quartic in the tangent of the half angle, its leading coefficient kept large by turning
    the angle's origin first, solved as the eigenvalues of its companion matrix.
    """
    e0, ec, es, ecc, ecs, ess = (np.atleast_1d(np.asarray(x, dtype=float)) for x in np.broadcast_arrays(*e))
    size = np.abs([e0, ec, es, ecc, ecs, ess]).max(axis=0)
    vanishing = size < 1e-300
    inverse = 1.0 / np.where(vanishing, 1.0, size)
    e0, ec, es, ecc, ecs, ess = (x * inverse for x in (e0, ec, es, ecc, ecs, ess))

    def f(c: Array, s: Array) -> Array:
        return np.asarray(e0 + ec * c + es * s + ecc * c * c + ecs * c * s + ess * s * s)

    trial = np.arange(7) * (2 * np.pi / 7) + 0.3  # any spread of origins does
    values = np.abs([f(-np.cos(p) * np.ones(1), -np.sin(p) * np.ones(1)) for p in trial])
    psi = trial[values.argmax(axis=0)]
    c0, s0 = np.cos(psi), np.sin(psi)
    # the same form in q' = q - psi
    rc, rs = ec * c0 + es * s0, es * c0 - ec * s0
    rcc = ecc * c0 * c0 + ecs * c0 * s0 + ess * s0 * s0
    rss = ecc * s0 * s0 - ecs * c0 * s0 + ess * c0 * c0
    rcs = 2 * (ess - ecc) * c0 * s0 + ecs * (c0 * c0 - s0 * s0)
    k4, k3, k2 = e0 - rc + rcc, 2 * rs - 2 * rcs, 2 * e0 - 2 * rcc + 4 * rss
    k1, k0 = 2 * rs + 2 * rcs, e0 + rc + rcc
    vanishing |= np.abs(k4) < 1e-14
    k4 = np.where(vanishing, 1.0, k4)
    companion = np.zeros((len(k4), 4, 4))
    companion[:, 0, :] = -np.stack([k3, k2, k1, k0], axis=1) / k4[:, None]
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    x = np.linalg.eigvals(companion).T  # (4, N)
    # the imaginary part as an angle: double roots come back as close complex pairs
    bend = 2 * np.abs(x.imag) / (1 + np.abs(x) ** 2)
    q = psi + 2 * np.arctan(x.real)
    for _ in range(3):
        c, s = np.cos(q), np.sin(q)
        slope = -ec * s + es * c + 2 * (ess - ecc) * c * s + ecs * (c * c - s * s)
        curve = -ec * c - es * s + 2 * (ess - ecc) * (c * c - s * s) - 4 * ecs * c * s
        value = f(c, s)
        # towards the root, or towards the extremum where a pair has only just left the real line
        flat = np.abs(slope) < 1e-7
        newton = value / np.where(flat, 1.0, slope)
        extremum = slope / np.where(np.abs(curve) < 1e-12, 1.0, curve)
        q = q - np.clip(np.where(flat, extremum, newton), -0.01, 0.01) * (bend < 1e-2)
    touching = (bend > 0) & (bend < near)
    doubt = vanishing | touching.any(axis=0)
    ordered = np.sort(np.where(bend < TOUCHING, q, np.inf), axis=0)
    with np.errstate(invalid="ignore"):
        doubt |= (np.diff(ordered, axis=0) < 2e-5).any(axis=0)
    q = np.where((bend < TOUCHING) & ~vanishing, q, np.nan)
    return q, doubt
