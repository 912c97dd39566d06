"""What is wrong with a path is told with its file and line, against the robot it is planned for."""

from __future__ import annotations

from pathlib import Path

import pytest

import armkin
from armkin.errors import NoSolutionError, PathFileError
from armkin.teach.recorded_program import MAX_MOVES, Program
from command_line import ROOT, THREE_DOF, run

START = "moves:\n  - point: [390, 80, 300]\n"


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("g.yaml", START + "  - line: [390, 140]\n", "g.yaml:3: move 2: a target of task xyz is x y z; got 2 numbers"),
        ("g.yaml", "moves:\n  - line: [390, 140]\n", "g.yaml:2: a target of task xyz is x y z; got 2 numbers"),
        (
            "g.yaml",
            START + "\n  - circle: {centre: [390, 120, 300], normal: [0, 0, 0]}\n",
            "g.yaml:4: move 2: circle: its normal [0.0, 0.0, 0.0] has no length; give the direction of the circle's",
        ),
        (
            "g.yaml",
            START + "  - spline: [[390, 100, 300], [390, 100, 300]]\n",
            "g.yaml:3: move 2: a spline passes the same point twice",
        ),
        (
            "g.yaml",
            START + "  - arc: {via: [390, 100, 300], to: [390, 120, 300]}\n",
            "g.yaml:3: move 2: the arc's start, via and to lie on one line",
        ),
        ("g.yaml", "task: xyzzy\n" + START, "g.yaml:1: task: "),
        ("g.yaml", "blend: 0\nstart: nowhere\n" + START, "g.yaml:2: start: there is no pose 'nowhere'"),
        ("q.csv", "x,y\n390,80\n390,140\n", "q.csv: row 2: a target of task xyz is x y z; got 2 numbers"),
        ("q.csv", "q1,q2,q3\n0,90,-90\n\n0,130,0\n", "q.csv: row 4: q2 = 130 deg is outside"),
    ],
)
def test_a_move_that_makes_no_sense_is_told_with_its_line(tmp_path: Path, name: str, text: str, says: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    completed = run("path", THREE_DOF, file)
    assert completed.code in (2, 3), completed.err
    assert f"{tmp_path}/{says}" in completed.err


def test_a_way_that_is_not_carried_names_its_own_moves_and_keeps_the_verdict(tmp_path: Path) -> None:
    """The group of moves 2 and 3 is planned when move 4 ends it, which is not at fault."""
    file = tmp_path / "g.yaml"
    file.write_text("moves:\n  - joint: home\n  - point: [390, 80, 300]\n  - line: [390, -400, 300]\n  - joint: home\n")
    completed = run("path", THREE_DOF, file, "--json")
    assert completed.code == 3
    assert f"{file}:3: moves 2 to 3: no branch carries" in completed.err
    assert completed.json["reconfigurations"][0]["why"] == "reach"
    with pytest.raises(NoSolutionError) as refused:
        armkin.path(armkin.load("three_dof"), str(file))
    assert refused.value.plan.branches


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[" * 40 + "]" * 40 + "\n", "deep.yaml:1: nested more than 12 deep; a path file never is"),
        ("x,y,z\n390,80,300\n", "; a path file is a mapping: moves: and a list; rows of CSV belong into a .csv file"),
        ("# nothing\n", "the file is empty; a path file has at least moves"),
        ("moves: [" + "1, " * 100_100 + "1]\n", "more than 100000 values; no path file has so many"),
    ],
)
def test_a_path_file_is_not_called_a_robot_file(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "deep.yaml"
    file.write_text(text)
    completed = run("path", THREE_DOF, file)
    assert completed.code == 2, completed.err
    assert says in completed.err
    assert "robot file" not in completed.err


@pytest.mark.parametrize("robot", ["ur5e", "nonsense"])
def test_a_path_of_another_robot_is_refused(tmp_path: Path, robot: str) -> None:
    file = tmp_path / "rb.yaml"
    file.write_text(f"# of another arm\nrobot: {robot}\n{START}")
    for words in (("path", "three_dof", file), ("send", "three_dof", "--path", file, "--dry-run")):
        completed = run(*words)
        assert completed.code == 2, completed.err
        assert f"{file}:2: robot: this is a path of {robot}, and the arm is three_dof" in completed.err
        assert "or write robot: three_dof" in completed.err
    with pytest.raises(PathFileError, match=r"rb\.yaml:2: robot"):
        Program(armkin.load("three_dof")).load(file.read_text(), str(file))


def test_a_path_of_this_robot_is_planned_by_its_name_and_by_its_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text((ROOT / THREE_DOF).read_text().replace("name: three_dof", "name: my_arm", 1))
    file = tmp_path / "g.yaml"
    for robot, arm in (("three_dof", THREE_DOF), (THREE_DOF, "three_dof"), ("mine.yaml", mine), ("my_arm", mine)):
        file.write_text(f"robot: {robot}\n{START}")
        completed = run("path", arm, file)
        assert completed.code == 0, (robot, completed.err)
    program = Program(armkin.load(mine))
    program.moves = [{"line": [390.123456, 80.123456, 300.123456]}] * MAX_MOVES
    program.names = ["a name of a move"] * MAX_MOVES
    program.load(program.text(), "long.yaml")
    assert len(program.moves) == MAX_MOVES
    program.load(file.read_text(), "g.yaml")
    program.load(program.text(), "saved.yaml")
    file.write_text(program.text())
    assert run("path", mine, file).code == 0


def test_a_value_beyond_the_gripper_is_refused_while_planning(tmp_path: Path) -> None:
    file = tmp_path / "g.yaml"
    file.write_text(START + "  - grip: 99999\n")
    for words in (("path", THREE_DOF, file), ("send", THREE_DOF, "--path", file, "--dry-run")):
        completed = run(*words)
        assert completed.code == 2, completed.err
        assert f"{file}:3: move 2: grip: 99999 is outside of the gripper's 30 to 120" in completed.err
    for value in ("30", "120", "75.5", "open", "closed"):
        file.write_text(START + f"  - grip: {value}\n")
        assert run("path", THREE_DOF, file).code == 0, value


def test_a_grip_without_a_gripper_is_refused_before_anything_moves(tmp_path: Path) -> None:
    text = (ROOT / THREE_DOF).read_text()
    bare, slow = tmp_path / "bare.yaml", tmp_path / "slow.yaml"
    bare.write_text(text[: text.index("gripper:")] + text[text.index("board: {kind") :])
    slow.write_text(text.replace(", max_speed: 120, max_accel: 480}", "}"))
    file = tmp_path / "g.yaml"
    file.write_text(START + "  - grip: closed\n")
    for words in (("path", bare, file), ("path", bare, file, "--dry-run"), ("send", bare, "--path", file, "--dry-run")):
        completed = run(*words)
        assert (completed.code, completed.out) == (2, ""), words
        assert (
            completed.err
            == f"error: {file}:3: move 2: grip: three_dof has no gripper; add gripper: to its robot file\n"
        )
    assert run("path", slow, file).code == 0  # a plan needs no board, a rehearsal does
    for words in (("path", slow, file, "--dry-run"), ("send", slow, "--path", file, "--dry-run")):
        completed = run(*words)
        assert (completed.code, completed.out) == (2, ""), words
        assert "the gripper has no max_speed" in completed.err


def test_an_arm_on_a_board_of_others_is_planned_without_a_port(tmp_path: Path) -> None:
    robot = "tests/robots/three_dof_grbl.yaml"
    corners = ("--via", "390,80,300", "--via", "390,100,300")
    completed = run("path", robot, *corners, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["segments"] > 5
    assert run("path", robot, *corners, "--dry-run").code == 0
    file = tmp_path / "g.yaml"
    file.write_text(START + "  - grip: closed\n")
    completed = run("send", robot, "--path", file, "--dry-run")
    assert completed.code == 2
    assert "has no gripper that a board of kind grbl moves" in completed.err


def test_an_arm_without_rates_is_planned_with_a_named_guess_and_never_moved(tmp_path: Path) -> None:
    corners = ("--via", "300,0,400", "--via", "300,50,400")
    completed = run("path", "ur5e", *corners, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["duration_s"] > 0
    assert "assumed for this plan alone, as ur5e does not say: max_accel of J1, J2, J3, J4" in completed.err
    assert "60 deg/s2" in completed.err
    assert run("path", "ur5e", *corners, "--port", "none", "--dry-run").code == 0
    refused = run("path", "ur5e", *corners, "--port", "none")
    assert (refused.code, refused.out) == (2, "")
    assert "have no max_accel, it has no board" in refused.err
    file = tmp_path / "f.csv"
    file.write_text("x,y,z\n300,0,400\n300,50,400\n")
    sent = run("send", "ur5e", "--path", file, "--dry-run", "--json")
    assert sent.code == 0, sent.err
    assert "assumed for this plan alone, as ur5e does not say: max_accel of J1" in sent.err
    assert sent.json["duration_s"] == completed.json["duration_s"]
    assert run("send", "ur5e", "--path", file, "--port", "none").code == 2
