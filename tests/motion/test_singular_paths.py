"""Through a wrist singularity, a micrometre and a tenth of a millimetre beside it; and where the branch must change."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import NoSolutionError, UsageError
from armkin.model.rotation import rpy
from armkin.motion.branches import wrist_turn
from armkin.motion.branches.branch_columns import BranchColumns, Samples
from armkin.motion.path_planner.branch_report import plan_fields, wrist_pass_lines
from armkin.plot.path_picture import plot_path


@cache  # what is prepared of an arm is kept by arm
def with_rates(name: str) -> armkin.Arm:
    """An arm of revolute joints with rates of ours where its file has none."""
    arm = armkin.load(name)
    speed = np.where(np.isnan(arm.max_speed), np.pi / 2, arm.max_speed)
    return replace(arm, max_speed=speed, max_accel=3 * speed)


@pytest.mark.parametrize("beside", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize(
    ("name", "q"), [("puma560", [0.3, -0.8, 0.5, 0.4, 0.0, 0.2]), ("irb120", [0.3, 0.3, 0.2, 0.5, 0.0, 0.3])]
)
def test_a_wrist_singularity_is_passed_within_limits_and_tolerance(name: str, q: list[float], beside: float) -> None:
    arm = with_rates(name)
    ends = np.tile(armkin.fk(arm, q), (2, 1, 1))
    ends[:, :3, 3] += np.array([[-60.0, -60, 0], [60, 60, 0]]) + beside * np.array([0.3, 0.5, 0.7])
    plan = armkin.path(arm, ends, hold=None)
    t = np.arange(0, plan.duration, 0.001)
    q_of = plan.q(t)
    assert np.abs(np.diff(q_of, axis=0) / 0.001 / arm.max_speed).max() <= 1.002
    assert np.abs(np.diff(q_of, n=2, axis=0) / 1e-6 / arm.max_accel).max() <= 1.002
    tips = armkin.fk(arm, q_of[plan.s(t) > 0])[:, :3, 3] - ends[0, :3, 3]
    way = (ends[1] - ends[0])[:3, 3]
    way /= np.linalg.norm(way)
    assert np.linalg.norm(tips - np.outer(tips @ way, way), axis=1).max() <= 0.05
    assert plan.deviation <= plan.tolerance


@pytest.mark.parametrize("seed", [9, 13, 17])
def test_acceleration_is_kept_inside_the_intervals_of_the_grid(seed: int) -> None:
    """Lines a micrometre beside a wrist singularity: joint 4 turns by half a turn within a few grid intervals."""
    arm, rng = with_rates("puma560"), np.random.default_rng(seed)
    q = rng.uniform(-0.6, 0.6, 6) * np.pi
    q[4] = 0.0
    d = rng.normal(size=3)
    ends = np.tile(armkin.fk(arm, q), (2, 1, 1))
    ends[:, :3, 3] += np.outer([-60, 60], d / np.linalg.norm(d)) + 1e-3 * rng.normal(size=3)
    plan = armkin.path(arm, ends, hold=None)
    for curve in plan.motion.stretches:
        t = np.linspace(0.0, curve.duration, 40_000)
        assert np.abs(curve.evaluate(t, 2) / arm.max_accel).max() <= 1.002
        assert np.abs(curve.evaluate(t, 1) / arm.max_speed).max() <= 1.002


def test_a_limit_ends_the_run_and_split_changes_the_branch_there() -> None:
    arm = with_rates("irb120")
    ends = np.tile(armkin.fk(arm, [0.3, 0.3, 0.2, 0.5, 0.0, 0.3]), (2, 1, 1))
    ends[:, :3, 3] += np.array([[0.0, 0, -80], [0, 0, 80]]) + 0.1 * np.array([0.3, 0.5, 0.7])
    with pytest.raises(NoSolutionError, match="J4 meets its limit 160 deg; with 1 change of branch") as refused:
        armkin.path(arm, ends)
    assert refused.value.fields["splittable"]
    plan = armkin.path(arm, ends, split=True)
    [change] = plan.reconfigurations
    assert (change.why, change.joint) == ("limit", "J4")
    assert len(plan.runs) == 2
    assert plan.runs[0].end == plan.runs[1].begin == change.s
    t = np.arange(0, plan.duration, 0.001)
    q = plan.q(t)
    assert np.abs(np.diff(q, axis=0)).max() < 0.01  # a joint move in between, no jump
    assert np.all((q >= arm.lower - 1e-6) & (q <= arm.upper + 1e-6))
    end = armkin.fk(arm, plan.q(plan.duration))[:3, 3]
    assert end == pytest.approx(ends[1, :3, 3], abs=0.001)


@pytest.mark.parametrize("name", ["puma560", "irb120"])
def test_free_joints_stay_where_the_whole_way_is_singular(name: str) -> None:
    """The wrist is straight (the forearm keeps its direction while joint 2 turns): joints 4 and 6 are free."""
    arm = with_rates(name)
    a, via, b = (armkin.fk(arm, [0.3, x, 0.2 - x, 0.5, 0.0, 0.3]) for x in (0.1, 0.3, 0.5))
    turned = np.rad2deg(rpy(a[:3, :3])).tolist()
    arc = {"via": via[:3, 3].tolist(), "to": [*b[:3, 3].tolist(), *turned]}
    moves = [{"point": [*a[:3, 3].tolist(), *turned]}, {"arc": arc}]
    plan = armkin.path(arm, {"task": "pose", "moves": moves}, hold=None)
    assert len(plan.runs) == 1
    curve = plan.motion.stretches[-1]
    q = curve.evaluate(np.linspace(0.0, curve.duration, 500))
    assert np.ptp(q[:, [3, 5]], axis=0).max() < 1e-6
    assert np.abs(q[:, 4]).max() < 1e-6
    assert np.ptp(q[:, 1]) == pytest.approx(0.4, abs=1e-6)


def plan_beside(arm: armkin.Arm, q: list[float], distance: float, turn: float) -> tuple[armkin.PathPlan, np.ndarray]:
    """A line of 170 mm that passes a singular posture at so many mm, and where it begins and ends."""
    ends = np.tile(armkin.fk(arm, q), (2, 1, 1))
    ends[:, :3, 3] += np.array([[-60.0, -60, 0], [60, 60, 0]]) + distance * np.array([0.3, 0.5, 0.7])
    turned = np.rad2deg(rpy(ends[0, :3, :3])).tolist()
    moves = [{key: [*end[:3, 3].tolist(), *turned]} for key, end in zip(("point", "line"), ends, strict=True)]
    return armkin.path(arm, {"task": "pose", "turn_tolerance": turn, "moves": moves}, hold=None), ends


QS = {"puma560": [0.3, -0.8, 0.5, 0.4, 0.0, 0.2], "irb120": [0.3, 0.3, 0.2, 0.5, 0.0, 0.3]}
QS["ar4"] = QS["irb120"]


@cache
def straight_through(name: str) -> armkin.PathPlan:
    return plan_beside(with_rates(name), QS[name], 0.0, 0.0)[0]


def line_seconds(plan: armkin.PathPlan) -> float:
    """Of the line alone: before it the arm goes from home to where it begins."""
    return sum(stretch.duration for stretch, _ in plan.on_path.values())


@pytest.mark.parametrize(
    ("name", "distance", "turn"),
    [("puma560", 0.01, 0.002), ("puma560", 0.1, 0.1), ("irb120", 1.0, 0.1), ("ar4", 0.01, 0.002),
     ("puma560", 0.001, 0.0), ("puma560", 0.01, 0.0), ("irb120", 0.001, 0.0), ("irb120", 0.01, 0.0),
     ("irb120", 0.02, 0.0), ("ar4", 0.001, 0.0), ("ar4", 0.01, 0.0)],
)  # fmt: skip
def test_beside_a_singularity_a_line_takes_as_long_as_straight_through_it(
    name: str, distance: float, turn: float
) -> None:
    """The tool turned a little and its tip on the line, or, where it may not be turned, aside within the tolerance."""
    arm = with_rates(name)
    plan, ends = plan_beside(arm, QS[name], distance, turn)
    slack = 1.05 if distance == 1.0 else 1.002
    assert line_seconds(plan) <= slack * line_seconds(straight_through(name))
    assert (plan.turned is not None) == (turn > 0)
    t = np.linspace(0.0, plan.duration, 4001)
    t = t[plan.s(t) > 0]
    T, way = armkin.fk(arm, plan.q(t)), (ends[1] - ends[0])[:3, 3]
    way /= np.linalg.norm(way)
    apart = T[:, :3, 3] - ends[0, :3, 3]
    leaves = float(np.linalg.norm(apart - np.outer(apart @ way, way), axis=1).max())
    assert leaves <= (1e-3 if turn else plan.deviation)
    assert plan.deviation <= plan.tolerance
    angle = np.arccos(np.clip((np.einsum("nij,ij->n", T[:, :3, :3], ends[0, :3, :3]) - 1) / 2, -1.0, 1.0))
    assert np.rad2deg(angle).max() <= max(turn * 1.01, 1e-3)
    assert np.rad2deg(plan.turned or 0.0) <= turn
    assert np.abs(plan.qd(t) / arm.max_speed).max() <= 1.002
    assert np.abs(plan.qdd(t) / arm.max_accel).max() <= 1.002


def test_a_plan_says_where_and_how_a_singularity_is_passed() -> None:
    for turn, how in ((0.0, "the tip at most 0.0045 mm aside"), (0.002, "the tool turned by at most 0.0017 deg")):
        plan, _ = plan_beside(with_rates("puma560"), QS["puma560"], 0.01, turn)
        [line] = wrist_pass_lines(plan)
        assert line.startswith("a wrist singularity is passed between 35.817 and 134.741 mm: ")
        assert how in line
        names = [branch["name"] for branch in plan_fields(plan)["branches"]]
        assert len(names) == len(set(names))
        [passed] = plan_fields(plan)["wrists_passed"]
        assert (passed["aside_mm"] > 0) == (turn == 0)
        assert (passed["turned_deg"] > 0) == (turn > 0)


def test_a_picture_says_how_a_singularity_is_passed(tmp_path: Path) -> None:
    for turn, how in ((0.0, "tip 0.0045 mm aside"), (0.002, "tool turned by 0.0017 deg")):
        plan, _ = plan_beside(with_rates("puma560"), QS["puma560"], 0.01, turn)
        plot_path(plan, str(tmp_path / "plan.svg"))
        caption = f"straight through a wrist singularity, 36 to 135 mm: {how}"
        assert caption in (tmp_path / "plan.svg").read_text()


def test_nothing_goes_along_the_line_faster_than_its_slowest_joint_alone() -> None:
    """The Puma's joint 3 turns by 18.84 degrees one way, from rest to rest: 0.528 s at 270 deg/s2."""
    arm = with_rates("puma560")
    plan, _ = plan_beside(arm, QS["puma560"], 0.01, 0.002)
    stretch, _ = plan.on_path[max(plan.on_path)]
    travel = np.abs(stretch.end - stretch.start)
    least = float((2 * np.sqrt(travel / arm.max_accel)).max())
    assert least == pytest.approx(0.528, abs=1e-3)
    assert least <= line_seconds(plan) <= 1.002 * least


