"""Degrees at the edge: what a robot file says comes back digit for digit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armkin
from armkin.model import units
from armkin.model.arm import from_links
from armkin.model.lock_joints import lock

ROBOTS = sorted((Path(__file__).parents[2] / "robots").glob("*.yaml"))


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_limits_home_and_poses_are_those_of_the_file(path: Path) -> None:
    arm = armkin.load(path)
    assert arm.file is not None
    joints = arm.file.joints
    assert units.limits_out(arm) == [j.limits or (-math.inf, math.inf) for j in joints]
    assert units.home_out(arm) == [j.home for j in joints]
    poses = {name: list(values) for name, values in (arm.file.poses or {}).items()}
    assert units.poses_out(arm) == {"home": [j.home for j in joints], **poses}


@given(st.integers(-(10**9), 10**9), st.integers(0, 9))
def test_every_decimal_of_nine_digits_comes_back(digits: int, places: int) -> None:
    value = float(f"{digits}e-{places}")
    limits = [[0, max(value, 0.0) * units.DEGREE or 1.0]]
    arm = from_links(np.tile(np.eye(4), (2, 1, 1)), [False], limits=limits)
    if value > 0:
        assert units.limits_out(arm) == [(0.0, value)]
    assert units.joint_as_typed(arm, 0, float(units.joints_in(arm, [value])[0])) == value


def test_a_locked_arm_has_its_own_limits() -> None:
    arm = armkin.load("panda")
    held = lock(arm, {"J3": 0.0})
    assert held.held == ("J3",)
    assert units.limits_out(held) == [ends for i, ends in enumerate(units.limits_out(arm)) if i != 2]
    assert len(held.homing) == held.n
