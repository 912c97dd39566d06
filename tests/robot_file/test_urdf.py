"""URDF in: real chains to rounding, every trap of real files, hostile XML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.errors import ArmkinError, FileError, RobotFileError, UsageError
from armkin.export.urdf_writer import urdf_text as write_urdf
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import urdf_reader
from armkin.robot_file.robot_file_text import format_robot_file, number_text, rpy_angles
from command_line import ROOT, run
from least_time import least_seconds
from urdf_chains import CHAINS, moving_joints, tip_pose
from urdf_chains import urdf_text as as_urdf


def import_chain(chain: dict[str, Any], **settings: Any) -> armkin.Arm:
    imported = urdf_reader.parse_urdf(as_urdf(chain).encode(), base=chain["base"], tip=chain["tip"], **settings)
    return arm_of_file(robot_file.parse_robot_file(format_robot_file(imported.data, imported.notes)))


@pytest.mark.parametrize("name", CHAINS)
def test_a_real_chain_has_the_poses_of_its_urdf(name: str) -> None:
    """To 1e-9 mm: against poses computed by pinocchio or yourdfpy (`expected`), and by tests/helpers/urdf_chains.py."""
    chain = CHAINS[name]
    assert chain["expected"]
    arm = import_chain(chain)
    joints = [joint for joint in moving_joints(chain) if joint["type"] != "fixed"]
    cases = [(case["q_si"], np.array(case["T_m"])) for case in chain.get("expected", [])]
    slides = np.array([joint["type"] == "prismatic" for joint in joints])
    for q in np.random.default_rng(7).uniform(-3, 3, (20, len(joints))) * np.where(slides, 0.1, 1.0):
        cases.append((q, tip_pose(chain, {joint["name"]: value for joint, value in zip(joints, q, strict=True)})))
    for q, T in cases:
        T_read = armkin.fk(arm, np.asarray(q) * np.where(slides, 1000.0, 1.0))
        assert np.abs(T_read[:3, 3] - 1000 * T[:3, 3]).max() < 1e-9
        assert np.abs(T_read[:3, :3] - T[:3, :3]).max() < 1e-12


@pytest.mark.parametrize("name", CHAINS)
def test_a_real_chain_goes_out_to_urdf_and_comes_back(name: str) -> None:
    """The same poses to 1e-9 mm, the same limits, and the same solver class."""
    arm = import_chain(CHAINS[name])
    again = arm_of_file(
        robot_file.parse_robot_file(format_robot_file(urdf_reader.parse_urdf(write_urdf(arm).encode()).data))
    )
    slides = np.where(arm.prismatic, 100.0, 1.0)
    q = np.random.default_rng(8).uniform(-2, 2, (20, arm.n)) * slides
    error = np.abs(armkin.fk(again, q) - armkin.fk(arm, q))
    assert error[:, :3, 3].max() < 1e-9
    assert error[:, :3, :3].max() < 1e-12
    for bound in ("lower", "upper"):
        values, values_again = getattr(arm, bound), getattr(again, bound)
        assert np.array_equal(np.isfinite(values), np.isfinite(values_again))
        assert values_again[np.isfinite(values_again)] == pytest.approx(values[np.isfinite(values)], abs=1e-10)
    assert solver_class(again) == solver_class(arm)


def solver_class(arm: armkin.Arm) -> str:
    """What ik solves the arm as; seven joints and more have no class of their own."""
    try:
        return armkin.method(arm)[0]
    except UsageError:
        return "none"


@pytest.mark.parametrize("name", CHAINS)
def test_a_real_chain_keeps_limits_and_speeds(name: str) -> None:
    chain = CHAINS[name]
    file = import_chain(chain).file
    assert file is not None
    joints = [joint for joint in moving_joints(chain) if joint["type"] != "fixed"]
    for joint, source in zip(file.joints, joints, strict=True):
        size = 1000.0 if source["type"] == "prismatic" else 180 / np.pi
        if source["type"] == "continuous":
            assert joint.limits is None
        elif joint.limits is not None:
            assert joint.limits == pytest.approx([float(source["lower"]) * size, float(source["upper"]) * size])
            assert joint.limits[0] <= joint.home <= joint.limits[1]
        if float(source.get("velocity") or 0) > 0:
            assert joint.max_speed == pytest.approx(float(source["velocity"]) * size)


# The arm that the traps spoil.
JOINTS = """
<link name="base"/><link name="upper"/><link name="lower"/><link name="hand"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1.5" effort="-1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0" rpy="1.5708 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1.5" effort="1"/></joint>
<joint name="wrist" type="revolute"><parent link="lower"/><child link="hand"/><origin xyz="0.2 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1.5" effort="1"/></joint>
"""
ELBOW = 'type="revolute"><parent link="upper"/>'
TWO_ENDS = (
    '<link name="finger"/><joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/>'
    '<limit lower="0" upper="0.04" velocity="0.1" effort="1"/></joint><link name="tcp"/>'
    '<joint name="tcp_joint" type="fixed"><parent link="hand"/><child link="tcp"/></joint>'
)


def urdf_of(*changes: tuple[str, str]) -> bytes:
    body = JOINTS
    for before, after in changes:
        assert before in body
        body = body.replace(before, after, 1)
    return f'<robot name="spoilt">{body}</robot>'.encode()


BAD = {
    "several ends": (urdf_of(("</joint>\n<joint name=\"elbow", TWO_ENDS.join(["</joint>", '\n<joint name="elbow']))),
                     "the tip must be named: hand, tcp, finger"),
    "axis of no length": (urdf_of(('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>')), "axis 0 0 0 has no direction"),
    "not a number": (urdf_of(('xyz="0 0 0.1"', 'xyz="0 0 nan"')), "origin xyz: '0 0 nan' is not 3 numbers"),
    "two numbers": (urdf_of(('xyz="0 0 0.1"', 'xyz="0 0.1"')), "origin xyz: '0 0.1' is not 3 numbers"),
    "infinite": (urdf_of(('lower="-2"', 'lower="-1e999"')), "limit lower: '-1e999' is not finite"),
    "word": (urdf_of(('velocity="1.5"', 'velocity="fast"')), "limit velocity: 'fast' is not a number"),
    "limits reversed": (urdf_of(('lower="-2" upper="2"', 'lower="2" upper="-2"')),
                        "lower limit 114.592 deg is above upper limit -114.592 deg"),
    "limits equal": (urdf_of(('lower="-2" upper="2"', 'lower="1" upper="1"')), "a joint that never moves is fixed"),
    "millimetres as metres": (urdf_of(('xyz="0.3 0 0"', 'xyz="30000 0 0"')), "a URDF is in metres"),
    "mimic on the chain": (urdf_of(("<axis", '<mimic joint="elbow" multiplier="-1"/><axis')), "mimics elbow"),
    "floating joint": (urdf_of((f'"elbow" {ELBOW}', f'"elbow" {ELBOW.replace("revolute", "floating")}')),
                       "type floating; revolute, continuous, prismatic and fixed can be read"),
    "no type": (urdf_of((ELBOW, ELBOW[15:])), "type is missing"),
    "unknown child": (urdf_of(('<child link="lower"/>', '<child link="lowr"/>')), "there is no child link lowr"),
    "no parent": (urdf_of(('<parent link="upper"/>', "")), "joint elbow: has no <parent link=...>"),
    "two joints of a name": (urdf_of(('name="wrist"', 'name="elbow"')), "two joints are named elbow"),
    "two links of a name": (urdf_of(('<link name="hand"/>', '<link name="lower"/>')), "two links are named lower"),
    "closed linkage": (urdf_of(('<child link="hand"/>', '<child link="upper"/>')),
                       "link upper hangs on two joints, shoulder and wrist"),
    "circle": (urdf_of(('<parent link="base"/>', '<parent link="hand"/>')), "the joints are a circle"),
    "two roots": (urdf_of(('<parent link="upper"/>', '<parent link="stand"/>'),
                           ('<link name="hand"/>', '<link name="hand"/><link name="stand"/>')),
                  "several links have no parent: base, stand"),
    "no joints": (b'<robot name="x"><link name="a"/></robot>', "no link carries another; there is no chain"),
    "all fixed": (urdf_of().replace(b"revolute", b"fixed"), "no joint moves between base and its ends"),
    "xacro": (b'<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="x"/></robot>', "xacrodoc"),
    "xacro value": (urdf_of(('xyz="0 0 0.1"', 'xyz="0 0 ${height}"')), "is a xacro, a template of a URDF"),
    "sdf": (b'<sdf version="1.6"><model name="x"/></sdf>', "is not a URDF but an SDF file"),
    "mjcf": (b'<mujoco model="x"/>', "is not a URDF but a MuJoCo file"),
    "html": (b"<html></html>", "its outermost element is <html>"),
    "not xml": (b"joints: []", "is not XML"),
    "empty": (b"", "is empty"),
    "cut off": (urdf_of()[:300], "is not XML"),
    "nameless": (urdf_of(('<link name="hand"/>', "<link/>")), "a <link> has no name"),
    "entities": (b'<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>', "has a DTD or entities"),
    "external file": (b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>', "has a DTD"),
    "deep": (b'<robot name="x">' + b"<a>" * 200_000, "elements nested deeper than 50"),
    "large": (b'<robot name="x">' + b"<link/>" * 1_500_000, "larger than 8 MB"),
    "many links": (b'<robot name="x">' + b"".join(b'<link name="l%d"/>' % i for i in range(9000)) + b"</robot>",
                   "more than 2000 links"),
    "long chain": (b'<robot name="x">' + b"".join(
        b'<link name="l%d"/><joint name="j%d" type="revolute"><parent link="l%d"/><child link="l%d"/></joint>'
        % (i, i, i, (i + 1) % 1500) for i in range(1499)) + b'<link name="l1499"/></robot>', "more than 200 links"),
    "strange encoding": (b'<?xml version="1.0" encoding="klingon"?><robot/>', "is not XML"),
    "null bytes": (b"\0" * 1000, "is not XML"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_trap_is_named_in_two_lines_and_two_seconds(name: str) -> None:
    raw, says = BAD[name]
    texts = []

    def read_trap() -> None:
        with pytest.raises((RobotFileError, UsageError)) as caught:
            urdf_reader.parse_urdf(raw, "arm.urdf")
        texts.append(str(caught.value))

    assert least_seconds(read_trap, 2) < 2
    assert says in texts[0]
    assert texts[0].startswith("arm.urdf: ")
    assert texts[0].count("\n") <= 1


def test_the_arm_that_the_traps_spoil_is_one() -> None:
    file = robot_file.parse_robot_file(format_robot_file(urdf_reader.parse_urdf(urdf_of()).data))
    assert [joint.name for joint in file.joints] == ["shoulder", "elbow", "wrist"]
    assert file.joints[0].limits == pytest.approx([-114.591559, 114.591559])
    assert file.joints[0].screw is not None
    assert file.joints[0].screw.q == (0, 0, 100)
    assert file.source == "robot.urdf: URDF of spoilt, from link base to link hand"


def test_axis_is_x_by_default_and_need_not_be_of_length_1() -> None:
    data = urdf_reader.parse_urdf(
        urdf_of(('<axis xyz="0 0 1"/>', ""), ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 -3"/>'))
    ).data
    assert data["joints"][0]["screw"]["w"] == [1, 0, 0]
    assert data["joints"][1]["screw"]["w"] == pytest.approx([0, 1, 0], abs=1e-5)


def test_limits_of_zero_none_and_away_from_zero() -> None:
    changes = (('lower="-2" upper="2"', 'lower="0" upper="0"'), ('lower="-2" upper="2"', 'lower="0.5" upper="1.5"'))
    imported = urdf_reader.parse_urdf(urdf_of(*changes))
    assert "limits" not in imported.data["joints"][0]
    assert imported.data["joints"][1]["home"] == pytest.approx(np.degrees(1.0))
    assert len(imported.notes) == 2
    robot_file.parse_robot_file(format_robot_file(imported.data))
    none = urdf_reader.parse_urdf(urdf_of(('<limit lower="-2" upper="2" velocity="1.5" effort="-1"/>', "")))
    assert none.notes == ("joint shoulder has no <limit>: read as no limits",)


def test_limits_lose_the_noise_of_radians() -> None:
    joint = urdf_reader.parse_urdf(
        urdf_of(('lower="-2" upper="2"', 'lower="-6.28318530718" upper="6.28318530718"'))
    ).data["joints"][0]
    assert joint["limits"] == [-360, 360]


def test_names_that_a_robot_file_cannot_have_are_changed_and_said() -> None:
    imported = urdf_reader.parse_urdf(
        urdf_of(('name="shoulder"', 'name="/px100/1st joint"'), ('name="elbow"', 'name="2"'))
    )
    assert [joint["name"] for joint in imported.data["joints"]] == ["_px100_1st_joint", "_2", "wrist"]
    assert imported.notes == ("joint /px100/1st joint is named _px100_1st_joint", "joint 2 is named _2")


def test_a_joint_and_a_link_may_share_a_name_and_transmissions_do_not_count() -> None:
    body = urdf_of(('name="elbow"', 'name="upper"')).replace(
        b"</robot>", b'<transmission name="t"><joint name="upper"/><actuator name="m"/></transmission></robot>'
    )
    assert [joint["name"] for joint in urdf_reader.parse_urdf(body).data["joints"]] == ["shoulder", "upper", "wrist"]


def test_an_empty_line_first_and_elements_of_simulators_do_no_harm() -> None:
    body = urdf_of(("<axis", '<dynamics damping="nan"/><safety_controller k_velocity="x"/><axis'))
    with_more = body.replace(b"</robot>", b'<gazebo reference="upper"><mu1>x</mu1></gazebo></robot>')
    assert (
        urdf_reader.parse_urdf(b'\n <?xml version="1.0"?>' + with_more).data == urdf_reader.parse_urdf(urdf_of()).data
    )


def test_base_and_tip_choose_a_part_of_the_chain() -> None:
    imported = urdf_reader.parse_urdf(urdf_of(), base="upper", tip="hand")
    assert [joint["name"] for joint in imported.data["joints"]] == ["elbow", "wrist"]
    with pytest.raises(UsageError, match="there is no link hnd for the tip; the links are base, upper, lower, hand"):
        urdf_reader.parse_urdf(urdf_of(), tip="hnd")
    with pytest.raises(UsageError, match="tip base does not hang on base upper"):
        urdf_reader.parse_urdf(urdf_of(), base="upper", tip="base")


def test_a_mimic_joint_off_the_chain_is_ignored() -> None:
    more = TWO_ENDS.replace("<limit", '<mimic joint="wrist"/><limit')
    imported = urdf_reader.parse_urdf(
        urdf_of(('</joint>\n<joint name="elbow', f'</joint>{more}\n<joint name="elbow')), tip="tcp"
    )
    assert len(imported.data["joints"]) == 3


def test_nothing_but_the_file_is_opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    mesh = '<link name="base"><visual><geometry><mesh filename="file:///etc/passwd"/></geometry></visual></link>'
    path.write_bytes(urdf_of(('<link name="base"/>', mesh)))
    opened: list[str] = []
    real = Path.open

    def note_and_call(self: Path, *words: Any, **named: Any) -> Any:
        opened.append(str(self))
        return real(self, *words, **named)

    monkeypatch.setattr(Path, "open", note_and_call)
    urdf_reader.read_urdf(path)
    assert opened == [str(path)]


def test_without_defusedxml_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "defusedxml.common", None)
    with pytest.raises(ArmkinError, match=r"pip install defusedxml"):
        urdf_reader.parse_urdf(urdf_of())


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(FileError, match=r"nowhere\.urdf: cannot read the URDF"):
        urdf_reader.read_urdf("nowhere.urdf")


def rough_wrist() -> str:
    """Six axes whose last one misses the wrist's centre by 0.4 um, because pi/2 is written with five digits."""
    places = ("0 0 0.1", "0 0 0.2", "0 0 0.3", "0.1 0 0.05", "0.2 0 0", "0.1 0 0")
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "0 -1 0")
    joints = [
        {"name": f"j{i}", "type": "continuous", "parent": f"l{i}", "child": f"l{i + 1}", "xyz": xyz, "axis": axis}
        for i, (xyz, axis) in enumerate(zip(places, axes, strict=True))
    ]
    joints[5]["rpy"] = "0 0 1.5708"
    return as_urdf({"links": [f"l{i}" for i in range(7)], "joints": joints})


