"""`near`: a batch of them is one by one, and a posture that solves its target stays, on its limits, too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import truth
from oracle import goal_of_joints
from shipped_arms import UNLIKE, shipped_arm

import armkin
from armkin import Status
from armkin.inverse.solvers.solver_of_arm import solver


@pytest.mark.parametrize("name", UNLIKE)
def test_near_as_a_batch_is_near_one_by_one(name: str, sample: Callable[[int, int], int]) -> None:
    """Row by row: at round postures, too, where joints are half a turn from `near` and motions are equal."""
    arm, screw = shipped_arm(name)
    task, geometry = solver(arm, None)
    rng = np.random.default_rng(4)
    q = rng.uniform(-1, 1, (16, arm.n)) * np.where(arm.prismatic, arm.reach / 4, np.pi)
    q = np.concatenate([q, truth.round_postures(arm, 90, 12, seed=3), truth.round_postures(arm, 45, 12, seed=3)])
    target = goal_of_joints(task, screw, q).array()
    near = q + rng.choice([0.0, 1.0], (40, 1)) * rng.normal(size=q.shape) * np.where(arm.prismatic, 50.0, 1.0)
    near[::4] = np.where(arm.prismatic, 0.0, np.pi / 2 * rng.integers(-2, 3, near[::4].shape))
    batch = armkin.ik(arm, target, near=near)
    for k in range(0, 40, 40 // sample(40, 13)):
        single = armkin.ik(arm, target[k], near=near[k])
        assert (single.status, single.complete, single.best) == (batch.status[k], batch.complete[k], batch.best[k])
        assert single.free.tolist() == batch.free[k].tolist()
        rows, count = batch.valid[k], single.valid.sum()
        assert rows.sum() == count
        assert batch.within_limits[k][rows].tolist() == single.within_limits[single.valid].tolist()
        np.testing.assert_allclose(batch.q[k][rows], single.q[single.valid], rtol=0, atol=1e-7)
        if geometry.pairs:  # others are numbered along a path
            assert batch.branch[k][rows].tolist() == single.branch[single.valid].tolist()


@pytest.mark.parametrize("near", [0.0, -90.0, 90.0])
def test_half_a_turn_from_near_is_above_it(near: float) -> None:
    arm = shipped_arm("ur5e")[0]  # limits of 360 degrees, so that both copies are legal, but for joint 3
    q = np.radians([[180.0, -90.0, 90.0, -90.0, -90.0, 180.0], [90.0, 180.0, 45.0, 0.0, 90.0, -90.0]])
    target, close = armkin.fk(arm, q), np.full(6, np.radians(near))
    for solutions in (armkin.ik(arm, target, near=close), armkin.ik(arm, target[0], near=close)):
        away = np.degrees(solutions.q - solutions.near[..., None, :])[..., [0, 1, 3, 4, 5]]
        half = np.abs(np.abs(away) - 180.0) < 1e-7
        assert half.any()
        assert (away[half] > 0.0).all()


@pytest.mark.parametrize("name", UNLIKE)
def test_a_posture_on_its_limits_stays_where_its_target_is_rounded(name: str) -> None:
    """The exact answer for a rounded target may lie beyond the limit that `near`, which solves it, too, is on."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(12)
    q = rng.uniform(np.clip(arm.lower, -np.pi, np.pi), np.clip(arm.upper, -np.pi, np.pi), (30, arm.n))
    on_limit = rng.random(q.shape) < 0.5
    ends = np.where(rng.random(q.shape) < 0.5, arm.lower, arm.upper)
    q = np.where(on_limit & np.isfinite(ends), ends, q)
    target = goal_of_joints(task, screw, q).array()
    kinds = {f"{n} digits": truth.typed_targets(task, target, n) for n in (11, 12)}
    verdict, report = truth.judge_kinds(
        arm, screw, dict.fromkeys(kinds, q), np.concatenate(list(kinds.values())), np.tile(q, (2, 1))
    )
    verdict.lost = []
    assert verdict, report


def test_a_posture_on_its_limit_stays_alone_and_in_a_batch() -> None:
    arm = shipped_arm("kuka_kr6_r700")[0]
    q = np.radians([0.0, 45.0, 0.0, 0.0, 90.0, 0.0])
    T = armkin.fk(arm, q)
    T[:3, 3] = np.round(T[:3, 3], 6)
    alone, batch = armkin.ik(arm, T, near=q), armkin.ik(arm, np.stack([T] * 3), near=q)
    np.testing.assert_allclose(alone.q[alone.best], q, atol=1e-12)
    np.testing.assert_allclose(batch.q[np.arange(3), batch.best], [q] * 3, atol=1e-12)
    assert alone.status == Status.EXACT


@pytest.mark.parametrize("name", ["yaw_two_link", "three_dof", "ur5e", "puma560", "irb120", "jaco_j2n6s300"])
def test_a_posture_that_solves_a_rounded_target_stays_beside_singular_ones(name: str) -> None:
    """There the exact answer may be 1e-6 to 0.5 rad away, though no two branches are close: both solve the target."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(2)
    q = np.concatenate([rows[:30] for rows in truth.singular_postures(arm, screw, None, 30).values()])
    q = q + rng.normal(size=q.shape) * 10.0 ** rng.uniform(-9, -2.5, (len(q), 1))
    q = np.clip(q, arm.lower, arm.upper)  # some have a joint on its limit
    target = goal_of_joints(task, screw, q).array()
    for digits in (9, 10, 12):
        rounded_target = truth.typed_targets(task, target, digits)
        verdict = truth.judge(arm, screw, None, q, rounded_target, near=q)
        assert not verdict.moves, f"{digits} digits: {verdict}"
        assert not verdict.false, f"{digits} digits: {verdict}"


def test_a_posture_that_solves_its_target_is_listed_to_the_bit() -> None:
    """Alone and in a batch, near home and anywhere, in place of the branch that is a hair away."""
    arm, screw = shipped_arm("yaw_two_link")
    task, _ = solver(arm, None)
    rng = np.random.default_rng(6)
    q = rng.uniform(-3, 3, (400, arm.n))
    q[:200, -1] = 10.0 ** rng.uniform(-4, -2, 200)  # all but stretched
    target = truth.typed_targets(task, goal_of_joints(task, screw, q).array(), 9)
    solves = armkin.ik(arm, target, near=q)
    rows = np.flatnonzero(truth.miss_of(arm, screw, truth.goal_of(task, target), q) < 0.9e-9)
    assert len(rows) > 200
    np.testing.assert_array_equal(solves.q[rows, solves.best[rows]], q[rows])
    assert solves.within_limits[rows, solves.best[rows]].all()
    for k in rows[::20]:
        single = armkin.ik(arm, target[k], near=q[k])
        np.testing.assert_array_equal(single.q[single.best], q[k])
        same = armkin.ik(arm, target, near=q[k])
        np.testing.assert_array_equal(same.q[k, same.best[k]], q[k])


def test_a_posture_just_beyond_its_limits_is_no_better_than_the_branch_within() -> None:
    """It solves the target, too; but what is answered has to be within limits."""
    arm, _ = shipped_arm("irb120")
    for joint in range(arm.n):
        q = np.full(arm.n, 0.3)
        q[joint] = arm.upper[joint]
        beyond = q + 5e-9 * (np.arange(arm.n) == joint)
        for near in (beyond, np.stack([beyond] * 3)):
            s = armkin.ik(arm, np.broadcast_to(armkin.fk(arm, q), (*near.shape[:-1], 4, 4)), near=near)
            assert (s.best >= 0).all()
