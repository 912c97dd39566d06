"""Batched linear algebra in which one exactly singular member does not fail the whole batch."""

from collections.abc import Callable
from typing import Any

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.numeric.tolerances import NOISE, TINY


def nudged(function: Callable[..., Any], matrix: Array, *arguments: Array) -> Array:
    """``function(matrix, *arguments)``, with noise of rounding size added to members that are singular.

    Numpy raises for a whole stack of matrices if one of them has a zero pivot. The others are left as they are: what
    becomes of a member does not depend on its neighbours.

    Args:
        function: `np.linalg.inv`, `np.linalg.solve` and the like.
        matrix: (M, k, k).
    """
    try:
        return np.asarray(function(matrix, *arguments))
    except np.linalg.LinAlgError:
        noise, nudge = np.random.default_rng(0), matrix.copy()
        size = NOISE * (1 + np.abs(matrix).max(axis=(1, 2), keepdims=True))
        for _ in range(8):  # the noise may itself cancel what is left of a pivot
            singular = np.linalg.slogdet(nudge).sign == 0
            nudge[singular] = (matrix + size * noise.standard_normal(matrix.shape[1:]))[singular]
            try:
                return np.asarray(function(nudge, *arguments))
            except np.linalg.LinAlgError:
                size *= 3
        raise


def damped_steps(J: Array, r: Array, damping: float) -> Array:
    """Solutions x (n, M) of (J'J + damping 1) x = J'r: column by column J (n, k, M), and r (k, M), by Cholesky.

    Over all members at once it takes a fraction of the time of `np.linalg.solve` on small matrices.
    """
    n = len(J)
    x = (J * r).sum(axis=1)
    L: list[list[Array]] = []
    for i in range(n):
        L.append([])
        for j in range(i + 1):
            entry = (J[i] * J[j]).sum(axis=0)
            for above, below in zip(L[i], L[j], strict=False):
                entry -= above * below
            L[i].append(np.sqrt(np.maximum(entry + damping, TINY)) if i == j else entry / L[j][j])
        for j in range(i):
            x[i] -= L[i][j] * x[j]
        x[i] /= L[i][i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= L[j][i] * x[j]
        x[i] /= L[i][i]
    return np.asarray(x)
