"""Self-motion manifolds walked in small straight steps: slow, and nothing of it is the solver's but the Jacobian.

What the solver lists as two rows must not lie on one manifold, the interval of a curve on which what is missed along
the lost direction stays within 1e-9 of the reach.
"""

from __future__ import annotations

import numpy as np

import armkin
from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.choose_task import task_for

STEP = 0.02  # [rad, reaches]
LONGEST = 25.0  # [rad, reaches] after which a manifold is left
MISS = 1e-9


def manifolds(arm: armkin.Arm, T: Array, rows: Array) -> list[set[int]]:
    """Which rows (M, n) of a pose are on one manifold, as walks both ways from each of them find."""
    parts = [{k} for k in range(len(rows))]
    for k in range(len(rows)):
        for sense in (1.0, -1.0):
            for met in walk(arm, T, rows, k, sense):
                joined = set().union(*(part for part in parts if k in part or met in part))
                parts = [part for part in parts if not part & joined] + [joined]
    return parts


def walk(arm: armkin.Arm, T: Array, rows: Array, k: int, sense: float) -> set[int]:
    """The other rows that a walk from the k-th comes by, until it misses too much or is back."""
    q, direction, _, second = _on_curve(arm, T, rows[k])
    direction, way, met = sense * direction, 0.0, set[int]()
    while way < LONGEST:
        length = STEP
        while True:
            landed, ahead, miss, second = _on_curve(arm, T, q + length * direction)
            if np.linalg.norm(landed - q - length * direction) < 0.1 * length or length < 1e-5:
                break
            length /= 2
        if miss > MISS:
            return met
        chord = landed - q
        offset = newton.difference(arm, rows, q)
        share = np.clip(offset @ chord / (chord @ chord), 0.0, 1.0)
        beside = np.linalg.norm(offset - share[:, None] * chord, axis=1)
        passed = set(np.flatnonzero(beside < 0.02 * length + 1e-5 + 3 * MISS / max(second, 1e-7)).tolist())
        met |= passed - {k}
        way += length
        if k in passed and way > 0.1:
            return met
        q, direction = landed, ahead * np.sign(ahead @ direction)
    return met


def _on_curve(arm: armkin.Arm, T: Array, q: Array) -> tuple[Array, Array, float, float]:
    """A posture moved onto the curve beside it, its direction, what it misses, and the second singular value."""
    task = task_for(arm, "pose")
    for _ in range(5):
        r, J = newton.scaled_residual_and_jacobian(arm, task, q[None], T[None])
        U, S, V = np.linalg.svd(J[0])
        step = V[:-1].T @ ((U[:, :-1].T @ r[0]) / S[:-1])
        if np.abs(step).max() < 1e-14:
            break
        q = q + step
    return q, V[-1], abs(float(U[:, -1] @ r[0])), float(S[-2])