def test_a_line_a_micrometre_beside_a_singularity_is_carried_where_a_limit_forbids_the_swing() -> None:
    """The AR4's joint 4 cannot swing round by half a turn; a micrometre away it need not."""
    arm = with_rates("ar4")
    ends = np.tile(armkin.fk(arm, [1.3, 0.4, -0.2, 0.9, 0.0, 0.7]), (2, 1, 1))
    ends[:, :3, 3] += np.array([[-60.0, -60, 0], [60, 60, 0]]) + 1e-3 * np.array([0.3, 0.5, 0.7])
    assert len(armkin.path(arm, ends, hold=None).runs) == 1


def test_no_tool_is_turned_farther_than_allowed_and_only_wrists_are() -> None:
    plan, _ = plan_beside(with_rates("puma560"), [0.3, -0.8, 0.5, 0.4, 0.0, 0.2], 1.0, 0.002)
    assert plan.turned is None
    with pytest.raises(UsageError, match="turn_tolerance is for arms with six joints that turn"):
        armkin.path(armkin.load("three_dof"), {"turn_tolerance": 0.1, "moves": [{"line": [390, 80, 300]}]})


@pytest.mark.parametrize("name", ["ar4", "irb120"])
def test_a_line_straight_through_a_singularity_is_carried_whole(name: str) -> None:
    plan, _ = plan_beside(with_rates(name), [0.3, 0.3, 0.2, 0.5, 0.0, 0.3], 0.0, 0.0)
    assert len(plan.runs) == 1
    assert plan.turned is None


