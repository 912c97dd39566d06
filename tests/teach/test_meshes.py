"""The meshes of a URDF on the bodies of an arm: where they stand, which files are read, what is refused."""

from __future__ import annotations

import base64
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.errors import UsageError
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import urdf_reader
from armkin.robot_file.robot_file_text import format_robot_file
from armkin.robot_file.urdf_document import parse_document
from armkin.teach.mesh_files import read_triangles
from armkin.teach.one_file import arm_html
from armkin.teach.urdf_meshes import MAX_TRIANGLES, meshes_json
from command_line import run

CORNERS = np.array([[[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0]], [[0, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]])
LINK = """<link name="{name}"><visual><origin xyz="{xyz}" rpy="0 0 0"/>
<geometry><mesh filename="{mesh}" scale="1 1 1"/></geometry></visual></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.001"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="f" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array>
<technique_common><accessor source="#f" count="4" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
<p>0 0 1 0 2 0</p></triangles>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>3</vcount><p>0 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>10 0 0</translate><rotate>0 0 1 90</rotate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes></COLLADA>"""


def binary_stl(corners: np.ndarray) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in corners)
    return b"\0" * 80 + struct.pack("<I", len(corners)) + rows


def text_stl(corners: np.ndarray) -> str:
    loops = ["".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in triangle) for triangle in corners]
    facets = "".join(f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in loops)
    return f"solid one\n{facets}endsolid"


def write_urdf(folder: Path, mesh: str = "package://arm/meshes/link.stl") -> Path:
    """A URDF of three joints, each link with a mesh, in a package."""
    place = folder / "arm" / "meshes"
    place.mkdir(parents=True)
    (place / "link.stl").write_bytes(binary_stl(CORNERS))
    (place / "plain.STL").write_text(text_stl(CORNERS))
    (place / "link.dae").write_text(DAE)
    names = ["base", "l1", "l2", "hand", "l3", "finger"]
    links = [LINK.format(name=name, mesh=mesh, xyz=f"0.0{k} 0 0") for k, name in enumerate(names)]
    joints = [
        JOINT.format(name="q1", kind="revolute", parent="base", child="l1", xyz="0 0 0.3", rpy="0 0 0.4", axis="0 0 1"),
        JOINT.format(name="q2", kind="revolute", parent="l1", child="l2", xyz="0 0.1 0", rpy="0.3 0 0", axis="0 1 0"),
        JOINT.format(name="q3", kind="prismatic", parent="l2", child="l3", xyz="0.4 0 0", rpy="0 0 0", axis="1 0 0"),
        JOINT.format(name="weld", kind="fixed", parent="l3", child="hand", xyz="0.1 0 0", rpy="0 1 0", axis="1 0 0"),
        JOINT.format(
            name="grip", kind="prismatic", parent="hand", child="finger", xyz="0 0 0", rpy="0 0 0", axis="1 0 0"
        ),
    ]
    file = folder / "arm" / "urdf" / "arm.urdf"
    file.parent.mkdir()
    file.write_text(f"<robot name='arm'>{''.join(links + joints)}</robot>")
    return file


def load_urdf(file: Path, base: list[float] | None = None) -> Any:
    document = urdf_reader.read_urdf(file, tip="l3").data
    if base is not None:
        document = {"base": {"xyz": base, "rpy": [0, 0, 30]}} | document
    return arm_of_file(robot_file.parse_robot_file(format_robot_file(document), "arm.yaml"))


def drawn_corners(drawn: dict[str, Any], body: int) -> np.ndarray:
    counts = np.frombuffer(base64.b64decode(drawn["bodies"][body]), "<i2").reshape(-1, 3, 3)
    return np.asarray(counts * drawn["unit"])


