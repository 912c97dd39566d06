"""Which pairs count, what answers say of them, and which branch is the best one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.errors import NoBranchError, RobotFileError
from armkin.keep_out.body_pairs import guard, sample_postures
from armkin.robot_file import keep_out_keys, scene_file
from command_line import run

BENCH = "examples/scenes/three_dof.yaml"
SLIDE = """
name: slider
convention: standard
keep_out: [self, floor: -50]
base: {body: {radius: 10}}
joints:
  - {name: q1, dh: {alpha: 90, a: 100, d: 200}, limits: [-90, 90], body: {radius: 20}}
  - {name: q2, type: prismatic, dh: {alpha: 0, a: 0, d: 50}, limits: [0, 300], body: {radius: 5}}
  - {name: q3, dh: {alpha: 0, a: 80, d: 0}, limits: [-90, 90], body: {radius: 0}}
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.yaml"
    path.write_text("keep_out:\n  - box: {min: [300, -400, 100], max: [700, 400, 180]}\n    name: table\n")
    return path


def test_neighbours_and_what_always_overlaps_do_not_count() -> None:
    held = guard(armkin.load("three_dof", scene=BENCH))
    assert [(pair.body, pair.name) for pair in held.pairs] == [
        (2, "floor"), (3, "floor"), (2, "table"), (3, "table"), (3, "base"),
    ]  # fmt: skip
    assert held.left_out == (("q2", "base"),)


def test_postures_begin_at_home_and_are_haltons() -> None:
    arm = armkin.load("three_dof", scene=BENCH)
    q = np.rad2deg(sample_postures(arm))
    assert len(q) == 256
    assert q[0] == pytest.approx([0, 90, -90])
    assert q[1] == pytest.approx([-120 + 240 / 2, -20 + 140 / 3, -120 + 240 / 5])
    assert q[6] == pytest.approx([-120 + 240 * 3 / 8, -20 + 140 * 2 / 9, -120 + 240 * (1 / 5 + 1 / 25)])


def test_a_slides_body_is_as_long_as_it_is_out(tmp_path: Path) -> None:
    path = tmp_path / "slider.yaml"
    path.write_text(SLIDE)
    answer = run("info", str(path), "--json").json
    named = {body["name"]: body for body in answer["bodies"]}
    assert named["base"]["segments"] == [{"from": [0.0, 0.0, 0.0], "to": [0.0, 0.0, 200.0]}]
    assert [segment.get("slide", False) for segment in named["q2"]["segments"]] == [True, False]
    assert named["q3"]["radius_mm"] == 0.0
    arm = armkin.load(path)
    clearance = armkin.clearance(arm, [[0.0, 100.0, 0.0], [0.0, 300.0, 0.0]])
    assert clearance.mm == pytest.approx([100 - 5 - 10] * 2)  # the slide begins 100 beside the base
    assert (clearance.body.tolist(), clearance.other.tolist()) == (["q2", "q2"], ["base", "base"])


def test_fk_tells_clearance_and_hits() -> None:
    completed = run("fk", "three_dof", "0", "0", "-45", "--scene", BENCH, "--json")
    answer = json.loads(completed.out)
    assert answer["scene"] == BENCH
    assert answer["clearance_mm"] == -answer["hits"][0]["depth_mm"]
    assert answer["hits"][0]["with"] == "table"
    assert "this pose hits table by 47.5 mm (q3)" in completed.err
    assert "clearance_mm" not in run("fk", "three_dof", "0", "0", "-45", "--json").json


