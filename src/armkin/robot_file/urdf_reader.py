"""URDF, the robot description of ROS, read as a robot file with screws.

Of a URDF a chain needs the joints' types, origins, axes, limits and speeds, and which link hangs on which; keep-outs
need the radii of round collision shapes. All else (meshes, inertias, transmissions, dynamics, effort) is left out, no
other file is opened, and XML's own dangers (entities, DTDs, deep nesting, size) are errors. The format: http://wiki.ros.org/urdf/XML.

A joint's origin and axis in the base frame, when all joints are 0, are its screw: nothing is fitted or rounded
beyond 1e-12 mm.
"""

import math
import os
import re
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.errors import FileError, RobotFileError
from armkin.robot_file.robot_file_text import pose_keys, tidy
from armkin.robot_file.urdf_document import Joint, Tree, is_xacro, parse_document

MAX_BYTES = 8 * 2**20
SNAP = 1e-4  # angle [rad] from a right angle that counts as one, with `snap`
METRE = 1000.0  # metre [mm]
MAX_METRES = 1e4  # distance [m], at most, of anything from the base
LARGE_METRES = 20.0  # distance [m] from base to tip that makes one ask
TURNS = 25.0  # limit [rad] that makes one ask: four turns
NO_LIMIT = 1e6  # limit [deg | mm] that is none

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_ROUND = ("cylinder", "sphere", "capsule")  # collision shapes with a radius
_MOVING = ("revolute", "continuous", "prismatic")

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class UrdfRobot:
    """A robot file's keys and values, and what a reader of the result should know."""

    data: dict[str, Any]
    notes: tuple[str, ...]
    base: str
    tip: str


def read_urdf(
    path: str | os.PathLike[str], *, base: str | None = None, tip: str | None = None, snap: bool = False
) -> UrdfRobot:
    """Read a URDF file; see `parse_urdf`. Raises FileError if it cannot be read."""
    name = os.fspath(path)
    return parse_urdf(read_bytes(name), name, base=base, tip=tip, snap=snap)


def read_bytes(path: str) -> bytes:
    """A file's bytes, MAX_BYTES and one more at most; `-`: what stands in standard input. Raises FileError."""
    try:
        with nullcontext(sys.stdin.buffer) if path == "-" else Path(path).open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"{path}: cannot read the URDF: {reason}") from None


def parse_urdf(
    raw: bytes, name: str = "robot.urdf", *, base: str | None = None, tip: str | None = None, snap: bool = False
) -> UrdfRobot:
    """The chain from link `base` to link `tip` as a robot file with convention screws.

    base: by default the link without a parent; tip: by default the one link in which the chain can end.
    snap: angles within 1e-4 rad of a right angle become right angles. Raises RobotFileError for what is no
    URDF of an arm, UsageError where base or tip must be chosen.
    """
    if len(raw) > MAX_BYTES:
        raise RobotFileError(f"{name}: larger than {MAX_BYTES // 2**20} MB; a URDF without its meshes has kilobytes")
    robot, tree = parse_document(raw, name)
    base_link = tree.base(base)
    chain = tree.chain(base_link, tree.tip(base_link, tip))
    robot_read = _chain_as_robot(name, robot, chain, base_link, tip or (chain[-1].parts["child"]["link"]), snap)
    _note_bodies(robot_read.data, tree, base_link, [joint for joint in chain if joint.kind != "fixed"])
    return robot_read


def _note_bodies(keys: dict[str, Any], tree: Tree, base: str, joints: list[Joint]) -> None:
    """Note the radius of every body whose collision shapes are all round: boxes and meshes tell none."""
    entries = keys.pop("joints")
    if radius := _greatest_radius(tree.collision_shapes(base)):
        keys["base"] = {"body": {"radius": radius}}
    for joint, entry in zip(joints, entries, strict=True):
        if radius := _greatest_radius(tree.collision_shapes(str(joint.text("child", "link")))):
            entry["body"] = {"radius": radius}
    keys["joints"] = entries


def _greatest_radius(solids: list[tuple[str, dict[str, str]]]) -> float | None:
    """The greatest radius of shapes [mm]; None where one has no radius, or one beyond a kilometre."""
    radii = [attributes.get("radius", "").strip() if tag in _ROUND else "" for tag, attributes in solids]
    if not radii or not all(_NUMBER.fullmatch(radius) for radius in radii):
        return None
    greatest = tidy(max(map(float, radii)) * METRE, 9)
    return greatest if 0 < greatest <= 1e6 else None


