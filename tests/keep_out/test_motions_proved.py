"""Motions proved free between their samples, against thousands of samples of each."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.keep_out.body_pairs import guard
from armkin.keep_out.displacement_bounds import approach_rates
from armkin.keep_out.motion_geometry import Cubics
from armkin.keep_out.motion_proof import hit_samples
from armkin.model.arm import Arm
from armkin.motion.joint_moves import plan_joint_moves
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.plan.trajectory_proof import check_free, hit_time, prove_trajectory
from armkin.motion.timing.trajectory import Trajectory

TABLE = "keep_out:\n  - self\n  - floor: -20\n  - box: {min: [300, -400, 0], max: [700, 400, 180]}\n    name: table\n"
RAIL = """
name: rail
convention: standard
keep_out: [self, floor: -50, box: {min: [150, -80, 0], max: [300, 80, 150]}]
joints:
  - {name: q1, dh: {alpha: -90, a: 0, d: 100}, limits: [-170, 170], max_speed: 60, max_accel: 100}
  - {name: q2, type: prismatic, dh: {alpha: 90, a: 0, d: 60}, limits: [0, 300], max_speed: 60, max_accel: 100}
  - {name: q3, dh: {alpha: 0, a: 150, d: 0}, limits: [-170, 170], max_speed: 60, max_accel: 100}
  - {name: q4, dh: {alpha: 90, a: 120, d: 0}, limits: [-170, 170], max_speed: 60, max_accel: 100}
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.yaml"
    path.write_text(TABLE)
    return path


def _arm_beside_table(kind: str, table: Path) -> Arm:
    if kind == "rail":
        path = table.parent / "rail.yaml"
        path.write_text(RAIL)
        return armkin.load(path)
    arm = armkin.load(kind, scene=table)
    return replace(arm, max_speed=np.ones(arm.n), max_accel=np.ones(arm.n))


def _random_postures(arm: Arm, count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.lower, -300.0), np.minimum(arm.upper, 300.0)
    low, high = (np.where(arm.prismatic, x, np.clip(x, -3.0, 3.0)) for x in (low, high))
    q = rng.uniform(low, high, (count, arm.n))
    return q[np.asarray(armkin.clearance(arm, q).mm) >= 0]


@pytest.mark.parametrize("kind", ["three_dof", "ur5e", "rail"])
def test_random_motions_are_free_when_proved_and_hit_when_not(kind: str, table: Path) -> None:
    arm = _arm_beside_table(kind, table)
    held, q = guard(arm), _random_postures(arm, 400, 5)
    share, free = np.linspace(0.0, 1.0, 1500)[:, None], 0
    for a, b in zip(q[:60], q[-60:], strict=True):
        proof = prove_trajectory(plan_joint_moves(arm, a, b))
        assert proof is not None
        least = float(held.clearances(a + share * (b - a)).min())
        assert least >= 0.0 if proof.free else least < 0.05
        assert proof.postures < 2000
        free += proof.free
    assert 5 < free < 60


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_a_body_moves_no_farther_than_its_levers(ratio: float, table: Path) -> None:
    """Of a calibrated arm, too, whose joints move by more than they are told."""
    for kind in ("ur5e", "rail"):
        arm = _arm_beside_table(kind, table)
        arm = replace(arm, ratio=np.full(arm.n, ratio))
        held, rng = guard(arm), np.random.default_rng(7)
        q = _random_postures(arm, 2000, 6)
        step = rng.normal(size=q.shape) * np.where(arm.prismatic, 1.0, 0.01)
        moved = np.abs(held.distances(q + step) - held.distances(q))
        bound = np.abs(step) @ approach_rates(held, np.where(arm.prismatic, np.abs(q).max(axis=0) + 5.0, 0.0))
        assert (moved <= bound + 1e-9).all()
        assert (moved.max(axis=0) > 0.2 * bound.max(axis=0)).any()  # and the bound is no guess in the sky
        travel = np.where(arm.prismatic, np.abs(q).max(axis=0), 0.0)
        last = [k for k, pair in enumerate(held.pairs) if pair.body == arm.n and not pair.other]
        tip = armkin.fk(arm, q)[:, :2, 3]  # axis 1 stands upright in the base's origin
        assert (approach_rates(held, travel)[0, last] >= ratio * np.hypot(*tip.T).max()).all()


def test_parts_of_cubics_go_no_farther_than_told() -> None:
    rng = np.random.default_rng(8)
    way = Cubics(rng.normal(size=(4, 7, 2)))
    way.points[0, 1:] = way.points[3, :-1]
    begin = rng.uniform(0, 7, 200)
    end = begin + rng.uniform(0, 1, 200) * (7 - begin)
    bounds = way.variation(begin, end)
    places = begin[:, None] + np.linspace(0, 1, 400) * (end - begin)[:, None]
    gone = np.abs(np.diff(way.joints_at(places.ravel()).reshape(200, 400, 2), axis=1)).sum(axis=1)
    assert (gone <= bounds + 1e-12).all()
    full_bound = way.variation(np.zeros(1), np.full(1, 7.0))[0]
    assert full_bound == pytest.approx(np.abs(np.diff(way.points, axis=0)).sum(axis=(0, 1)))


