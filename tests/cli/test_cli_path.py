"""`armkin path`: plans, tells, draws, moves on the simulated board; refuses in words with the right exit code."""

from __future__ import annotations

import csv
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import armkin
from command_line import ROOT, THREE_DOF, run

PICK = """
robot: three_dof
blend: 5
start: home
moves:
  - point: [390, 80, 300]
  - line: [390, 140, 300]
  - arc: {via: [380, 160, 300], to: [360, 160, 300]}
  - grip: closed
  - offset: {xyz: [0, 0, -30]}
  - wait: 0.2
  - joint: home
"""


@pytest.fixture
def pick(tmp_path: Path) -> Path:
    path = tmp_path / "pick.yaml"
    path.write_text(PICK)
    return path


def test_a_plan_is_told_drawn_and_written(pick: Path, tmp_path: Path) -> None:
    completed = run("path", THREE_DOF, pick, "--json", "--out", tmp_path / "o.csv", "--plot", tmp_path / "o.png")
    assert completed.code == 0, completed.err
    plan = completed.json
    assert plan["robot"] == "three_dof"
    assert len(plan["robot_sha256"]) == 64
    assert plan["length_mm"] == pytest.approx(134.628, abs=0.001)
    assert [run["s_mm"] for run in plan["runs"]] == [[0.0, plan["length_mm"]]]
    assert plan["runs"][0]["branches"] == [{"s_mm": 0.0, "name": "left, elbow up"}]
    assert plan["reconfigurations"] == []
    assert plan["branches"][0]["carries_mm"] == plan["length_mm"]
    assert max(plan["limits"]["speed"].values()) <= 1.002
    assert max(plan["limits"]["accel"].values()) <= 1.002
    assert plan["deviation_mm"] <= plan["tolerance_mm"] == 0.05
    assert plan["segments"] < 100 * plan["duration_s"]
    rows = list(csv.DictReader((tmp_path / "o.csv").read_text().splitlines()))
    assert float(rows[-1]["time_s"]) == plan["duration_s"]
    assert float(rows[-1]["s_mm"]) == pytest.approx(plan["length_mm"])
    q = np.deg2rad([float(rows[300][name]) for name in ("q1", "q2", "q3")])
    tip = armkin.fk(armkin.load(THREE_DOF), q)[:3, 3]
    assert tip == pytest.approx([float(rows[300][f"{axis}_mm"]) for axis in "xyz"])
    assert (tmp_path / "o.png").stat().st_size > 20_000


def test_the_arm_goes_along_a_path_and_ends_at_exact_counts(pick: Path) -> None:
    completed = run("path", THREE_DOF, pick, "--port", "sim", "--json")
    assert completed.code == 0, completed.err
    assert completed.json["pulses"] == [0, 0, 0]
    assert completed.json["position"] == "known"


def test_a_closed_path_moves_although_it_ends_where_it_starts(tmp_path: Path) -> None:
    circle = tmp_path / "circle.yaml"
    circle.write_text("moves:\n  - circle: {centre: [228, 10, 367], normal: [0, 0, 1]}\n")
    completed = run("path", THREE_DOF, circle, "--port", "sim", "--json")
    assert completed.code == 0, completed.err
    assert completed.json["pulses"] == [0, 0, 0]
    assert completed.json["length_mm"] == pytest.approx(60 * np.pi)
    assert completed.json["segments"] > 30


def test_corners_from_options_and_from_csv(tmp_path: Path) -> None:
    rows = tmp_path / "rows.csv"
    rows.write_text("z,x,y,blend\n300,390,80,0\n300,390,140,10\n300,330,140,0\n")
    from_csv = run("path", THREE_DOF, rows, "--json").json
    two = run("path", THREE_DOF, "--via", "390,80,300", "--via", "390,140,300", "--via", "330,140,300",
              "--blend", 10, "--json").json  # fmt: skip
    assert from_csv["length_mm"] == pytest.approx(two["length_mm"])
    assert from_csv["length_mm"] < 120
    assert run("path", THREE_DOF, "-", "--json", stdin=rows.read_bytes()).json["length_mm"] == from_csv["length_mm"]


