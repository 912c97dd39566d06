"""Targets: which numbers a task prescribes, and how they are read.

Every task is a choice of three kinds of constraints:

- coordinates of the tool's position (`position`: 2 for planar arms, else 3),
- sums of joint values modulo a turn (`sums`: theta, phi, yaw, roll),
- the direction of the tool's z axis or its whole orientation (`orientation`).

What is missing to a target stands in `residuals`, which task fits an arm in `fitting`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.formula.trace import Straight

if TYPE_CHECKING:
    from armkin.model.arm import Arm

LABELS = {
    "xy": ("x", "y"),
    "xy_theta": ("x", "y", "theta"),
    "xyz": ("x", "y", "z"),
    "xyz_pitch": ("x", "y", "z", "phi"),
    "xyz_yaw": ("x", "y", "z", "yaw"),
    "xyz_pitch_roll": ("x", "y", "z", "phi", "roll"),
    "xyz_axis": ("x", "y", "z", "ax", "ay", "az"),
    "pose": ("x", "y", "z", "roll", "pitch", "yaw"),
}
LARGEST = 1e15  # [mm, rad] of a target: its powers in the polynomials stay finite


@dataclass(frozen=True, eq=False)
class Task:
    """What a target prescribes for one arm."""

    name: str
    position: int  # 2 or 3 coordinates
    sums: Array  # (k, n): sums @ q + offsets = target, modulo a turn
    offsets: Array  # (k,) [rad]
    orientation: Literal["none", "axis", "full"]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the target's numbers, as on the command line."""
        return LABELS[self.name]

    @property
    def constraints(self) -> int:
        """How many degrees of freedom the target takes."""
        return self.position + len(self.sums) + {"none": 0, "axis": 2, "full": 3}[self.orientation]


def read_targets(task: Task, targets: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """Targets as a flat batch and its leading shape.

    (..., m) -> (N, m), or (N, 4, 4) for poses. Raises UsageError for a wrong shape,
    numbers that are not finite or too large, an axis of no length or a matrix that is no pose.
    """
    values = arrays.real(targets, "targets")
    shape = (4, 4) if task.orientation == "full" else (len(task.labels),)
    if values.shape[-len(shape) :] != shape or values.ndim < len(shape):
        expected = "(..., 4, 4)" if task.orientation == "full" else f"(..., {shape[0]}): {' '.join(task.labels)}"
        raise UsageError(f"task {task.name} takes targets of shape {expected}; got {values.shape}")
    if not np.isfinite(values).all():
        raise UsageError("a target holds nan or infinity; every number must be finite")
    if np.abs(values).max(initial=0.0) > LARGEST:
        raise UsageError(f"a target holds a number beyond {LARGEST:g}; no arm reaches there")
    lead = values.shape[: values.ndim - len(shape)]
    flat = values.reshape(-1, *shape)
    if task.orientation == "axis":
        length = np.linalg.norm(flat[:, 3:], axis=1, keepdims=True)
        if (length < 1e-12).any():
            raise UsageError("a target's axis ax ay az has no length; give the direction of the tool's z axis")
        flat = np.concatenate([flat[:, :3], flat[:, 3:] / length], axis=1)
    if task.orientation == "full":
        for start in range(0, len(flat), arrays.CHUNK):
            if not _are_rotations(flat[start : start + arrays.CHUNK]):
                raise UsageError("a target is no pose: its 3 x 3 part must be a rotation to 1e-6")
    return flat, lead


@cache
def _rotation_check() -> Straight:
    """How far the columns x and z are from unit vectors at right angles, and y from z x x."""

    def formula(P: pose.Pose) -> list[Entry]:
        x, y, z = P[0:3], P[3:6], P[6:9]
        off = [arrays.dot(x, x) - 1.0, arrays.dot(z, z) - 1.0, arrays.dot(x, z)]
        off += [arrays.sub(a, b) for a, b in zip(arrays.cross(z, x), y, strict=True)]
        worst = np.abs(off[0])
        for e in off[1:]:
            worst = np.maximum(worst, np.abs(e))
        return [worst]

    return Straight(formula, 12)


def _are_rotations(T: Array) -> bool:
    """Whether (N, 4, 4) hold rotations to 1e-6."""
    check = _rotation_check()
    if len(T) == 1:
        return bool(check.single(pose.read_one(T[0]))[0] <= 1e-6)
    return bool(check.run(pose.read(T), check.workspace(len(T)))[0].max(initial=0.0) <= 1e-6)


def targets_of(task: Task, T: Array, q: Array) -> Array:
    """The targets that poses T (M, 4, 4) of joint values q (M, n) answer: (M, m) or (M, 4, 4)."""
    if task.orientation == "full":
        return T
    parts = [T[:, : task.position, 3], q @ task.sums.T + task.offsets]
    if task.orientation == "axis":
        parts.append(T[:, :3, 2])
    return np.concatenate(parts, axis=1)


def distance(arm: Arm, task: Task, target: Array) -> Array:
    """How far targets (M, m) or (M, 4, 4) are from the arm's first joint, in reaches: (M,)."""
    p = target[:, :3, 3] if task.orientation == "full" else target[:, : task.position]
    away: Array = np.linalg.norm(p - arm.link[0][: p.shape[1], 3], axis=1) / arm.reach
    return away
