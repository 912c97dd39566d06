"""`armkin.time_law`: the fastest timing of a given joint path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import as_joints, position
from armkin.motion.branches.branch_path import coupled_motors
from armkin.motion.joint_moves import check_rates
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.hold_speed_limit import hold_cap
from armkin.motion.timing.limit_jerk import Smoothed, fastest_timing, smoothed, smoothing_window
from armkin.motion.timing.time_optimal import Bounds, knots_of_samples, optimal_law, refine_knots
from armkin.motion.timing.trajectory import Trajectory

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def time_law(
    arm: Arm,
    q: ArrayLike,
    s: ArrayLike | None = None,
    *,
    speed: float = 1.0,
    accel: float = 1.0,
    tool_speed: float | None = None,
    jerk: ArrayLike | None = None,
    hold: float | None = None,
) -> Trajectory:
    """The fastest motion from rest to rest through joint values that are samples of a smooth way.

    Method: Pham and Pham, A new approach to time-optimal path parameterization based on reachability analysis, 2018.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (N, n) [rad | mm] the samples, N at least 5.
        s: (N,) [any unit] the parameter of the samples, increasing; by default their numbers.
        speed: [1] fraction of the joints' max_speed.
        accel: [1] fraction of the joints' max_accel.
        tool_speed: [mm/s] of the tool at most; None: no bound.
        jerk: () or (n,) [rad/s3 | mm/s3] at most, by a moving average; None: no bound.
        hold: [1] how many times max_accel a joint may be asked for when the board holds on the way; None: no matter.

    Returns:
        The motion, sampled at will: `duration` [s], `q(t)`, `qd(t)`, `qdd(t)` (..., n) [rad | mm, per s, per s2].

    Raises:
        UsageError: samples that are no way, or an arm without max_speed and max_accel.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof")
    >>> turned = np.linspace(0, np.pi / 2, 500)
    >>> q = np.stack([turned, 1.2 + 0.1 * np.sin(turned), -1.0 + 0 * turned], axis=1)
    >>> round(armkin.time_law(arm, q).duration, 3)
    2.0
    """
    check_rates(arm)
    values = as_joints(arm, q)
    parameter = np.arange(len(values), dtype=float) if s is None else np.asarray(s, dtype=float)
    _check_samples(arm, values, parameter)
    path = refine_knots(knots_of_samples(parameter, values))
    cap = _speed_cap(arm, path, tool_speed, hold)

    def timed(share: float) -> list[Curve | Smoothed]:
        limits: Array = arm.max_accel * accel * share
        x = optimal_law(path, Bounds(arm.max_speed * speed, limits, cap), coupled_motors(arm, accel * share))
        curve = Curve(path, x)
        return [curve if jerk is None else smoothed(curve, smoothing_window(limits, jerk))]

    return Trajectory(arm, values[0], tuple(timed(1.0) if jerk is None else fastest_timing(timed)))


def _check_samples(arm: Arm, values: Array, parameter: Array) -> None:
    """Raise UsageError unless there are five samples at least, all finite, with an increasing parameter."""
    if values.ndim != 2 or len(values) < 5 or parameter.shape != values.shape[:1]:
        raise UsageError(
            f"a way has samples (N, {arm.n}), N at least 5, and s (N,); got {values.shape}, {parameter.shape}"
        )
    if not (np.isfinite(values).all() and np.isfinite(parameter).all() and (np.diff(parameter) > 0).all()):
        raise UsageError("samples must be finite, and s must increase from each to the next")


def _speed_cap(arm: Arm, path: Knots, tool_speed: float | None, hold: float | None) -> Array:
    """The square of the greatest speed along the path (N,), by the tool's speed [mm/s] and by a hold on the way."""
    cap = np.full(len(path.s), np.inf)
    if tool_speed is not None:
        tip = np.linalg.norm(np.diff(position(arm, path.q), axis=0), axis=1) / path.h
        tip = np.maximum(np.append(tip, 0.0), np.append(0.0, tip))
        cap = (tool_speed / np.maximum(tip, 1e-150)) ** 2
    if hold is not None:
        cap = np.minimum(cap, hold_cap(arm, path, hold))
    return cap
