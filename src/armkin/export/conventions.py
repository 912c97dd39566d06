"""Converts an arm to another convention: screws, or a Denavit-Hartenberg table, standard or modified.

Results are robot files with unchanged limits, drives, tool and meaning of targets. Screws exist for every arm. A DH
table exists unless two axes are parallel except for rounding, as the foot of their common normal is then undetermined.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armkin import robot_file
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.tasks.choose_task import task_for
from armkin.model import units
from armkin.model.build_arm import arm_of_file
from armkin.model.rotation import FLIP, inverse, transform
from armkin.robot_file.robot_file_text import format_robot_file, pose_keys, tidy

if TYPE_CHECKING:
    from armkin.model.arm import Arm

COORDINATES = 1e-9  # largest allowed error [mm] of poses by a DH table
PARALLEL = 1e-13  # angle [rad] up to which axes count as parallel, without a unique common normal
MIN_DISTANCE = 1e-11  # distance [mm] below which a length counts as rounding

_GEOMETRY = ("convention", "base", "tool", "zero_pose", "joints")


def screws(arm: Arm, tool: Array | None = None) -> dict[str, Any]:
    """The keys and values of a robot file with screws; tool: by default that of the file.

    >>> import armkin
    >>> screws(armkin.load("robots/three_dof.yaml"))["joints"][1]["screw"]
    {'w': [0.0, -1.0, 0.0], 'q': [0.0, 0.0, 170.0]}
    """
    T, rows = inverse(arm.base), []
    links = _unsigned_links(arm)
    for i in range(arm.n):
        T = T @ links[i]
        direction, point = [tidy(x, 15) for x in T[:3, 2].tolist()], [tidy(x, 12) for x in T[:3, 3].tolist()]
        rows.append({"screw": {"w": [0, 0, 0], "v": direction} if arm.prismatic[i] else {"w": direction, "q": point}})
    tool = tool_of(arm) if tool is None else tool
    zero = T @ links[-1] @ inverse(tool)
    return _file_keys(arm, "screws", rows, arm.base, tool, {"zero_pose": pose_keys(zero.tolist())})


def dh(arm: Arm, *, modified: bool = False) -> dict[str, Any]:
    """The keys and values of a robot file with a DH table.

    Raises UsageError if no table gives the arm's poses to 1e-9 mm.

    >>> import armkin
    >>> dh(armkin.load("robots/three_dof.yaml"), modified=True)["joints"][1]["dh"]
    {'alpha': 90.0, 'a': 0.0, 'd': 0.0, 'theta': 0.0}
    """
    links = _unsigned_links(arm)
    base, theta, d = _split_first_link(arm, links[0])
    last, tool = _split_last_link(arm, links[-1], modified)
    normals = [*map(_common_normal, links[1:-1]), last]
    # of each joint: what the link before it turns about and shifts along the joint's axis
    motions_before = [(theta, d), *((normal.theta_after, normal.d_after) for normal in normals[:-1])]
    twists = [(normal.alpha, normal.a) for normal in normals]
    twists = [(0.0, 0.0), *twists[:-1]] if modified else twists
    rows = []
    for (alpha, a), (theta, d), normal in zip(twists, motions_before, normals, strict=True):
        angle, offset = _degrees(theta + normal.theta), tidy(d + normal.d, 12)
        rows.append({"dh": {"alpha": _degrees(alpha), "a": tidy(a, 12), "d": offset, "theta": angle}})
    keys = _file_keys(arm, "modified" if modified else "standard", rows, base, tool, {})
    _check_poses(arm, keys, links)
    return keys


class _Normal(NamedTuple):
    """Rz(theta) Tz(d) Tx(a) Rx(alpha) Rz(theta_after) Tz(d_after)."""

    theta: float
    d: float
    a: float
    alpha: float
    theta_after: float = 0.0
    d_after: float = 0.0


def _unsigned_links(arm: Arm) -> Array:
    """The links without the joints' signs: each z axis is that of the DH row or screw, not of the joint."""
    flips = [FLIP if sign < 0 else np.eye(4) for sign in arm.dh_sign]
    links = arm.link.copy()
    for i, flip in enumerate(flips):
        links[i] = links[i] @ flip
        links[i + 1] = flip @ links[i + 1]
    return links


def tool_of(arm: Arm) -> Array:
    """The tool frame of the robot file, after its last joint."""
    if arm.file is None:
        return np.eye(4)

    return transform(arm.file.tool.xyz, arm.file.tool.rpy)


