"""Batched linear algebra in which one exactly singular member does not fail the whole batch."""

from collections.abc import Callable
from typing import Any

import numpy as np

from armkin.formula.arrays import Array


def nudged(function: Callable[..., Any], matrix: Array, *arguments: Array) -> Array:
    """``function(matrix, *arguments)``, with noise of rounding size added if a member is singular.

    Numpy raises for a whole stack of matrices if one of them has a zero pivot.  Other members lose a few of
    their last digits, which Newton's method gives back.

    Args:
        function: `np.linalg.inv`, `np.linalg.solve` and the like.
        matrix: (M, k, k).
    """
    try:
        return np.asarray(function(matrix, *arguments))
    except np.linalg.LinAlgError:
        noise = np.random.default_rng(0)
        size = 1e-13 * (1 + float(np.abs(matrix).max()))
        for _ in range(8):  # the noise may itself cancel what is left of a pivot
            try:
                return np.asarray(function(matrix + size * noise.standard_normal(matrix.shape), *arguments))
            except np.linalg.LinAlgError:
                size *= 3
        raise
