"""The nearest legal pose: within limits, reported truly, and a local optimum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracle import forward, screws_of

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import read_targets

ROBOTS = Path(__file__).parents[2] / "robots"


def pose_cost(arm: armkin.Arm, task: str | None, target: np.ndarray, q: np.ndarray) -> np.ndarray:
    """What `closest` minimises, from the oracle's kinematics: squared distance and angle at a quarter of the reach."""
    definition = task_for(arm, task)
    T = forward(screws_of(arm.file), q)
    goal = read_targets(definition, target)[0]
    r = residual(definition, T, q, np.repeat(goal, len(q), axis=0))
    p = definition.position
    return np.asarray((r[:, :p] ** 2).sum(axis=1) + (arm.reach / 4) ** 2 * (r[:, p:] ** 2).sum(axis=1))


CASES = [
    ("three_dof", None, [900, 80, 300]),  # too far
    ("three_dof", None, [-300, 10, 300]),  # reached by branches outside limits only
    ("three_dof", None, [0, 0, 170]),
    ("yaw_two_link", None, [2000, 0, 0]),
    ("planar_3dof", None, [900, 0, 0.3]),
    ("ra02", None, [250, 0, 300, 2.0]),
    ("labvolt_5150", None, [600, 0, 0, 0, 0.5]),
    ("cobra600", None, [300, 500, 1000, 0.2]),
]


@pytest.mark.parametrize(("name", "task", "target"), CASES)
def test_no_legal_pose_nearby_is_better(name: str, task: str | None, target: list[float]) -> None:
    arm = armkin.load(ROBOTS / f"{name}.yaml")
    closest = armkin.closest(arm, target, task)
    assert closest.converged
    assert ((closest.q >= arm.lower) & (closest.q <= arm.upper)).all()
    T = forward(screws_of(arm.file), closest.q)
    np.testing.assert_allclose(closest.position, T[:3, 3], atol=1e-9)
    p = task_for(arm, task).position
    assert closest.distance == pytest.approx(np.linalg.norm(T[:p, 3] - np.array(target)[:p]), abs=1e-9)
    closest_cost = pose_cost(arm, task, np.array(target), closest.q[None])[0]
    rng = np.random.default_rng(1)
    for size in (1e-4, 1e-3, 1e-2, 0.1):
        step = rng.normal(size=(2000, arm.n)) * size * np.where(arm.prismatic, arm.reach / 5, 1.0)
        around = np.clip(closest.q + step, arm.lower, arm.upper)
        assert pose_cost(arm, task, np.array(target), around).min() >= closest_cost * (1 - 1e-9) - 1e-9


def test_poses_that_five_joints_cannot_reach() -> None:
    arm = armkin.load(ROBOTS / "labvolt_5150.yaml")
    q = np.radians([20, 40, -60, 80, 30.0])
    T = armkin.fk(arm, q)
    s = armkin.ik(arm, T, "pose")
    assert s.status == armkin.Status.EXACT
    assert s.valid.any()
    assert s.complete
    tilted = T.copy()
    tilted[:3, :3] = tilted[:3, :3] @ np.array(
        [[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]]
    )
    s = armkin.ik(arm, tilted, "pose")
    assert s.status == armkin.Status.UNREACHABLE
    closest = armkin.closest(arm, tilted, "pose")
    assert closest.converged
    assert 0.0 < closest.angle < 0.25
    closest_cost = pose_cost(arm, "pose", tilted, closest.q[None])[0]
    rng = np.random.default_rng(2)
    for size in (1e-3, 1e-2, 0.1):
        around = np.clip(closest.q + rng.normal(size=(2000, 5)) * size, arm.lower, arm.upper)
        assert pose_cost(arm, "pose", tilted, around).min() >= closest_cost * (1 - 1e-9)


@pytest.mark.parametrize(("name", "count"), [("three_dof", 3), ("ra02", 4), ("moveo", 5), ("labvolt_5150", 5)])
def test_full_poses_of_short_arms(name: str, count: int) -> None:
    """Poses on the manifold that the arm reaches are solved exactly."""
    arm = armkin.load(ROBOTS / f"{name}.yaml")
    assert arm.n == count
    q = np.random.default_rng(3).uniform(-2, 2, (40, count))
    s = armkin.ik(arm, forward(screws_of(arm.file), q), "pose")
    d = s.q - q[:, None]
    d = np.abs(d - 2 * np.pi * np.rint(d / (2 * np.pi))).max(axis=2)
    assert np.nanmin(d, axis=1).max() < 1e-6
    assert s.residual()[0][s.valid].max() < 1e-9


def test_a_reachable_legal_target_is_its_own_closest_pose() -> None:
    arm = armkin.load(ROBOTS / "three_dof.yaml")
    closest = armkin.closest(arm, [390, 80, 300])
    assert closest.distance < 1e-6


def test_just_beyond_a_stretched_elbow_the_closest_pose_is_found_to_a_nanometre() -> None:
    """There the distance is a fold's, which is flat: a posture 0.01 rad off is 4 um farther from a target 1 um away."""
    arm, rng = armkin.load(ROBOTS / "three_dof.yaml"), np.random.default_rng(3)
    for beyond in 10.0 ** rng.uniform(-5.0, 0.0, 40):  # [mm]
        q = np.deg2rad([rng.uniform(-110, 110), rng.uniform(-10, 110), 0.0])
        shoulder, tip = armkin.frames(arm, q)[[1, -1], :3, 3]
        target = tip + beyond * (tip - shoulder) / np.linalg.norm(tip - shoulder)
        found = armkin.closest(arm, target)
        assert found.converged
        assert found.distance <= np.linalg.norm(target - tip) + 1e-6
