"""Every motion begins at the counts that the board gave, on every kind of board."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import armkin
from armkin.board.backend.motion_start import StartError
from armkin.errors import NoSolutionError
from armkin.motion.joint_moves import plan_joint_moves as plan_joints
from armkin.motion.joint_moves import straight_move
from armkin.motion.timing.trajectory import Trajectory
from command_line import run
from simulated_starts import ELSEWHERE, EXAMPLES, KINDS, PATHS, Kind, carried_out, simulated_kind

THREE_DOF = armkin.load("three_dof")


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_sent_from_elsewhere_is_on_its_way_from_the_first_step(kind: str) -> None:
    """A sample: all of them on all kinds is `tests/bench/bench_starts.py`."""
    kind_of_board, k = simulated_kind(kind), list(KINDS).index(kind)
    examples = [yaml.safe_load(path.read_text()) for path in EXAMPLES if kind in ("uno_cnc_shield", "klipper")]
    for moves in (*examples, PATHS[2 * k + 4]):
        motion = carried_out(kind_of_board, moves, ELSEWHERE[k % len(ELSEWHERE)])
        assert motion.off_mm < kind_of_board.tolerance
        assert motion.begins_mm < kind_of_board.tolerance
        assert motion.rest <= kind_of_board.rest


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "grbl"])
def test_both_reports_of_a_false_start(kind: str) -> None:
    """A point as the start: the tip began 67 mm off the circle; home behind a move: 36 mm off the lines."""
    kind_of_board = simulated_kind(kind)
    for moves, place in zip(PATHS[:2], ((0, 90, -90), (8, 84, -80)), strict=True):
        motion = carried_out(kind_of_board, moves, place)
        assert motion.off_mm < kind_of_board.tolerance
        assert motion.begins_mm < kind_of_board.tolerance


@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_that_begins_elsewhere_is_an_error_and_no_motion(kind: str) -> None:
    kind_of_board = simulated_kind(kind)
    arm, machine = kind_of_board.arm, kind_of_board.machine
    counts, goal = machine.counts(), arm.home + np.deg2rad([5, -5, 5])
    foreign_plan = plan_joints(arm, goal, arm.home)
    with pytest.raises(StartError, match="was made for an arm at"):
        machine.plan_trajectory(foreign_plan, np.array(counts))  # the trajectory is not what the counts are
    with pytest.raises(StartError, match="the arm stands at"):
        machine.run([machine.plan_trajectory(foreign_plan, armkin.pulses(arm, goal))])  # the counts are not the board's
    machine.refresh()
    assert np.abs(np.array(machine.counts()) - counts).max() <= kind_of_board.rest
    first = machine.plan(counts, goal[None])
    with pytest.raises(StartError, match="the arm stands at"):
        machine.run([machine.plan(counts, arm.home[None]), None, first, first])  # the second one begins at the goal
    machine.hold()  # one that plans ahead has found the second plan while it carried out the first
    assert machine.position() != "lost"
    assert (np.abs(np.array(machine.counts()) - counts) <= np.abs(first.end - first.start) + kind_of_board.rest).all()


def test_an_approach_is_told_and_counted_nowhere_else(tmp_path: Path) -> None:
    file = tmp_path / "lines.yaml"
    file.write_text("start: home\nspeed: 50\nmoves: [{line: [390, 60, 300]}, {line: [390, -60, 300]}]\n")
    from_start = run("path", "three_dof", file, "--json").json
    assert "approach" not in from_start
    from_elsewhere = run("path", "three_dof", file, "--start", "8,84,-80", "--json").json
    assert from_elsewhere["approach"] == {"from_joints": [8, 84, -80], "duration_s": pytest.approx(0.5833, abs=1e-3)}
    assert {key: value for key, value in from_elsewhere.items() if key != "approach"} == from_start
    completed = run("path", "three_dof", file, "--port", "sim", "--assume", "8,84,-80", "--json")
    assert "first a joint move to where the path starts: 0.58" in completed.err
    assert completed.json["approach"]["duration_s"] == pytest.approx(0.5833, abs=1e-3)
    for key in ("length_mm", "samples", "segments", "deviation_mm", "duration_s"):
        assert completed.json[key] == pytest.approx(from_start[key])
    dry = run("send", "three_dof", "--path", file, "--from", "8,84,-80", "--dry-run")
    assert "before it 0.583 s from where the arm stands to its start" in dry.out


def test_a_start_that_cannot_be_reached_is_said_of_its_key(tmp_path: Path) -> None:
    file = tmp_path / "far.yaml"
    file.write_text("start: {point: [900, 0, 300]}\nmoves: [{line: [390, 60, 300]}]\n")
    completed = run("path", "three_dof", file)
    assert completed.code == 3
    assert "far.yaml:1" in completed.err
    assert "out of reach" in completed.err


def test_joints_named_behind_lines_leave_the_others_where_the_lines_ended() -> None:
    lines = [{"line": [390, 60, 300]}, {"line": [390, -60, 300]}]
    end = armkin.path(THREE_DOF, {"start": "home", "moves": lines}).motion.end
    plan = armkin.path(THREE_DOF, {"start": "home", "moves": [*lines, {"joint": {"q1": 30}}]})
    assert plan.motion.end == pytest.approx([np.deg2rad(30), *end[1:]])


OUT = np.deg2rad([125.0, 90, -90])  # q1 goes to 120


def run_jog(kind_of_board: Kind, joint: int, rate: float, seconds: float) -> None:
    """A jog at deg/s."""
    joint_rate = float(np.deg2rad(rate))
    assert kind_of_board.board.ready_to_jog(joint, joint_rate) == joint_rate
    kind_of_board.board.jog(joint, joint_rate, seconds)


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "grbl", "klipper"])
def test_an_arm_outside_its_limits_may_come_back_and_go_no_farther(kind: str) -> None:
    kind_of_board = simulated_kind(kind, OUT)
    arm, machine = kind_of_board.arm, kind_of_board.machine
    assert machine.position() == "known"
    begin = machine.counts()
    with pytest.raises(NoSolutionError, match=r"q1 = 12[45][.\d]* deg is outside -120 to 120 deg, where the arm"):
        run_jog(kind_of_board, 0, 5, 0.5)
    with pytest.raises(NoSolutionError, match=r"nothing was moved"):
        armkin.path(arm, {"moves": [{"line": [-230, 330, 300]}]}, start=machine.joints())
    farther = Trajectory(arm, machine.joints(), (straight_move(arm, machine.joints(), np.deg2rad([126, 95, -90])),))
    with pytest.raises(NoSolutionError, match=r"q1 = 12[45][.\d]* deg is outside"):
        machine.plan_trajectory(farther, np.array(begin))
    assert machine.counts() == begin
    run_jog(kind_of_board, 0, -5, 0.4)
    machine.refresh()
    assert 122 < np.rad2deg(machine.joints()[0]) < 124.5
    run_jog(kind_of_board, 1, -5, 0.4)  # the others may move
    machine.run([machine.plan(machine.counts(), arm.home[None])])
    assert list(machine.counts()) == armkin.pulses(arm, arm.home).tolist()


@pytest.mark.parametrize("kind", ["uno_cnc_shield", "grbl", "klipper"])
def test_more_than_a_turn_outside_nobody_believes(kind: str) -> None:
    near, far = (simulated_kind(kind, np.deg2rad([120 + more, 90, -90])).machine for more in (359, 361))
    near.refresh()
    far.refresh()
    assert (near.position(), far.position()) == ("known", "lost")
    assert "q1 = 481" in far.loss_reason.replace("480.99", "481")
    assert near.loss_reason == ""


def test_a_servo_bus_stands_where_it_measures() -> None:
    kind_of_board = simulated_kind("feetech", np.deg2rad([125.0, 90, -90]))
    assert kind_of_board.machine.position() == "known"
    with pytest.raises(NoSolutionError, match=r"q1 = 124\.98"):
        run_jog(kind_of_board, 0, 5, 0.5)
    run_jog(kind_of_board, 0, -20, 0.5)
    assert np.rad2deg(kind_of_board.machine.joints()[0]) == pytest.approx(115, abs=1.5)


def test_whole_steps_beyond_a_limit_are_on_it() -> None:
    """The step next to a limit may lie half a step outside: a path goes on from there."""
    arm, step = THREE_DOF, 2 * np.pi / 42962
    arm = replace(arm, upper=np.array([2.0, arm.home[1] + 3000.7 * step, 2.0]))
    counts = armkin.pulses(arm, arm.upper * [0, 1, -0.75])
    assert armkin.joints(arm, counts)[1] > arm.upper[1]
    plan = armkin.path(arm, {"moves": [{"offset": {"xyz": [20, 0, 0]}}]}, start=armkin.joints(arm, counts))
    assert armkin.pulses(arm, plan.motion.start).tolist() == counts.tolist()
