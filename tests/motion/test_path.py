"""`armkin.path`: what is executed keeps to the path and to every limit; what is not carried is refused in words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import NoSolutionError, UsageError
from armkin.model.arm import Arm
from armkin.motion.branches.branch_path import route_samples
from armkin.motion.plan.path_plan import PathPlan

CIRCLE = {"circle": {"centre": [340, 80, 300], "normal": [0, 0, 1]}}


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return armkin.load("robots/three_dof.yaml")


def executed_samples(plan: PathPlan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint values every millisecond; the speeds and accelerations of their differences, as shares of the limits."""
    q = plan.q(np.arange(0.0, plan.duration, 0.001))
    v = np.diff(q, axis=0) / 0.001
    a = np.diff(v, axis=0) / 0.001
    return q, np.abs(v) / plan.arm.max_speed, np.abs(a) / plan.arm.max_accel


def test_a_circle_is_followed_within_every_limit(three_dof: Arm) -> None:
    plan = armkin.path(three_dof, {"moves": [{"point": [390, 80, 300]}, CIRCLE]}, start=three_dof.home)
    q, v, a = executed_samples(plan)
    assert v.max() <= 1.002
    assert a.max() <= 1.002
    assert max(v.max(), a.max()) > 0.99  # and nothing is left unused
    tip = armkin.fk(three_dof, q)[:, :3, 3]
    on_path = plan.s(np.arange(0.0, plan.duration, 0.001)) > 0
    deviation = np.hypot(np.hypot(*(tip[on_path, :2] - [340, 80]).T) - 50, tip[on_path, 2] - 300)
    assert deviation.max() < plan.deviation + 1e-9 < plan.tolerance
    assert plan.length == pytest.approx(100 * np.pi)
    assert [run.end for run in plan.runs] == [pytest.approx(100 * np.pi)]


@pytest.mark.parametrize("jerk", [None, np.deg2rad(2000.0)])
def test_all_moves_together_end_where_they_shall(three_dof: Arm, jerk: float | None) -> None:
    moves: list[dict[str, Any]] = [
        {"joint": [0, 90, -90]},
        {"point": [390, 80, 300]},
        {"line": [390, 140, 300]},
        {"arc": {"via": [380, 160, 300], "to": [360, 160, 300]}},
        {"wait": 0.5},
        {"spline": [[340, 140, 310], [330, 100, 300], [300, 120, 280]]},
        {"grip": "closed"},
        {"offset": {"xyz": [0, 0, -30]}, "tool_speed": 50},
        {"offset": {"xyz": [10, 0, 0], "frame": "tool"}},
        {"circle": {"centre": [290, 60, 250], "turns": -0.5, "rise": 20}},
        {"joint": "home"},
    ]
    plan = armkin.path(three_dof, {"moves": moves, "blend": 5, "start": "home"}, jerk=jerk)
    q, v, a = executed_samples(plan)
    assert v.max() <= 1.002
    assert a.max() <= 1.002
    assert np.abs(np.diff(q, axis=0)).max() < 0.01
    if jerk is not None:
        # executed at 5 ms: third differences of what is sent
        t = np.arange(0, plan.duration, 0.002)
        j = np.abs(np.diff(plan.qdd(t), axis=0)) / 0.002
        assert j.max() <= 1.02 * jerk
    assert plan.q(plan.duration) == pytest.approx(three_dof.home)
    assert [(marker.kind, marker.value) for marker in plan.markers] == [("grip", "closed")]


def test_a_path_beyond_the_reach_is_refused_with_what_each_branch_carries(three_dof: Arm) -> None:
    with pytest.raises(NoSolutionError, match=r"275\.256 of 480\.000 mm, then the path leaves the reach") as refused:
        armkin.path(three_dof, [[390, 80, 300], [390, -400, 300]])
    plan: PathPlan = refused.value.plan
    # Where the horizontal distance makes the arm straight: its reach from the shoulder is 455, offset 10.
    edge = 80 + np.sqrt(455**2 + 10**2 - 130**2 - 390**2)
    assert plan.branches[0].carries == pytest.approx(edge, abs=0.01)
    assert [branch.name for branch in plan.branches][:2] in (
        ["left, elbow up", "left, elbow down"],
        ["left, elbow down", "left, elbow up"],
    )


