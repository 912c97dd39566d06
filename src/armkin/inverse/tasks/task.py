"""Tasks and their targets: the numbers that a task prescribes, and how they are read.

Every task is a choice of three kinds of constraints:

- coordinates of the tool's position (`position`: 2 for planar arms, else 3),
- sums of joint values modulo a turn (`sums`: theta, phi, yaw, roll),
- the direction of the tool's z axis or its whole orientation (`orientation`).

`residuals` computes the error of a pose from its target, `choose_task` the task of an arm.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry, Int
from armkin.formula.trace import StraightLineCode
from armkin.model.arm import Arm

LABELS = {
    "xy": ("x", "y"),
    "xy_theta": ("x", "y", "theta"),
    "xyz": ("x", "y", "z"),
    "xyz_pitch": ("x", "y", "z", "phi"),
    "xyz_yaw": ("x", "y", "z", "yaw"),
    "xyz_pitch_roll": ("x", "y", "z", "phi", "roll"),
    "xyz_roll": ("x", "y", "z", "roll"),
    "xyz_axis": ("x", "y", "z", "ax", "ay", "az"),
    "pose": ("x", "y", "z", "roll", "pitch", "yaw"),
}
ROTATION = 5e-6  # largest distance from orthonormal columns that counts as rounding, six printed digits
ROUNDED = 1e-14  # distance from orthonormal columns that needs no correction
NO_DIRECTION = 1e-12  # a shorter vector has no direction
AROUND_DISTANCE = 1e-4  # distance [reaches, rad] of `targets_around` from their target
MAX_TARGET = 1e15  # largest size [mm, rad] of a target, so that its powers stay finite


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

    @cached_property
    def constraints(self) -> int:
        """The number of degrees of freedom that a target fixes."""
        return self.position + len(self.sums) + {"none": 0, "axis": 2, "full": 3}[self.orientation]


def read_near(arm: Arm, near: ArrayLike | None, lead: tuple[int, ...]) -> Array:
    """Joint values to stay close to, (n,) or (*lead, n) [rad | mm]; by default home. Raises UsageError for others."""
    reference = arm.home if near is None else arrays.real_array(near, "near")
    if reference.shape != (arm.n,) and reference.shape != (*lead, arm.n):
        shapes = " or ".join(dict.fromkeys([str((arm.n,)), str((*lead, arm.n))]))
        raise UsageError(f"near has shape {reference.shape}; expected {shapes}")
    if not np.isfinite(reference).all():
        raise UsageError("near holds nan or infinity; every joint value must be finite")
    return reference


def read_targets(task: Task, targets: ArrayLike) -> tuple[Array, tuple[int, ...], Array]:
    """Targets (..., m), or (..., 4, 4) for poses, as a flat batch (N, ...); its shape; defects of rotations (N,).

    A rotation that was rounded, to six decimals or to float32, is replaced by the nearest rotation.
    Raises UsageError for a wrong shape, numbers not finite or too large, an axis of no length, no rotation to 5e-6.
    """
    flat, lead = flat_targets(task, targets)
    rounding = np.zeros(len(flat))
    if task.orientation == "full":
        unread = flat
        for rows in arrays.slices(len(flat), arrays.CHUNK):
            part = unread[rows]
            near, rounding[rows], _ = read_poses(part)
            if near is not part:
                flat = flat.copy() if flat is unread else flat
                flat[rows] = near
    return flat, lead, rounding


def flat_targets(task: Task, targets: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """Targets as a flat batch (N, m), or (N, 4, 4) for poses with unchecked rotations, and the batch's shape."""
    values = arrays.real_array(targets, "targets")
    shape = (4, 4) if task.orientation == "full" else (len(task.labels),)
    if values.shape[-len(shape) :] != shape or values.ndim < len(shape):
        expected = "(..., 4, 4)" if task.orientation == "full" else f"(..., {shape[0]}): {' '.join(task.labels)}"
        raise UsageError(f"task {task.name} takes targets of shape {expected}; got {values.shape}")
    flat = values.reshape(-1, *shape)
    if task.orientation != "full":
        _refuse_wild(flat)
    if task.orientation == "axis":
        length = np.linalg.norm(flat[:, 3:], axis=1, keepdims=True)
        if (length < NO_DIRECTION).any():
            raise UsageError("a target's axis ax ay az has no length; give the direction of the tool's z axis")
        flat = np.concatenate([flat[:, :3], flat[:, 3:] / length], axis=1)
    return flat, values.shape[: values.ndim - len(shape)]


def _refuse_wild(values: Array) -> None:
    """Raise UsageError for numbers that are not finite or too large."""
    if not (values.min(initial=0.0) >= -MAX_TARGET and values.max(initial=0.0) <= MAX_TARGET):
        if not np.isfinite(values).all():
            raise UsageError("a target holds nan or infinity; every number must be finite")
        raise UsageError(f"a target holds a number beyond {MAX_TARGET:g}; no arm reaches there")