def _split_first_link(arm: Arm, link: Array) -> tuple[Array, float, float]:
    """The base, and the turn about and shift along the first axis that are part of the first link."""
    link_in_base = inverse(arm.base) @ link
    if _is_screw_along_z(link_in_base):
        return arm.base, math.atan2(link_in_base[1, 0], link_in_base[0, 0]), float(link_in_base[2, 3])
    return link, 0.0, 0.0


def _split_last_link(arm: Arm, link: Array, modified: bool) -> tuple[_Normal, Array]:
    """The part of the last link that belongs to the last row, and the remaining tool."""
    tool = tool_of(arm)
    link_to_tool = link @ inverse(tool)
    theta = math.atan2(link_to_tool[1, 0], link_to_tool[0, 0])
    if modified:
        if _is_screw_along_z(link_to_tool):
            return _Normal(theta, float(link_to_tool[2, 3]), 0.0, 0.0), tool
        return _Normal(0.0, 0.0, 0.0, 0.0), link
    # Denavit and Hartenberg's conditions: the x axis of a row's frame is normal to the joint's axis and intersects it
    x, p = link_to_tool[:3, 0], link_to_tool[:3, 3]
    a = float(x[:2] @ p[:2])
    if abs(x[2]) < 1e-14 and np.abs(p[:2] - a * x[:2]).max() < MIN_DISTANCE:
        return _Normal(theta, float(p[2]), a, math.atan2(link_to_tool[2, 1], link_to_tool[2, 2])), tool
    return _Normal(0.0, 0.0, 0.0, 0.0), link


def _is_screw_along_z(T: Array) -> bool:
    """Whether a transform is only a turn about z and a shift along z."""
    return bool(np.hypot(T[0, 2], T[1, 2]) < 1e-14 and T[2, 2] > 0 and np.hypot(T[0, 3], T[1, 3]) < MIN_DISTANCE)


def _common_normal(link: Array) -> _Normal:
    """The common normal of a link's two axes, x of the row (Craig, Introduction to Robotics, sect. 3.4).

    For parallel axes the normal starts at the origin of the first axis. Of its two directions, the one with theta in
    (-90, 90] degrees is used, whatever the sign of a.
    """
    z, p = link[:3, 2], link[:3, 3]
    sine = math.hypot(z[0], z[1])
    if sine <= PARALLEL:
        a = math.hypot(p[0], p[1])
        a = a if a > MIN_DISTANCE else 0.0
        theta = math.atan2(p[1], p[0]) if a else 0.0
        if not _is_forward(theta):
            a, theta = -a, theta - math.copysign(math.pi, theta)
        alpha = 0.0 if z[2] > 0 else math.pi
        d, d_after = 0.0, float(p[2] * np.sign(z[2]))
    else:
        n = np.array([-z[1], z[0]]) / sine
        alpha, a = math.atan2(sine, z[2]), float(n @ p[:2])
        a = a if abs(a) > MIN_DISTANCE else 0.0
        theta = math.atan2(n[1], n[0])
        if not _is_forward(theta):
            n, a, alpha = -n, -a, -alpha
            theta = math.atan2(n[1], n[0])
        d_after = float((p[:2] - a * n) @ z[:2]) / sine**2
        d = float(p[2] - d_after * z[2])
    c, s = math.cos(theta), math.sin(theta)
    ca, sa = math.cos(alpha), math.sin(alpha)
    frame = np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0, sa, ca]]).T @ link[:3, :3]
    return _Normal(theta, d, a, alpha, math.atan2(frame[1, 0], frame[0, 0]), d_after)


def _is_forward(theta: float) -> bool:
    """Whether an angle is in (-90, 90] degrees, except for rounding."""
    return -math.pi / 2 + 1e-9 < theta < math.pi / 2 + 1e-9


def _degrees(angle: float) -> float:
    value = tidy(math.degrees(angle), 12)
    return tidy(180.0 - (180.0 - value) % 360.0, 12)  # angle in (-180, 180]


def _file_keys(
    arm: Arm, convention: str, rows: list[dict[str, Any]], base: Array, tool: Array, keys: dict[str, Any]
) -> dict[str, Any]:
    """The keys of a robot file with new rows, and everything else unchanged."""
    head, joints, tail = _unchanged_parts(arm)
    file_keys: dict[str, Any] = {**head, "convention": convention}
    for key, frame in (("base", base), ("tool", tool)):
        if np.abs(frame - np.eye(4)).max() > 1e-15:
            file_keys[key] = pose_keys(frame.tolist())
    order = ("name", "type")
    file_keys |= keys | {
        "joints": [
            {name: joint[name] for name in order if name in joint}
            | row
            | {name: value for name, value in joint.items() if name not in order}
            for joint, row in zip(joints, rows, strict=True)
        ]
    }
    file_keys |= tail
    return _keep_pitch(arm, file_keys)