def _chain_as_robot(path: str, robot: str, chain: list[Joint], base: str, tip: str, snap: bool) -> UrdfRobot:
    """The chain as a robot file."""
    if "${" in "".join(str(joint.parts) for joint in chain):
        raise is_xacro(path)
    T = np.eye(4)
    joints: list[dict[str, Any]] = []
    notes: list[str] = []
    names = _unique_names([joint.name for joint in chain if joint.kind != "fixed"], notes)
    for joint in chain:
        place = f"{path}: joint {joint.name}"
        T = T @ joint_origin(joint, place, snap)
        if joint.kind == "fixed":
            continue
        _check_moving(joint, place)
        direction = T[:3, :3] @ joint_axis(joint, place, snap)
        joints.append(_joint_keys(joint, names[joint.name], T[:3, 3], direction, place, notes))
        if np.abs(T[:3, 3]).max() > MAX_METRES:
            raise RobotFileError(f"{place}: stands more than 10 km from {base}; a URDF is in metres")
    reach = float(np.abs(T[:3, 3]).max())
    _check_chain(path, base, tip, len(joints), reach)
    if reach > LARGE_METRES:
        notes.append(f"{tip} is {reach:.4g} m from {base}: a URDF is in metres, are these millimetres?")
    T[:3, 3] *= METRE
    title = re.sub(r"[^\x20-\x7e]+", " ", robot).strip()[:80] or "arm"
    keys = {
        "name": title,
        "source": f"{os.path.basename(path)}: URDF of {title}, from link {base} to link {tip}"
        + (", right angles snapped" if snap else ""),
        "convention": "screws",
        "zero_pose": pose_keys(T.tolist()),
        "joints": joints,
    }
    return UrdfRobot(keys, tuple(notes), base, tip)


def _check_chain(path: str, base: str, tip: str, joints: int, reach: float) -> None:
    """reach: [m] of the tip from the base, along the farthest axis."""
    if not joints:
        raise RobotFileError(f"{path}: no joint moves between {base} and {tip}; choose another base or tip")
    if joints > 12:
        raise RobotFileError(f"{path}: {joints} joints between {base} and {tip}; a robot file has at most 12")
    if reach > MAX_METRES:
        raise RobotFileError(f"{path}: {tip} is more than 10 km from {base}; a URDF is in metres")


def _check_moving(joint: Joint, place: str) -> None:
    """Raise RobotFileError for a joint that moves as none of a robot file does."""
    if joint.kind not in _MOVING:
        kinds = "revolute, continuous, prismatic and fixed can be read"
        raise RobotFileError(f"{place}: type {joint.kind or 'is missing'}; {kinds}")
    if "mimic" in joint.parts:
        leader = joint.text("mimic", "joint") or "another joint"
        raise RobotFileError(
            f"{place}: mimics {leader}: two joints of the chain move as one, which a robot file cannot say; "
            "choose another tip"
        )


def _joint_keys(
    joint: Joint, name: str, point: Matrix, direction: Matrix, place: str, notes: list[str]
) -> dict[str, Any]:
    """A joint of the robot file: screw, limits, home and speed."""
    slides = joint.kind == "prismatic"
    unit, size = ("mm", METRE) if slides else ("deg", 180.0 / math.pi)
    vector = [tidy(x, 15) for x in direction.tolist()]
    entry: dict[str, Any] = {"name": name}
    if slides:
        entry |= {"type": "prismatic", "screw": {"w": [0, 0, 0], "v": vector}}
    else:
        entry["screw"] = {"w": vector, "q": [tidy(x * METRE, 12) for x in point.tolist()]}
    lower, upper = (_limit_value(joint, key, place) for key in ("lower", "upper"))
    if joint.kind != "continuous" and "limit" in joint.parts:
        low, high = (tidy((value or 0.0) * size, 9) for value in (lower, upper))
        entry |= _limit_keys(name, low, high, unit, place, notes)
    elif joint.kind != "continuous":
        notes.append(f"joint {name} has no <limit>: read as no limits")
    speed = _limit_value(joint, "velocity", place) or 0.0
    if speed < 0:
        raise RobotFileError(f"{place}: velocity {speed:g} is negative")
    if 1e-6 <= speed * size <= 1e6:
        entry["max_speed"] = tidy(speed * size, 9)
    return entry


