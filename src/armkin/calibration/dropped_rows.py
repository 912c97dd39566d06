"""Where a calibration drops a row: one that is far out loses its weight, however the others are fitted.

Geman and McClure's loss rho(u) = u^2 / (1 + u^2 / K^2) of a residual of u scales, whose weight (1 + u^2 / K^2)^-2
forgets rows that are far out (Geman and McClure, Statistical methods for tomographic image reconstruction, 1987); the
scale is that of the median residual. No row is left out beforehand: a better fit may take it back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array

K = 4.0  # residuals beyond K scales lose three quarters of their weight
MEDIAN = 1.5382  # median of the length of three standard normal numbers
MIN_SCALES = 0.005, 1e-5  # smallest scale [mm, rad]: what a measurement's last digit is worth
DROPPED = 0.1  # weight below which a row is called wrong


def weights(r: Array | None, scale: float) -> Array:
    """The weights (M,) of residuals (M, 3); 1 for all where nothing was measured."""
    if r is None:
        return np.ones(1)
    return np.asarray((1.0 + _squared_norms(r, scale) / K**2) ** -2)


def loss(r: Array, scale: float) -> float:
    """The sum of rho over residuals (M, 3): what `weights` are the slopes of."""
    u2 = _squared_norms(r, scale)
    return float((u2 / (1.0 + u2 / K**2)).sum())


def scales(position_residuals: Array, rotation_residuals: Array | None, fitted_numbers: float) -> tuple[float, float]:
    """The noise of a component [mm, rad] from the median residual, larger by the numbers that a fit has used."""
    numbers = position_residuals.size + (0 if rotation_residuals is None else rotation_residuals.size)
    used = np.sqrt(numbers / max(numbers - fitted_numbers, 0.25 * numbers))
    size = float(np.median(np.linalg.norm(position_residuals, axis=1))) / MEDIAN * used
    turn = (
        0.0
        if rotation_residuals is None
        else float(np.median(np.linalg.norm(rotation_residuals, axis=1))) / MEDIAN * used
    )
    return max(size, MIN_SCALES[0]), max(turn, MIN_SCALES[1])


def dropped_row_numbers(weights: Array) -> NDArray[np.intp]:
    """The rows, from 0, that a fit with these weights (M,) did without."""
    return np.flatnonzero(weights < DROPPED)


def _squared_norms(r: Array, scale: float) -> Array:
    return np.asarray(np.einsum("mi,mi->m", r, r) / scale**2)
