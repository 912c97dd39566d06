"""Forward kinematics, frames and Jacobian of every arm against products of exponentials."""

from pathlib import Path

import numpy as np
import pytest
from ik_checks import random_joints
from oracle import forward, forward_and_jacobian, screws_of

import armkin
from armkin.forward import position

ROBOTS = sorted((Path(__file__).parents[2] / "robots").glob("*.yaml"))
POSES = 10_000


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_tool_and_jacobian_are_those_of_the_exponentials(path: Path) -> None:
    arm = armkin.load(path)
    screw = screws_of(arm.file)
    q = random_joints(screw, POSES, 6)
    T, J = armkin.fk(arm, q), armkin.jacobian(arm, q)
    expected, jacobian = forward_and_jacobian(screw, q)
    assert np.abs(T - expected).max() < 1e-9
    assert np.abs(J - jacobian).max() < 1e-9
    assert np.abs(T[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2) - np.eye(3)).max() < 1e-14
    row_by_row = np.array([armkin.fk(arm, row) for row in q[:50]])
    assert np.abs(row_by_row - expected[:50]).max() < 1e-9


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_frames_begin_at_the_base_and_end_at_the_tool(path: Path) -> None:
    arm = armkin.load(path)
    screw = screws_of(arm.file)
    q = random_joints(screw, 200, 7)
    frames = armkin.frames(arm, q)
    assert frames.shape == (200, arm.n + 2, 4, 4)
    assert np.array_equal(frames[:, 0], np.broadcast_to(arm.base, (200, 4, 4)))
    assert np.abs(frames[:, -1] - forward(screw, q)).max() < 1e-9


def test_the_jacobian_is_the_derivative() -> None:
    arm = armkin.load(ROBOTS[0].parent / "stanford.yaml")
    q = random_joints(screws_of(arm.file), 20, 8)
    J, h = armkin.jacobian(arm, q), 1e-6
    for i in range(arm.n):
        step = np.eye(arm.n)[i] * h
        slope = (armkin.fk(arm, q + step)[:, :3, 3] - armkin.fk(arm, q - step)[:, :3, 3]) / (2 * h)
        assert np.abs(slope - J[:, :3, i]).max() < 1e-5


@pytest.mark.parametrize("name", ["ur5e", "stanford", "ratio_arm"])
def test_few_poses_have_the_bits_of_many(name: str) -> None:
    """Few are computed in plain Python, some with all cosines at once, many joint by joint."""
    arm = armkin.load(Path(__file__).parents[1] / "robots/ratio_arm.yaml" if name == "ratio_arm" else name)
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (300, arm.n))
    for compute in (armkin.fk, armkin.jacobian, armkin.frames, position):
        of_all = compute(arm, q)
        for _ in range(6):  # from the fifth call on it is recorded
            for count in (2, 3, 16, 17, 100):
                assert np.array_equal(compute(arm, q[:count]), of_all[:count])


def test_manipulability_and_condition_tell_a_singularity() -> None:
    arm = armkin.load(ROBOTS[0].parent / "puma560.yaml")
    regular, singular = np.radians([10, 20, 30, 40, 50, 60]), np.radians([10, 20, 30, 40, 0, 60])
    assert armkin.manipulability(arm, regular) > 1e6
    assert armkin.manipulability(arm, singular) < 1e-6
    assert armkin.condition(arm, regular) < 100 < 1e12 < armkin.condition(arm, singular)
