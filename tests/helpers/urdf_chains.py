"""Real arms' URDF chains as numbers (robot_file/urdf_chains.json), as URDF text, and a forward kinematics of our own.

Each chain names its source; `expected` are poses that pinocchio 4.1 (yourdfpy for the first six) computed from the
whole file. `pose` shares no code with armkin: it walks the joints as http://wiki.ros.org/urdf/XML/joint describes
them, in metres, with Rodrigues' formula.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

CHAINS: dict[str, dict[str, Any]] = json.loads((Path(__file__).parents[1] / "robot_file/urdf_chains.json").read_text())


def urdf_text(chain: Mapping[str, Any]) -> str:
    """The chain as a URDF file."""
    parts = [f"<link name={quoteattr(link)}/>" for link in chain["links"]]
    for joint in chain["joints"]:
        inner = f"<parent link={quoteattr(joint['parent'])}/><child link={quoteattr(joint['child'])}/>"
        if "xyz" in joint or "rpy" in joint:
            inner += f'<origin xyz="{joint.get("xyz", "0 0 0")}" rpy="{joint.get("rpy", "0 0 0")}"/>'
        if "axis" in joint:
            inner += f'<axis xyz="{joint["axis"]}"/>'
        limits = "".join(
            f' {key}="{joint[key]}"' for key in ("lower", "upper", "velocity", "effort") if joint.get(key) is not None
        )
        inner += f"<limit{limits}/>" if limits else ""
        if "mimic" in joint:
            inner += f"<mimic joint={quoteattr(str(joint['mimic']))}/>"
        parts.append(f'<joint name={quoteattr(joint["name"])} type="{joint["type"]}">{inner}</joint>')
    return '<?xml version="1.0"?>\n<robot name="arm">\n' + "\n".join(parts) + "\n</robot>\n"


def moving_joints(chain: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The joints from base to tip."""
    by_child = {joint["child"]: joint for joint in chain["joints"]}
    link, found = chain["tip"], []
    while link != chain["base"]:
        found.append(by_child[link])
        link = by_child[link]["parent"]
    return found[::-1]


def tip_pose(chain: Mapping[str, Any], values: Mapping[str, float]) -> NDArray[np.float64]:
    """The tip in the base [m] for joint values [rad | m] by name."""
    T = np.eye(4)
    for joint in moving_joints(chain):
        xyz, rpy = (np.array(joint.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
        T = T @ rigid_transform(
            rotation_about([0, 0, 1], rpy[2]) @ rotation_about([0, 1, 0], rpy[1]) @ rotation_about([1, 0, 0], rpy[0]),
            xyz,
        )
        if joint["type"] == "fixed":
            continue
        axis = np.array(joint.get("axis", "1 0 0").split(), dtype=float)
        axis /= np.sqrt(axis @ axis)
        value = values[joint["name"]]
        slides = joint["type"] == "prismatic"
        T = T @ (
            rigid_transform(np.eye(3), axis * value)
            if slides
            else rigid_transform(rotation_about(axis, value), np.zeros(3))
        )
    return T


def rotation_about(axis: Any, angle: float) -> NDArray[np.float64]:
    """Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))


def rigid_transform(R: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
    """A 4 x 4 transform."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T