def _unchanged_parts(arm: Arm) -> tuple[dict[str, Any], list[dict[str, Any]], dict[str, Any]]:
    """The parts that a change of convention does not affect: head, joints without geometry, and the rest."""
    if arm.file is None:
        return {"name": arm.name}, _joints_without_a_file(arm), {}
    keys = arm.file.model_dump(exclude_unset=True, exclude_none=True)
    joints = [{k: v for k, v in joint.items() if k not in ("dh", "screw", "ratio")} for joint in keys["joints"]]
    for joint, ratio in zip(joints, arm.ratio.tolist(), strict=True):
        joint |= {"ratio": ratio} if ratio != 1.0 else {}
    head = {k: v for k, v in keys.items() if k in ("name", "description", "source", "compared", "task", "pitch_offset")}
    tail = {k: v for k, v in keys.items() if k not in head and k not in _GEOMETRY}
    return head, joints, tail


def _joints_without_a_file(arm: Arm) -> list[dict[str, Any]]:
    """The keys of joints without geometry, from the arrays of the arm."""
    joints = []
    limits, home = units.limits_out(arm), units.home_out(arm)
    for i, name in enumerate(arm.joint_names):
        joint: dict[str, Any] = {"name": name}
        joint |= {"type": "prismatic"} if arm.prismatic[i] else {}
        joint |= {"limits": list(limits[i])} if np.isfinite(limits[i]).all() else {}
        joint |= {"home": home[i]} if home[i] else {}
        joints.append(joint)
    return joints


def _keep_pitch(arm: Arm, robot: dict[str, Any]) -> dict[str, Any]:
    """The file with a `pitch_offset` that keeps the zero of the targets' pitch."""
    for name in ("xyz_pitch", "xyz_pitch_roll"):
        try:
            pitch = task_for(arm, name).offsets[0]
        except UsageError:
            continue
        pitch_without = task_for(_build_arm({**robot, "pitch_offset": 0.0, "task": name}), name).offsets[0]
        offset = _degrees(pitch - pitch_without)
        robot = {k: v for k, v in robot.items() if k != "pitch_offset"}
        if offset:
            keys = list(robot)
            index = keys.index("convention")
            robot = {k: robot[k] for k in keys[:index]} | {"pitch_offset": offset} | {k: robot[k] for k in keys[index:]}
            if robot.get("task") not in (None, "xyz_pitch", "xyz_pitch_roll"):
                del robot["pitch_offset"]
        break
    return robot


def differences(arm: Arm, keys: dict[str, Any]) -> list[str]:
    """Texts about angles of targets whose zero differs with the other table; [] for most arms."""
    try:
        task, new_task = task_for(arm), task_for(_build_arm(keys))
    except UsageError:
        return []
    if task.name != new_task.name:
        return [f"the task was {task.name} and is {new_task.name}"]
    lines = []
    for label, zero, new_zero in zip(task.labels[task.position :], task.offsets, new_task.offsets, strict=False):
        if abs(turn := _degrees(new_zero - zero)) > 1e-9:
            lines.append(f"{label} counts from another zero: in targets it is {turn:g} deg more for the same pose")
    return lines


def _build_arm(keys: dict[str, Any]) -> Arm:
    return arm_of_file(robot_file.parse_robot_file(format_robot_file(keys), str(keys["name"])))


def _check_poses(arm: Arm, keys: dict[str, Any], links: Array) -> None:
    """Raise UsageError, naming the axes, if the table does not give the arm's poses."""
    q = np.random.default_rng(5).uniform(-1.5, 1.5, (20, arm.n)) * np.where(arm.prismatic, 100.0, 1.0)
    sizes = [abs(v) for joint in keys["joints"] for v in (joint["dh"]["a"], joint["dh"]["d"])]
    if max(sizes) < 1e7:
        deviation = np.abs(fk(_build_arm(keys), q) - fk(arm, q))
        if deviation[:, :3, 3].max() < COORDINATES and deviation[:, :3, :3].max() < 1e-11:
            return
    sines = np.hypot(links[1:-1, 0, 2], links[1:-1, 1, 2])
    sines = np.where(sines > PARALLEL, sines, np.inf)
    worst_joint = int(np.argmin(sines))
    names = arm.joint_names[worst_joint : worst_joint + 2]
    angle = f"{math.degrees(sines[worst_joint]):.2g}"
    raise UsageError(
        f"{arm.name}: no DH table gives its poses to {COORDINATES:g} mm: the axes of {names[0]} and "
        f"{names[1]} are {angle} deg from parallel, so that their common normal is far away; "
        "screws say it exactly"
    )
