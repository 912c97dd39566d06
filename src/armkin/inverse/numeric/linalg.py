"""Batched linear algebra in which one exactly singular member does not fail the whole batch."""

from collections.abc import Callable
from typing import Any

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.numeric.tolerances import NOISE


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
