"""`armkin new`: a robot file from a DH table, and the example that shows every key."""

import json
import os
import pty
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin import robot_file
from command_line import ROOT, run

TABLE = ["--dh", "90,0,170", "--dh", "0,197,-10", "--dh", "0,258,0"]


def file_made(*words: object, stdin: bytes = b"") -> robot_file.RobotFile:
    """The robot file that a command line writes to standard output."""
    completed = run("new", "arm", *words, "--out", "-", stdin=stdin)
    assert completed.code == 0, completed.err
    return robot_file.parse_robot_file(completed.out, "arm.yaml")


def test_a_table_becomes_an_arm(tmp_path: Path) -> None:
    path = tmp_path / "mine"
    completed = run("new", path, *TABLE, "--convention", "standard", "--source", 'the "paper": Table 1')
    assert (completed.code, completed.out) == (0, "")
    assert f"wrote {path}.yaml" in completed.err
    arm, paper = armkin.load(f"{path}.yaml"), armkin.load("three_dof")
    q = np.random.default_rng(1).uniform(-3, 3, (50, 3))
    assert np.array_equal(armkin.fk(arm, q), armkin.fk(paper, q))
    assert robot_file.read_robot_file(f"{path}.yaml").source == 'the "paper": Table 1'
    assert run("fk", f"{path}.yaml", "home").code == 0
    again = run("new", path, *TABLE, "--convention", "standard")
    assert again.code == 1
    assert "is there already" in again.err


def test_entries_as_papers_write_them() -> None:
    rows = ["--dh", "pi/2,0,170,q1", "--dh", "-pi/2,0.5,d2", "--dh", "0,258,0,q3 - 90", "--dh", "0,1,2,theta4+pi/2"]
    file = file_made(*rows, "--convention", "modified")
    assert [joint.type for joint in file.joints] == ["revolute", "prismatic", "revolute", "revolute"]
    tables = [joint.dh for joint in file.joints]
    assert [dh and (dh.alpha, dh.a, dh.d, dh.theta) for dh in tables] == [
        (90, 0, 170, 0),
        (-90, 0.5, 0, 0),
        (0, 258, 0, -90),
        (0, 1, 2, 90),
    ]


def test_a_csv_table() -> None:
    text = b"# a comment\nname,d,alpha,a,type,lower,upper,theta\n"
    text += b"base,170,90,0,,-120,120,\nlift,0,0,0,prismatic,10,300,45\n"
    file = file_made("--batch", "-", "--convention", "standard", stdin=text)
    base, lift = file.joints
    assert (base.name, base.limits, base.home) == ("base", (-120, 120), 0)
    assert (lift.type, lift.limits, lift.home) == ("prismatic", (10, 300), 10)
    plain = file_made("--batch", "-", "--convention", "standard", stdin=b"90,0,170\n0,1e-7,0,45\n")
    assert plain.joints[1].dh is not None
    assert (plain.joints[1].dh.a, plain.joints[1].dh.theta) == (1e-7, 45)


def test_the_comments_become_keys_when_they_are_taken_out() -> None:
    text = run("new", "arm", *TABLE, "--convention", "standard", "--out", "-").out
    lines = []
    for line in text.splitlines():
        bare = line.strip().removeprefix("# ")
        is_key = line.strip().startswith("# ") and bare.split(":")[0].isidentifier() and "`" not in bare.split("#")[0]
        lines.append(line.replace("# ", "", 1) if is_key else line)
    file = robot_file.parse_robot_file("\n".join(lines), "arm.yaml")
    assert file.board is not None
    assert file.gripper is not None
    assert file.poses is not None
    assert all(joint.drive and joint.max_speed and joint.limits and joint.sign == -1 for joint in file.joints)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["arm", *TABLE], "--convention is missing: standard"),
        (["arm", *TABLE, "--convention", "craig"], "must be standard or modified"),
        (["arm"], "no table: give --dh"),
        (["arm.yaml", *TABLE], "write arm"),
        (["arm", "--dh", "1,2", "--convention", "standard"], "row 1 takes alpha,a,d"),
        (["arm", "--dh", "1,2,x", "--convention", "standard"], "row 1: d: 'x' is not a number"),
        (["arm", "--dh", "q1,2,3", "--convention", "standard"], "only theta or d can be"),
        (["arm", "--dh", "1,2,d1,q1", "--convention", "standard"], "both theta and d are variables"),
        (["arm", "--dh", "1,2,3,-q1", "--convention", "standard"], "sign: -1"),
        (["arm", "--dh", "1,2,3", "--batch", "-", "--convention", "standard"], "give one of the two"),
    ],
)
def test_what_is_wrong_is_told_and_nothing_is_written(words: list[str], says: str, tmp_path: Path) -> None:
    completed = run("new", *words, cwd=tmp_path)
    assert completed.code == 2
    assert says in completed.err
    assert list(tmp_path.iterdir()) == []


def test_the_questions_of_a_terminal(tmp_path: Path) -> None:
    answers = ["standard", "2", "pi/2", "0", "a lot", "170", "", "-90,90", "0", "200", "0", "q2 + 45", "none"]
    answers += ["5000", "-20"]  # the floor: one that swallows the arm is asked for again
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "armkin", "new", "asked"]
    with subprocess.Popen(command, cwd=tmp_path, stdin=slave, stdout=slave, stderr=subprocess.PIPE) as process:
        os.close(slave)
        os.write(master, "".join(f"{answer}\n" for answer in answers).encode())
        assert process.stderr is not None
        messages = process.stderr.read().decode()
        assert process.wait(30) == 0, messages
    os.close(master)
    assert "d: 'a lot' is not a number" in messages
    assert "floor is hit in every posture" in messages
    assert [entry.floor for entry in robot_file.read_robot_file(tmp_path / "asked.yaml").keep_out] == [-20]
    first, second = robot_file.read_robot_file(tmp_path / "asked.yaml").joints
    assert first.dh is not None
    assert second.dh is not None
    assert (first.dh.alpha, first.dh.d, first.limits) == (90, 170, (-90, 90))
    assert (second.dh.a, second.dh.theta, second.limits) == (200, 45, None)


def key_names(part: Any) -> set[str]:
    """All names of keys in a schema."""
    if isinstance(part, list):
        return {key for item in part for key in key_names(item)}
    if not isinstance(part, dict):
        return set()
    names = set(part.get("properties", ()))
    return names | {key for value in part.values() for key in key_names(value)}


def test_the_example_shows_every_key() -> None:
    path = ROOT / "examples/every_key.yaml"
    text = path.read_text()
    schema = json.loads(run("schema").out)
    expected = key_names(schema["properties"]) | key_names(schema["$defs"])
    missing = {key for key in expected if f"{key}:" not in text}
    assert len(expected) > 45
    assert not missing
    assert run("send", path, "show", "--port", "sim").code == 0
