"""A self-motion whose nearest posture hits something is answered by its nearest free one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.inverse.singular.legal_postures import follow_self_motion
from armkin.inverse.tasks.choose_task import task_for
from armkin.keep_out.clearance import hits_nothing

JOINTS = np.deg2rad([20.0, -70.0, 60.0, 30.0, 0.0, 50.0])  # four parallel axes: the elbow can move


@pytest.fixture
def arm(tmp_path: Path) -> armkin.Arm:
    path = tmp_path / "scene.yaml"
    path.write_text("keep_out: [capsule: {from: [-540, -196, 760], to: [-500, -182, 700], radius: 20}]\n")
    return armkin.load("ur5e", scene=path)


def test_the_nearest_free_posture_of_a_self_motion_is_the_branch(arm: armkin.Arm) -> None:
    assert not hits_nothing(arm, JOINTS[None]).any()
    T = armkin.fk(arm, JOINTS)
    solutions = armkin.ik(arm, T, near=JOINTS)
    assert solutions.status == 2
    best = solutions.q[solutions.best]
    assert hits_nothing(arm, best[None]).all()
    assert np.abs(armkin.fk(arm, best) - T).max() < 1e-6
    every = follow_self_motion(arm, task_for(arm), JOINTS, T)
    turned = np.abs((every - JOINTS + np.pi) % (2 * np.pi) - np.pi).sum(axis=1)
    hit = ~hits_nothing(arm, every)
    nearest = np.rad2deg(turned[~hit].min())
    assert 0.5 < nearest < np.rad2deg(np.abs(best - JOINTS).sum()) + 0.4
    assert np.rad2deg(np.abs(best - JOINTS).sum()) < nearest + 0.4  # four joints, each to 0.1 degrees
    assert hit.any()


def test_without_keep_outs_the_nearest_posture_stays() -> None:
    arm = armkin.load("ur5e")
    solutions = armkin.ik(arm, armkin.fk(arm, JOINTS), near=JOINTS)
    assert np.abs(solutions.q[solutions.best] - JOINTS).max() < 1e-6


def test_the_whole_of_a_self_motion_is_followed() -> None:
    arm = armkin.load("ur5e")
    T = armkin.fk(arm, JOINTS)
    passed = follow_self_motion(arm, task_for(arm), JOINTS, T)
    assert np.abs(armkin.fk(arm, passed)[:, :3, 3] - T[:3, 3]).max() < 1e-6
    turns = np.sort(passed[:, 3] % (2 * np.pi))
    assert np.rad2deg(np.diff(turns).max()) < 0.1  # a whole turn of the fourth joint
