"""Named poses stand wherever joint values do."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.errors import RobotFileError
from command_line import ROOT, THREE_DOF, run

POSES = "\nposes:\n  park: [30, 60, -45]\n  up: [0, 90, 0]\n"


@pytest.fixture
def arm_file(tmp_path: Path) -> str:
    path = tmp_path / "posed.yaml"
    path.write_text((ROOT / THREE_DOF).read_text() + POSES)
    return str(path)


def test_a_pose_is_its_joint_values(arm_file: str, tmp_path: Path) -> None:
    for command in ("fk", "pulses"):
        named, plain = run(command, arm_file, "park", "--json"), run(command, arm_file, 30, 60, -45, "--json")
        assert named.code == 0
        assert named == plain
    assert run("fk", arm_file, "home", "--json").json["joints"] == [0, 90, -90]
    assert run("ik", arm_file, 390, 80, 300, "--near", "park", "--json").json["near"] == [30, 60, -45]
    assert run("pulses", arm_file, "up", "--from", "park", "--json").json["from"] == [30, 60, -45]
    sent = run("send", arm_file, "park", "--port", "sim", "--json").json
    assert sent["pulses"] == run("pulses", arm_file, "park", "--json").json["pulses"]
    assert run("send", arm_file, "up", "--dry-run", "--from", "park", "--json").json["start_pulses"] == sent["pulses"]
    picture = tmp_path / "park.png"
    assert run("plot", arm_file, "park", "--out", picture).code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_home_is_a_pose_of_every_arm() -> None:
    assert run("fk", THREE_DOF, "home") == run("fk", THREE_DOF, 0, 90, -90)


def test_an_unknown_pose_is_named_with_those_that_exist(arm_file: str) -> None:
    completed = run("fk", arm_file, "prk")
    assert (completed.code, completed.out) == (2, "")
    assert "no pose 'prk'; did you mean park?" in completed.err
    assert "its poses: home, park, up" in run("fk", arm_file, "zzz").err
    assert "--near: three_dof has no pose 'upp'; did you mean up?" in run("ik", arm_file, 1, 2, 3, "--near", "upp").err


def test_info_lists_the_poses(arm_file: str) -> None:
    assert run("info", arm_file, "--json").json["poses"] == {
        "home": [0, 90, -90],
        "park": [30, 60, -45],
        "up": [0, 90, 0],
    }
    assert "park" in run("info", arm_file).out


def test_poses_in_python(arm_file: str) -> None:
    arm = armkin.load(arm_file)
    assert list(arm.poses) == ["home", "park", "up"]
    assert np.allclose(np.rad2deg(arm.poses["park"]), [30, 60, -45])
    assert np.allclose(np.rad2deg(armkin.lock(arm, {"q2": 0.0}).poses["park"]), [30, -45])
    for copied in (pickle.loads(pickle.dumps(arm)), copy.deepcopy(arm)):
        assert np.array_equal(copied.poses["up"], arm.poses["up"])


@pytest.mark.parametrize(
    ("poses", "says"),
    [
        ("{home: [0, 90, -90]}", "home is always a pose"),
        ("{park: [0, 90]}", "has 2 values; the arm has 3 joints"),
        ("{park: [130, 0, 0]}", "q1 = 130 is outside its limits -120 to 120"),
        ("{two words: [0, 0, 0]}", "poses.two words: the text 'two words' is not a name"),
        ("[0, 0, 0]", "names with joint values"),
        ("{park: up}", "poses.park: must be joint values, for example"),
        ("{park: [0, .nan, 0]}", "finite"),
    ],
)
def test_poses_are_validated(poses: str, says: str) -> None:
    text = (ROOT / THREE_DOF).read_text() + f"poses: {poses}\n"
    with pytest.raises(RobotFileError, match=r"^arm.yaml:\d+: ") as caught:
        robot_file.parse_robot_file(text, "arm.yaml")
    assert says in str(caught.value)
