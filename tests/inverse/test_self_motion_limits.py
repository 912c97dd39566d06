"""A self-motion that passes through the limits has a branch within them, wherever `near` is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import armkin
from armkin.inverse.numeric.newton import missing


def narrowed(robot: str, width: float) -> tuple[armkin.Arm, np.random.Generator]:
    """An arm with a wrist whose joints have so many degrees each, around random middles; joint 5 passes zero."""
    arm, rng = armkin.load(robot), np.random.default_rng(4)
    middle = rng.uniform(-1, 1, arm.n)
    middle[4] = 0.0
    half = np.radians(width) / 2
    return replace(arm, lower=middle - half, upper=middle + half), rng


@pytest.mark.parametrize("width", [40, 150])
@pytest.mark.parametrize("robot", ["irb120", "puma560", "wx250s"])
def test_what_stands_within_limits_is_not_said_to_be_outside(robot: str, width: float) -> None:
    """A quarter of these were: joints 4 and 6 were listed where `near` has one of them, and the other was outside."""
    arm, rng = narrowed(robot, width)
    q, near = rng.uniform(arm.lower, arm.upper, (2, 120, arm.n))
    q[:, 4] = 0.0
    target = armkin.fk(arm, q)
    found = armkin.ik(arm, target, near=near)
    assert (found.status == armkin.Status.SINGULAR).all()
    assert (found.best >= 0).all()
    best = found.q[np.arange(len(q)), found.best]
    assert ((best >= arm.lower) & (best <= arm.upper)).all()
    assert missing(arm, found.task, best, target).max() < 1e-9
    for k in range(5):
        one = armkin.ik(arm, target[k], near=near[k])
        np.testing.assert_allclose(one.q[one.best], best[k], atol=1e-12)


def test_near_outside_limits_gives_way_to_a_posture_within() -> None:
    """Joint 4 at -180 degrees is beyond its -160; with joint 6 turned back it need not stand there."""
    arm = armkin.load("irb120")
    near = np.radians([45.0, 90.0, 0.0, -180.0, 0.0, 45.0])
    found = armkin.ik(arm, armkin.fk(arm, near), near=near)
    assert found.within_limits.any()
    np.testing.assert_allclose(armkin.fk(arm, found.q[found.best]), armkin.fk(arm, near), atol=1e-6)
