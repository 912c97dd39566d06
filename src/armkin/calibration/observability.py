"""Observability: which corrections the rows determine, singly or only as sums, and which poses add most.

All from the fit's normal matrix in units of the prior: its inverse says how much of each correction's prior doubt is
left (Hollerbach and Wampler, The calibration index and taxonomy for robot kinematic calibration methods, 1996).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.calibration.corrected_chain import CorrectedChain
from armkin.calibration.dropped_rows import MIN_POSITION_SCALE
from armkin.calibration.robust_fit import Fit
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model import units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.model.arm import Arm

UNSEEN_SHARE = 0.7  # remaining share of the prior's deviation above which the rows do not determine a correction
SUM_CORRELATION = 0.9  # correlation of two corrections above which only their sum is determined
CANDIDATE_COUNT = 400  # random postures from which the next ones to measure are chosen
UNLIMITED_TURN, UNLIMITED_SLIDE = np.pi, 200.0  # range [rad], [mm] to each side of an unlimited joint


def correction_deviations(model: CorrectedChain, fit: Fit) -> Array:
    """The remaining standard deviation of each free correction: (F,) [mm, rad, 1]."""
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(fit.normal))) * model.prior[fit.free_indices])


def unseen_corrections(model: CorrectedChain, fit: Fit) -> list[str]:
    """Texts about corrections that the rows do not determine; those with a determined sum share a text."""
    if not len(fit.free_indices):
        return []
    covariance = np.linalg.inv(fit.normal)
    deviations = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviations, deviations)
    names = [model.parameters[number].name for number in fit.free_indices]
    unseen_numbers = np.flatnonzero(deviations > UNSEEN_SHARE)
    texts: list[str] = []
    grouped_numbers: set[int] = set()
    for number in unseen_numbers:
        if number in grouped_numbers:
            continue
        group = [number] + [j for j in np.flatnonzero(np.abs(correlation[number]) > SUM_CORRELATION) if j != number]
        grouped_numbers.update(int(j) for j in group)
        texts.append(names[number] if len(group) == 1 else " + ".join(names[j] for j in group) + " (only their sum)")
    return texts


def tip_deviation(model: CorrectedChain, fit: Fit) -> float:
    """Standard deviation of the tip [mm] by the covariance of a fit: root mean square over 100 poses.

    The poses are random, within limits.
    """
    _, J = model.poses(fit.corrections, _random_poses(model.arm, 100))
    J = J[:, :3, fit.free_indices] * model.prior[fit.free_indices]
    return float(np.sqrt(np.einsum("mip,pq,miq->m", J, np.linalg.inv(fit.normal), J, optimize=True).mean()))


def suggest_poses(
    model: CorrectedChain, count: int, free_indices: NDArray[np.intp], measured: Array | None = None
) -> Array:
    """The most informative joint values (count, n) to measure next, within limits.

    free_indices: the corrections to determine; measured: (M, n) poses measured already. Each next pose is the one of
    400 random poses with the largest gain of information, log det(I + J N^-1 J^T) (greedy D-optimality).
    """
    if count < 1 or count > 1000:
        raise UsageError(f"{count} poses cannot be suggested; ask for 1 to 1000")
    arm = model.arm
    step = units.joint_scale(arm)  # whole degrees and millimetres, as people type them
    low, high = _joint_range(arm)
    candidates = np.clip(np.round(_random_poses(arm, CANDIDATE_COUNT) / step) * step, low, high)
    J = _whitened_jacobian(model, candidates, free_indices)
    N = np.eye(len(free_indices))
    if measured is not None and len(measured):
        rows = _whitened_jacobian(model, measured, free_indices).reshape(-1, len(free_indices))
        N += rows.T @ rows
    chosen_numbers: list[int] = []
    for _ in range(count):
        gain = np.linalg.slogdet(np.eye(3) + J @ np.linalg.solve(N, np.swapaxes(J, 1, 2)))[1]
        gain[chosen_numbers] = -np.inf if len(chosen_numbers) < CANDIDATE_COUNT else gain[chosen_numbers]
        best_number = int(np.argmax(gain))
        chosen_numbers.append(best_number)
        N = N + J[best_number].T @ J[best_number]
    return np.asarray(candidates[chosen_numbers])


def _joint_range(arm: Arm) -> tuple[Array, Array]:
    """Lower and upper limits (n,) [rad | mm]; half a turn or 200 mm to a side without a limit."""
    span = np.where(arm.prismatic, UNLIMITED_SLIDE, UNLIMITED_TURN)
    low = np.where(np.isfinite(arm.lower), arm.lower, np.where(np.isfinite(arm.upper), arm.upper - span, -span))
    return low, np.where(np.isfinite(arm.upper), arm.upper, np.where(np.isfinite(arm.lower), arm.lower + span, span))


def _random_poses(arm: Arm, count: int) -> Array:
    """Random joint values (count, n) within limits, the same each time."""
    return np.random.default_rng(3).uniform(*_joint_range(arm), (count, arm.n))


def _whitened_jacobian(model: CorrectedChain, commanded: Array, free_indices: NDArray[np.intp]) -> Array:
    """Displacement of the tip by the corrections, in units of the prior and of a noise of 0.1 mm: (M, 3, F)."""
    J = model.poses(np.zeros(len(model.parameters)), commanded)[1][:, :3, free_indices]
    return np.asarray(J * model.prior[free_indices] / max(0.1, MIN_POSITION_SCALE))
