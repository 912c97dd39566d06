"""An arm's bodies: they meet at every joint in every pose, and end at the tip, whatever the convention."""

from __future__ import annotations

import numpy as np
import pytest

import armkin
from armkin.model.rotation import rotation_about
from armkin.view.skeleton import arm_shape, skeleton
from command_line import ROOT

ROBOTS = sorted(path.stem for path in (ROOT / "robots").glob("*.yaml"))


@pytest.mark.parametrize("robot", ROBOTS)
def test_bodies_meet_at_every_joint_and_end_at_the_tip(robot: str) -> None:
    arm = armkin.load(str(ROOT / f"robots/{robot}.yaml"))
    form = arm_shape(arm)
    rng = np.random.default_rng(3)
    q = rng.uniform(-2, 2, arm.n) * np.where(arm.prismatic, arm.reach / 10, 1.0)
    T, end = arm.link[0], form.bodies[0][-1]
    assert end == pytest.approx(arm.link[0][:3, 3], abs=1e-9)
    for i, value in enumerate(q * arm.ratio):
        # The body before ends where the joint sits; a slide carries the next one along its axis.
        corner = T[:3, :3] @ [0, 0, form.joint_offsets[i]] + T[:3, 3]
        assert end == pytest.approx(corner, abs=1e-6)
        move = np.eye(4)
        if arm.prismatic[i]:
            move[2, 3] = value
        else:
            move[:3, :3] = rotation_about(2, value)
        T = T @ move
        placed = form.bodies[i + 1] @ T[:3, :3].T + T[:3, 3]
        assert np.cross(placed[0] - T[:3, 3], T[:3, 2]) == pytest.approx(0, abs=1e-6)  # it begins on its axis
        end = placed[-1]
        T = T @ arm.link[i + 1]
    assert end == pytest.approx(armkin.fk(arm, q)[:3, 3], abs=1e-6)
    assert skeleton(arm, q).tip == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize("robot", ROBOTS)
def test_between_axes_that_are_not_parallel_lies_the_common_normal(robot: str) -> None:
    arm = armkin.load(str(ROOT / f"robots/{robot}.yaml"))
    form = arm_shape(arm)
    for i in range(arm.n - 1):
        link = arm.link[i + 1]
        _, foot, across = form.bodies[i + 1]
        way = across - foot
        if 1 - abs(link[2, 2]) > 1e-2 and np.linalg.norm(way) > 1e-6 * arm.reach:
            way = way / np.linalg.norm(way)
            assert abs(way[2]) < 1e-6  # square to its own axis
            assert abs(way @ link[:3, 2]) < 1e-6  # and to the next one's


def test_the_same_arm_in_two_conventions_looks_the_same() -> None:
    by_dh, by_screws = (armkin.load(str(ROOT / f"robots/{name}.yaml")) for name in ("ra02", "ra02_screws"))
    a, b = (skeleton(arm, arm.home).path for arm in (by_dh, by_screws))
    for point in a:  # every corner of the one lies on the other
        ends, starts = b[1:], b[:-1]
        along = np.clip(((point - starts) * (ends - starts)).sum(1) / ((ends - starts) ** 2).sum(1), 0, 1)
        assert np.linalg.norm(starts + along[:, None] * (ends - starts) - point, axis=1).min() < 1.0