@pytest.mark.parametrize(
    ("moves", "words"),
    [
        ([{"line": [258, 10, 367]}], "no length"),
        ([{"arc": {"via": [300, 10, 367], "to": [340, 10, 367]}}], "on one line"),
        ([{"circle": {"centre": [258, 10, 400], "normal": [0, 0, 1]}}], "no radius"),
        ([{"joint": [0, 90]}], "got 2 values"),
        ([{"joint": "parked"}], "no pose 'parked'"),
        ([{"joint": {"q9": 3}}], "no joint q9"),
        ([{"line": [1, 2]}], "got 2 numbers"),
        ([{"lin": [300, 10, 367]}], "unknown key; did you mean line"),
        ([{"line": [300, 10, float("nan")]}], "finite"),
        ([{"spline": [[300, 10, 367], [300, 10, 367]]}], "same point twice"),
        ([{"spline": [[300, 10, 367], [258, 10, 367]]}], "spline turns back by half a turn near 300, 10, 367"),
    ],
)
def test_moves_that_make_no_sense_are_refused_in_words(three_dof: Arm, moves: list[Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        armkin.path(three_dof, {"moves": moves, "blend": 15, "start": "home"})


def test_a_way_of_many_turns_is_planned(three_dof: Arm) -> None:
    """The grid grows with the way: 100 turns of 50 mm are 31 m."""
    one_turn, hundred_turns = (
        armkin.path(
            three_dof,
            {"start": {"point": [350, 0, 300]}, "moves": [{"circle": {"centre": [300, 0, 300], "turns": turns}}]},
            tolerance=0.1,
        )
        for turns in (1, 100)
    )
    assert hundred_turns.deviation <= 0.1
    assert hundred_turns.duration == pytest.approx(100 * one_turn.duration, rel=0.08)


def test_a_very_long_way_is_solved_every_two_millimetres() -> None:
    """Farther apart no step is certified, and each is looked at one by one."""
    way: Any = SimpleNamespace(length=439_823.0, breaks=np.array([0.0, 439_823.0]))
    assert np.diff(route_samples(way)).max() <= 2.001


def test_branches_do_not_depend_on_the_blocks_they_are_solved_in(
    three_dof: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    moves = {"moves": [{"point": [390, 80, 300]}, CIRCLE]}
    at_once = armkin.path(three_dof, moves, start=three_dof.home)
    monkeypatch.setattr("armkin.motion.branches.linked_branches._BLOCK_STEPS", 64)
    monkeypatch.setattr("armkin.motion.branches.branch_columns._BLOCK_SAMPLES", 64)
    monkeypatch.setattr("armkin.motion.plan.path_plan._BLOCK_TIMES", 100)
    parts = armkin.path(three_dof, moves, start=three_dof.home)
    assert parts.duration == pytest.approx(at_once.duration, rel=1e-12)
    assert [b.carries for b in parts.branches] == [b.carries for b in at_once.branches]
    for key, share in at_once.limits.items():
        np.testing.assert_allclose(parts.limits[key], share, rtol=1e-9)
    assert parts.nearest_singularity is not None
    assert at_once.nearest_singularity is not None
    assert parts.nearest_singularity[:2] == pytest.approx(at_once.nearest_singularity[:2])


def test_a_path_that_begins_on_a_boundary_is_carried_by_the_branches_that_meet_there(three_dof: Arm) -> None:
    plan = armkin.path(three_dof, {"start": {"joints": [0, 0, 0]}, "moves": [{"line": [400, 10, 170]}]})
    q, v, a = executed_samples(plan)
    assert v.max() <= 1.002
    assert a.max() <= 1.002
    assert q[0] == pytest.approx([0, 0, 0], abs=1e-9)
    tip = armkin.fk(three_dof, q)[:, :3, 3]
    assert np.abs(tip[:, 1:] - [10, 170]).max() < 1e-6
    assert plan.deviation <= plan.tolerance


def test_one_jerk_for_all_joints_is_each_ones_where_a_joint_is_redundant() -> None:
    arm = replace(armkin.load("panda"), max_accel=np.full(7, 2.0))
    goals = np.repeat(armkin.fk(arm, arm.home)[None], 2, axis=0)
    goals[1, :3, 3] += [0, 2, -2]
    by_number, by_array = (armkin.path(arm, goals, jerk=jerk, samples=9) for jerk in (50.0, np.full(7, 50.0)))
    assert by_number.held == by_array.held
    assert by_number.duration == by_array.duration


def test_postures_that_fail_leave_nothing_behind(three_dof: Arm) -> None:
    """The tool's axes hang on the posture, and from the postures nearest to home the tool leaves the reach."""
    tool, base = [-40, 40, 0], [10, 20, -40]
    moves: list[dict[str, Any]] = [
        {"point": [-40, -90, 600]},
        {"wait": 0.2},
        {"offset": {"xyz": tool, "frame": "tool"}},
        {"offset": {"xyz": base}},
    ]
    plan = armkin.path(three_dof, {"moves": moves, "start": "home"})
    begin = plan.runs[0].start_joints
    degrees = np.rad2deg(begin).tolist()
    assert np.abs(begin - armkin.ik(three_dof, [-40, -90, 600], near=three_dof.home).best).max() > 0.1
    approach = armkin.path(three_dof, {"moves": [{"joint": degrees}], "start": "home"})
    alone = armkin.path(three_dof, {"moves": moves[1:], "start": {"joints": degrees}})
    assert plan.length == pytest.approx(alone.length) == pytest.approx(np.linalg.norm(tool) + np.linalg.norm(base))
    assert (plan.samples, len(plan.runs)) == (alone.samples, 1)
    assert plan.duration == pytest.approx(approach.duration + alone.duration)


@pytest.mark.parametrize("jerk", [100.0, 1000.0, 5000.0])
def test_the_deviation_tells_how_far_the_average_that_limits_jerk_leaves_a_circle(jerk: float) -> None:
    centre, radius = np.array([360.0, 80.0, 300.0]), 30.0
    moves = {"start": {"point": [390, 80, 300]}, "moves": [{"circle": {"centre": centre.tolist()}}]}
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, moves, jerk=np.deg2rad(jerk))
    tips = armkin.fk(arm, plan.motion.q(np.linspace(0.0, plan.motion.duration, 2000)))[:, :3, 3] - centre
    away = np.hypot(np.hypot(tips[:, 0], tips[:, 1]) - radius, tips[:, 2]).max()
    assert 0.02 < away <= plan.deviation + 1e-6
    assert plan.deviation < 1.01 * away
    assert armkin.path(arm, moves).deviation < 1e-3


@pytest.mark.parametrize("jerk", [10.0, 100.0, 1000.0])  # [deg/s3]
def test_with_little_jerk_a_path_takes_little_more_than_the_jerk_asks(three_dof: Arm, jerk: float) -> None:
    """Accelerations of 120 deg/s2 made windows of 2.4 to 24 s, and a line of 190 mm that took 33 s at 100 deg/s3."""
    plan = armkin.path(three_dof, {"start": {"point": [390, 80, 300]}, "moves": [{"line": [390, -80, 200]}]},
                       jerk=np.deg2rad(jerk))  # fmt: skip
    t = np.linspace(0.0, plan.motion.duration, 4000)
    change = np.abs(np.diff(plan.motion.qdd(t), axis=0)).max(axis=0) / (t[1] - t[0])
    assert change.max() <= 1.02 * np.deg2rad(jerk)
    way = float(np.abs(plan.motion.end - plan.motion.start).max())
    least = (32 * way / np.deg2rad(jerk)) ** (1 / 3)  # of a joint from rest to rest, by jerk alone
    assert plan.motion.duration < 2.2 * least


@pytest.mark.parametrize("tolerance", [0.05, 0.5, 2.0])
def test_an_average_over_more_than_a_rounding_stays_within_the_tolerance(three_dof: Arm, tolerance: float) -> None:
    moves = [{"joint": [0, 60, -80]}, *({"offset": {"xyz": xyz}} for xyz in ([30, 0, 0], [0, 30, 0], [-25, -20, 0]))]
    plan = armkin.path(three_dof, {"blend": 0.02, "moves": moves}, jerk=np.deg2rad(20.0), tolerance=tolerance)
    assert plan.deviation <= tolerance
    corners = armkin.fk(three_dof, np.deg2rad([0.0, 60.0, -80.0]))[:3, 3] + np.cumsum(
        [[0, 0, 0], [30, 0, 0], [0, 30, 0], [-25, -20, 0]], axis=0
    )
    t = np.linspace(plan.motion.stretches[0].duration, plan.motion.duration, 3000)
    tips = armkin.fk(three_dof, plan.motion.q(t))[:, None, :3, 3]
    way = np.diff(corners, axis=0)
    share = np.clip(((tips - corners[:-1]) * way).sum(axis=2) / (way * way).sum(axis=1), 0.0, 1.0)
    assert np.linalg.norm(tips - corners[:-1] - share[..., None] * way, axis=2).min(axis=1).max() <= tolerance + 0.01