def test_the_best_branch_is_free_and_stands_first(table: Path) -> None:
    target = ["420", "40", "210"]
    low = run("ik", "three_dof", *target, "--near", "4,-19,42", "--json").json
    assert low["branches"][0]["name"] == "left, elbow down"
    words = ["--near", "4,-19,42", "--scene", str(table), "--all-branches"]
    free = run("ik", "three_dof", *target, *words, "--json").json
    first, second = free["branches"][:2]
    assert (first["name"], first["hits"], free["best"]) == ("left, elbow up", [], 0)
    assert second["hits"][0]["with"] == "table"
    assert (free["branches_within_limits"], free["branches_free"]) == (2, 1)
    arm = armkin.load("three_dof", scene=table)
    solutions = armkin.ik(arm, [420.0, 40.0, 210.0], near=np.deg2rad([4, -19, 42]))
    assert solutions.names[solutions.branch[solutions.best]] == "left, elbow up"
    assert solutions.clear[solutions.best]
    assert solutions.clear.shape == solutions.valid.shape
    assert "table" in run("ik", "three_dof", *target, *words).out


@pytest.mark.parametrize("robot", ["three_dof", "ur5e", "cobra600"])
def test_the_nearest_pair_is_the_least_of_all(robot: str, table: Path) -> None:
    """Found by middles and half lengths first, as most segments are too far to matter."""
    held = guard(armkin.load(robot, scene=table))
    q = np.random.default_rng(4).uniform(-3, 3, (3000, held.arm.n)) * np.where(held.arm.prismatic, 100.0, 1.0)
    mm, pairs = held.least_clearances(q)
    every = held.clearances(q)
    assert np.abs(mm - every.min(axis=1)).max() < 1e-9
    assert np.abs(every[np.arange(len(q)), pairs] - mm).max() < 1e-9


def test_no_free_branch_is_no_solution_and_names_the_hits() -> None:
    completed = run("ik", "three_dof", "300", "0", "-100", "--scene", BENCH, "--json")
    answer = json.loads(completed.out)
    assert (completed.code, answer["best"], answer["closest"]) == (3, None, None)
    assert "every branch within limits hits something: left, elbow up hits floor by 117.5 mm (q3)" in completed.err


def test_a_held_joint_keeps_its_body(table: Path) -> None:
    arm = armkin.load("three_dof", scene=table)
    q = np.deg2rad([10.0, 5.0, 20.0])
    locked = armkin.lock(arm, {"q2": float(q[1])})
    assert armkin.clearance(locked, q[[0, 2]]).mm == armkin.clearance(arm, q).mm


def test_an_arm_without_keep_outs_is_clear_of_everything() -> None:
    arm = armkin.load("three_dof")
    solutions = armkin.ik(arm, [390.0, 80.0, 300.0])
    assert solutions.clear.tolist() == solutions.valid.tolist()
    assert armkin.clearance(arm, arm.home).mm == np.inf


def test_both_files_are_kept_and_the_greater_clearance_holds(tmp_path: Path) -> None:
    robot, more = tmp_path / "arm.yaml", tmp_path / "scene.yaml"
    robot.write_text(SLIDE.replace("floor: -50]", "floor: -50]\nclearance: 7"))
    more.write_text("clearance: 2\nkeep_out: [floor: -60, capsule: {from: [0, 900, 0], to: [0, 900, 9], radius: 1}]\n")
    arm = armkin.load(robot, scene=more)
    assert arm.clearance == 7.0
    assert keep_out_keys.keep_out_names(arm.keep_out) == ["self", "floor", "floor 2", "capsule 1"]