@pytest.mark.parametrize("name", ["irb120", "ar4"])
def test_nearer_to_a_singularity_is_hardly_slower(name: str) -> None:
    """Joint 4 turns by half a turn in any case; where its cubics wavered, 0.01 mm took 9 % longer than 0.1."""
    off = [plan_beside(with_rates(name), [0.3, 0.3, 0.2, 0.5, 0.0, 0.3], off, 0.0)[0].duration for off in (1e-2, 1e-1)]
    assert off[0] <= 1.03 * off[1]


@pytest.mark.parametrize(
    ("way", "split", "carried"), [([0, 0, 20], False, True), ([20, 0, 0], True, True), ([0, 0, -20], True, False)]
)
def test_a_whole_stretch_of_singular_postures_is_solved_at_few_samples(
    way: list[float], split: bool, carried: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the Stanford arm's home: straight up joints 4 and 6 are free all along, and divided steps multiplied."""
    sample_counts, solved = [], Samples.solve_at

    def count_and_call(self: Samples, s: np.ndarray, examine: bool = True) -> BranchColumns:
        sample_counts.append(len(s))
        return solved(self, s, examine)

    monkeypatch.setattr(Samples, "solve_at", count_and_call)
    moves: dict[str, object] = {"start": "home", "moves": [{"offset": {"xyz": way}}]}
    arm = with_rates("stanford")
    if carried:
        assert len(armkin.path(arm, moves, split=split).runs) <= (3 if split else 1)
    else:
        with pytest.raises(NoSolutionError, match=r"q3 meets its limit 304\.8 mm"):
            armkin.path(arm, moves, split=split)
    assert sum(sample_counts) < 1500


def test_a_home_that_is_singular_and_a_way_that_is_not_keep_their_branch() -> None:
    """Straight down from the Puma's home only the first samples leave a joint free: they lead on to what is beyond."""
    plan = armkin.path(with_rates("puma560"), {"start": "home", "moves": [{"offset": {"xyz": [0, 0, -20]}}]})
    assert len(plan.runs) == 1


def test_an_ordinary_line_asks_once_how_straight_a_wrist_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joint 5 alone tells; the axes were asked anew for each branch of a line, which took up to 15 % of its time."""
    counts = []

    def count_and_call(arm: armkin.Arm, q: np.ndarray) -> np.ndarray:
        counts.append(len(q))
        return armkin.jacobian(arm, q)

    monkeypatch.setattr(wrist_turn, "jacobian", count_and_call)
    arm = with_rates("irb2400")
    ends = np.tile(armkin.fk(arm, [0.3, 0.3, 0.2, 0.5, 1.0, 0.3]), (2, 1, 1))
    ends[1, :3, 3] += [60.0, 60.0, 0.0]
    assert armkin.path(arm, ends).motion.duration > 0
    assert counts == [3]


def test_a_way_that_is_singular_throughout_has_one_place_where_its_wrist_is_straight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Rounding made every other sample one, each with windows to plan: 8.5 s of a core for a second's motion."""
    place_counts: list[int] = []
    straight = wrist_turn._straight_samples

    def count_and_call(*arguments: Any) -> list[int]:
        places = straight(*arguments)
        place_counts.append(len(places))
        return places

    monkeypatch.setattr(wrist_turn, "_straight_samples", count_and_call)
    test_free_joints_stay_where_the_whole_way_is_singular("puma560")
    assert max(place_counts) == 1
