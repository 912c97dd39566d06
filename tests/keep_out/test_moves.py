"""No command and no kind of board takes an arm through a keep-out."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.firmware import jogging
from armkin.cli.app import load_command
from armkin.cli.commands import COMMANDS
from armkin.formula.arrays import Array
from command_line import run

TABLE = "keep_out:\n  - box: {min: [300, -400, 0], max: [700, 400, 180]}\n    name: table\n"
KINDS = ["three_dof", "tests/robots/three_dof_grbl.yaml", "tests/robots/three_dof_klipper.yaml"]


@pytest.fixture
def table(tmp_path: Path) -> str:
    path = tmp_path / "table.yaml"
    path.write_text(TABLE)
    return str(path)


@pytest.mark.parametrize("robot", KINDS)
def test_a_motion_through_the_table_is_refused_and_one_above_it_is_made(robot: str, table: str) -> None:
    words = [robot, "--port", "sim", "--scene", table]
    completed = run("send", *words, "0", "10", "-30")
    assert (completed.code, completed.out) == (3, "")
    assert "q3 would hit table" in completed.err
    assert "nothing was moved" in completed.err
    assert run("send", *words, "40", "80", "-80").code == 0
    assert "q2, q3: 12.51 mm are assumed" in run("send", *words, "40", "80", "-80").err
    assert run("send", *words, "--target", "420,40,150").code == 3
    path = run("path", robot, "--via", "390,80,300", "--via", "390,-80,150", "--scene", table, "--port", "sim")
    assert (path.code, "then q3 hits table" in path.err) == (3, True)


@pytest.mark.parametrize("robot", KINDS)
def test_a_jog_stands_before_the_hit(robot: str, table: str) -> None:
    completed = run("jog", robot, "q3", "30", "--seconds", "60", "--port", "sim", "--scene", table, "--json")
    free = run("jog", robot, "q2", "-30", "--seconds", "60", "--port", "sim", "--scene", table, "--json")
    assert (completed.code, free.code) == (0, 0), completed.err + free.err
    for answer in (completed.json, free.json):
        arm = armkin.load(robot, scene=table)
        assert armkin.clearance(arm, np.deg2rad(answer["joints"])).mm >= 0.0
    assert free.json["joints"][1] < 70.0  # it went until the table was near


@pytest.mark.parametrize("robot", KINDS)
def test_a_jog_that_ignores_tells_what_it_passes_through(robot: str, table: str) -> None:
    words = ["jog", robot, "--port", "sim", "--scene", table, "--ignore-keep-out", "--json"]
    completed = run(*words, "q2", "-60", "--seconds", "1.5")
    assert completed.code == 0, completed.err
    [depth] = re.findall(r"--ignore-keep-out: this motion hits table by (\d+\.\d) mm \(q3\)", completed.err)
    arm = armkin.load(robot, scene=table)
    way = np.linspace(arm.home, np.deg2rad(completed.json["joints"]), 2000)
    assert -float(depth) == pytest.approx(float(np.min(armkin.clearance(arm, way).mm)), abs=0.1)
    assert "this motion" not in run(*words, "q1", "30", "--seconds", "0.5").err


def test_a_jog_ends_so_early_that_it_stands_at_the_hit(table: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load("three_dof", scene=table)
    way: list[float] = []

    def half(arm: armkin.Arm, q: Array, goal: Array) -> tuple[float, Any]:
        way.append(float(goal[0] - q[0]) / 2)
        return 0.5, SimpleNamespace(message="hit", fields={})

    monkeypatch.setattr(jogging, "free_way", half)
    axes = (0, 1, 2)
    machine: Any = SimpleNamespace(
        arm=arm, position=lambda: "known", joints=lambda: arm.home, configuration=SimpleNamespace(axes=axes)
    )
    rates = jogging.count_rates(machine, 0, 30.0)  # deg/s
    rate = float((np.linalg.pinv(arm.motor_gain) @ np.array([rates[axis] for axis in axes]))[0])
    seconds = jogging.free_seconds(machine, 0, rates) + jogging.HANDLE_TIME
    assert seconds * rate + rate**2 / (2 * float(arm.max_accel[0])) == pytest.approx(way[0])


def test_a_jog_of_coupled_motors_is_looked_at_as_whole_counts_make_it(
    table: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = armkin.load("tests/robots/differential_wrist.yaml", scene=table)
    goals: list[Array] = []

    def note_and_call(arm: armkin.Arm, q: Array, goal: Array) -> tuple[float, None]:
        goals.append(goal - q)
        return 1.0, None

    monkeypatch.setattr(jogging, "free_way", note_and_call)
    configuration = SimpleNamespace(axes=range(7))
    machine: Any = SimpleNamespace(
        arm=arm, position=lambda: "known", joints=lambda: arm.home, configuration=configuration
    )
    rates = jogging.count_rates(machine, 4, 0.4)  # deg/s of J5
    assert jogging.free_seconds(machine, 4, rates) == np.inf
    assert goals[0] @ arm.motor_gain.T == pytest.approx([60 * rates[k] for k in range(7)], abs=1e-6)


def test_ignoring_is_told_and_lasts_for_one_command(table: str) -> None:
    words = ["send", "three_dof", "0", "10", "-30", "--port", "sim", "--scene", table]
    completed = run(*words, "--ignore-keep-out")
    assert completed.code == 0
    assert "--ignore-keep-out: this motion hits table by" in completed.err
    assert run(*words).code == 3
    path = run(
        "path", "three_dof", "--via", "390,80,300", "--via", "390,-80,150", "--scene", table, "--ignore-keep-out"
    )
    assert (path.code, "this motion hits table" in path.err) == (0, True)


IN_THE_FLOOR = "0,-5,-60"


@pytest.mark.parametrize("words", [
    ["send", "three_dof", "0", "20", "-60", "--from", IN_THE_FLOOR, "--dry-run"],
    ["send", "three_dof", "--path", "PATH", "--from", IN_THE_FLOOR, "--dry-run"],
    ["send", "three_dof", "0", "20", "-60", "--assume", IN_THE_FLOOR, "--port", "sim"],
    ["path", "three_dof", "PATH", "--start", IN_THE_FLOOR],
    ["path", "three_dof", "--via", "390,80,300", "--via", "390,-80,200", "--start", IN_THE_FLOOR],
    ["path", "three_dof", "PATH", "--assume", IN_THE_FLOOR, "--port", "sim"],
])  # fmt: skip
def test_an_arm_that_stands_in_a_hit_is_told_so_by_plans_too(words: list[str], tmp_path: Path) -> None:
    floor, path = tmp_path / "floor.yaml", tmp_path / "path.yaml"
    floor.write_text("keep_out: [{floor: 20}]\n")
    path.write_text("{start: {point: [390, 80, 300]}, moves: [{line: [390, -80, 200]}]}\n")
    words = [str(path) if word == "PATH" else word for word in words]
    depth = run("fk", "three_dof", *IN_THE_FLOOR.split(","), "--scene", floor, "--json").json["hits"][0]["depth_mm"]
    completed = run(*words, "--scene", floor)
    assert completed.code == 0, completed.err
    told = f"the arm stands in a hit: it hits floor by {depth:.1f} mm (q3): it may move out, and no farther in\n"
    assert completed.err.count(told) == 1
    assert "stands in a hit" not in run(*words).err


def test_a_jog_from_a_hit_is_told_so(tmp_path: Path) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("keep_out:\n  - box: {min: [200, -100, 300], max: [500, 100, 600]}\n")
    for more, allowance in (([], ": it may move out, and no farther in"), (["--ignore-keep-out"], "")):
        completed = run("jog", "three_dof", "q1", 50, "--seconds", 1, "--port", "sim", "--scene", box, *more)
        assert completed.code == 0, completed.err
        assert f"the arm stands in a hit: it hits box 1 by 70.5 mm (q3){allowance}\n" in completed.err


def test_a_piped_answer_keeps_its_scene(table: str, tmp_path: Path) -> None:
    answer = run("ik", "three_dof", "390", "80", "300", "--scene", table, "--json").out.encode()
    assert b'"scene_sha256"' in answer
    refused = run("send", "--port", "sim", stdin=answer)
    assert refused.code == 1
    assert f"was computed in the scene {table}; give --scene {table}" in refused.err
    assert run("send", "--port", "sim", "--scene", table, stdin=answer).code == 0
    Path(table).write_text(TABLE + "  - floor: 0\n")
    assert "is another one, or it has changed" in run("send", "--port", "sim", "--scene", table, stdin=answer).err


def test_a_port_remembers_its_scene(table: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from armkin.cli.boards import keep_outs
    from armkin.errors import UsageError

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    bare, inside = armkin.load("three_dof"), armkin.load("three_dof", scene=table)
    keep_outs.check_port("/dev/ttyX", bare, False)
    keep_outs.check_port("/dev/ttyX", inside, False)
    with pytest.raises(UsageError, match=r"was last used with the scene .*table.yaml, and this motion has none"):
        keep_outs.check_port("/dev/ttyX", bare, False)
    keep_outs.check_port("/dev/ttyY", bare, False)
    keep_outs.check_port("/dev/ttyX", bare, True)
    keep_outs.check_port("/dev/ttyX", bare, False)
    keep_outs.check_port("sim", inside, False, simulated=True)
    keep_outs.check_port("sim", bare, False)


WITHOUT_SCENE = {
    "send": ["0", "20", "-60"],
    "path": ["--via", "390,80,300", "--via", "390,-80,230"],
    "jog": ["q1", "5"],
    "home": [],
    "teach": [],
    "begin": ["--out", "mine.yaml"],
}


def test_a_scene_and_no_scene_are_refused_together(table: str) -> None:
    options = {name: {param.name for param in load_command(name).params} for name in COMMANDS}
    assert {name for name in COMMANDS if {"scene", "no_scene"} <= options[name]} == set(WITHOUT_SCENE)
    for name, words in WITHOUT_SCENE.items():
        for more in (["--port", "sim"], *([["--dry-run"]] if "dry_run" in options[name] else [])):
            for contradiction in (["--no-scene", "--scene", table], ["--scene", table, "--no-scene"]):
                completed = run(name, "three_dof", *words, *more, *contradiction)
                assert (completed.code, completed.out) == (2, "")
                assert "--scene and --no-scene contradict each other: leave one away" in completed.err


def test_path_tells_its_clearance(table: str) -> None:
    answer = run("path", "three_dof", "--via", "390,80,300", "--via", "390,-80,230", "--scene", table, "--json").json
    assert set(answer["clearance"]) == {"mm", "s_mm", "body", "with"}
    assert 0 < answer["clearance"]["mm"] < 60
    assert "clearance" not in run("path", "three_dof", "--via", "390,80,300", "--via", "390,-80,230", "--json").json
    hit = run("path", "three_dof", "-", "--scene", table, "--json", stdin=b"moves:\n  - joint: [0, 10, -30]\n")
    assert hit.code == 3
    assert hit.json["clearance"]["with"] == "table"


def test_a_path_through_the_table_tells_the_depth_that_it_is_warned_of(table: str) -> None:
    words = ["path", "three_dof", "--via", "390,80,300", "--via", "390,-80,30", "--scene", table, "--ignore-keep-out"]
    answer, text = run(*words, "--json"), run(*words)
    [depth] = re.findall(r"this motion hits table by (\d+\.\d) mm \(q3\)", answer.err)
    assert answer.json["clearance"]["mm"] == pytest.approx(-float(depth), abs=0.1)
    [shown] = re.findall(r"hits table by up to (\d+\.\d) mm \(q3\)", text.out)
    assert float(shown) == pytest.approx(float(depth), abs=0.1)


def test_rows_that_stream_in_are_proved_one_by_one(table: str) -> None:
    rows = b"20,80,-80\n0,10,-30\n"
    completed = run("send", "three_dof", "--batch", "-", "--port", "sim", "--scene", table, stdin=rows)
    assert completed.code == 3
    assert "row 2: q3 would hit table" in completed.err


def test_rows_that_come_one_by_one_are_told_before_they_pass_through_something(table: str) -> None:
    rows = b"0,60,-90\n0,20,-90\n0,60,-90\n0,15,-90\n"
    for option in (("--port", "sim"), ("--dry-run",)):
        completed = run("send", "three_dof", "--batch", "-", *option, "--scene", table, "--ignore-keep-out", stdin=rows)
        assert completed.code == 0
        assert completed.err.count("--ignore-keep-out: this motion hits table by") == 1
