"""Joint waypoints without a stop: straight lines in joint space, their corners rounded by parabolas."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model import units
from armkin.model.limits import check_limits
from armkin.motion.branches.branch_path import coupled_motors
from armkin.motion.joint_moves import check_jerk, check_rates, plan_joint_moves
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.hold_speed_limit import hold_cap
from armkin.motion.timing.limit_jerk import share_within, smoothed, smoothing_window
from armkin.motion.timing.time_optimal import Bounds, optimal_law
from armkin.motion.timing.trajectory import Trajectory

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_NODE_COUNT = 12  # grid points of a line, and of a corner


def round_waypoints(
    arm: Arm,
    start: ArrayLike,
    targets: ArrayLike,
    blend: float,
    *,
    speed: float = 1.0,
    accel: float = 1.0,
    hold: float | None = None,
) -> Trajectory:
    """From joint values through joint targets, within `blend` of each, as fast as the joints allow.

    start: (n,); targets: (w, n) [rad | mm]; blend: how far from a corner its rounding begins, as the length of the
    change of joint values in degrees and mm, at most half of the way to the next corner. The rounding stays between
    the corner and its chord: within all limits that the corners keep. The jerk of an arm with max_jerk is kept by a
    moving average, for which the corner is left earlier; it is passed within `blend`. Other arguments as in
    `armkin.path`.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof")
    >>> corners = np.deg2rad([[20, 90, -90], [20, 70, -90], [0, 70, -90]])
    >>> round(round_waypoints(arm, arm.home, corners, 10.0).duration, 2) < 2.0
    True
    """
    check_rates(arm)
    if not (np.isfinite(blend) and blend > 0):
        raise UsageError(f"a blend of {blend:g} rounds nothing; it must be above 0")
    goals = np.atleast_2d(np.asarray(targets, dtype=float))
    check_limits(arm, goals)
    unit = np.where(arm.prismatic, 1.0, units.DEGREE)
    corners = np.vstack([np.asarray(start, dtype=float), goals]) / unit
    corners = corners[np.concatenate([[True], np.linalg.norm(np.diff(corners, axis=0), axis=1) > 1e-9])]
    first = np.asarray(start, dtype=float)
    if len(corners) < 2:
        return Trajectory(arm, first, ())
    path = _scale_joints(_rounded_way(corners, blend), unit)
    cap = np.full(len(path.s), np.inf)
    if hold is not None and len(arm.motor_gain) and arm.motor_gain.any(axis=0).all():
        cap = hold_cap(arm, path, hold)
    window, jerk = 0.0, check_jerk(arm, None)
    if jerk is not None:
        # a parabola is at most half a blend from its corner, so the average may be the other half from the parabola
        accel *= share_within(blend / 2, arm.max_accel * accel / unit, jerk / unit)
        window = smoothing_window(arm.max_accel * accel, jerk)
    bounds = Bounds(arm.max_speed * speed, arm.max_accel * accel, cap)
    curve = Curve(path, optimal_law(path, bounds, coupled_motors(arm, accel)), len(goals))
    rounded = Trajectory(arm, first, (smoothed(curve, window),))
    if jerk is None:
        return rounded
    stopped = plan_joint_moves(arm, first, goals, speed=speed)  # with little jerk, or a small blend, this is faster
    return min(rounded, stopped, key=lambda trajectory: trajectory.duration)


def _rounded_way(corners: Array, blend: float) -> Knots:
    """The knots of the polyline through corners (w, n), no two neighbours equal, that parabolas round by `blend`."""
    side = np.diff(corners, axis=0)
    length = np.linalg.norm(side, axis=1)
    direction = side / length[:, None]
    cut = np.concatenate([[0.0], np.minimum(blend, np.minimum(length[:-1], length[1:]) / 2), [0.0]])
    q, slopes, s = [corners[:1]], [direction[:1]], [np.zeros(1)]
    fraction = np.linspace(0.0, 1.0, _NODE_COUNT + 1)[1:, None]
    length_before = 0.0
    for i in range(len(side)):
        straight_begin = corners[i] + cut[i] * direction[i]
        straight_length = length[i] - cut[i] - cut[i + 1]
        if straight_length > 1e-9 * length[i]:
            q.append(straight_begin + fraction * straight_length * direction[i])
            slopes.append(np.repeat(direction[i : i + 1], _NODE_COUNT, axis=0))
            s.append(length_before + fraction[:, 0] * straight_length)
            length_before += straight_length
        if i + 1 < len(side):  # a parabola whose tangents are the two sides
            cut_length = cut[i + 1]
            begin, corner = corners[i + 1] - cut_length * direction[i], corners[i + 1]
            end = corner + cut_length * direction[i + 1]
            q.append((1 - fraction) ** 2 * begin + 2 * fraction * (1 - fraction) * corner + fraction**2 * end)
            slopes.append((1 - fraction) * direction[i] + fraction * direction[i + 1])
            s.append(length_before + 2 * cut_length * fraction[:, 0])
            length_before += 2 * cut_length
    return Knots(np.concatenate(s), np.concatenate(q), np.concatenate(slopes))


def _scale_joints(path: Knots, unit: Array) -> Knots:
    """The path's joint values and their derivatives times `unit` (n,): in [rad | mm]."""
    return Knots(path.s, path.q * unit, path.d * unit)
