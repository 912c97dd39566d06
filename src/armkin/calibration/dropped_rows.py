"""Weights with which a calibration ignores outliers.

The loss of Geman and McClure is rho(u) = u^2 / (1 + u^2 / K^2) for a residual of u scales. Its weight
(1 + u^2 / K^2)^-2 is close to 0 for outliers (Geman and McClure, Statistical methods for tomographic image
reconstruction, 1987). The scale comes from the median residual. Weights are computed anew in each step, so that a
better fit may use a row again.
"""

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array

K = 4.0  # residuals beyond K scales lose three quarters of their weight
MEDIAN_NORM = 1.5382  # median of the length of three standard normal numbers
MIN_POSITION_SCALE, MIN_ROTATION_SCALE = 0.005, 1e-5  # [mm], [rad], about the last digit of a measurement
DROPPED_WEIGHT = 0.1  # weight below which a row is reported as dropped


def weights(residuals: Array | None, scale: float) -> Array:
    """The weights (M,) of residuals (M, 3); 1 for all without measurements."""
    if residuals is None:
        return np.ones(1)
    return np.asarray((1.0 + _squared_norms(residuals, scale) / K**2) ** -2)


def loss(residuals: Array, scale: float) -> float:
    """The sum of rho over residuals (M, 3), whose derivative gives `weights`."""
    u_squared = _squared_norms(residuals, scale)
    return float((u_squared / (1.0 + u_squared / K**2)).sum())


def scales(position_residuals: Array, rotation_residuals: Array | None, fitted_count: float) -> tuple[float, float]:
    """The noise of a component [mm, rad] from the median residual, corrected for the number of fitted parameters."""
    count = position_residuals.size + (0 if rotation_residuals is None else rotation_residuals.size)
    correction = np.sqrt(count / max(count - fitted_count, 0.25 * count))
    position_scale = float(np.median(np.linalg.norm(position_residuals, axis=1))) / MEDIAN_NORM * correction
    rotation_scale = (
        0.0
        if rotation_residuals is None
        else float(np.median(np.linalg.norm(rotation_residuals, axis=1))) / MEDIAN_NORM * correction
    )
    return max(position_scale, MIN_POSITION_SCALE), max(rotation_scale, MIN_ROTATION_SCALE)


def dropped_row_numbers(weights: Array) -> NDArray[np.intp]:
    """The indices of rows that a fit with these weights (M,) ignored."""
    return np.flatnonzero(weights < DROPPED_WEIGHT)


def _squared_norms(residuals: Array, scale: float) -> Array:
    return np.asarray(np.einsum("mi,mi->m", residuals, residuals) / scale**2)
