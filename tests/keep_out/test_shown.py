"""Keep-outs in pictures, in the workspace and on the page; shipped bodies and benches."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.keep_out.body_pairs import guard, sample_postures
from armkin.teach.pose_answers import Question, answer_question
from command_line import run

BENCHES = sorted(path.stem for path in Path("examples/scenes").glob("*.yaml"))


@pytest.mark.parametrize("robot", BENCHES)
def test_a_bench_leaves_its_arm_room(robot: str) -> None:
    arm = armkin.load(robot, scene=f"examples/scenes/{robot}.yaml")
    assert armkin.clearance(arm, arm.home).mm > 0
    assert 0.2 < (guard(arm).clearances(sample_postures(arm)).min(axis=1) >= 0).mean() < 0.95
    assert robot == "three_dof" or not guard(arm).bodies.assumed.any()
    assert not armkin.load(robot).keep_out


def test_a_hit_is_red_in_a_picture(tmp_path: Path) -> None:
    picture = tmp_path / "arm.svg"
    scene = "examples/scenes/three_dof.yaml"
    assert run("plot", "three_dof", "--target", "400,40,100", "--scene", scene, "-o", picture).code == 0
    drawn = picture.read_text()
    assert "hits table by 11.9 mm" in drawn
    assert "#d62728" in drawn


def test_branches_that_hit_much_leave_the_arm_its_room(tmp_path: Path) -> None:
    picture, words = tmp_path / "arm.svg", ["ur5e", "--target", "500,200,50,180,0,0"]
    assert run("plot", *words, "--scene", "examples/scenes/ur5e.yaml", "-o", picture).code == 0
    assert "hits floor by 270.5 mm (J2) and 3 more" in picture.read_text()
    lines = [float(x) for x in re.findall(r'id="axis3d_.*?M (\d+\.\d+)', picture.read_text(), re.DOTALL)]
    assert lines
    assert min(lines) < 0.5 * 9.6 * 72


def test_the_workspace_tells_the_free_share() -> None:
    words = ("workspace", "three_dof", "--samples", "500")
    survey = run(*words, "--scene", "examples/scenes/three_dof.yaml", "--json").json
    assert 0.2 < survey["free_share"] < 0.95
    assert "free_share" not in run(*words, "--json").json


def test_the_page_is_told_of_hits() -> None:
    arm = armkin.load("three_dof", scene="examples/scenes/three_dof.yaml")
    answer = answer_question(arm, Question(q=np.deg2rad([0.0, 0.0, -45.0])))
    assert answer["outside"][0].startswith("it hits table by 47.5 mm (q3)")
    assert any(branch["hits"] for branch in answer["branches"])
    assert answer_question(arm, Question(q=arm.home))["outside"] == []
