"""Limits the speed of a path so that a hold on it keeps every joint within its acceleration."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.speed_bounds import TINY, interval_parts
from armkin.motion.timing.trajectory import BRAKE_SHARE
from armkin.motors import motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def hold_cap(arm: Arm, path: Knots, share: float) -> Array:
    """Greatest x = (ds/dt)^2 at which a hold needs no more than `share` of any joint's max_accel: (N,).

    On a hold the board lets the leading motor m (the one with the longest way to a stop) slow down with BRAKE_SHARE of
    its greatest acceleration, b = BRAKE_SHARE a_m, along the path: u = -b / |n'_m| - n''_m x / n'_m, and a joint then
    accelerates with -q'_j b / |n'_m| + x (q''_j - q'_j n''_m / n'_m). The two terms may cancel in part, for example
    where the path speeds a joint up and the hold slows it down. At x = 0 the first term is at most
    BRAKE_SHARE max_accel, so a bound that holds at x holds at every lower speed down to rest.
    """
    parts = [
        _part_cap(arm, Knots(path.s[a : b + 1], path.q[a : b + 1], path.d[a : b + 1]), share)
        for a, b in ((intervals.start, intervals.stop) for intervals in interval_parts(len(path.s) - 1))
    ]
    for previous, following in pairwise(parts):
        following[0] = min(previous[-1], following[0])
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]])


def _part_cap(arm: Arm, path: Knots, share: float) -> Array:
    """`hold_cap` of a part of the path."""
    gain = arm.motor_gain
    brakes = BRAKE_SHARE * motor_accel(arm)
    ends = path.second_derivatives()
    caps = np.full(len(path.s), np.inf)
    rate = path.d @ gain.T
    leader = (np.abs(rate) / brakes).argmax(axis=1)
    lead = rate[np.arange(len(leader)), leader]
    lead = np.where(np.abs(lead) < TINY, TINY, lead)
    ratio = path.d / lead[:, None]  # q'_j / n'_m
    slowing_accel = -ratio * np.sign(lead)[:, None] * brakes[leader][:, None]
    max_accel = share * arm.max_accel
    for second, part in ((ends[0], slice(None, -1)), (ends[1], slice(1, None))):
        leader_bend = (second * gain[leader[part]]).sum(axis=1)
        bend = second - ratio[part] * leader_bend[:, None]
        margin = max_accel - np.sign(bend) * slowing_accel[part]
        interval_cap = np.maximum(margin, 0.0) / np.maximum(np.abs(bend), TINY)
        caps[part] = np.minimum(caps[part], interval_cap.min(axis=1))
    return caps