def test_snapping_makes_right_angles_and_the_class_that_they_buy() -> None:
    exact, snapped = (
        arm_of_file(
            robot_file.parse_robot_file(
                format_robot_file(urdf_reader.parse_urdf(rough_wrist().encode(), snap=snap).data)
            )
        )
        for snap in (False, True)
    )
    assert armkin.method(exact)[0] == "general elimination"
    assert armkin.method(snapped)[0] == "spherical wrist"
    q = np.random.default_rng(1).uniform(-3, 3, (100, 6))
    moved = np.abs(armkin.fk(exact, q) - armkin.fk(snapped, q))
    assert moved[:, :3, 3].max() < 1e-9  # the tip is on the last axis
    assert 3e-6 < moved.max() < 5e-6


def test_the_command_prints_a_robot_file_and_says_what_it_read(tmp_path: Path) -> None:
    path = tmp_path / "ur5.urdf"
    path.write_text(as_urdf(CHAINS["ur5"]))
    several = run("import", path)
    assert several.code == 2
    assert several.out == ""
    assert "the tip must be named: wrist_3_link, ee_link, tool0" in several.err
    assert "--tip LINK" in several.err
    assert "--base" not in several.err
    assert "--" not in run("import", path, "--tip", "world", "--base", "tool0").err
    completed = run("import", path, "--tip", "tool0")
    assert completed.code == 0
    assert "note: 6 joints from world to tool0" in completed.err
    screws = tmp_path / "screws.yaml"
    screws.write_text(completed.out)
    table = tmp_path / "dh.yaml"
    assert run("import", path, "--tip", "tool0", "--dh", "--out", table).code == 0
    q = (10, -80, 70, -60, 50, 40)
    poses = [run("fk", file, *q, "--json").json for file in (screws, table)]
    assert poses[0]["position_mm"] == pytest.approx(poses[1]["position_mm"], abs=1e-9)
    assert "dh: {alpha: " in table.read_text()
    assert run("import", path, "--tip", "tool0", "--out", path).code == 2
    rough = tmp_path / "rough.urdf"
    rough.write_text(rough_wrist())
    assert "ik is solved as: general elimination; with --snap as: spherical wrist" in run("import", rough).err


