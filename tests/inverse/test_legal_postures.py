"""Edges of which other postures than those closest to `near` are within limits."""

from __future__ import annotations

import numpy as np
import pytest
from oracle import goal, missing
from test_every_branch import shipped

import armkin
from armkin import Status

CASES = [
    # joint 4 is outside its limits where joint 1 is closest to home, and not where it is turned
    ("thor", None, [-90, 0, 0, -90, -90, 0], Status.SINGULAR),
    # an SO-101 that points straight down: joint 5 may turn, joint 1 hardly
    ("so101", "xyz_axis", [-5, -85, -95, -90, 90], Status.SINGULAR),
    # a double root at a limit of joint 5, which rounding moves by 2e-8 rad beyond it
    ("stanford", None, [45, 0, 902, -45, -90, 45], Status.BOUNDARY),
]


@pytest.mark.parametrize(("name", "task", "q", "status"), CASES)
def test_a_legal_posture_of_an_edge_is_listed(name: str, task: str | None, q: list[float], status: Status) -> None:
    """No branch was within limits, and the nearest pose within limits 0.0000 mm away."""
    arm, screw = shipped(name)
    joints = np.where(arm.prismatic, q, np.radians(q))
    target = armkin.fk(arm, joints)
    if task is not None:
        target = np.array([*target[:3, 3], 0.0, 0.0, -1.0])
    s = armkin.ik(arm, target, task)
    assert s.status == status
    assert s.best >= 0
    legal = s.q[s.best]
    assert (legal >= arm.lower - 1e-9).all()
    assert (legal <= arm.upper + 1e-9).all()
    mm, rad = missing(screw, goal(s.task, screw, joints[None]), legal[None])
    assert mm[0] < 1e-9 * arm.reach
    assert rad[0] < 1e-8
    other = armkin.fk(arm, joints * 0.9)
    other = np.array([*other[:3, 3], *other[:3, 2]]) if task is not None else other
    batch = armkin.ik(arm, np.array([other, target]), task)
    np.testing.assert_array_equal(batch.q[1][batch.valid[1]], s.q[s.valid])
