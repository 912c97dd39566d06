"""Many small systems of linear equations at once: the same operations for all, on columns of numbers."""

import numpy as np

from armkin.formula.arrays import Array, Bool


def eliminate(A: Array, least: float) -> Bool:
    """Solve systems of n equations A (n, n + r, M) in place: the r right sides, which come last, become the solutions.

    All have the same rows as pivots, those that are largest on the whole. Returns which systems (M,) have a pivot that
    is no larger than `least`: their solutions may be wrong.
    """
    n, weak = len(A), np.zeros(A.shape[2], bool)
    for k in range(n):
        pivot = k + int(np.abs(A[k:, k]).sum(axis=1).argmax())
        if pivot != k:
            A[[k, pivot]] = A[[pivot, k]]
        weak |= ~(np.abs(A[k, k]) > least)
        A[k, k + 1 :] /= np.where(A[k, k] == 0.0, 1.0, A[k, k])
        A[k + 1 :, k + 1 :] -= A[k + 1 :, k, None] * A[k, None, k + 1 :]
    for k in range(n - 1, 0, -1):
        A[:k, n:] -= A[:k, k, None] * A[k, None, n:]
    return weak