@pytest.mark.parametrize(
    ("raw", "code"), [(b"<robot", 4), (b'<!DOCTYPE r [<!ENTITY a "b">]><robot/>', 4), (urdf_of(), 0)]
)
def test_exit_codes(raw: bytes, code: int, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(raw)
    assert run("import", path).code == code
    assert run("import", tmp_path / "none.urdf").code == 1


def test_numbers_are_written_without_exponents_and_come_back() -> None:
    for value in (1e-5, -1.5e-12, 1 / 3, 123456789.123, 2e22, 0.1 + 0.2):
        assert "e" not in number_text(value)
        assert float(number_text(value)) == value


def test_angles_come_back_also_where_the_pitch_is_a_quarter_turn() -> None:
    from urdf_chains import rotation_about

    rng = np.random.default_rng(3)
    for pitch in (0.3, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-10, -np.pi / 2 + 3e-8):
        roll, yaw = rng.uniform(-3, 3, 2)
        R = rotation_about([0, 0, 1], yaw) @ rotation_about([0, 1, 0], pitch) @ rotation_about([1, 0, 0], roll)
        r, p, y = rpy_angles(R.tolist())
        again = rotation_about([0, 0, 1], y) @ rotation_about([0, 1, 0], p) @ rotation_about([1, 0, 0], r)
        assert np.abs(again - R).max() < 1e-15 * 8


def test_radii_come_from_round_collision_shapes_and_no_others() -> None:
    def solid(shape: str, of: str = "collision") -> str:
        return f"<{of}><geometry>{shape}</geometry></{of}>"

    links = {
        "base": solid('<cylinder radius="0.06" length="0.1"/>'),
        "upper": solid('<cylinder radius="0.04" length="0.3"/>') + solid('<sphere radius="0.05"/>'),
        "lower": solid('<cylinder radius="0.03" length="0.3"/>') + solid('<box size="1 1 1"/>'),
        "hand": solid('<sphere radius="0.5"/>', "visual"),
    }
    raw = urdf_of(*((f'<link name="{name}"/>', f'<link name="{name}">{of}</link>') for name, of in links.items()))
    data = urdf_reader.parse_urdf(raw).data
    assert data["base"] == {"body": {"radius": 60.0}}
    assert [joint.get("body") for joint in data["joints"]] == [{"radius": 50.0}, None, None]
    assert robot_file.parse_robot_file(format_robot_file(data)).joints[0].body is not None
    fixed = '<link name="tcp"><collision><geometry><cylinder radius="0.02"/></geometry></collision></link>'
    joint = '<joint name="to_tcp" type="fixed"><parent link="hand"/><child link="tcp"/></joint>'
    assert urdf_reader.parse_urdf(urdf_of(('<link name="hand"/>', f'<link name="hand"/>{fixed}{joint}'))).data[
        "joints"
    ][2]["body"] == {"radius": 20.0}
    for odd in ("-1", "nan", "", "1e9", "x"):
        raw = urdf_of(('<link name="upper"/>', f'<link name="upper">{solid(f"""<sphere radius="{odd}"/>""")}</link>'))
        assert "body" not in urdf_reader.parse_urdf(raw).data["joints"][0]


def test_shipped_file_is_data_of_this_project() -> None:
    assert len(CHAINS) >= 30
    assert all(chain["source"] for chain in CHAINS.values())
    assert (ROOT / "tests/robot_file/urdf_chains.json").exists()