def test_what_is_not_carried_is_exit_3_with_the_verdict() -> None:
    completed = run("path", THREE_DOF, "--via", "390,80,300", "--via", "390,-400,300", "--json", "--port", "sim")
    assert completed.code == 3
    plan = completed.json
    assert plan["duration_s"] is None
    assert plan["reconfigurations"][0]["why"] == "reach"
    assert plan["reconfigurations"][0]["status_beyond"] == "unreachable"
    assert [branch["ends_because"] for branch in plan["branches"]][-1] == "q1 meets its limit -120 deg"


AT = "moves:\n  - point: [390, 80, 300]\n"


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("moves: []", 2, "has 0 items"),
        ("moves:\n  - lin: [1, 2, 3]", 2, ":2: move 1: lin: unknown key; did you mean line?"),
        ("moves:\n  - line: [1, 2, x]", 2, "move 1: line"),
        ("moves:\n  - line: [300, 0, 300]\n    joint: home", 2, "has joint and line: one of them"),
        ("speed: 200\nmoves:\n  - joint: home", 2, "speed: must be at most 100"),
        ("moves:\n  - line: [258, 10, 367]", 2, "no length"),
        ("moves:\n  - joint: [0, 130, 0]", 3, "q2 = 130 deg is outside"),
        ("moves:\n  - point: [3000, 0, 0]", 3, "the point 3000, 0, 0 is out of reach"),
        ("start: {point: [900, 0, 0]}\nmoves:\n  - line: [390, 80, 300]", 3, "start: the point 900, 0, 0 is out of"),
        ("start: {point: [-100, 10, 300]}\nmoves:\n  - joint: home", 3, "has no solution within the limits"),
        ("moves:\n  - line: [390, .nan, 300]", 2, ".nan is not a finite number; write one"),
        (AT + "  - line: [390, 80, 300]", 2, "its points are all the same"),
        (AT + "  - arc: {via: [390, 120, 300], to: [390, 160, 300]}", 2, "lie on one line"),
        (AT + "  - arc: {via: [390, 120, 300], to: [390, 80, 300]}", 2, "or two of them are the same"),
        (AT + "  - spline: [[390, 80, 300]]", 2, "passes the same point twice"),
        ("moves:\n  - point: [3000, 0, 0]\n  - line: [2000, 0, 0]", 3, "first point is out of reach"),
        ("x,y,z\n1,2\n", 2, ":2: 2 cells, 3 columns"),
        ("x,y,z\n1,2,nan\n", 2, ":2: 'nan' is no number"),
        ("x,x,z\n1,2,3\n", 2, "column x stands twice"),
    ],
)
def test_bad_paths_are_refused_in_words(tmp_path: Path, text: str, code: int, words: str) -> None:
    bad = tmp_path / ("bad.csv" if text.startswith("x") else "bad.yaml")
    bad.write_text(text)
    completed = run("path", THREE_DOF, bad, "--port", "sim")
    assert completed.code == code, completed.err
    assert words in completed.err
    assert "read back" not in completed.out


def test_a_file_that_is_not_there_is_called_a_path_file(tmp_path: Path) -> None:
    completed = run("path", THREE_DOF, tmp_path / "nofile.yaml")
    assert (completed.code, completed.out) == (1, "")
    assert "nofile.yaml: cannot read the path file: No such file" in completed.err
    assert "robot" not in completed.err


def test_a_million_rows_are_refused_without_being_read() -> None:
    """The text is read, and of its rows as many as a path may have."""
    rows = b"x,y,z\n" + b"390,80,300\n" * 1_000_000
    tracemalloc.start()
    completed = run("path", THREE_DOF, "-", stdin=rows)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert completed.code == 2
    assert "has more than 120000 rows" in completed.err
    assert most < 12 * len(rows)


