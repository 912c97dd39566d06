"""Held joints: what is left is an arm of its own, with a task that its joints suggest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.errors import UsageError
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of
from armkin.model.arm import Arm, from_links

ROBOTS = Path(__file__).parents[2] / "robots"


def taskless_arm(name: str) -> Arm:
    """A shipped robot as if its file named no task."""
    return replace(armkin.load(ROBOTS / f"{name}.yaml"), task=None)


@pytest.mark.parametrize(
    ("name", "held", "task", "method"),
    [
        ("panda", {"J3": 0.35}, "pose", "general elimination"),
        ("iiwa7", {"J3": 0.35}, "pose", "spherical wrist"),
        ("panda", {"J3": 0.0, "J5": 0.0}, "xyz_pitch_roll", "elbow with pitch"),
        ("iiwa7", {"J3": 0.0, "J5": 0.0}, "xyz_pitch_roll", "elbow with pitch"),
        ("iiwa7", {"J3": 0.0, "J5": 0.0, "J7": 0.0}, "xyz_pitch", "elbow with pitch"),
        ("iiwa7", {"J3": 0.0, "J5": 0.0, "J6": 0.3, "J7": 0.0}, "xyz", "elbow"),
        ("puma560", {"q4": 0.0, "q6": 0.0}, "xyz_pitch", "elbow with pitch"),
        ("ur5e", {"J6": 0.0}, "xyz_pitch_roll", "elbow with pitch"),
    ],
)
def test_the_task_follows_from_the_joints_that_are_left(
    name: str, held: dict[str, float], task: str, method: str
) -> None:
    arm = armkin.lock(taskless_arm(name), held)
    definition, geometry = solver(arm, None)
    assert (definition.name, geometry.name) == (task, method)
    q = np.random.default_rng(0).uniform(-2, 2, (50, arm.n))
    s = armkin.ik(arm, targets_of(definition, armkin.fk(arm, q), q))
    away = np.abs(np.angle(np.exp(1j * (s.q - q[:, None])))).max(axis=2)
    assert np.nanmin(away, axis=1).max() < 1e-6
    full_q = armkin.unlock(armkin.load(ROBOTS / f"{name}.yaml"), held, q)
    np.testing.assert_allclose(armkin.fk(armkin.load(ROBOTS / f"{name}.yaml"), full_q), armkin.fk(arm, q), atol=1e-9)


def test_the_task_of_the_file_stays() -> None:
    arm = armkin.lock(armkin.load(ROBOTS / "puma560.yaml"), {"q4": 0.0})
    assert solver(arm, None)[0].name == "pose"


def test_seven_joints_have_a_pose_and_one_too_many() -> None:
    for name in ("panda", "iiwa7"):
        arm = taskless_arm(name)
        assert armkin.ik(arm, armkin.fk(arm, arm.home)).interval is not None
        with pytest.raises(UsageError, match="7 joints for the 3 constraints of task xyz leave 4 degrees of freedom"):
            armkin.ik(arm, [400, 0, 400], "xyz")


def test_an_arm_without_a_task_says_what_to_ask_for() -> None:
    arm = armkin.lock(taskless_arm("ur5e"), {"J1": 0.0, "J5": 1.57, "J6": 0.0})  # three parallel axes, not along z
    with pytest.raises(UsageError, match=r"no task fits .* 3 joints \(RRR\) by itself: ask for task pose"):
        armkin.ik(arm, [0, 0, 0])
    q = np.array([0.3, 0.4, 0.5])
    solutions = armkin.ik(arm, armkin.fk(arm, q), "pose")
    assert np.abs(solutions.q[solutions.valid] - q).max(axis=1).min() < 1e-9
    four = from_links(np.tile(np.eye(4) + 100.0 * np.eye(4, k=3), (5, 1, 1)), [False] * 4)  # in the x-y plane
    with pytest.raises(UsageError, match="move the tool in 3 of its six directions"):
        armkin.ik(four, [0, 0, 0])
