"""Every shipped arm in other words: the same poses, targets that mean the same, and the same solver."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.errors import UsageError
from armkin.export import conventions
from armkin.export.urdf_writer import urdf_text as write_urdf
from armkin.inverse.tasks.choose_task import task_for
from armkin.model.arm import actual_arm, from_links
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import urdf_reader
from armkin.robot_file.robot_file_text import format_robot_file
from command_line import ROOT, run

FILES = sorted((ROOT / "robots").glob("*.yaml")) + sorted((ROOT / "tests/robots").glob("*.yaml"))
KINDS: dict[str, Callable[[armkin.Arm], dict[str, Any]]] = {
    "screws": conventions.screws,
    "dh": conventions.dh,
    "mdh": lambda arm: conventions.dh(arm, modified=True),
}


def posture_values(arm: armkin.Arm, count: int = 25) -> np.ndarray:
    q = np.random.default_rng(6).uniform(-2, 2, (count, arm.n))
    return q * np.where(arm.prismatic, 100.0, 1.0)


def solver_class(arm: armkin.Arm) -> str:
    try:
        return armkin.method(arm)[0]
    except UsageError:
        return "none"


def number_attribute(element: ET.Element | None, name: str) -> np.ndarray:
    """An attribute of numbers with spaces between them."""
    assert element is not None
    return np.array((element.get(name) or "").split(), dtype=float)


def arm_again(data: dict[str, Any]) -> armkin.Arm:
    return arm_of_file(robot_file.parse_robot_file(format_robot_file(data)))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_table_is_the_same_arm(path: Path) -> None:
    arm = armkin.load(path)
    q = posture_values(arm)
    for kind, write in KINDS.items():
        read_back = arm_again(write(arm))
        error = np.abs(armkin.fk(read_back, q) - armkin.fk(arm, q))
        assert error[:, :3, 3].max() < 1e-9, kind
        assert error[:, :3, :3].max() < 1e-12, kind
        assert solver_class(read_back) == solver_class(arm), kind
        for field in ("lower", "upper", "home", "ratio", "motor_gain", "motor_bias", "pose_joints", "dh_sign"):
            assert np.array_equal(getattr(read_back, field), getattr(arm, field)), (kind, field)
        assert np.array_equal(read_back.max_speed, arm.max_speed, equal_nan=True)
        if arm.task in ("xyz_pitch", "xyz_yaw"):
            assert task_for(read_back).offsets == pytest.approx(task_for(arm).offsets, abs=1e-12)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_out_to_urdf_and_back_is_the_same_arm(path: Path) -> None:
    arm = armkin.load(path)
    turned = actual_arm(arm)
    read_back = arm_again(urdf_reader.parse_urdf(write_urdf(arm).encode()).data)
    q = posture_values(arm)
    error = np.abs(armkin.fk(read_back, q) - armkin.fk(turned, q))
    assert error[:, :3, 3].max() < 1e-9
    assert error[:, :3, :3].max() < 1e-12
    assert read_back.joint_names == arm.joint_names
    assert np.array_equal(read_back.prismatic, arm.prismatic)
    limited = np.isfinite(turned.lower) & np.isfinite(turned.upper)
    assert read_back.lower[limited] == pytest.approx(turned.lower[limited], abs=1e-10)
    assert read_back.upper[limited] == pytest.approx(turned.upper[limited], abs=1e-10)
    assert not np.isfinite(read_back.lower[~limited]).any()
    assert read_back.max_speed == pytest.approx(turned.max_speed, abs=1e-10, nan_ok=True)
    if arm.task not in ("xy", "xy_theta", "xyz", "xyz_yaw"):  # a URDF has no task
        assert solver_class(read_back) == solver_class(arm)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_visuals_are_primitives_along_the_links(path: Path) -> None:
    arm = armkin.load(path)
    root = ET.fromstring(write_urdf(arm))
    shapes = {shape.tag for shape in root.iterfind("link/visual/geometry/*")}
    assert shapes <= {"cylinder", "sphere"}
    longest = max(float(shape.get("length", 0)) for shape in root.iterfind("link/visual/geometry/cylinder"))
    assert 0 < longest * 1000 <= arm.reach + np.linalg.norm(arm.link[0][:3, 3]) + 100
    limits = root.findall("joint/limit")
    assert len(limits) == arm.n
    assert all(limit.get("effort") is not None and limit.get("velocity") is not None for limit in limits)


def test_links_are_drawn_from_axis_to_axis() -> None:
    """In three_dof's home the last ball of every link stands on the next joint's axis."""
    arm = armkin.load("three_dof")
    root = ET.fromstring(write_urdf(arm))
    for name, following in (("q1", "q2"), ("q2", "q3")):
        [link] = [link for link in root.iterfind("link") if link.get("name") == f"{name}_link"]
        [joint] = [joint for joint in root.iterfind("joint") if joint.get("name") == following]
        balls = [v for v in link.iterfind("visual") if v.find("geometry/sphere") is not None]
        end = number_attribute(balls[-1].find("origin"), "xyz")
        place = joint.find("origin")
        roll = number_attribute(place, "rpy")[0]
        z = np.array([0, -np.sin(roll), np.cos(roll)])  # both of its turns are about x alone
        offset = end - number_attribute(place, "xyz")
        assert np.linalg.norm(offset - (offset @ z) * z) < 1e-6


def test_a_makers_table_comes_back_as_printed() -> None:
    """UR5e and Panda through screws: a = -425 and -82.5 with theta 0, as their makers write them."""
    for name, modified in (("ur5e", False), ("panda", True)):
        arm = armkin.load(name)
        rows = [
            joint["dh"] for joint in conventions.dh(arm_again(conventions.screws(arm)), modified=modified)["joints"]
        ]
        assert arm.file is not None
        for row, joint in zip(rows, arm.file.joints, strict=True):
            assert joint.dh is not None
            assert row == pytest.approx(joint.dh.model_dump(), abs=1e-9)


def test_axes_a_hair_from_parallel_have_no_table() -> None:
    link = np.tile(np.eye(4), (3, 1, 1))
    link[1][:3, 3] = link[2][:3, 3] = (300, 40, 50)
    link[1][1, 2], link[1][2, 1] = -1e-9, 1e-9
    arm = from_links(link, [False, False], name="hair")
    with pytest.raises(UsageError, match=r"the axes of q1 and q2 are 5.7e-08 deg from parallel.*screws say it"):
        conventions.dh(arm)
    error = np.abs(
        armkin.fk(arm_again(conventions.screws(arm)), posture_values(arm)) - armkin.fk(arm, posture_values(arm))
    )
    assert error[:, :3, 3].max() < 1e-9


def test_what_targets_count_from_is_said_where_it_changes() -> None:
    arm = armkin.load("planar_3dof")
    assert conventions.differences(arm, conventions.dh(arm)) == []
    shifted = {**conventions.dh(arm), "task": "xy_theta"}
    shifted["joints"] = [dict(joint) for joint in shifted["joints"]]
    shifted["joints"][0]["dh"] = {**shifted["joints"][0]["dh"], "theta": 30.0}
    assert conventions.differences(arm, shifted) == [
        "theta counts from another zero: in targets it is 30 deg more for the same pose"
    ]


def test_the_command_writes_each_kind(tmp_path: Path) -> None:
    q = (10, 20, -30, 40, 50, 60)
    expected = run("fk", "ur5e", *q, "--json").json["position_mm"]
    for kind in ("--dh", "--mdh", "--screws"):
        path = tmp_path / f"arm{kind}.yaml"
        assert run("export", "ur5e", kind, "--out", path) == (0, "", "")
        assert run("fk", path, *q, "--json").json["position_mm"] == pytest.approx(expected, abs=1e-9)
    exported = run("export", "three_dof", "--urdf")
    assert exported.code == 0
    assert exported.out.startswith("<?xml")
    assert run("export", "ra02", "--urdf").err.startswith("note: velocity is 0 for q1, q2, q3, q4")
    assert run("export", "ur5e").code == 2
    assert run("export", "ur5e", "--dh", "--urdf").code == 2


def test_json_is_enough_for_another_program() -> None:
    """Poses from the screws and from the tables in the JSON, by the textbook's formulas alone."""
    from urdf_chains import rigid_transform, rotation_about

    answer = json.loads(run("export", "ur5e", "--json").out)
    assert answer["robot"] == "ur5e"
    q = np.radians([10, -80, 70, -60, 50, 40])
    T = np.eye(4)
    for joint, value in zip(answer["joints"], q, strict=True):
        w, p = np.array(joint["screw"]["w"]), np.array(joint["screw"]["q"])
        R = rotation_about(w, value * joint["sign"])
        T = T @ rigid_transform(R, p - R @ p)
    zero = answer["zero_pose"]
    roll, pitch, yaw = np.radians(zero["rpy"])
    T = T @ rigid_transform(
        rotation_about([0, 0, 1], yaw) @ rotation_about([0, 1, 0], pitch) @ rotation_about([1, 0, 0], roll),
        np.array(zero["xyz"]),
    )
    assert armkin.fk(armkin.load("ur5e"), q) == pytest.approx(T, abs=1e-9)
    D = np.eye(4)
    for row, value in zip(answer["dh_standard"]["rows"], q, strict=True):
        D = D @ rigid_transform(rotation_about([0, 0, 1], value + np.radians(row["theta"])), np.array([0, 0, row["d"]]))
        D = D @ rigid_transform(rotation_about([1, 0, 0], np.radians(row["alpha"])), np.array([row["a"], 0, 0]))
    assert pytest.approx(T, abs=1e-9) == D
