"""`armkin path --lock`: planned for the joints that are free, moved and told for all; joint moves need no task."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armkin
from command_line import ROOT, run

MOVES = "moves:\n  - point: [450, 200]\n  - line: [350, 300]\n"


@pytest.fixture
def planar(tmp_path: Path) -> Path:
    """The planar arm of three servos, with rates."""
    text = (ROOT / "robots/planar_3dof.yaml").read_text()
    arm = tmp_path / "planar.yaml"
    arm.write_text(
        text.replace("    drive:", "    limits: [-90, 90]\n    max_speed: 60\n    max_accel: 120\n    drive:")
    )
    return arm


def test_a_held_joint_goes_to_its_value_first_and_stays(planar: Path, tmp_path: Path) -> None:
    path = tmp_path / "way.yaml"
    path.write_text(MOVES)
    samples = tmp_path / "way.csv"
    completed = run(
        "path", planar, path, "--lock", "q3=20", "--task", "xy", "--port", "sim", "--json", "--out", samples
    )
    assert completed.code == 0, completed.err
    arm = armkin.load(planar)
    assert completed.json["task"] == "xy"
    assert completed.json["joints"][2] == pytest.approx(20, abs=0.1)  # what the servo makes of it
    assert completed.json["pulses"] == armkin.pulses(arm, np.deg2rad(completed.json["joints"])).tolist()
    assert list(completed.json["limits"]["speed"]) == ["q1", "q2", "q3"]
    rows = list(csv.DictReader(samples.read_text().splitlines()))
    q = np.deg2rad([[float(row[name]) for name in ("q1", "q2", "q3")] for row in rows])
    on_path = np.array([float(row["s_mm"]) for row in rows]) > 0
    assert completed.json["approach"]["from_joints"][2] == 0
    assert "first a joint move to where the path starts" in completed.err
    assert np.allclose(q[:, 2], np.deg2rad(20))
    tips = armkin.fk(arm, q[on_path])[:, :2, 3]
    assert np.abs(tips.sum(axis=1) - 650).max() < 0.05 * np.sqrt(2)  # on the line
    assert tips[-1] == pytest.approx([350, 300], abs=1e-6)
    planned = run("path", planar, path, "--lock", "q3=20", "--task", "xy", "--json").json
    assert planned["duration_s"] == pytest.approx(completed.json["duration_s"], abs=0.01)
    planned_there = run("path", planar, path, "--lock", "q3=20", "--task", "xy", "--start", "0,0,20", "--json").json
    assert "approach" not in planned_there
    assert planned_there["duration_s"] == pytest.approx(planned["duration_s"], abs=1e-9)


def test_a_held_joint_outside_its_limits_or_a_way_beyond_the_reach_moves_nothing(planar: Path, tmp_path: Path) -> None:
    path = tmp_path / "way.yaml"
    path.write_text(MOVES)
    completed = run("path", planar, path, "--lock", "q3=120", "--task", "xy", "--port", "sim")
    assert completed.code == 3
    assert "q3 = 120 deg is outside -90 to 90 deg" in completed.err
    path.write_text("moves:\n  - point: [450, 200]\n  - line: [850, 200]\n")
    completed = run("path", planar, path, "--lock", "q3=20", "--task", "xy", "--json")
    assert completed.code == 3
    assert [len(branch["start_joints"]) for branch in completed.json["branches"]] == [3, 3]


def test_joint_moves_need_no_task(tmp_path: Path) -> None:
    arm = tmp_path / "head.yaml"
    text = (ROOT / "robots/pan_tilt.yaml").read_text()
    arm.write_text("\n".join(
        f"{line}\n    max_speed: 60\n    max_accel: 120" if line.startswith("    dh:") else line
        for line in text.splitlines()
    ))  # fmt: skip
    path = tmp_path / "look.yaml"
    path.write_text("moves:\n  - joint: [30, 20]\n  - wait: 0.5\n  - joint: {q1: -30}\n  - joint: home\n")
    completed = run("path", arm, path, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["task"] is None
    assert completed.json["joints"] == [0, 0]
    assert completed.json["duration_s"] == pytest.approx(1.0 + 0.5 + 1.5 + 1.0)
    path.write_text("moves:\n  - joint: [30, 20]\n  - line: [1000, 1000, 0]\n")
    completed = run("path", arm, path)
    assert completed.code == 2
    assert "no task fits its 2 joints" in completed.err


SEVEN = "task: pose\nstart: home\nmoves:\n  - point: [400, 0, 400, 180, 0, 0]\n  - line: [400, 150, 400, 180, 0, 0]\n"


@pytest.mark.parametrize(("robot", "held"), [("panda", 45.0), ("iiwa7", None)])
def test_of_seven_joints_the_redundant_one_is_held_where_it_carries_the_path(robot: str, held: float | None) -> None:
    """panda's J7 stays at home; iiwa7's does not carry there, and goes to the nearest value that does."""
    completed = run("path", robot, "-", "--json", stdin=SEVEN.encode())
    assert completed.code == 0, completed.err
    arm, plan = armkin.load(robot), completed.json
    assert plan["held"]["J7"] == plan["joints"][6]
    assert plan["held"]["J7"] == (held if held is not None else pytest.approx(-2.4648, abs=1e-3))
    assert plan["start_joints"] == pytest.approx(np.rad2deg(arm.home).tolist())
    at_end = armkin.fk(arm, np.deg2rad(plan["joints"]))
    assert at_end[:3, 3] == pytest.approx([400, 150, 400])
    again = armkin.path(
        arm_with_rates(robot), {"moves": [{"point": [400, 0, 400, 180, 0, 0]}, {"line": [400, 150, 400]}]}
    )
    assert again.held["J7"] == np.deg2rad(plan["held"]["J7"])
    assert "held: J7 at" in run("path", robot, "-", stdin=SEVEN.encode()).out


def test_near_says_where_the_redundant_joint_is_preferred() -> None:
    near = "0,-17,0,-126,0,114,-20"
    assert run("path", "panda", "-", "--near", near, "--json", stdin=SEVEN.encode()).json["held"][
        "J7"
    ] == pytest.approx(-20)
    from_here = SEVEN.replace("  - point: [400, 0, 400, 180, 0, 0]\n", "").replace(
        "line: [", "offset: {xyz: [0, 20, 0]}  # ["
    )
    completed = run("path", "panda", "-", "--near", near, "--json", stdin=from_here.encode())
    assert completed.code == 0, completed.err
    assert completed.json["held"]["J7"] == pytest.approx(45.0)  # the way begins where the joints stand


def arm_with_rates(robot: str) -> armkin.Arm:
    arm = armkin.load(robot)
    return replace(arm, max_speed=np.full(7, 0.5), max_accel=np.full(7, 1.0))


def test_joint_moves_say_where_the_redundant_joint_is_held_and_agree() -> None:
    joint = "  - joint: [0, -17, 0, -120, 0, 110, 30]\n"
    down = "  - offset: {xyz: [0, 0, -30]}\n"
    completed = run("path", "panda", "-", "--json", stdin=(SEVEN + joint + down).encode())
    assert completed.code == 0, completed.err
    assert completed.json["held"] == {"J7": pytest.approx(30.0)}
    second_joint = joint.replace("30]", "31]")
    refused = run("path", "panda", "-", stdin=(SEVEN + joint + second_joint + down).encode())
    assert refused.code == 2
    assert (
        "standard input:7: move 4: J7 is redundant and held along a path: it cannot be at 30 and then at 31 deg"
        in refused.err
    )
    one_joint = run("path", "panda", "-", "--json", stdin=(SEVEN + "  - joint: {J1: 30}\n").encode())
    assert one_joint.json["held"] == {"J7": pytest.approx(45.0)}
    moves = run("path", "panda", "-", "--json", stdin=b"moves:\n  - joint: [0, -17, 0, -120, 0, 110, 30]\n")
    assert moves.code == 0
    assert "held" not in moves.json  # joint moves alone hold nothing


def test_info_names_the_redundant_joint() -> None:
    assert run("info", "panda", "--json").json["redundant"] == "J7"
    assert "J7 is redundant: ik lists the intervals of its values" in run("info", "panda").out
    assert "redundant" not in run("info", "ur5e", "--json").json


def test_the_redundant_joint_is_held_where_the_arm_hits_nothing(tmp_path: Path) -> None:
    """A ball where panda's elbow passes with J7 at home: the path was refused, though other values carry it."""
    moves = {"moves": [{"point": [400, 0, 400, 180, 0, 0]}, {"line": [400, 150, 400]}]}
    plain = armkin.path(arm_with_rates("panda"), moves)
    elbow = armkin.frames(plain.arm, plain.runs[0].end_joints)[3, :3, 3]
    scene = tmp_path / "ball.yaml"
    ball = f"from: {elbow.tolist()}, to: {np.add(elbow, [0, 0, 1]).tolist()}, radius: 40"
    scene.write_text(f"keep_out:\n  - name: ball\n    capsule: {{{ball}}}\n")
    arm = armkin.load("panda", scene=scene)
    plan = armkin.path(replace(arm, max_speed=np.full(7, 0.5), max_accel=np.full(7, 1.0)), moves)
    assert plan.clearance is not None
    assert plan.clearance["mm"] > 0
    assert plan.held["J7"] != plain.held["J7"]
    ignored = armkin.load("panda", scene=scene)
    ignored = replace(ignored, max_speed=np.full(7, 0.5), max_accel=np.full(7, 1.0), ignores_keep_out=True)
    assert armkin.path(ignored, moves).held == plain.held
