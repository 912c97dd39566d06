"""The remainder of a stretch after a stop on it: the same path through joint space, started from rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.motion.joint_moves import straight_move
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.profile import rest_profile, seven_phases, trapezoid
from armkin.motion.timing.trajectory import Straight
from armkin.motors import motor_accel, pulses

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch

_TIME_STEP = 0.002  # step [s] of the plan's time between two grid points
_MIN_SHARE = 1e-9  # least share of a straight line that is left, so that its rates stay finite
_SHORT_TIME = 0.05  # a remainder below this time [s] is slow and nearly straight


def remainder(arm: Arm, stretch: Stretch, begin: float, present: Array) -> Stretch:
    """The part of a stretch from its time `begin` [s] on, for an arm at rest at joint values `present` (n,).

    It follows the plan's own time law after a run-up, in which the plan's time s passes at a rate that grows from 0 to
    1. The joints' accelerations bound that growth: |q'(s) u + q''(s) x| <= max_accel with x = (ds/dt)^2 and u half its
    slope, which allows u >= 0 wherever the plan itself keeps to the limits.
    """
    time_left = stretch.duration - begin
    if isinstance(stretch, Straight) and np.array_equal(stretch.start, stretch.end):  # a curve may be closed
        if np.array_equal(pulses(arm, present), pulses(arm, stretch.end)):
            return Straight(stretch.end, stretch.end, rest_profile(max(time_left, 0.0)))  # a pause
        return straight_move(arm, present, stretch.end)
    if isinstance(stretch, Straight):
        return _rest_of_line(arm, stretch, begin, present)
    if time_left < _SHORT_TIME:
        return straight_move(arm, present, stretch.end)
    s = _grid_times(stretch, begin)
    path = Knots(s, stretch.evaluate(s), stretch.evaluate(s, 1))
    return Curve(path, _run_up(arm, path))


def _rest_of_line(arm: Arm, stretch: Straight, begin: float, present: Array) -> Straight:
    """The remainder of a straight line, within the plan's own speed, acceleration and jerk."""
    share = max(1.0 - float(stretch.law.evaluate(np.array([begin]))[0]), _MIN_SHARE)
    # Rounding to whole steps changes the joints' shares on a short path, so each keeps its own limits, too.
    fastest = straight_move(arm, present, stretch.end).law
    if not fastest.length:
        return Straight(present, stretch.end, fastest)
    peak, accel = min(stretch.law.peak / share, fastest.peak), min(stretch.law.accel / share, fastest.accel)
    jerks = [float(jerk.max()) for jerk in (stretch.law.jerk / share, fastest.jerk) if jerk.any()]
    law = seven_phases(1.0, peak, accel, min(jerks)) if jerks else trapezoid(1.0, peak, accel)
    return Straight(present, stretch.end, law)


def _grid_times(stretch: Stretch, begin: float) -> Array:
    """Times of the plan from `begin` to its end, at most 2 ms apart, with those at which its acceleration jumps."""
    jumps = stretch.times[stretch.times > begin + 1e-4] if isinstance(stretch, Curve) else np.array([stretch.duration])
    edges = np.concatenate([[begin], jumps])
    parts = np.maximum(np.ceil(np.diff(edges) / _TIME_STEP), 1).astype(int)
    return np.asarray(np.interp(np.arange(parts.sum() + 1), np.concatenate([[0], np.cumsum(parts)]), edges))


def _run_up(arm: Arm, path: Knots) -> Array:
    """(ds/dt)^2, from 0 up to 1, at the grid points of a path that is parametrised by its plan's time."""
    max_accel = np.concatenate([arm.max_accel, motor_accel(arm)])
    second = path.second_derivatives()

    def rows(d: Array) -> Array:
        return np.concatenate([d, d @ arm.motor_gain.T], axis=-1)

    # Both ends of every interval keep to the limits; joints and motors alike.
    P = np.stack([rows(path.d[:-1]), rows(path.d[1:])], axis=1)
    Q = np.stack([rows(second[0]), rows(second[1])], axis=1)
    size, bend = np.maximum(np.abs(P), 1e-12), Q * np.sign(P)
    x = np.empty(len(path.s))
    x[0] = 0.0
    for i, h in enumerate(path.h):
        # |P u + Q (x + 2 h u f)| <= most, f = 0 and 1 at the two ends
        ends = (max_accel - bend[i] * x[i]) / np.maximum(size[i] + bend[i] * np.array([[0.0], [2 * h]]), 1e-12)
        x[i + 1] = min(1.0, x[i] + 2 * h * max(float(ends.min()), 0.0))
    return x
