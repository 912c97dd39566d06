"""Along a path a branch keeps its name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.inverse.branches.tracking import follow_branches
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of

ROBOTS = Path(__file__).parents[2] / "robots"


def load_tracked(name: str) -> armkin.Arm:
    arm = armkin.load(ROBOTS / f"{name}.yaml")
    return armkin.lock(arm, {"J3": 0.35}) if name == "panda" else arm


def path_targets(arm: armkin.Arm, q: np.ndarray) -> np.ndarray:
    task, _ = solver(arm, None)
    return targets_of(task, armkin.fk(arm, q), q)


def branch_jumps(s: armkin.Solutions, name: int) -> np.ndarray:
    """Largest step of the branch of that name between neighbouring targets that both have it."""
    has = (s.branch == name).any(axis=1)
    column = (s.branch == name).argmax(axis=1)
    q = s.q[np.arange(len(has)), column]
    has_both = has[1:] & has[:-1]
    step = np.diff(q, axis=0)
    step = np.where(s.arm.prismatic, step / s.arm.reach, step - 2 * np.pi * np.rint(step / (2 * np.pi)))
    return np.asarray(np.abs(step).max(axis=1)[has_both])


def test_the_published_circle() -> None:
    """Document 5's path: each of the four names is one smooth motion, and the published ones are among them."""
    arm = load_tracked("yaw_two_link")
    t = np.linspace(0, 2 * np.pi, 111)
    c, r = np.cos(-np.pi / 4), 400.0
    path = np.stack([c * r * np.cos(t), r * np.sin(t), 660 - np.sin(-np.pi / 4) * r * np.cos(t)], axis=1)
    s = armkin.ik(arm, path)
    assert s.valid.all()
    for name in range(4):
        assert branch_jumps(s, name).max() < 0.1
    first = np.degrees(s.q[0])
    for published in ([0, 107.282, -124.565], [0, -17.282, 124.565]):
        b = np.abs(first - published).max(axis=1).argmin()
        np.testing.assert_allclose(first[b], published, atol=1e-3)
        assert np.degrees(s.q[np.arange(111), (s.branch == s.branch[0, b]).argmax(axis=1)])[0] == pytest.approx(
            published, abs=1e-3
        )


@pytest.mark.parametrize("name", ["puma560", "ur5e", "irb120", "three_dof", "labvolt_5150", "cobra600", "stanford"])
def test_closed_forms_keep_names_through_joint_space(name: str) -> None:
    arm = load_tracked(name)
    rng = np.random.default_rng(2)
    for _ in range(5):
        a, b = rng.uniform(0.2, 0.6, (2, arm.n))
        q = a + (b - a) * np.linspace(0, 1, 300)[:, None]
        q = np.where(arm.prismatic, 300 + 100 * q, q)
        s = armkin.ik(arm, path_targets(arm, q))
        d = s.q - q[:, None]
        d = np.abs(np.where(arm.prismatic, d, d - 2 * np.pi * np.rint(d / (2 * np.pi)))).max(axis=2)
        column = np.nanargmin(d, axis=1)
        assert len(set(s.branch[np.arange(300), column])) == 1


@pytest.mark.parametrize("name", ["jaco_j2n6s300", "panda", "moveo"])
def test_numbered_branches_follow_a_path(name: str) -> None:
    arm = load_tracked(name)
    rng = np.random.default_rng(4)
    a = rng.uniform(-1.5, 1.5, arm.n)
    q = a + rng.uniform(-0.3, 0.3, arm.n) * np.linspace(0, 1, 120)[:, None]
    s = armkin.ik(arm, path_targets(arm, q))
    d = s.q - q[:, None]
    column = np.nanargmin(np.abs(d - 2 * np.pi * np.rint(d / (2 * np.pi))).max(axis=2), axis=1)
    assert len(set(s.branch[np.arange(120), column])) == 1
    for row, valid in zip(s.branch, s.valid, strict=True):
        assert len(set(row[valid])) == valid.sum()
        assert (row[~valid] == -1).all()
    smooth = np.concatenate([branch_jumps(s, k) for k in range(s.q.shape[1])])
    assert np.quantile(smooth, 0.99) < 0.2


def test_the_order_of_the_answers_does_not_matter() -> None:
    """The same path with its branches shuffled at every target: the same motions under one number each."""
    arm = load_tracked("jaco_j2n6s300")
    task, _ = solver(arm, None)
    rng = np.random.default_rng(6)
    start = rng.uniform(-2.5, 2.5, (5, 6))
    t = np.linspace(0, 1, 50)[:, None, None]
    q = start + 0.3 * t * rng.uniform(-1, 1, (5, 6))
    order = np.argsort(rng.random((50, 5)), axis=1)
    shuffled = np.take_along_axis(q, order[:, :, None], axis=1)
    target = armkin.fk(arm, q[:, 0])
    number = follow_branches(arm, task, shuffled, target)
    unshuffled = np.take_along_axis(number, np.argsort(order, axis=1), axis=1)
    assert (unshuffled == unshuffled[0]).all()


def test_unrelated_targets_are_numbered_in_order() -> None:
    arm = load_tracked("jaco_j2n6s300")
    s = armkin.ik(arm, armkin.fk(arm, np.random.default_rng(7).uniform(-3, 3, (50, 6))))
    count = s.valid.sum(axis=1)
    for row, k in zip(s.branch, count, strict=True):
        assert sorted(row[:k]) == list(range(k))