def read_poses(T: Array) -> tuple[Array, Array, pose.Pose]:
    """Poses (N, 4, 4) with the nearest rotations, the defects of the given ones (N,), and the entries."""
    _refuse_wild(T)
    entries = pose.read_pose(T)
    check = rotation_check()
    if len(T) == 1:
        defect = check.one_by_one([pose.read_one(T[0])])[0]
    else:
        defect = np.array(check.run(entries, check.workspace(len(T)))[0])
    if not (defect <= ROTATION).all():
        raise UsageError("a target is no pose: its 3 x 3 part must be a rotation to 5e-6")
    rows = np.flatnonzero(defect > ROUNDED)
    if len(rows):
        T = T.copy()
        T[rows, :3, :3] = nearest_rotation(T[rows, :3, :3])
        entries = pose.read_pose(T)
    return T, defect, entries


@cache
def rotation_check() -> StraightLineCode:
    """The formula of a rotation's defect: the distance of x and z from orthonormal vectors, and of y from z x x."""

    def formula(P: pose.Pose) -> list[Entry]:
        x, y, z = P[0:3], P[3:6], P[6:9]
        defects = [arrays.dot(x, x) - 1.0, arrays.dot(z, z) - 1.0, arrays.dot(x, z)]
        defects += [arrays.sub(a, b) for a, b in zip(arrays.cross(z, x), y, strict=True)]
        worst = arrays.absolute(defects[0])
        for e in defects[1:]:
            worst = arrays.maximum(worst, arrays.absolute(e))
        return [worst]

    return StraightLineCode(formula, 12)


def nearest_rotation(R: Array) -> Array:
    """The nearest rotations to matrices (N, 3, 3) that are rotations to 5e-6: their orthogonal polar factors.

    Two steps of Newton and Schulz, R (3 - R^T R) / 2, each of which squares the distance
    (Higham, Functions of Matrices, 2008, eq. 8.20).
    """
    x: list[Any]
    y: list[Any]
    z: list[Any]
    x, y, z = ([R[:, row, column] for row in range(3)] for column in range(3))
    for _ in range(2):
        xx, yy, zz = (1.5 - 0.5 * arrays.dot(v, v) for v in (x, y, z))
        xy, yz, zx = (-0.5 * arrays.dot(u, v) for u, v in ((x, y), (y, z), (z, x)))
        rows = ((xx, xy, zx), (xy, yy, yz), (zx, yz, zz))
        x, y, z = (arrays.combine(1.0, arrays.combine(a, x, b, y), c, z) for a, b, c in rows)
    return np.moveaxis(np.array([x, y, z]), 2, 0).swapaxes(1, 2)


def targets_of(task: Task, T: Array, q: Array) -> Array:
    """The targets that poses T (M, 4, 4) at joint values q (M, n) reach: (M, m) or (M, 4, 4)."""
    if task.orientation == "full":
        return T
    parts = [T[:, : task.position, 3], q @ task.sums.T + task.offsets]
    if task.orientation == "axis":
        parts.append(T[:, :3, 2])
    return np.concatenate(parts, axis=1)


def shifted_targets(arm: Arm, task: Task, target: Array, shift: Array) -> Array:
    """Targets (M, m) or (M, 4, 4) moved a little; shift: (6,) three [reaches], three [rad]."""
    targets = target.copy()
    if task.orientation == "full":
        targets[:, :3, 3] += shift[:3] * arm.reach
        x, y, z = shift[3:]
        spin = np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
        targets[:, :3, :3] = np.linalg.qr(spin)[0] * np.sign(np.diag(np.linalg.qr(spin)[1])) @ target[:, :3, :3]
        return targets
    targets[:, : task.position] += shift[: task.position] * arm.reach
    targets[:, task.position :] += shift[3 : 3 + (targets.shape[1] - task.position)]
    if task.orientation == "axis":
        targets[:, 3:] /= np.linalg.norm(targets[:, 3:], axis=1, keepdims=True)
    return targets


def targets_around(arm: Arm, task: Task, target: Array, pairs: int = 2, size: float = AROUND_DISTANCE) -> Array:
    """Targets (M, m) or (M, 4, 4) moved by up to size [reaches, rad], in opposite pairs: (M, 2 pairs, ...)."""
    moves = np.random.default_rng(3).uniform(-size, size, (pairs, 6))
    return np.stack([shifted_targets(arm, task, target, sign * d) for d in moves for sign in (1.0, -1.0)], axis=1)


def targets_at(task: Task, target: Array, tip: Array, room: float | Array, first: Array | None = None) -> Int:
    """Which targets (N, m) or (N, 4, 4) are at positions of the tool.

    tip: (3,) or (N, 3) [mm]; room: how far off they may be [mm], a number or (N,); first: (N,) the targets' first
    coordinate, where it stands alone.
    """
    point = target[:, :3, 3] if task.orientation == "full" else target[:, : task.position]
    x = point[:, 0] if first is None else first
    rows = np.flatnonzero(np.abs(x - tip[..., 0]) <= room)  # one coordinate tells nearly all others
    if len(rows):
        offset = np.abs(point[rows] - (tip if tip.ndim == 1 else tip[rows])[..., : task.position])
        rows = rows[offset.max(axis=1) <= (room if isinstance(room, float) else room[rows])]
    return rows


def distance(arm: Arm, task: Task, target: Array) -> Array:
    """Distances of targets (M, m) or (M, 4, 4) from the arm's first joint [reaches]: (M,)."""
    p = target[:, :3, 3] if task.orientation == "full" else target[:, : task.position]
    return np.asarray(np.linalg.norm(p - arm.link[0][: p.shape[1], 3], axis=1) / arm.reach)