def _limit_keys(name: str, low: float, high: float, unit: str, place: str, notes: list[str]) -> dict[str, Any]:
    """Limits [deg | mm] and home of a joint; none where the URDF means none."""
    if low > high:
        raise RobotFileError(f"{place}: lower limit {low:g} {unit} is above upper limit {high:g} {unit}")
    if max(-low, high) > NO_LIMIT:
        notes.append(f"joint {name} has limits beyond {NO_LIMIT:.0f} {unit}: read as no limits")
        return {}
    if low == high == 0:
        notes.append(f"joint {name} has limits 0 and 0: read as no limits")
        return {}
    if low == high:
        raise RobotFileError(f"{place}: both limits are {low:g} {unit}; a joint that never moves is fixed")
    entry: dict[str, Any] = {"limits": [low, high]}
    if unit == "deg" and max(-low, high) > math.degrees(TURNS):
        notes.append(f"joint {name} turns {low:g} to {high:g} deg: a URDF is in radians, are these degrees?")
    if not low <= 0 <= high:
        entry["home"] = tidy((low + high) / 2, 9)
        notes.append(f"joint {name} has 0 outside its limits: home is their middle, {entry['home']:g} {unit}")
    return entry


def _unique_names(joints: list[str], notes: list[str]) -> dict[str, str]:
    """Joint names as a robot file takes them: no spaces, slashes or colons, 32 characters, all different."""
    name_of: dict[str, str] = {}
    for name in joints:
        new_name = re.sub(r"[^A-Za-z0-9_.-]", "_", name)[:32]
        new_name = new_name if re.match(r"[A-Za-z_]", new_name) else f"_{new_name}"[:32]
        number = 2
        while new_name in name_of.values():
            new_name, number = f"{new_name[:29]}_{number}", number + 1
        if new_name != name:
            notes.append(f"joint {name[:60]} is named {new_name}")
        name_of[name] = new_name
    return name_of


def joint_origin(joint: Joint, place: str, snap: bool = False) -> Matrix:
    """Where the joint stands in its parent link [m]."""
    return origin_pose(joint.parts.get("origin", {}), place, snap)


def origin_pose(attributes: Mapping[str, str], place: str, snap: bool = False) -> Matrix:
    """The pose that an <origin> says [m]."""
    xyz = parse_triple(attributes.get("xyz"), (0.0, 0.0, 0.0), f"{place}: origin xyz")
    rpy = parse_triple(attributes.get("rpy"), (0.0, 0.0, 0.0), f"{place}: origin rpy")
    if max(map(abs, xyz)) > MAX_METRES:
        raise RobotFileError(f"{place}: origin xyz is more than 10 km; a URDF is in metres")
    (cr, sr), (cp, sp), (cy, sy) = (_cos_sin(angle, snap) for angle in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _cos_sin(angle: float, snap: bool) -> tuple[float, float]:
    quarter = round(angle / (math.pi / 2))
    if abs(angle - quarter * (math.pi / 2)) <= (SNAP if snap else 0.0):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return math.cos(angle), math.sin(angle)


def joint_axis(joint: Joint, place: str, snap: bool = False) -> Matrix:
    """The joint's direction in its own frame, of length 1; by default x, as the format says."""
    axis = np.array(parse_triple(joint.text("axis", "xyz"), (1.0, 0.0, 0.0), f"{place}: axis xyz"))
    length = float(np.linalg.norm(axis))
    if not 1e-12 < length < 1e12:
        raise RobotFileError(f"{place}: axis {' '.join(f'{x:g}' for x in axis)} has no direction")
    axis = axis / length
    largest = int(np.argmax(np.abs(axis)))
    if snap and np.abs(np.delete(axis, largest)).max() <= SNAP:
        axis = np.eye(3)[largest] * np.sign(axis[largest])
    return np.asarray(axis)


def _limit_value(joint: Joint, key: str, place: str) -> float | None:
    text = joint.text("limit", key)
    return None if text is None else _parse_floats(text, 1, f"{place}: limit {key}")[0]


def parse_triple(text: str | None, default: tuple[float, ...], place: str) -> tuple[float, ...]:
    """Three numbers of an attribute."""
    return default if text is None else _parse_floats(text, 3, place)


def _parse_floats(text: str, count: int, place: str) -> tuple[float, ...]:
    """The `count` finite numbers of a text, separated by blanks."""
    words = text.split()
    if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
        expected = "a number" if count == 1 else f"{count} numbers"
        raise RobotFileError(f"{place}: '{text[:60]}' is not {expected}")
    values = tuple(float(word) for word in words)
    if not all(math.isfinite(value) for value in values):
        raise RobotFileError(f"{place}: '{text[:60]}' is not finite")
    return values
