"""Self-motions of two joints about one line, decided all at once: a straight wrist, a wrist over the shoulder.

Two joints move at the same pace, so the tool's pose is a trigonometric polynomial of second degree in the way: it keeps
its target everywhere if it does at five places. What else these targets have are regular branches; what is closer, or
loses more than one direction, is left to `singular.components`, whose criteria these are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, wrapped
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.linalg import nudged
from armkin.inverse.numeric.tolerances import CLOSE_BY, CLOSED, FOLDED, SAME, SEED, SOLUTION, TURNED

if TYPE_CHECKING:
    from armkin.inverse.answers.batch import Goals

PLACES = np.arange(1.0, 5.0)[:, None]  # [rad] along a line; zero is the fifth


class Lines(NamedTuple):
    """known: (K,) targets of which all is known; branch: (K, B) their candidates that are listed; free: (K, n)."""

    known: Bool
    branch: Bool
    free: Bool


def settle(goals: Goals, q: Array, other: Array, loose: Bool) -> Lines:
    """Candidates q (K, B, n) with joints that are free as near `near`, loose ones (K, B) also at other values."""
    arm, task, target, near = goals
    K, B, n = q.shape
    both = np.concatenate([near[:, None], q], axis=1).reshape(-1, n)
    r, J = newton.scaled(arm, task, both, np.repeat(target, B + 1, axis=0))
    size = np.sqrt((r * r).sum(axis=1)).reshape(K, B + 1)
    if J.shape[1] != n or n != task.constraints or task.orientation != "full":
        return Lines(np.zeros(K, bool), np.zeros((K, B), bool), np.zeros((K, n), bool))
    J = J.reshape(K, B + 1, n, n)[:, 1:]
    with np.errstate(invalid="ignore"):
        known, size = size[:, 0] > SOLUTION, size[:, 1:]
        valid = size < CLOSED
        way = newton.difference(arm, other, q)
        turning = np.abs(way) > SAME
        even = ((np.abs(np.abs(way) - 1.0) < SAME) & ~arm.prismatic | ~turning).all(axis=2)
        known &= valid.any(axis=1) & (valid | ~(size < SEED)).all(axis=1)
    first, last = turning.argmax(axis=2), n - 1 - turning[:, :, ::-1].argmax(axis=2)
    line = loose & even & (turning.sum(axis=2) == 2) & (last - first == 2)
    known &= (~loose | line & valid).all(axis=1)
    line &= known[:, None]
    k, b = np.nonzero(line)
    d = np.where(line[:, :, None] & turning, np.sign(way), 0.0)
    places = (q[k, b][:, None] + PLACES * d[k, b][:, None]).reshape(-1, n)
    miss = newton.missing(arm, task, places, np.repeat(target[k], len(PLACES), axis=0)).reshape(-1, len(PLACES))
    known[k[(miss > CLOSED).any(axis=1)]] = False
    _weak(J, d, line, valid, known)
    branch = _apart(goals, q, valid, d, known)
    return Lines(known, branch, np.asarray((d != 0.0).any(axis=1)))


def _weak(J: Array, d: Array, line: Bool, valid: Bool, known: Bool) -> None:
    """Change known: targets with a branch that loses a direction, or a line whose postures lose two, are not.

    Bordered by the direction of a line, and by any other, the Jacobian's smallest singular value bounds its second
    smallest; the Frobenius norm of the inverse is no smaller than its largest singular value.
    """
    n = J.shape[3]
    k, b = np.nonzero(valid & known[:, None])
    bordered = np.zeros((len(k), n + 1, n + 1))
    bordered[:, :n, :n] = J[k, b]
    bordered[:, n, :n] = d[k, b] / 2**0.5
    on = line[k, b]
    bordered[:, :n, n] = np.where(on[:, None], np.cos(np.arange(n)), 0.0)
    bordered[:, n, n] = ~on
    inverse = nudged(np.linalg.inv, bordered)
    known[k[~((inverse * inverse).sum(axis=(1, 2)) * FOLDED**2 < 1.0)]] = False


def _apart(goals: Goals, q: Array, valid: Bool, d: Array, known: Bool) -> Bool:
    """Of valid candidates (K, B) one of each line; known is changed where two are neither one nor clearly apart."""
    arm, _, _, near = goals
    with np.errstate(invalid="ignore"):
        way = newton.difference(arm, q[:, None], q[:, :, None])  # (K, B, B, n)
        motion = np.abs(newton.difference(arm, q, near[:, None])).sum(axis=2)
        own = np.broadcast_to(d[:, :, None], way.shape)
        held = np.abs(np.where(own != 0.0, 0.0, way)).max(axis=3)
        # what the two that turn differ by, besides a way along the line; before and behind the first of them
        first, ways = (np.cumsum(np.abs(own), axis=3) == 1.0) & (own != 0.0), own * way
        left = wrapped(np.where(first, ways, -ways).sum(axis=3))
        held = np.maximum(held, np.abs(left))
        alike = (np.abs(d[:, :, None]) == np.abs(d[:, None])).all(axis=3)
        sense = d.prod(axis=2, where=d != 0.0)
        alike &= sense[:, :, None] == sense[:, None]
    pair = valid[:, :, None] & valid[:, None] & ~np.eye(q.shape[1], dtype=bool)
    same = pair & alike & (d != 0.0).any(axis=2)[:, :, None] & (held < TURNED)
    known &= ~(pair & ~same & (held < CLOSE_BY)).any(axis=(1, 2))
    before = np.tri(q.shape[1], k=-1, dtype=bool)
    better = (motion[:, None] < motion[:, :, None]) | ((motion[:, None] == motion[:, :, None]) & before)
    return np.asarray(valid & ~(same & better).any(axis=2))
