"""Cells of a reach map: sectors of rings about the axis of joint 1, and the orientations in each cell.

Cell (i, j, k) is at r = (i + 1/2) grid, z = j grid, azimuth 360 k / M in the reach frame, whose z axis is the axis of
joint 1. Its orientations are given in the reach frame turned by the azimuth, so that a turn of joint 1 maps a cell and
its orientations to the next cell of the ring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.tasks.choose_task import task_for
from armkin.model.rotation import rotation_about

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

MAX_CELLS = 10**9  # most cells of a map
MAX_ORIENTATIONS = 10**6  # most orientations of a cell
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))  # golden angle [rad]
STRAIGHT = 1e-9  # sine of the angle up to which axes count as parallel


@dataclass(frozen=True, eq=False)
class Grid:
    """The grid of a reach map: cell size [mm], and numbers of azimuths, directions and rolls."""

    arm: Arm
    step: float
    azimuths: int
    directions: int
    rolls: int
    tool_down: bool

    def __post_init__(self) -> None:
        if not (math.isfinite(self.step) and self.step > 0):
            raise UsageError(f"grid: {self.step:g} mm; a cell needs a size above 0")
        for name in ("azimuths", "directions", "rolls"):
            if getattr(self, name) < 1:
                raise UsageError(f"{name}: {getattr(self, name)}; at least 1 is needed")
        if self.tool_down and self.task.orientation == "none" and not _is_pitch(self.task):
            raise UsageError(
                f"tool_down: task {self.task.name} does not prescribe where the tool's z axis points; "
                "tasks pose, xyz_axis and those with a pitch do"
            )
        cells_across = self.arm.reach / self.step
        if cells_across * (2 * cells_across + 1) * self.azimuths > 2 * MAX_CELLS:
            raise UsageError(
                f"grid: cells of {self.step:g} mm are some {cells_across * (2 * cells_across + 1) * self.azimuths:.1g} "
                f"within a reach of {self.arm.reach:.0f} mm; {MAX_CELLS:,} at most: take a coarser grid",
                most=MAX_CELLS,
            )
        if self.orientations > MAX_ORIENTATIONS:
            raise UsageError(f"{self.orientations:,} orientations a cell; {MAX_ORIENTATIONS:,} at most")

    @cached_property
    def task(self) -> Task:
        """The arm's own task."""
        return task_for(self.arm, None)

    @cached_property
    def frame(self) -> Array:
        """The reach frame in the frame of targets: (4, 4)."""
        frame = np.eye(4)
        frame[:3, 3] = self.arm.link[0][:3, 3]
        z = self.arm.base[:3, 2] if self.arm.prismatic[0] else self.arm.link[0][:3, 2]
        x = self.arm.base[:3, 0]
        if np.linalg.norm(np.cross(x, z)) < STRAIGHT:
            x = self.arm.base[:3, 1]
        x = x - (x @ z) * z
        frame[:3, 0] = x / np.linalg.norm(x)
        frame[:3, 2] = z
        frame[:3, 1] = np.cross(z, frame[:3, 0])
        return frame

    @cached_property
    def rings(self) -> Array:
        """Indices i and j of every ring within the reach, sorted: (R, 2)."""
        greatest = self.arm.reach**2 * (1 + 1e-9) / self.step**2
        top = math.isqrt(int(greatest)) + 1 if self.task.position == 3 else 0
        i, j = np.meshgrid(np.arange(math.isqrt(int(greatest)) + 1), np.arange(-top, top + 1), indexing="ij")
        in_reach = (i + 0.5) ** 2 + j**2 <= greatest
        return np.stack([i[in_reach], j[in_reach]], axis=1)

    @cached_property
    def rolls_count(self) -> int:
        """Number of turns about the tool's z axis."""
        return self.rolls if self.task.name in ("pose", "xyz_pitch_roll", "xyz_roll") else 1

    @cached_property
    def directions_count(self) -> int:
        """Number of directions, pitches or yaws."""
        return 1 if self.tool_down or self.task.name in ("xy", "xyz", "xyz_roll") else self.directions

    @property
    def orientations(self) -> int:
        """Number of orientations of a cell."""
        return self.directions_count * self.rolls_count

    @property
    def down_is_apart(self) -> bool:
        """Whether `tool_down` has another direction in each cell, as joint 1 is not along the z axis of targets."""
        return self.tool_down and not _is_pitch(self.task) and abs(self.frame[2, 2]) < 1 - STRAIGHT

    @cached_property
    def vectors(self) -> Array:
        """Directions of the tool's z axis in the cell's frame: (N, 3)."""
        if self.tool_down:
            return np.array([[0.0, 0.0, -1.0 if self.frame[2, 2] > 0 or self.down_is_apart else 1.0]])
        n = np.arange(self.directions)
        z = 1.0 - (2.0 * n + 1.0) / self.directions
        radius, angle = np.sqrt(1.0 - z * z), n * GOLDEN
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)

    @cached_property
    def angles(self) -> Array:
        """Pitches, or yaws counted from the cell's x: (N,) [rad]."""
        if self.tool_down:
            return np.array([_pitch_down(self.arm, self.task)])
        return np.asarray(np.arange(self.directions_count) * (2 * math.pi / self.directions_count), dtype=float)

    def positions(self, rings: Array, azimuth: Array) -> Array:
        """Centres of cells in the frame of targets: rings (..., 2), azimuth (...) [rad] -> (..., 3)."""
        radius, z = (rings[..., 0] + 0.5) * self.step, rings[..., 1] * self.step
        local = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z + 0.0 * azimuth], axis=-1)
        return np.asarray(self.frame[:3, 3] + local @ self.frame[:3, :3].T)

    def targets(self, rings: Array, azimuth: Array, direction: NDArray[np.intp], roll: Array) -> Array:
        """Targets of `ik`: rings (S, 2), azimuth, roll (S,) [rad], direction (S,) index -> (S, ...)."""
        positions = self.positions(rings, azimuth)
        if self.task.orientation == "full":
            T = np.zeros((len(positions), 4, 4))
            T[:, :3, :3] = self._cell_frames(azimuth) @ self._shortest_rotations[direction] @ rotation_about(2, roll)
            T[:, :3, 3], T[:, 3, 3] = positions, 1.0
            return T
        parts = [positions[:, : self.task.position]]
        if self.task.orientation == "axis":
            parts.append(np.einsum("sij,sj->si", self._cell_frames(azimuth), self.vectors[direction]))
        elif self.task.name in ("xy_theta", "xyz_yaw"):
            x = self._cell_frames(azimuth)[:, :, 0]
            parts.append((np.arctan2(x[:, 1], x[:, 0]) + self.angles[direction])[:, None])
        elif _is_pitch(self.task):
            parts.append(self.angles[direction][:, None])
        if self.task.name in ("xyz_pitch_roll", "xyz_roll"):
            parts.append(roll[:, None])
        return np.concatenate(parts, axis=1)

    def _cell_frames(self, azimuth: Array) -> Array:
        """Frames of cells in the frame of targets: (S, 3, 3)."""
        if self.down_is_apart:
            return np.broadcast_to(np.eye(3), (len(azimuth), 3, 3))
        return np.asarray(self.frame[:3, :3] @ rotation_about(2, azimuth))

    @cached_property
    def _shortest_rotations(self) -> Array:
        """The shortest rotations that take +z to `vectors`: (N, 3, 3)."""
        x, y, z = self.vectors.T
        R = np.empty((len(z), 3, 3))
        with np.errstate(divide="ignore", invalid="ignore"):
            h = 1.0 / (1.0 + z)
            R[:, 0] = np.stack([1 - h * x * x, -h * x * y, x], axis=1)
            R[:, 1] = np.stack([-h * x * y, 1 - h * y * y, y], axis=1)
        R[:, 2] = np.stack([-x, -y, z], axis=1)
        R[z <= -1 + STRAIGHT] = np.diag([1.0, -1.0, -1.0])
        return R


def _is_pitch(task: Task) -> bool:
    return task.name in ("xyz_pitch", "xyz_pitch_roll")


def _pitch_down(arm: Arm, task: Task) -> float:
    """The pitch at which the tool's z axis points down [rad]. Raises UsageError if there is none."""
    q = arm.home.copy()
    joint = int(np.flatnonzero(task.sums[0])[0])
    moved_q = q.copy()
    moved_q[joint] += 0.1
    z, z_moved = fk(arm, q)[:3, 2], fk(arm, moved_q)[:3, 2]
    axis = np.cross(z, z_moved)
    down = np.array([0.0, 0.0, -1.0])
    size = np.linalg.norm(axis)
    if size < 0.09 or abs(axis[2]) > 1e-6 * size:
        raise UsageError(f"tool_down: no pitch of {arm.name} points its tool's z axis straight down")
    axis /= size
    angle = math.atan2(float(axis @ np.cross(z, down)), float(z @ down))
    return float(task.sums[0] @ q + task.offsets[0] + angle * np.sign(task.sums[0][joint]))
