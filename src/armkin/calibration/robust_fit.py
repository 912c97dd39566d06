"""Robust damped Gauss-Newton with a prior.

The fit minimises sum rho(|r_k| / s) + sum (p_i / prior_i)^2, with the loss rho and the scale s of `dropped_rows`, which
ignore outliers. Corrections that the rows do not determine stay at the prior, that is at the robot file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.calibration.corrected_chain import CorrectedChain
from armkin.calibration.dropped_rows import loss, scales, weights
from armkin.formula.arrays import Array

STEPS = 40  # most steps of a fit


@dataclass(frozen=True, eq=False)
class Measurements:
    """Commanded joint values and measured tips."""

    commanded: Array  # (M, n) [rad | mm]
    position: Array  # (M, 3) [mm]
    rotation: Array | None = None  # (M, 3, 3)

    def __len__(self) -> int:
        return len(self.commanded)

    def take(self, selected: NDArray[np.intp] | NDArray[np.bool_]) -> Measurements:
        """Some of the rows."""
        rotation = None if self.rotation is None else self.rotation[selected]
        return Measurements(self.commanded[selected], self.position[selected], rotation)


@dataclass(frozen=True, eq=False)
class Fit:
    """Corrections that fit some rows."""

    corrections: Array  # (P,)
    scale: tuple[float, float]  # [mm, rad] of the measurements' noise, each component
    weights: Array  # (M,) in [0, 1]
    normal: Array  # (F, F) normal matrix of the free parameters, prior included, in units of the prior
    free_indices: NDArray[np.intp]  # (F,) of the corrections that were fitted


class Residuals(NamedTuple):
    """Differences between measured and modelled tips, and their dependence on the corrections."""

    position: Array  # (M, 3) [mm]
    turn: Array | None  # (M, 3) [rad]; None where no rotations were measured
    jacobian: Array  # (M, 6, P)


def residuals(model: CorrectedChain, corrections: Array, rows: Measurements) -> Residuals:
    """The residuals of the model with corrections (P,)."""
    T, J = model.poses(corrections, rows.commanded)
    position_residuals = rows.position - T[:, :3, 3]
    if rows.rotation is None:
        return Residuals(position_residuals, None, J)
    # half the sum of the columns' cross products is the rotation vector, with an error of third order
    rotation_residuals = 0.5 * np.cross(T[:, :3, :3], rows.rotation, axis=1).sum(axis=2)
    return Residuals(position_residuals, rotation_residuals, J)


def fit_corrections(
    model: CorrectedChain,
    rows: Measurements,
    free_indices: NDArray[np.intp],
    start: Array | None = None,
    steps: int = STEPS,
) -> Fit:
    """The best fit of the parameters of `free_indices`; the others stay at `start` (0)."""
    corrections = np.zeros(len(model.parameters)) if start is None else start.copy()
    prior = model.prior[free_indices]
    damping = 1e-3
    current = residuals(model, corrections, rows)
    fitted_count = 0.0  # effective number of fitted parameters
    for iteration in range(steps):
        scale = scales(current.position, current.turn, fitted_count)
        H, right_side = _normal_equations(current, scale, free_indices, prior)
        z = corrections[free_indices] / prior  # in units of the prior
        cost = _cost(current, scale, z)
        with_prior = H + np.eye(len(free_indices))
        fitted_count = float(np.trace(np.linalg.solve(with_prior, H))) if len(free_indices) else 0.0
        for _ in range(8):
            z_step = np.linalg.solve(with_prior + damping * np.diag(np.diag(H)), right_side - z)
            trial_corrections = corrections.copy()
            trial_corrections[free_indices] += z_step * prior
            trial_residuals = residuals(model, trial_corrections, rows)
            if _cost(trial_residuals, scale, z + z_step) <= cost:
                break
            damping = max(damping, 1e-6) * 10
        else:
            break  # no step lowers the cost
        corrections, current = trial_corrections, trial_residuals
        damping *= 0.1
        if np.abs(z_step).max(initial=0.0) < 1e-5 and iteration > 3:
            break
    scale = scales(current.position, current.turn, fitted_count)
    H, _ = _normal_equations(current, scale, free_indices, prior)
    row_weights = np.minimum(weights(current.position, scale[0]), weights(current.turn, scale[1]))
    return Fit(corrections, scale, row_weights, H + np.eye(len(free_indices)), free_indices)


def _cost(current: Residuals, scale: tuple[float, float], z: Array) -> float:
    """The minimised sum, for corrections z in units of the prior."""
    parts = ((current.position, scale[0]), (current.turn, scale[1]))
    return float(z @ z) + sum(loss(r, s) for r, s in parts if r is not None)


def _normal_equations(
    current: Residuals, scale: tuple[float, float], free_indices: NDArray[np.intp], prior: Array
) -> tuple[Array, Array]:
    """J^T W J and J^T W r of the free parameters, in units of the prior and the scales, without the prior."""
    J = current.jacobian[:, :, free_indices] * prior
    A, b = _weighted_equations(J[:, :3], current.position, scale[0])
    if current.turn is not None:
        A_turn, b_turn = _weighted_equations(J[:, 3:], current.turn, scale[1])
        A, b = np.concatenate([A, A_turn]), np.concatenate([b, b_turn])
    return A.T @ A, A.T @ b


def _weighted_equations(J: Array, r: Array, scale: float) -> tuple[Array, Array]:
    """Rows (3 M, F) and right sides (3 M,) of J x = r, each times the root of its weight, divided by the scale."""
    factor = np.sqrt(weights(r, scale)) / scale
    rows, values = J * factor[:, None, None], r * factor[:, None]
    return rows.reshape(values.size, J.shape[2]), values.reshape(-1)