def test_a_path_tells_a_lower_bound_of_its_clearance(table: Path) -> None:
    arm = armkin.load("three_dof", scene=table)
    for jerk in (None, 8.0):
        plan = armkin.path(arm, [[390, 80, 300], [390, -80, 200], [300, -80, 250]], blend=5, jerk=jerk)
        assert plan.clearance is not None
        sampled = _least_sampled(plan)
        assert 0 <= plan.clearance["mm"] <= sampled <= plan.clearance["mm"] + 1.0
        assert plan.clearance["with"] == "table"


def _least_sampled(plan: PathPlan) -> float:
    return float(np.min(armkin.clearance(plan.arm, plan.q(np.linspace(0, plan.duration, 5000))).mm))


@pytest.mark.parametrize("jerk", [None, 8.0])
def test_a_path_that_hits_tells_a_lower_bound_as_well(jerk: float | None, table: Path) -> None:
    """One that ignores what it hits, one that starts inside and leaves, and one that is refused."""
    arm = armkin.load("three_dof", scene=table)
    ignoring, inside = replace(arm, ignores_keep_out=True), np.deg2rad([0, 20, -45])
    through: list[list[float]] = [[390, 80, 300], [390, -80, 60], [390, -80, 300]]
    with pytest.raises(NoSolutionError) as raised:  # it comes near the table, hits it, and then goes deeper
        armkin.path(arm, {"moves": [{"joint": [0, 60, -90]}, {"joint": [0, 10, -30]}, {"joint": [0, 0, -45]}]})
    plans = [
        armkin.path(ignoring, through, jerk=jerk),
        armkin.path(arm, [[390, 80, 300], [390, -80, 250]], start=inside, jerk=jerk),
        raised.value.plan,
    ]
    for plan in plans:
        least = _least_sampled(plan)
        assert least < -10.0
        assert plan.clearance["mm"] <= least <= plan.clearance["mm"] + 0.1
        assert plan.clearance["with"] == "table"
    times = np.linspace(0, plans[0].duration, 5000)
    there = plans[0].q(times[np.abs(plans[0].s(times) - plans[0].clearance["s_mm"]).argmin()])
    assert armkin.clearance(arm, there).mm == pytest.approx(_least_sampled(plans[0]), abs=0.2)
    assert plans[1].clearance["s_mm"] == 0.0


def test_a_path_through_the_table_is_refused_with_the_place(table: Path) -> None:
    arm = armkin.load("three_dof", scene=table)
    with pytest.raises(NoSolutionError, match="then q3 hits table"):
        armkin.path(arm, [[390, 80, 300], [390, -80, 150]])
    with pytest.raises(NoSolutionError, match=r"q3 would hit table at 0\.000 mm of the path") as raised:
        armkin.path(arm, {"moves": [{"joint": [0, 0, -30]}]})
    assert raised.value.plan.clearance["with"] == "table"
    ignoring = replace(arm, ignores_keep_out=True)
    assert armkin.path(ignoring, [[390, 80, 300], [390, -80, 150]]).clearance is not None


def test_the_first_hit_is_where_the_clearance_runs_out(table: Path) -> None:
    arm = armkin.load("three_dof", scene=table)
    way = plan_joint_moves(arm, np.deg2rad([0, 90, -90]), np.deg2rad([[30, 90, -90], [30, 0, -45]]))
    proof = prove_trajectory(way)
    assert proof is not None
    assert (proof.free, proof.stretch, proof.body, proof.keep_out) == (False, 1, "q3", "table")
    time = hit_time(way, proof)
    assert way.q(time) == pytest.approx(proof.joints, abs=1e-6)
    assert abs(float(armkin.clearance(arm, proof.joints).mm)) < 0.02
    with pytest.raises(NoSolutionError, match="q3 would hit table on the way to waypoint 2"):
        check_free(way)


def test_an_arm_in_a_hit_may_leave_it_and_not_go_deeper(table: Path) -> None:
    arm = armkin.load("three_dof", scene=table)
    inside, free = np.deg2rad([0, 20, -45]), np.deg2rad([0, 90, -90])
    assert armkin.clearance(arm, inside).mm < -5
    proof = prove_trajectory(plan_joint_moves(arm, inside, free))
    assert proof is not None
    assert proof.free
    assert proof.escaping == (("q3", "table"),)
    with pytest.raises(NoSolutionError, match="q3 would go deeper into table"):
        check_free(plan_joint_moves(arm, inside, np.deg2rad([0, 15, -45])))
    with pytest.raises(NoSolutionError, match="q3 would"):  # out, and in again
        check_free(plan_joint_moves(arm, inside, np.stack([free, inside])))


def test_hits_of_a_chain_are_those_of_each_sample(table: Path) -> None:
    arm = armkin.load("ur5e", scene=table)
    held, q = guard(arm), _random_postures(arm, 60, 9)
    chain = np.concatenate([np.linspace(a, b, 97)[:-1] for a, b in pairwise(q[:9])])
    assert hit_samples(held, chain).tolist() == (held.clearances(chain) < 0).any(axis=1).tolist()


def test_without_keep_outs_nothing_is_proved() -> None:
    arm = armkin.load("three_dof")
    way = plan_joint_moves(arm, arm.home, np.zeros((1, 3)))
    assert prove_trajectory(way) is None
    check_free(Trajectory(arm, arm.home, ()))
