"""The rest of a stretch that was left in its middle: the same way through joint space, from rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.motion.joint_moves import straight_move
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.profile import rest_profile, trapezoid
from armkin.motion.timing.trajectory import Straight
from armkin.motors import motor_accel, pulses

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch

_TIME_STEP = 0.002  # step [s] of the plan's time between grid points
_SHORT_TIME = 0.05  # length [s] of the plan's time below which what is left is slow, and as good as straight


def remainder(arm: Arm, stretch: Stretch, begin: float, standing: Array) -> Stretch:
    """What a stretch has left at its time `begin` [s], where the arm stands still at joint values `standing` (n,).

    The plan's own time law, but for a run-up: its time s passes at a rate that grows from 0 to 1 as the joints'
    accelerations allow, |q'(s) u + q''(s) x| <= max_accel with x = (ds/dt)^2 and u half its slope; they allow u >= 0
    wherever the plan itself keeps to them.
    """
    left = stretch.duration - begin
    if np.array_equal(stretch.start, stretch.end):
        if np.array_equal(pulses(arm, standing), pulses(arm, stretch.end)):
            return Straight(stretch.end, stretch.end, rest_profile(max(left, 0.0)))  # a pause
        return straight_move(arm, standing, stretch.end)
    if isinstance(stretch, Straight) and stretch.law.is_trapezoid:
        share = max(1.0 - float(stretch.law.evaluate(np.array([begin]))[0]), 1e-9)
        # On a short way whole steps change the share of some joints: there they keep to their own limits.
        fastest = straight_move(arm, standing, stretch.end).law
        top, accel = min(stretch.law.peak / share, fastest.peak), min(stretch.law.accel / share, fastest.accel)
        return Straight(standing, stretch.end, trapezoid(1.0, top, accel) if fastest.length else fastest)
    if left < _SHORT_TIME:
        return straight_move(arm, standing, stretch.end)
    s = _grid_times(stretch, begin)
    path = Knots(s, stretch.evaluate(s), stretch.evaluate(s, 1))
    return Curve(path, _run_up(arm, path))


def _grid_times(stretch: Stretch, begin: float) -> Array:
    """Times of the plan from `begin` to its end, 2 ms apart at most; where its acceleration jumps there is one."""
    jumps = stretch.times[stretch.times > begin + 1e-4] if isinstance(stretch, Curve) else np.array([stretch.duration])
    edges = np.concatenate([[begin], jumps])
    parts = np.maximum(np.ceil(np.diff(edges) / _TIME_STEP), 1).astype(int)
    return np.asarray(np.interp(np.arange(parts.sum() + 1), np.concatenate([[0], np.cumsum(parts)]), edges))


def _run_up(arm: Arm, path: Knots) -> Array:
    """(ds/dt)^2 at the grid points of a way that is parametrised by its plan's time: from 0 up to 1."""
    most = np.concatenate([arm.max_accel, motor_accel(arm)])
    second = path.second_derivatives()

    def rows(d: Array) -> Array:
        return np.concatenate([d, d @ arm.motor_gain.T], axis=-1)

    # Both ends of every interval keep to the limits; joints and motors alike.
    P = np.stack([rows(path.d[:-1]), rows(path.d[1:])], axis=1)
    Q = np.stack([rows(second[0]), rows(second[1])], axis=1)
    size, along = np.maximum(np.abs(P), 1e-12), Q * np.sign(P)
    x = np.empty(len(path.s))
    x[0] = 0.0
    for k, h in enumerate(path.h):
        # |P u + Q (x + 2 h u f)| <= most, f = 0 and 1 at the two ends
        ends = (most - along[k] * x[k]) / np.maximum(size[k] + along[k] * np.array([[0.0], [2 * h]]), 1e-12)
        x[k + 1] = min(1.0, x[k] + 2 * h * max(float(ends.min()), 0.0))
    return x