def test_a_floor_that_swallows_the_arm_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.yaml"
    path.write_text("keep_out: [floor: 5000]\n")
    with pytest.raises(RobotFileError, match=r"floor is hit in every posture: is the base's z right\?"):
        armkin.load("three_dof", scene=path)
    assert run("fk", "three_dof", "0", "0", "0", "--scene", str(path)).code == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("keep_out: [selff]", "keep_out 1: 'selff' is no keep-out; write"),
        ("keep_out:\n  - box: {min: [0, 5, 0], max: [1, -5, 1]}", "is inside out: its y goes from 5 to -5"),
        ("keep_out:\n  - box: {min: [0, 5, 0], max: [1, 5, 1]}", "has no thickness: its y goes from 5 to 5"),
        ("keep_out:\n  - box: {size: [0, 1, 1]}", "box.size: must be above 0, not 0"),
        ("keep_out:\n  - box: {max: [0, 1, 1]}", "has no min; a box has both corners"),
        ("keep_out:\n  - capsule: {from: [0, 0, 0], to: [0, 0, 1], radius: 0}", "must be above 0"),
        ("keep_out:\n  - capsule: {from: [0, 0, 0], too: [0, 0, 1], radius: 1}", "did you mean to?"),
        ("keep_out:\n  - floor: .nan", ".nan is not a finite number"),
        ("keep_out:\n  - {floor: 0, box: {size: [1, 1, 1]}}", "has floor and box; write an entry for each"),
        ("keep_out:\n  - {floor: 0, name: a}\n  - {floor: 1, name: a}", "a keep-out named a is there already"),
        ("keep_out:\n  - {}", "is no keep-out: it has none of floor, box, capsule"),
        ("keep_out: self", "must be a list"),
        ("keep_out: [" + "floor: 0," * 1000 + "]", "1000 entries; a file has at most 256"),
        ("keepout: [self]", "unknown key; a scene has clearance and keep_out"),
        ("clearance: -1\nkeep_out: [self]", "clearance: must be at least 0, not -1"),
        ("", "the file is empty; a scene has at least keep_out"),
    ],
)
def test_a_malformed_scene_is_refused_in_words(text: str, words: str) -> None:
    with pytest.raises(RobotFileError) as raised:
        scene_file.parse_scene(text, "scene.yaml")
    assert words in str(raised.value)
    assert "scene.yaml" in str(raised.value)


def test_names_of_bodies_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("keep_out: [{floor: 0, name: q2}]\n")
    with pytest.raises(RobotFileError, match="q2 is the name of one of the arm's bodies"):
        armkin.load("three_dof", scene=path)


@pytest.mark.parametrize(
    ("scene", "line", "words"),
    [
        ("  - box: {size: [9, 9, 9]}\n    name: box 1\n", 2, "keep_out 1: a keep-out named box 1 is there already"),
        ("  - self\n  - floor: -60\n    name: floor\n", 3, "keep_out 2: a keep-out named floor is there already"),
        ("  - floor: -60\n    name: base\n", 3, "keep_out 1: name: base is the name of one of the arm's bodies"),
        ("  - self\n  - floor: -60\n    name: q1\n", 4, "keep_out 2: name: q1 is the name of one of the arm's bodies"),
    ],
)
def test_a_name_that_clashes_with_the_robots_stands_in_a_line_of_the_scene(
    scene: str, line: int, words: str, tmp_path: Path
) -> None:
    robot, path = tmp_path / "robot.yaml", tmp_path / "scene.yaml"
    robot.write_text(SLIDE.replace("floor: -50]", "floor: -50, box: {min: [500, 0, 0], max: [600, 9, 9]}]"))
    path.write_text(f"keep_out:\n{scene}")
    with pytest.raises(RobotFileError) as raised:
        armkin.load(robot, scene=path)
    assert str(raised.value).startswith(f"{path}:{line}: {words}")
    assert (raised.value.fields["file"], raised.value.fields["line"]) == (str(path), line)


def test_the_refusal_has_fields() -> None:
    from armkin.inverse import choose_branch

    arm = armkin.load("three_dof", scene=BENCH)
    request = choose_branch.Request(arm=arm)
    [answer] = choose_branch.solve(request, np.array([[300.0, 0.0, -100.0]]))
    error = choose_branch.refusal_error(request, answer, 0.0)
    assert isinstance(error, NoBranchError)
    assert [hit["with"] for hit in error.fields["hits"]] == ["floor", "table"]
    ignoring = choose_branch.Request(arm=arm, ignore=True)
    [taken] = choose_branch.solve(ignoring, np.array([[300.0, 0.0, -100.0]]))
    assert taken.best == 0


def test_the_shipped_schema_is_the_models() -> None:
    from armkin.robot_file.robot_schema import scene_schema

    assert json.loads(Path("robots/scene.schema.json").read_text()) == scene_schema()
    assert run("schema", "--scene").json == scene_schema()
