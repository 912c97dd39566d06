"""Robust damped Gauss-Newton with a prior.

Minimised is sum rho(|r_k| / s) + sum (p_i / prior_i)^2, with the loss rho and the scale s of `dropped_rows`: rows
that are far out are forgotten. What the rows do not show stays where the prior has it: at the robot file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armkin.calibration.corrected_chain import Model
from armkin.calibration.dropped_rows import loss, scales, weights
from armkin.formula.arrays import Array

STEPS = 40  # steps, at most, of a fit


@dataclass(frozen=True, eq=False)
class Measurements:
    """Commanded joint values and measured tips."""

    c: Array  # (M, n) [rad | mm]
    position: Array  # (M, 3) [mm]
    rotation: Array | None = None  # (M, 3, 3)

    def __len__(self) -> int:
        return len(self.c)

    def take(self, selected: NDArray[np.intp] | NDArray[np.bool_]) -> Measurements:
        """Some of the rows."""
        return Measurements(
            self.c[selected], self.position[selected], None if self.rotation is None else self.rotation[selected]
        )


@dataclass(frozen=True, eq=False)
class Fit:
    """Corrections that fit some rows."""

    p: Array  # (P,)
    scale: tuple[float, float]  # [mm, rad] of the measurements' noise, each component
    weights: Array  # (M,) in [0, 1]
    normal: Array  # (F, F) normal matrix of the free parameters, prior included, in units of the prior
    free: NDArray[np.intp]  # (F,)


def residuals(model: Model, p: Array, rows: Measurements) -> tuple[Array, Array | None, Array]:
    """What the model misses: (M, 3) [mm], (M, 3) [rad] or None, and the Jacobian (M, 6, P)."""
    T, J = model.poses(p, rows.c)
    position_residuals = rows.position - T[:, :3, 3]
    if rows.rotation is None:
        return position_residuals, None, J
    # Half the sum of the columns' cross products is the rotation vector to third order.
    turned = 0.5 * np.cross(T[:, :3, :3], rows.rotation, axis=1).sum(axis=2)
    return position_residuals, turned, J


def fit_corrections(
    model: Model,
    rows: Measurements,
    free: NDArray[np.intp],
    start: Array | None = None,
    steps: int = STEPS,
) -> Fit:
    """The corrections of the free parameters that fit best; the others stay at `start` (0)."""
    p = np.zeros(len(model.parameters)) if start is None else start.copy()
    prior = model.prior[free]
    damping = 1e-3
    scale = (0.0, 0.0)
    position_residuals, turned, J = residuals(model, p, rows)
    held = 0.0  # numbers that the fit itself has used up
    for step in range(steps):
        scale = scales(position_residuals, turned, held)
        weight, weight_turn = weights(position_residuals, scale[0]), weights(turned, scale[1])
        H, g = _normal_equations(J[:, :, free] * prior, position_residuals, turned, weight, weight_turn, scale)
        z = p[free] / prior
        cost = _cost(position_residuals, turned, scale, z)
        with_prior = H + np.eye(len(free))
        held = float(np.trace(np.linalg.solve(with_prior, H))) if len(free) else 0.0
        better = False
        for _ in range(8):
            move = np.linalg.solve(with_prior + damping * np.diag(np.diag(H)), g - z)
            trial = p.copy()
            trial[free] += move * prior
            trial_residuals = residuals(model, trial, rows)
            if _cost(trial_residuals[0], trial_residuals[1], scale, z + move) <= cost:
                better = True
                break
            damping = max(damping, 1e-6) * 10
        if not better:
            break
        p, (position_residuals, turned, J) = trial, trial_residuals
        damping *= 0.1
        if np.abs(move).max(initial=0.0) < 1e-5 and step > 3:
            break
    scale = scales(position_residuals, turned, held)
    weight, weight_turn = weights(position_residuals, scale[0]), weights(turned, scale[1])
    H, _ = _normal_equations(J[:, :, free] * prior, position_residuals, turned, weight, weight_turn, scale)
    return Fit(p, scale, np.minimum(weight, weight_turn), H + np.eye(len(free)), free)


def _cost(position_residuals: Array, rotation_residuals: Array | None, scale: tuple[float, float], z: Array) -> float:
    return float(z @ z) + sum(
        loss(r, s) for r, s in ((position_residuals, scale[0]), (rotation_residuals, scale[1])) if r is not None
    )


def _normal_equations(
    J: Array,
    position_residuals: Array,
    rotation_residuals: Array | None,
    weight: Array,
    weight_turn: Array,
    scale: tuple[float, float],
) -> tuple[Array, Array]:
    """J^T W J and J^T W r in units of the prior and the scales, without the prior."""
    rows = J[:, :3] * (np.sqrt(weight) / scale[0])[:, None, None]
    values = position_residuals * (np.sqrt(weight) / scale[0])[:, None]
    A, b = rows.reshape(values.size, J.shape[2]), values.reshape(-1)
    if rotation_residuals is not None:
        rows = J[:, 3:] * (np.sqrt(weight_turn) / scale[1])[:, None, None]
        values = rotation_residuals * (np.sqrt(weight_turn) / scale[1])[:, None]
        A, b = np.concatenate([A, rows.reshape(values.size, J.shape[2])]), np.concatenate([b, values.reshape(-1)])
    return A.T @ A, A.T @ b
