"""Paths that begin or end exactly on a boundary or at a singular home: carried, or the truth about why not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import NoSolutionError
from armkin.model.arm import Arm
from armkin.motion.branches import boundary_chains
from armkin.motion.branches.branch_chains import BranchChain
from armkin.motion.branches.branch_columns import Samples


@cache  # what is prepared of an arm is kept by arm
def arm_with_rates(name: str) -> Arm:
    """An arm with rates, ours where its file has none."""
    arm = armkin.load(name)
    speed, accel = (np.where(np.isnan(x), 2.0, x) for x in (arm.max_speed, arm.max_accel))
    return replace(arm, max_speed=speed, max_accel=accel)


def planned_to(arm: Arm, points: list[np.ndarray], start: dict[str, Any]) -> np.ndarray:
    """Where the tip is at the end of lines through points."""
    plan = armkin.path(arm, {"start": start, "moves": [{"line": p.tolist()} for p in points]})
    assert plan.deviation <= 0.05
    assert (plan.limits["accel"] <= 1.002).all()
    return np.asarray(armkin.fk(arm, plan.q(plan.duration))[:3, 3])


@pytest.mark.parametrize("joints", [(20.0, 40.0, 0.0), (0.0, 0.0, 0.0), (-50.0, 60.0, 0.0)])
def test_both_branches_go_on_from_a_boundary_and_end_on_it(joints: tuple[float, ...]) -> None:
    """The arm is straight at the edge of its reach, where the two elbows meet."""
    arm = armkin.load("three_dof")
    edge = armkin.fk(arm, np.deg2rad(joints))[:3, 3]
    outwards = edge - np.array([0.0, 0.0, 170.0])
    inside = edge - 30 * outwards / np.linalg.norm(outwards)
    beside = inside + np.array([0.0, 5.0, 3.0])
    for start, way in (
        ({"joints": list(joints)}, [inside]),
        ({"point": edge.tolist()}, [inside]),
        ({"point": inside.tolist()}, [edge]),
        ({"point": inside.tolist()}, [edge, beside]),
    ):
        np.testing.assert_allclose(planned_to(arm, way, start), way[-1], atol=0.01)


@pytest.mark.parametrize("name", ["ar4", "irb120", "irb2400", "kuka_kr6_r700", "fanuc_crx10ia"])
def test_a_singular_home_is_left_or_the_wrist_turns_first(name: str) -> None:
    """20 mm up and 20 mm sideways; --split turns the wrist at rest where the straight way makes the joints jump."""
    arm = arm_with_rates(name)
    home = armkin.fk(arm, arm.home)[:3, 3]
    up, sideways = ({"start": "home", "moves": [{"offset": {"xyz": way}}]} for way in ([0, 0, 20], [0, 20, 0]))
    plan = armkin.path(arm, up)
    np.testing.assert_allclose(armkin.fk(arm, plan.q(plan.duration))[:3, 3], home + np.array([0, 0, 20]), atol=0.01)
    with pytest.raises(NoSolutionError, match="with 1 change of branch it can be done"):
        armkin.path(arm, sideways)
    plan = armkin.path(arm, sideways, split=True)
    turn = plan.motion.stretches[0]  # at rest before and after
    assert np.abs(turn.end - arm.home).max() > 1.0
    assert np.linalg.norm(armkin.fk(arm, turn.end)[:3, 3] - home) <= 0.01
    np.testing.assert_allclose(armkin.fk(arm, plan.q(plan.duration))[:3, 3], home + np.array([0, 20, 0]), atol=0.01)
    assert (plan.limits["speed"] <= 1.002).all()


def test_many_boundaries_in_a_row_do_not_multiply_the_chains(monkeypatch: pytest.MonkeyPatch) -> None:
    """A myCobot 280 straight down from home: eight boundaries within 3 micrometres took all memory there is."""
    joined = boundary_chains._join_chains
    count = 0

    def count_and_call(a: BranchChain, b: BranchChain) -> BranchChain:
        nonlocal count
        count += 1
        assert count <= 100
        return joined(a, b)

    monkeypatch.setattr(boundary_chains, "_join_chains", count_and_call)
    arm = arm_with_rates("mycobot_280")
    plan = armkin.path(arm, {"start": "home", "moves": [{"offset": {"xyz": [0, 0, -20]}}]})
    down = armkin.fk(arm, arm.home)[:3, 3] - np.array([0, 0, 20])
    np.testing.assert_allclose(armkin.fk(arm, plan.q(plan.duration))[:3, 3], down, atol=0.01)
    assert count > 0


def test_a_stretched_arm_stands_at_its_path_s_start() -> None:
    """Thor's home is straight up, its wrist singular: beside it, upwards, there is nothing, and it was out of reach."""
    arm = armkin.load("thor")

    def up(s: np.ndarray) -> np.ndarray:
        T = np.tile(armkin.fk(arm, arm.home), (len(s), 1, 1))
        T[:, 2, 3] += s
        return T

    solutions = Samples(arm, up, None, arm.home, 20.0).solve_at(np.array([0.0, 20.0]))
    assert solutions.valid.any(axis=1).tolist() == [True, False]


