"""Robots by name, from any folder; a path to a file wins."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest

import armkin
from armkin.errors import FileError
from armkin.robot_file import catalogue
from command_line import run_process

ROOT = Path(__file__).parents[2]


def test_every_shipped_robot_has_a_name() -> None:
    assert catalogue.robot_names() == tuple(sorted(path.stem for path in (ROOT / "robots").glob("*.yaml")))


def test_the_wheel_holds_the_robots_where_the_catalogue_looks() -> None:
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["force-include"] == {"robots": "armkin/robots"}
    assert Path(armkin.__file__).parent / "robots" in catalogue._FOLDERS


def test_a_name_works_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    arm = armkin.load("three_dof")
    assert (arm.path, arm.name) == ("three_dof", "three_dof")
    assert arm.sha256 == armkin.load(ROOT / "robots" / "three_dof.yaml").sha256
    completed = run_process("fk", "three_dof", -30, 5, -5, "--json", cwd=tmp_path)
    assert (completed.code, completed.json["robot_file"]) == (0, "three_dof")


def test_a_path_wins_over_a_name_and_a_name_over_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkdir("three_dof")
    assert armkin.load("three_dof").n == 3
    os.rmdir("three_dof")
    Path("three_dof").write_text("name: mine\nconvention: standard\njoints: [{name: q1, dh: {alpha: 0, a: 1, d: 2}}]\n")
    assert armkin.load("three_dof").name == "mine"


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ("three-dof", "there is no robot three-dof; did you mean three_dof?"),
        ("Three_DOF.yml", "there is no robot Three_DOF.yml; did you mean three_dof?"),
        ("UR5", "there is no robot UR5; did you mean ur5e?"),
        ("arms/mine.yml", "there is no robot arms/mine.yml; did you mean arms/mine.yaml?"),
        ("arms/mime", "there is no robot arms/mime; did you mean arms/mine.yaml?"),
        ("arm.yaml", "arm.yaml: cannot read the robot file: No such file or directory"),
        ("no/such.yaml", "no/such.yaml: cannot read the robot file: No such file or directory"),
        ("zzz", "there is no robot zzz: neither a file nor a shipped robot (three_dof, ur5e, ...: armkin robots)"),
        ("arms", "arms: cannot read the robot file: Is a directory; name a file, for example robots/three_dof.yaml"),
        ("../three_dof", "there is no robot ../three_dof; did you mean three_dof?"),
    ],
)
def test_what_is_neither_is_said_with_what_is_near(
    robot: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "mine.yaml").write_text("")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError) as caught:
        armkin.load(robot)
    assert str(caught.value) == message
    assert caught.value.fields == {"file": robot}


@pytest.mark.parametrize("robot", ["", "\0", "x" * 5000, "\udcff"])
def test_what_no_file_can_be_called_is_an_error_of_ours(robot: str) -> None:
    with pytest.raises(FileError):
        armkin.load(robot)
