"""A hold on a curve: motors slow down along the path at 5/8 of their accelerations, and no joint is overasked."""

from __future__ import annotations

import numpy as np
import pytest

import armkin
from armkin.motion.timing.curved_stretch import Curve
from armkin.motors import motor_accel

CIRCLE = {"start": {"point": [350, 0, 300]}, "moves": [{"circle": {"centre": [300, 0, 300]}}]}


def hold_acceleration(plan: armkin.PathPlan) -> float:
    """Greatest share of max_accel that a joint is asked for when the arm is held anywhere on the plan's curves.

    By finite differences of the way alone: the leading motor slows down with 5/8 of its greatest acceleration, as the
    frames ask the board to, the others follow along the path.
    """
    arm, worst = plan.arm, 0.0
    brakes = motor_accel(arm) * 5 / 8
    for curve in plan.motion.stretches:
        if not isinstance(curve, Curve):
            continue
        for t in np.linspace(0.02, curve.duration - 0.02, 200):
            v = curve.locate(np.array([t]))[2][0]
            q = curve.evaluate(np.array([t - 1e-4, t, t + 1e-4]))
            s = curve.lengths(np.array([t - 1e-4, t, t + 1e-4]))
            first = (q[2] - q[0]) / (s[2] - s[0])
            second = 2 * ((q[2] - q[1]) / (s[2] - s[1]) - (q[1] - q[0]) / (s[1] - s[0])) / (s[2] - s[0])
            rate, bend = arm.motor_gain @ first, arm.motor_gain @ second
            m = int(np.argmax(np.abs(rate) / brakes))
            slower = (-np.sign(rate[m]) * brakes[m] - bend[m] * v**2) / rate[m]
            worst = max(worst, float(np.abs((first * slower + second * v**2) / arm.max_accel).max()))
    return worst


@pytest.mark.parametrize(("hold", "most"), [(1.5, 1.52), (1.0, 1.02)])
def test_a_hold_asks_for_no_more_than_it_may(hold: float, most: float) -> None:
    arm = armkin.load("three_dof")
    assert hold_acceleration(armkin.path(arm, CIRCLE, hold=hold)) <= most
    assert hold_acceleration(armkin.path(arm, CIRCLE, hold=None)) > most + 0.1  # without the cap it does


def test_the_cap_costs_little() -> None:
    arm = armkin.load("three_dof")
    free, held = (armkin.path(arm, CIRCLE, hold=hold).duration for hold in (None, 1.5))
    assert free < held <= 2.45
    assert armkin.path(arm, CIRCLE).duration == held  # it is the default
