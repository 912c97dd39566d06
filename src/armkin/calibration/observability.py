"""What the rows show: which corrections they determine, which only as sums, and which poses would tell more.

All from the fit's normal matrix in units of the prior: its inverse says how much of each correction's prior doubt is
left (Hollerbach and Wampler, The calibration index and taxonomy for robot kinematic calibration methods, 1996).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.calibration.corrected_chain import Model
from armkin.calibration.dropped_rows import MIN_SCALES
from armkin.calibration.robust_fit import Fit
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model import units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.model.arm import Arm

UNSEEN = 0.7  # share of the prior's doubt: a correction of which more is left is not shown by the rows
SUM_CORRELATION = 0.9  # correlation of two corrections from which on only their sum is seen
CANDIDATES = 400  # postures among which the next ones to measure are chosen
UNLIMITED = np.pi, 200.0  # way [rad, mm] that an unlimited joint is moved for a suggestion


def doubts(model: Model, fit: Fit) -> Array:
    """How large each free correction may still be: (F,) standard deviations [mm, rad, 1]."""
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(fit.normal))) * model.prior[fit.free])


def unseen_corrections(model: Model, fit: Fit) -> list[str]:
    """Corrections that the rows do not show, in words; those of which they show the sum stand together."""
    if not len(fit.free):
        return []
    spread = np.linalg.inv(fit.normal)
    left = np.sqrt(np.diag(spread))
    correlation = spread / np.outer(left, left)
    names = [model.parameters[k].name for k in fit.free]
    weak = np.flatnonzero(left > UNSEEN)
    lines: list[str] = []
    grouped: set[int] = set()
    for k in weak:
        if k in grouped:
            continue
        group = [k] + [j for j in np.flatnonzero(np.abs(correlation[k]) > SUM_CORRELATION) if j != k]
        grouped.update(int(j) for j in group)
        lines.append(names[k] if len(group) == 1 else " + ".join(names[j] for j in group) + " (only their sum)")
    return lines


def left_open(model: Model, fit: Fit) -> float:
    """The tip's standard deviation after a fit, by the fit's covariance [mm]: root mean square over 100 poses.

    The poses are random, within limits.
    """
    J = model.poses(fit.p, _random_poses(model.arm, 100))[1][:, :3, fit.free] * model.prior[fit.free]
    return float(np.sqrt(np.einsum("mip,pq,miq->m", J, np.linalg.inv(fit.normal), J, optimize=True).mean()))


def suggest_poses(model: Model, count: int, free: NDArray[np.intp], measured: Array | None = None) -> Array:
    """Joint values (count, n) whose measurement would tell most, one after the other, within limits.

    free: the corrections to see; measured: (M, n) poses measured already. Each next pose is that of 400 random ones
    with the largest gain of information, log det(I + J N^-1 J^T) (D-optimality, greedily).
    """
    if count < 1 or count > 1000:
        raise UsageError(f"{count} poses cannot be suggested; ask for 1 to 1000")
    arm = model.arm
    step = units.joint_scale(arm)  # whole degrees and millimetres, as people type them
    low, high = _joint_range(arm)
    candidates = np.clip(np.round(_random_poses(arm, CANDIDATES) / step) * step, low, high)
    J = _whitened_jacobian(model, candidates, free)
    N = np.eye(len(free))
    if measured is not None and len(measured):
        rows = _whitened_jacobian(model, measured, free).reshape(-1, len(free))
        N += rows.T @ rows
    chosen: list[int] = []
    for _ in range(count):
        gain = np.linalg.slogdet(np.eye(3) + J @ np.linalg.solve(N, np.swapaxes(J, 1, 2)))[1]
        gain[chosen] = -np.inf if len(chosen) < CANDIDATES else gain[chosen]
        k = int(np.argmax(gain))
        chosen.append(k)
        N = N + J[k].T @ J[k]
    return np.asarray(candidates[chosen])


def _joint_range(arm: Arm) -> tuple[Array, Array]:
    """Limits, lower and upper (n,) [rad | mm]; where a joint has none, half a turn or 200 mm to that side."""
    span = np.where(arm.prismatic, UNLIMITED[1], UNLIMITED[0])
    low = np.where(np.isfinite(arm.lower), arm.lower, np.where(np.isfinite(arm.upper), arm.upper - span, -span))
    return low, np.where(np.isfinite(arm.upper), arm.upper, np.where(np.isfinite(arm.lower), arm.lower + span, span))


def _random_poses(arm: Arm, count: int) -> Array:
    """Random joint values (count, n) within limits, the same each time."""
    return np.random.default_rng(3).uniform(*_joint_range(arm), (count, arm.n))


def _whitened_jacobian(model: Model, c: Array, free: NDArray[np.intp]) -> Array:
    """What the corrections do to the tip, in units of the prior and of a noise of 0.1 mm: (M, 3, F)."""
    J = model.poses(np.zeros(len(model.parameters)), c)[1][:, :3, free]
    return np.asarray(J * model.prior[free] / max(0.1, MIN_SCALES[0]))
