"""Writes an arm as URDF: joints with limits and speeds, links as cylinders and spheres.

Units are metres and radians, as URDF requires. The frame of a link is that of its joint, with z along the axis; the
last link, `tool`, is the TCP. For a calibrated arm, joint values are the actual ones, as URDF has no ratio. Home,
accelerations and drives are omitted, because URDF cannot express them.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.arm import actual_arm
from armkin.robot_file.robot_file_text import number_text, rpy_angles
from armkin.view.skeleton import arm_shape

if TYPE_CHECKING:
    from armkin.model.arm import Arm

METRE = 1000.0  # metre [mm]
LINK_RADIUS = 0.035  # radius of a link, as a share of the reach
MIN_LENGTH = 1e-6  # length [mm] below which a part of a link is not drawn

_COLOURS = (("body", "0.85 0.85 0.85 1"), ("joint", "0.25 0.35 0.5 1"))


def urdf_text(arm: Arm) -> str:
    """The arm as the text of a URDF file.

    >>> import armkin
    >>> urdf_text(armkin.load("robots/three_dof.yaml")).splitlines()[2]
    '<robot name="three_dof">'
    """
    actual = actual_arm(arm)
    links = ["base_link"]
    for name in arm.joint_names:
        links.append(_free_name(f"{name}_link", tuple(links)))
    radius, shape = LINK_RADIUS * arm.reach, arm_shape(actual)
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {_comment_text(arm)} -->",
        f"<robot name={quoteattr(arm.name)}>",
        *(f'  <material name="{name}"><color rgba="{rgba}"/></material>' for name, rgba in _COLOURS),
        *_link_lines("base_link", _body_lines(shape.bodies[0], radius)),
    ]
    for index, name in enumerate(arm.joint_names):
        lines += _joint_lines(actual, index, name, links[index], links[index + 1])
        lines += _link_lines(
            links[index + 1],
            [
                _hub_lines(float(shape.joint_offsets[index]), radius),
                *_body_lines(shape.bodies[index + 1], radius * 0.85),
            ],
        )
    tool = _free_name("tool", tuple(links))
    lines += [
        f'  <joint name="{_free_name("tool_joint", arm.joint_names)}" type="fixed">',
        *_place_lines(actual.link[-1], links[-1], tool),
        "  </joint>",
        f'  <link name="{tool}"/>',
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _comment_text(arm: Arm) -> str:
    source = f"; {arm.source}" if arm.source else ""
    text = f"{arm.name}, written by armkin{source}"
    return text.replace("--", "- -").replace("\n", " ")


def _free_name(name: str, used_names: tuple[str, ...]) -> str:
    while name in used_names:
        name += "_"
    return name


def _joint_lines(arm: Arm, i: int, name: str, parent: str, child: str) -> list[str]:
    """The lines of joint i of a URDF between two links, lengths in metres."""
    slides, has_limits = bool(arm.prismatic[i]), math.isfinite(arm.lower[i]) and math.isfinite(arm.upper[i])
    rotary_kind = "revolute" if has_limits else "continuous"
    kind = "prismatic" if slides else rotary_kind
    unit = METRE if slides else 1.0
    speed = 0.0 if math.isnan(arm.max_speed[i]) else float(arm.max_speed[i]) / unit
    ends = f'lower="{_real_text(arm.lower[i] / unit)}" upper="{_real_text(arm.upper[i] / unit)}" ' if has_limits else ""
    return [
        f'  <joint name="{name}" type="{kind}">',
        *_place_lines(arm.link[i], parent, child),
        '    <axis xyz="0 0 1"/>',
        f'    <limit {ends}effort="0" velocity="{_real_text(speed)}"/>',
        "  </joint>",
    ]


def _place_lines(T: Array, parent: str, child: str) -> list[str]:
    return [f'    <parent link="{parent}"/>', f'    <child link="{child}"/>', f"    {_origin_element(T)}"]


def _origin_element(T: Array) -> str:
    xyz = " ".join(_real_text(x / METRE) for x in T[:3, 3])
    rpy = " ".join(_real_text(angle) for angle in rpy_angles(T.tolist()))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _real_text(value: float) -> str:
    return number_text(0.0 if abs(value) < 1e-18 else float(value))


def _link_lines(name: str, pieces: list[list[str]]) -> list[str]:
    piece_lines = [line for piece in pieces for line in piece]
    return [f'  <link name="{name}">', *piece_lines, "  </link>"] if piece_lines else [f'  <link name="{name}"/>']


def _body_lines(corners: Array, radius: float) -> list[list[str]]:
    """The straight pieces of a link between the corners of `armkin.view.skeleton`."""
    return [_piece_lines(start, end, radius) for start, end in pairwise(corners)]


def _hub_lines(offset: float, radius: float) -> list[str]:
    """A short cylinder for a joint, at an offset [mm] along its axis."""
    cylinder = f'<cylinder radius="{_metres_text(radius)}" length="{_metres_text(2.2 * radius)}"/>'
    return _visual_lines("joint", f'<origin xyz="0 0 {_metres_text(offset)}" rpy="0 0 0"/>', cylinder)


def _piece_lines(start: Array, end: Array, radius: float) -> list[str]:
    """A cylinder from start to end [mm] in the link's frame, with a sphere at its end; [] if both are equal."""
    direction = end - start
    length = float(np.linalg.norm(direction))
    if length < MIN_LENGTH:
        return []
    z = direction / length
    # Rz(yaw) Ry(pitch) turns z into the direction of the piece; a cylinder needs no third angle
    pitch, yaw = math.atan2(math.hypot(z[0], z[1]), z[2]), math.atan2(z[1], z[0])
    centre = " ".join(_metres_text(x) for x in (start + end) / 2)
    ball = " ".join(_metres_text(x) for x in end)
    cylinder = f'<cylinder radius="{_metres_text(radius)}" length="{_metres_text(length)}"/>'
    return [
        *_visual_lines("body", f'<origin xyz="{centre}" rpy="0 {pitch:.6f} {yaw:.6f}"/>', cylinder),
        *_visual_lines("body", f'<origin xyz="{ball}" rpy="0 0 0"/>', f'<sphere radius="{_metres_text(radius)}"/>'),
    ]


def _visual_lines(material: str, origin: str, form: str) -> list[str]:
    return [
        f'    <visual>{origin}<geometry>{form}</geometry><material name="{material}"/></visual>',
    ]


def _metres_text(value: float) -> str:
    """The text in metres of a length [mm]."""
    return number_text(round(float(value) / METRE, 7))
