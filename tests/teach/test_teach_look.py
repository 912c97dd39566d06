"""What the page is told of a pose or a target is what the command line says, to the last digit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.model import units
from armkin.teach.arm_description import first_lock, scene_json
from armkin.teach.pose_answers import Question, answer_question
from armkin.teach.quick_ik import QuickIk
from command_line import ROOT, run

ROBOTS = sorted(path.stem for path in (ROOT / "robots").glob("*.yaml"))


def load_robot(name: str) -> armkin.Arm:
    return armkin.load(str(ROOT / f"robots/{name}.yaml"))


def ask_pose(name: str, q: Sequence[float], **more: Any) -> dict[str, Any]:
    one = load_robot(name)
    return answer_question(one, Question(units.joints_in(one, q), **more))


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_robot_has_a_scene_and_a_first_picture(robot: str) -> None:
    one = load_robot(robot)
    held = first_lock(one)
    drawn = scene_json(one)
    answer = answer_question(one, Question(one.home, held=() if held is None else (held,)))
    json.dumps([drawn, answer], allow_nan=False)
    assert len(drawn["bodies"]) == one.n + 1
    assert answer["q"] == pytest.approx(units.home_out(one), abs=1e-9)
    if answer["task"] is None:
        assert answer["why"]
    else:
        assert answer["branches"]


@pytest.mark.parametrize(
    ("robot", "target"),
    [
        ("three_dof", [390, 80, 300]),
        ("three_dof", [600, 0, 170]),
        ("three_dof", [2000, 0, 0]),
        ("ur5e", [300, 200, 400, 10, 20, 30]),
        ("cobra600", [400, 200, 300, 30]),
    ],
)
def test_branches_are_those_of_ik(robot: str, target: list[float]) -> None:
    file = f"robots/{robot}.yaml"
    by_command = run("ik", file, *target, "--all-branches", "--json").json
    answer = ask_pose(robot, units.home_out(load_robot(robot)), target=target)
    assert answer["status"] == by_command["status"]
    assert answer["complete"] == by_command["complete"]
    assert [(b["name"], b["joints"], b["within_limits"]) for b in answer["branches"]] == [
        (b["name"], b["joints"], b["within_limits"]) for b in by_command["branches"]
    ]
    if by_command["best"] is None:
        assert answer["closest"]["distance_mm"] == by_command["closest"]["distance_mm"]
        assert answer["closest"]["joints"] == by_command["closest"]["joints"]
    else:
        assert answer["q"] == by_command["branches"][by_command["best"]]["joints"]


@pytest.mark.parametrize("best", [False, True])
def test_pulses_and_tip_are_those_of_the_command_line(best: bool) -> None:
    pose = [-30, 5, -5]
    by_command = run("pulses", "robots/three_dof.yaml", *pose, "--json", *(["--best"] if best else [])).json
    pose_answer = run("fk", "robots/three_dof.yaml", *pose, "--json").json
    answer = ask_pose("three_dof", pose, best=best)
    assert answer["motors"]["pulses"] == by_command["pulses"]
    assert answer["motors"]["moves"] == by_command["moves"]
    assert answer["motors"]["error_mm"] == by_command["error_mm"]
    assert answer["tip"] == {"position_mm": pose_answer["position_mm"], "rpy_deg": pose_answer["rpy_deg"]}


def test_a_pose_is_on_one_of_its_branches() -> None:
    answer = ask_pose("three_dof", [20, 30, 40])
    assert answer["branches"][answer["chosen"]]["joints"] == pytest.approx([20, 30, 40])
    assert answer["outside"] == []


def test_what_is_outside_is_said_in_words() -> None:
    answer = ask_pose("three_dof", [0, 130, 0])
    assert answer["outside"] == ["q2 = 130 deg is outside -20 to 120 deg"]


def test_a_branch_is_kept_while_the_target_moves() -> None:
    answer = ask_pose("three_dof", [0, 90, -90], target=[390, 80, 300], branch="left, elbow down")
    assert answer["branches"][answer["chosen"]]["name"] == "left, elbow down"


def test_seven_joints_need_one_that_is_held() -> None:
    home = units.home_out(load_robot("panda"))
    free = ask_pose("panda", home)
    assert free["task"] is None
    assert "panda" in free["why"]
    held = ask_pose("panda", home, held=("J3",))
    assert len(held["branches"]) == 8
    assert all(branch["joints"][2] == pytest.approx(home[2]) for branch in held["branches"])
    assert scene_json(load_robot("panda"))["lock"] == "J7"  # the redundant one, as info names it
    assert len(ask_pose("panda", home, held=("J7",))["branches"]) == 8


def test_free_joints_of_a_self_motion_are_named() -> None:
    answer = ask_pose("puma560", [0, 0, 0, 20, 0, 30])
    assert answer["status"] == "singular"
    assert answer["free"] == ["J4", "J6"] or len(answer["free"]) == 2


def test_moves_start_where_the_arm_stands() -> None:
    answer = ask_pose("three_dof", [-30, 5, -5], standing_pulses=(-1000, 0, 0))
    assert answer["motors"]["moves"] == [-67, -10144, 5667]
    assert answer["motors"]["from"] == "arm"


@pytest.mark.parametrize(("robot", "held"), [("jaco_j2n6s300", ()), ("kinova_gen3", ("J7",))])
def test_an_elimination_is_answered_by_machine_code_as_soon_as_that_is_built(robot: str, held: tuple[str, ...]) -> None:
    one = load_robot(robot)
    pose = units.home_out(one) + np.linspace(9, 3, one.n)
    question = Question(units.joints_in(one, pose), held=held)
    slow, quick = answer_question(one, question), QuickIk()
    answer_question(one, question, quick)
    assert quick.ready.wait(120)
    assert quick.built
    here = answer_question(one, Question(question.q, slow["target"], held), quick)
    assert [b["name"] for b in here["branches"]] == [b["name"] for b in slow["branches"]]
    for mine, other in zip(here["branches"], slow["branches"], strict=True):
        assert mine["joints"] == pytest.approx(other["joints"], abs=1e-6)
    # another arm, as with another joint held, is none that was built
    other = answer_question(one, Question(question.q, held=(one.joint_names[3],)), quick)
    assert other == answer_question(one, Question(question.q, held=(one.joint_names[3],)))


def test_without_a_compiler_an_elimination_is_answered_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    one, quick = load_robot("xarm6"), QuickIk()
    monkeypatch.setenv("CC", "/nowhere/cc")
    question = Question(units.joints_in(one, [10.0, 20, -30, 40, 50, 60]))
    assert answer_question(one, question, quick) == answer_question(one, question)
    assert quick.ready.wait(120)
    assert not quick.built
    assert answer_question(one, question, quick) == answer_question(one, question)