def test_corners_of_half_a_turn_and_points_given_twice_are_no_errors(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("blend: 5\n" + AT + 2 * "  - line: [390, 160, 300]\n" + "  - line: [390, 80, 300]\n")
    plan = run("path", THREE_DOF, path, "--json").json
    assert plan["length_mm"] == pytest.approx(160)
    assert plan["deviation_mm"] <= 0.05


def test_the_robot_file_is_not_written_over(tmp_path: Path, pick: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text((ROOT / THREE_DOF).read_text())
    assert run("path", mine, pick, "--out", mine).code == 2


def test_send_follows_a_path_file_and_rounds_waypoints(pick: Path, tmp_path: Path) -> None:
    along = run("send", THREE_DOF, "--path", pick, "--port", "sim", "--json")
    assert along.code == 0, along.err
    assert along.json["pulses"] == [0, 0, 0]
    dry = run("send", THREE_DOF, "--path", pick, "--dry-run", "--json").json
    assert dry["length_mm"] == along.json["length_mm"]
    assert run("send", THREE_DOF, "1", "2", "3", "--path", pick, "--dry-run").code == 2
    for option, value in (("--task", "pose"), ("--branch", "left"), ("--lock", "q1=0")):
        refused = run("send", THREE_DOF, "--path", pick, option, value, "--dry-run")
        assert refused == (2, "", f"error: --path and {option}: give one of them; armkin path has more options\n")
    rows = tmp_path / "rows.csv"
    rows.write_text("q1,q2,q3\n20,90,-90\n20,70,-90\n0,70,-90\n0,90,-90\n")
    stops = run("send", THREE_DOF, "--batch", rows, "--port", "sim", "--json").json
    flows = run("send", THREE_DOF, "--batch", rows, "--port", "sim", "--json", "--blend", 8)
    assert flows.code == 0, flows.err
    assert flows.json["pulses"] == stops["pulses"] == [0, 0, 0]  # a closed way
    assert flows.json["duration_s"] < 0.8 * stops["duration_s"]
    assert flows.json["waypoints"] == stops["waypoints"] == 4
    assert run("send", THREE_DOF, 1, 2, 3, "--blend", 8, "--dry-run").code == 2


def test_a_branch_is_asked_for_in_any_spelling_and_a_wrong_one_is_told(tmp_path: Path) -> None:
    corners = ("--via", "390,80,300", "--via", "390,100,300")
    for name in ("left, elbow up", "left elbow up", "left/elbow-up", "Elbow up left"):
        completed = run("path", THREE_DOF, *corners, "--branch", name, "--json")
        assert completed.code == 0, completed.err
        assert completed.json["runs"][0]["branches"][0]["name"] == "left, elbow up"
    wrong = run("path", THREE_DOF, *corners, "--branch", "nope")
    assert (wrong.code, wrong.out) == (2, "")
    assert "no branch is called 'nope'; this arm's are: right, elbow up;" in wrong.err
    outside = run("path", THREE_DOF, *corners, "--branch", "right")
    assert outside.code == 3
    assert "branch 'right' is not within the limits at the path's start; left, elbow" in outside.err
    assert "carries 20.000 of 20.000 mm" in outside.err
    file = tmp_path / "g.yaml"
    for name, code in (("elbow up", 0), ("nope", 2)):
        file.write_text(f"moves:\n  - {{point: [390, 80, 300], branch: {name}}}\n  - joint: [0, 90, -90]\n")
        assert run("path", THREE_DOF, file).code == code
    assert f"{file}:2: move 1: no branch is called 'nope'" in run("path", THREE_DOF, file).err


def test_samples_on_stdout_and_the_answer_beside_them() -> None:
    completed = run("path", THREE_DOF, "--via", "390,80,300", "--via", "390,100,300", "--out", "-", "--json")
    assert completed.code == 0
    heading, *rows = completed.out.splitlines()
    assert heading.startswith("time_s,q1,")
    assert all(row.count(",") == heading.count(",") for row in rows)
    assert json.loads(completed.err)["length_mm"] == pytest.approx(20)


def test_a_plan_begins_within_the_limits() -> None:
    for words in (
        ("path", THREE_DOF, "--via", "390,80,300", "--start", "500,0,0"),
        ("send", THREE_DOF, "home", "--dry-run", "--from", "500,0,0"),
    ):
        completed = run(*words)
        assert (completed.code, completed.out) == (3, ""), words
        assert f"error: {words[-2]}: q1 = 500 deg is outside -120 to 120 deg" in completed.err


def test_a_start_outside_the_limits_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "begin.yaml"
    path.write_text("start: {joints: [0, 130, 0]}\nmoves:\n  - joint: home\n")
    completed = run("path", THREE_DOF, path)
    assert completed.code == 3
    assert f"{path}:1: start: q2 = 130 deg is outside" in completed.err