@pytest.mark.parametrize("base", [None, [100.0, -50.0, 20.0]])
def test_a_mesh_stands_where_the_urdf_has_it(tmp_path: Path, base: list[float] | None) -> None:
    file = write_urdf(tmp_path)
    arm = load_urdf(file, base)
    drawn = meshes_json(arm, str(file))
    poses = {"base": np.eye(4)}
    _, robot = parse_document(file.read_bytes(), "arm")
    for name, joint in (("l1", "q1"), ("l2", "q2"), ("l3", "q3")):  # at joint values 0
        T = urdf_reader.joint_origin(robot.parent[name], "arm")
        poses[name] = poses[{"l1": "base", "l2": "l1", "l3": "l2"}[name]] @ T
        assert robot.parent[name].name == joint
    frames = [np.eye(4), arm.link[0], arm.link[0] @ arm.link[1], arm.link[0] @ arm.link[1] @ arm.link[2]]
    for body, (name, shift) in enumerate({"base": 0.0, "l1": 0.01, "l2": 0.02, "l3": 0.04}.items()):
        placed = drawn_corners(drawn, body) @ frames[body][:3, :3].T + frames[body][:3, 3]
        expected = (CORNERS + np.array([shift, 0, 0])) @ poses[name][:3, :3].T + poses[name][:3, 3]
        expected = expected * 1000 @ arm.base[:3, :3].T + arm.base[:3, 3]
        for triangle in expected:
            assert np.abs(placed - triangle).max(axis=(1, 2)).min() < 2 * drawn["unit"]
    assert [len(drawn_corners(drawn, body)) for body in range(4)] == [2, 2, 2, 6]  # with the hand and its finger


def test_three_kinds_of_files_hold_the_same_triangles(tmp_path: Path) -> None:
    write_urdf(tmp_path)
    folder = tmp_path / "arm" / "meshes"
    assert np.abs(read_triangles(folder / "link.stl") - CORNERS).max() < 1e-7
    assert np.abs(read_triangles(folder / "plain.STL") - CORNERS).max() < 1e-7
    turned = CORNERS @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [0.01, 0, 0]  # by its node
    assert np.abs(read_triangles(folder / "link.dae") - turned).max() < 1e-7


def test_a_mesh_of_many_triangles_becomes_coarser(tmp_path: Path) -> None:
    file = write_urdf(tmp_path)
    rng = np.random.default_rng(1)
    triangles = rng.uniform(-0.2, 0.2, (20_000, 1, 3)) + rng.uniform(-0.005, 0.005, (20_000, 3, 3))
    (tmp_path / "arm" / "meshes" / "link.stl").write_bytes(binary_stl(triangles))
    arm = load_urdf(file)
    drawn = meshes_json(arm, str(file))
    assert 0.2 * MAX_TRIANGLES < sum(len(drawn_corners(drawn, k)) for k in range(4)) <= MAX_TRIANGLES
    assert len(arm_html(arm, meshes=drawn)) < 1.5e6


@pytest.mark.parametrize(
    ("mesh", "raw", "message"),
    [
        ("http://example.org/a.stl", None, "no local file"),
        ("package://arm/../../../etc/passwd", None, "neither .stl nor .dae"),
        ("package://none/a.stl", None, "is not found"),
        ("../meshes/none.stl", None, "cannot read the mesh"),
        ("../meshes/link.stl", b"\0" * 200, "is no mesh"),
        ("../meshes/link.stl", binary_stl(CORNERS)[:-7], "is no mesh"),
        ("../meshes/link.stl", binary_stl(np.full((1, 3, 3), np.nan)), "not finite"),
        ("../meshes/link.stl", binary_stl(CORNERS * 1e6), "are its units metres"),
        ("../meshes/link.dae", b"<COLLADA><asset></COLLADA>", "is no mesh"),
        ("../meshes/link.dae", b"<!DOCTYPE a [<!ENTITY b 'c'>]><COLLADA/>", "is no mesh"),
        ("../meshes/link.dae", DAE.replace("0 2 3</p>", "0 2 9</p>").encode(), "not there"),
        ("../meshes/link.dae", b"<COLLADA/>", "has no meshes"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path: Path, mesh: str, raw: bytes | None, message: str) -> None:
    file = write_urdf(tmp_path, mesh)
    arm = load_urdf(file)
    if raw is not None:
        (tmp_path / "arm" / "urdf" / mesh).resolve().write_bytes(raw)
    with pytest.raises(UsageError, match=message):
        meshes_json(arm, str(file))


def test_the_urdf_of_another_arm_is_refused(tmp_path: Path) -> None:
    file = write_urdf(tmp_path)
    with pytest.raises(UsageError, match="at joint values 0 the axis of its joint q2 is not that of q2"):
        meshes_json(armkin.load("three_dof"), str(file))
    completed = run("export", "three_dof", "--js", "--meshes", file)
    assert completed.code == 2
    assert "--meshes goes with --html alone" in completed.err
