"""An arm at a place, with obstacles that are fixed to the frame of the targets."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.keep_out.body_pairs import guard
from armkin.keep_out.clearance import hits_nothing
from armkin.model.rotation import rotation_about
from armkin.model.units import DEGREE
from armkin.robot_file.scene_file import read_scene

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.robot_file.keep_out_keys import Entry

ROUNDED_DEPTH = 1e-6  # depth [mm] of a base in an obstacle that counts as rounding


class Obstacles(NamedTuple):
    """Keep-outs fixed to the frame of the targets, and the clearance [mm] that arms keep from them."""

    keep_out: tuple[Entry, ...] = ()
    clearance: float = 0.0
    sha256: str = ""


def split_keep_outs(arm: Arm, scene: str | os.PathLike[str] | None) -> tuple[Arm, Obstacles]:
    """The arm with only its own keep-outs, and the obstacles of its scene and of another one.

    The entry `self`, for hits between bodies, goes with the arm, even if a scene contains it.
    """
    count = len(arm.keep_out) - arm.of_scene
    own_entries, obstacles = arm.keep_out[:count], list(arm.keep_out[count:])
    clearance, sha256 = arm.clearance, arm.scene_sha256
    if scene is not None:
        file_scene = read_scene(os.fspath(scene))
        obstacles, clearance, sha256 = (
            [*obstacles, *file_scene.keep_out],
            max(clearance, file_scene.clearance),
            file_scene.sha256,
        )
    if not obstacles:
        return arm, Obstacles()
    self_entries = tuple(entry for entry in obstacles if entry.kind == "self")
    if not any(entry.kind == "self" for entry in own_entries):
        own_entries += self_entries[:1]
    fixed = tuple(entry for entry in obstacles if entry.kind != "self")
    return replace(arm, keep_out=own_entries, clearance=clearance, of_scene=0), Obstacles(fixed, clearance, sha256)


def free_at_place(
    arm: Arm, obstacles: Obstacles, position: tuple[float, float, float], turn: float, q: Array
) -> NDArray[np.bool_]:
    """Which postures (..., n) of an arm at a place hit no obstacle; False for nan.

    All are False if the base is inside an obstacle; it may stand on one.
    """
    placed_arm = _arm_among_obstacles(arm, obstacles, position, turn)
    arm_guard = guard(placed_arm)
    is_base = arm_guard.bodies.owner == 0
    begin, end = arm_guard.bodies.begin[is_base].T, arm_guard.bodies.end[is_base].T
    if any((shape.distance(begin, end) < -ROUNDED_DEPTH).any() for _, shape in arm_guard.obstacles):
        return np.zeros(q.shape[:-1], bool)
    return hits_nothing(placed_arm, q)


@lru_cache(maxsize=4)
def _arm_among_obstacles(arm: Arm, obstacles: Obstacles, position: tuple[float, float, float], turn: float) -> Arm:
    """The arm at a place, in the frame of the targets, with the obstacles as its only keep-outs."""
    return replace(_move_arm(arm, position, turn), keep_out=obstacles.keep_out, clearance=obstacles.clearance)


def arm_at_place(arm: Arm, obstacles: Obstacles, position: tuple[float, float, float], turn: float) -> Arm:
    """The arm at a place, in the frame of the targets, with its own keep-outs moved along and the obstacles."""
    own_entries = tuple(_move_entry(entry, position, turn) for entry in arm.keep_out)
    clearance = max(arm.clearance, obstacles.clearance)
    return replace(_move_arm(arm, position, turn), keep_out=own_entries + obstacles.keep_out, clearance=clearance)


def _move_arm(arm: Arm, position: tuple[float, float, float], turn: float) -> Arm:
    P = np.eye(4)
    P[:3, :3], P[:3, 3] = rotation_about(2, turn), position
    link, base = arm.link.copy(), P @ arm.base
    link[0] = P @ link[0]
    for matrix in (link, base):
        matrix.flags.writeable = False
    return replace(arm, link=link, base=base)


def _move_entry(entry: Entry, position: tuple[float, float, float], turn: float) -> Entry:
    """A keep-out of an arm after the arm is moved to a place."""

    def from_place(point: Sequence[float]) -> tuple[float, float, float]:
        x, y, z = (rotation_about(2, turn) @ np.array(point) + position).tolist()
        return x, y, z

    if entry.floor is not None:
        return entry.model_copy(update={"floor": entry.floor + position[2]})
    if entry.capsule is not None:
        ends = {"begin": from_place(entry.capsule.begin), "end": from_place(entry.capsule.end)}
        return entry.model_copy(update={"capsule": entry.capsule.model_copy(update=ends)})
    if entry.box is not None:
        box = entry.box
        if box.min is not None and box.max is not None:
            low, high = np.array(box.min), np.array(box.max)
            box = box.model_copy(
                update={"size": tuple(high - low), "xyz": tuple(0.5 * (low + high)), "min": None, "max": None}
            )
        roll, pitch, yaw = box.rpy
        pose = {"xyz": from_place(box.xyz), "rpy": (roll, pitch, yaw + turn / DEGREE)}
        return entry.model_copy(update={"box": box.model_copy(update=pose)})
    return entry
