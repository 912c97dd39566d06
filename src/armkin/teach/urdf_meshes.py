"""Puts the meshes of a URDF's <visual> elements on the bodies of an arm: local files only, coarsened for a page."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.model.rotation import inverse
from armkin.robot_file import urdf_reader
from armkin.robot_file.urdf_document import Joint, Tree, parse_document
from armkin.teach.mesh_files import read_triangles

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MAX_TRIANGLES = 18_000  # most triangles of an arm, 0.43 MB of a page
_MAX_FILES = 200  # most mesh files of an arm
_GRID_DIVISOR = 1000  # the finest grid of corners is the reach divided by this
_GRID_FACTOR = 1.25  # factor from a grid to the next coarser one
_AXIS_DISTANCE = 0.1  # largest distance [mm] between an axis of the URDF and of the arm
_AXIS_ANGLE = 1e-3  # largest angle [rad] between them


def meshes_json(arm: Arm, path: str) -> dict[str, Any]:
    """The meshes for a page: `unit` [mm], and for each body (0 the base) the corners of its triangles in units.

    A triangle is nine little-endian 16-bit numbers, in base64, in the frame after the body's joint (the base's:
    of targets); "" where a body has no mesh. Raises UsageError for the URDF of another arm, or a file that is no mesh.
    """
    bodies = _body_triangles(arm, path)
    unit = arm.reach / _GRID_DIVISOR
    while True:
        rounded_bodies = [_on_grid(body, unit) for body in bodies]
        if sum(map(len, rounded_bodies)) <= MAX_TRIANGLES:
            break
        unit *= _GRID_FACTOR
    if not any(map(len, rounded_bodies)):
        raise UsageError(f"{path}: has no meshes of this arm in its <visual> elements")
    if max(int(np.abs(body).max(initial=0)) for body in rounded_bodies) > 32_767:
        raise UsageError(f"{path}: a mesh is more than 30 times as large as the arm: are its units metres?")
    return {
        "unit": unit,
        "bodies": [base64.b64encode(body.astype("<i2").tobytes()).decode() for body in rounded_bodies],
    }


def _on_grid(body: Array, unit: float) -> Array:
    """Corners (N, 3, 3) in whole units, without degenerate and duplicate triangles."""
    corners = np.rint(body / unit).astype(np.int64)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    corners = corners[np.cross(b - a, c - a).any(axis=1)].reshape(-1, 9)
    corners = corners[np.lexsort(corners.T[::-1])]  # faster than `np.unique` of rows with many duplicates
    is_first = np.append(True, (corners[1:] != corners[:-1]).any(axis=1))[: len(corners)]
    return np.asarray(corners[is_first])


def _body_triangles(arm: Arm, path: str) -> list[Array]:
    """The triangles (N, 3, 3) of each body, in its frame [mm]."""
    raw = urdf_reader.read_bytes(path)
    if len(raw) > urdf_reader.MAX_BYTES:
        raise UsageError(
            f"{path}: larger than {urdf_reader.MAX_BYTES // 2**20} MB; a URDF without its meshes has kilobytes"
        )
    _, tree = parse_document(raw, path)
    base_link = tree.base(None)
    joint_frames = _joint_frames(arm)
    chain = _matching_joints(arm, tree, base_link, joint_frames)
    triangles_of: list[list[Array]] = [[np.zeros((0, 3, 3))] for _ in range(arm.n + 1)]
    stack = [(base_link, np.eye(4), 0)]
    files = 0
    while stack:
        link, T, body = stack.pop()
        for visual in tree.visuals[link]:
            files += "mesh" in visual
            if files > _MAX_FILES:
                raise UsageError(f"{path}: more than {_MAX_FILES} meshes")
            if "mesh" in visual:
                corners = _mesh_triangles(path, link, visual) @ T[:3, :3].T + T[:3, 3]
                to_body = arm.base if body == 0 else inverse(joint_frames[body - 1]) @ arm.base
                triangles_of[body].append(corners * urdf_reader.METRE @ to_body[:3, :3].T + to_body[:3, 3])
        for joint in tree.children[link]:
            child = str(joint.text("child", "link"))
            stack.append(
                (child, T @ urdf_reader.joint_origin(joint, path), chain.index(joint) + 1 if joint in chain else body)
            )
    return [np.concatenate(parts) for parts in triangles_of]


def _joint_frames(arm: Arm) -> list[Array]:
    """The frame after each joint at joint values 0."""
    frames, T = [], np.eye(4)
    for link in arm.link[:-1]:
        T = T @ link
        frames.append(T)
    return frames


def _matching_joints(arm: Arm, tree: Tree, first: str, joint_frames: list[Array]) -> list[Joint]:
    """The moving joints of the URDF with the arm's axes at joint values 0."""
    mismatch = ""
    for leaf in tree.leaves(first):
        T, axes = np.eye(4), []
        for joint in tree.chain(first, leaf):
            T = T @ urdf_reader.joint_origin(joint, tree.name)
            if joint.kind != "fixed":
                axes.append((joint, T[:3, :3] @ urdf_reader.joint_axis(joint, tree.name), T[:3, 3] * urdf_reader.METRE))
        if len(axes) < arm.n:
            mismatch = mismatch or f"it has {len(axes)} moving joints on the way to {leaf}, the arm {arm.n}"
            continue
        for index, (joint, z, p) in enumerate(axes[: arm.n]):
            joint_frame = inverse(arm.base) @ joint_frames[index]
            offset = p - joint_frame[:3, 3]
            distance = (
                0.0
                if arm.prismatic[index]
                else float(np.linalg.norm(offset - (offset @ joint_frame[:3, 2]) * joint_frame[:3, 2]))
            )
            if distance > _AXIS_DISTANCE or np.linalg.norm(z - joint_frame[:3, 2]) > _AXIS_ANGLE:
                mismatch = (
                    f"at joint values 0 the axis of its joint {joint.name} is not that of {arm.joint_names[index]}"
                )
                break
        else:
            return [joint for joint, _, _ in axes[: arm.n]]
    raise UsageError(f"{tree.name}: is not the URDF of {arm.name}: {mismatch}")


def _mesh_triangles(path: str, link: str, visual: dict[str, dict[str, str]]) -> Array:
    """A mesh's triangles in its link's frame [m]."""
    context = f"{path}: visual of {link}"
    name = visual["mesh"].get("filename", "")
    scale = urdf_reader.parse_triple(visual["mesh"].get("scale"), (1.0, 1.0, 1.0), f"{context}: mesh scale")
    T = urdf_reader.origin_pose(visual.get("origin", {}), context)
    return np.asarray(read_triangles(_mesh_path(path, name, context)) * scale @ T[:3, :3].T + T[:3, 3])


def _mesh_path(path: str, name: str, context: str) -> Path:
    """The local file of a mesh: beside the URDF, or for package://NAME/... in a folder NAME above it."""
    scheme, colon, address = name.partition("://")
    if Path(name).suffix.lower() not in (".stl", ".dae"):
        raise UsageError(f"{context}: mesh {name[:80] or 'without a filename'} is neither .stl nor .dae")
    folder = Path(path).resolve().parent
    if not colon:
        return folder / name
    if scheme == "file":
        return Path(address)
    if scheme != "package":
        raise UsageError(f"{context}: mesh {name[:80]} is no local file: package://, file:// or a path beside the URDF")
    package, _, relative = address.partition("/")
    for parent in [folder, *folder.parents]:
        for candidate in (parent / package / relative, parent / relative):
            if candidate.is_file():
                return candidate
    raise UsageError(f"{context}: mesh {name[:80]} is not found in the URDF's folder or above it")