def test_an_offset_in_the_tool_s_frame_takes_the_posture_that_carries_what_follows() -> None:
    """The tool's axes are another posture's with each branch, so that a point and an offset have several lines."""
    arm, rng, other_posture_count = armkin.load("labvolt_5150"), np.random.default_rng(1), 0
    arm = replace(arm, max_speed=np.full(5, 1.0), max_accel=np.full(5, 2.0))
    arm = replace(arm, lower=np.full(5, -2.8), upper=np.full(5, 2.8))
    postures = rng.uniform(-2.6, 2.6, (19, 5))
    for q in postures[[3, 7, 15, 18]]:
        tip = armkin.fk(arm, q)[:3, 3].tolist()
        sums = np.rad2deg([q[1] + q[2] + q[3], q[4]]).tolist()
        moves = [{"point": [*tip, *sums]}, {"offset": {"xyz": [60, 0, 100], "frame": "tool"}}]
        carried = []
        solutions = armkin.ik(arm, np.array([*tip, *np.deg2rad(sums)]))
        for b in [b for b in solutions.order if solutions.within_limits[b] and solutions.valid[b]]:
            start = {"joints": np.rad2deg(solutions.q[b]).tolist()}
            try:
                armkin.path(arm, {"start": start, "moves": moves[1:]})
                carried.append(True)
            except NoSolutionError:
                carried.append(False)
        try:
            armkin.path(arm, {"moves": moves})
            planned = True
        except NoSolutionError:
            planned = False
        assert planned == any(carried)
        other_posture_count += planned and not carried[0]
    assert other_posture_count > 0


def test_sums_stay_what_was_typed() -> None:
    """phi 79 and then 81 is two degrees, in whatever posture the tool's frame was known before it."""
    arm = armkin.load("labvolt_5150")
    arm = replace(arm, max_speed=np.full(5, 1.0), max_accel=np.full(5, 2.0))
    for roll in (0.0, 40.0):
        point = [250.0, 60.0, 200.0, 79.0, roll]
        near = np.deg2rad([0.0, -150.0, -100.0, -31.0, roll])
        file = {
            "moves": [
                {"point": point},
                {"offset": {"xyz": [0, 0, 1], "frame": "tool"}},
                {"line": [*point[:3], 81.0, roll]},
            ]
        }
        plan = armkin.path(arm, file, start=near)
        stretch = next(plan.motion.begins[k] for k in sorted(plan.on_path))
        q = plan.q(np.linspace(stretch, plan.duration, 300))
        assert np.ptp(np.rad2deg(q[:, 1:4].sum(axis=1))) <= 2.1
