"""Tasks: what a target prescribes, and which task fits an arm.

Every task is a choice of three kinds of constraints:

- coordinates of the tool's position (`position`: 2 for planar arms, else 3),
- sums of joint values modulo a turn (`sums`: theta, phi, yaw, roll),
- the direction of the tool's z axis or its whole orientation (`orientation`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry, wrapped
from armkin.formula.trace import Straight
from armkin.model.chain import Chain, axes

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
PARALLEL = 3e-3  # [rad] axes this close count as parallel for the choice of a task, not for its solution
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


def task_for(arm: Arm, name: str | None = None) -> Task:
    """The task of that name for this arm; without a name the robot file's, or the one its structure suggests.

    Raises UsageError if the task does not exist or does not fit the arm's joints.
    """
    name = name or arm.task or default_task(arm)
    if name is None:
        raise UsageError(
            f"{arm.name}: no task fits its {_joints(arm)}: there is no position that it could reach at will; "
            "fk, pulses and workspace work, ik does not"
        )
    if name not in LABELS:
        raise UsageError(f"unknown task '{name}'; tasks are {', '.join(LABELS)}")
    task = _BUILDERS[name](arm, name)
    if isinstance(task, str):
        raise UsageError(f"{arm.name}: task {name} does not fit its {_joints(arm)}: {task}")
    return task


def default_task(arm: Arm) -> str | None:
    """The task that the arm's structure suggests, or None."""
    order = {
        2: ("xy",),
        3: ("xy_theta", "xyz"),
        4: ("xyz_yaw", "xyz_pitch"),
        5: ("xyz_pitch_roll", "xyz_axis"),
    }.get(arm.n, ("pose",) if arm.n > 5 else ())
    for name in order:
        if not isinstance(task := _BUILDERS[name](arm, name), str) and rank(arm, task) == min(task.constraints, arm.n):
            return name
    return None


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


def residual(task: Task, T: Array, q: Array, target: Array) -> Array:
    """What is missing to the targets: (M, position + sums + orientation), mm first, then rad.

    T: (M, 4, 4) the tool's poses; q: (M, n); target: (M, m) or (M, 4, 4).
    """
    parts = []
    if task.orientation == "full":
        parts.append(target[:, :3, 3] - T[:, :3, 3])
        R, Rt = T[:, :3, :3], target[:, :3, :3]
        # half the sum of the columns' vector products is the rotation vector to third order
        w = 0.5 * np.cross(R, Rt, axis=1).sum(axis=2)
        trace = np.einsum("mij,mij->m", R, Rt)
        far = trace < 3.0 - 1e-8
        if far.any():
            w[far] = _rotation_vector(Rt[far] @ np.swapaxes(R[far], 1, 2))
        parts.append(w)
    else:
        parts.append(target[:, : task.position] - T[:, : task.position, 3])
        if len(task.sums):
            wanted = target[:, task.position : task.position + len(task.sums)]
            angle = wanted - q @ task.sums.T - task.offsets
            parts.append(wrapped(angle))
        if task.orientation == "axis":
            z = T[:, :3, 2]
            w = np.cross(z, target[:, 3:])
            sine = np.linalg.norm(w, axis=1)
            cosine = np.einsum("mi,mi->m", z, target[:, 3:])
            angle = np.arctan2(sine, cosine)
            w = np.where(sine[:, None] > 1e-12, w * (angle / np.maximum(sine, 1e-300))[:, None], w)
            half = (sine <= 1e-12) & (cosine < 0)  # opposed: any axis across will do
            w[half] = np.pi * T[half][:, :3, 0]
            parts.append(w)
    return np.concatenate(parts, axis=1)


def task_jacobian(task: Task, J: Array) -> Array:
    """Rows of the task: (M, 6, n) geometric Jacobians -> (M, rows, n), in the order of `residual`."""
    parts = [J[:, : task.position, :]]
    if len(task.sums):
        parts.append(np.broadcast_to(task.sums, (len(J), *task.sums.shape)))
    if task.orientation != "none":
        parts.append(J[:, 3:, :])
    return np.concatenate(parts, axis=1)


def axis_projected(task: Task, Jt: Array, T: Array) -> Array:
    """For tasks that prescribe an axis: take the turn about the tool's z axis out of the angular rows."""
    if task.orientation != "axis":
        return Jt
    z = T[:, :3, 2]
    out = Jt.copy()
    out[:, -3:, :] -= z[:, :, None] * np.einsum("mi,min->mn", z, Jt[:, -3:, :])[:, None, :]
    return out


def _rotation_vector(R: Array) -> Array:
    """Rotation vectors of rotation matrices (M, 3, 3), also near half a turn."""
    w = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    s = np.linalg.norm(w, axis=1)
    c = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    angle = np.arctan2(s, c)
    near_half = s < 1e-6
    if near_half.any():
        B = R[near_half] + np.eye(3)
        k = np.argmax(np.einsum("mij,mij->mj", B, B), axis=1)
        axis = B[np.arange(len(B)), :, k]
        w[near_half] = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300)
        s = np.where(near_half, 1.0, s)
    out: Array = w * (angle / np.maximum(s, 1e-300))[:, None]
    return out


def _joints(arm: Arm) -> str:
    kinds = "".join("P" if p else "R" for p in arm.prismatic)
    return f"{arm.n} joints ({kinds})"


def rank(arm: Arm, task: Task, tolerance: float = 1e-4) -> int:
    """Rank of the task's Jacobian at poses in general position; tolerance: of the reach, and in rad."""
    from armkin.forward import fk, jacobian

    q = np.random.default_rng(1).uniform(-2.0, 2.0, (4, arm.n)) * np.where(arm.prismatic, arm.reach / 4, 1.0)
    Jt = axis_projected(task, task_jacobian(task, jacobian(arm, q)), fk(arm, q))
    Jt[:, : task.position] /= arm.reach
    Jt = Jt * np.where(arm.prismatic, arm.reach, 1.0)
    return int(max(np.linalg.matrix_rank(Jt, tol=tolerance)))


def _plain(arm: Arm, name: str, position: int, sums: ArrayLike, offsets: ArrayLike) -> Task:
    return Task(
        name, position, np.asarray(sums, dtype=float).reshape(-1, arm.n), np.asarray(offsets, dtype=float), "none"
    )


def _free(arm: Arm, name: str) -> Task:
    orientation: Literal["none", "axis", "full"] = {"xyz": "none", "xyz_axis": "axis", "pose": "full"}[name]  # type: ignore[assignment]
    return Task(name, 3, np.zeros((0, arm.n)), np.zeros(0), orientation)


def _directions(arm: Arm) -> Array:
    return axes(Chain(arm.link, arm.prismatic))[1]


def _along(directions: Array, reference: Array) -> NDArray[np.float64]:
    """+1 or -1 where a direction is parallel or antiparallel to the reference, else 0."""
    cosine = directions @ reference
    across = np.linalg.norm(np.cross(directions, reference), axis=1)
    return np.where(across < PARALLEL, np.sign(cosine), 0.0)


def _planar(arm: Arm, name: str) -> Task | str:
    w = _directions(arm)
    z = np.array([0.0, 0.0, 1.0])
    turns = np.where(arm.prismatic, 0.0, _along(w, z))
    if (turns[~arm.prismatic] == 0).any() or (np.abs(w[arm.prismatic] @ z) > PARALLEL).any():
        return "its joints do not all move in the base's x-y plane"
    if name == "xy":
        return _plain(arm, name, 2, np.zeros((0, arm.n)), np.zeros(0))
    if not turns.any():
        return "it has no joint that turns"
    # DH angles about the base's z axis: theta is the direction of the last link
    offset = float((turns * arm.dh_sign * arm.dh_theta).sum())
    return _plain(arm, name, 2, turns, [offset])


def _yaw(arm: Arm, name: str) -> Task | str:
    from armkin.forward import fk

    w = _directions(arm)
    z = np.array([0.0, 0.0, 1.0])
    turns = np.where(arm.prismatic, 0.0, _along(w, z))
    lifts = np.where(arm.prismatic, _along(w, z), 0.0)
    if (turns[~arm.prismatic] == 0).any() or not lifts.any() or not turns.any():
        return "it needs joints that turn about the base's z axis and one that slides along it"
    T0 = fk(arm, np.zeros(arm.n))
    return _plain(arm, name, 3, turns, [np.arctan2(T0[1, 0], T0[0, 0])])


def _pitch(arm: Arm, name: str) -> Task | str:
    w = _directions(arm)
    last = 3 if name == "xyz_pitch" else 4
    if arm.n != last + 1:
        return f"it needs {last + 1} joints"
    if arm.prismatic[1:].any():
        return "joints 2 and after must turn"
    parallel = _along(w, w[1])
    parallel[[0, *range(4, arm.n)]] = 0.0
    if (parallel[1:4] == 0).any():
        return "joints 2, 3 and 4 must be parallel"
    # the canonical axis of a joint with sign -1 points against its DH axis
    weights = parallel * arm.dh_sign[1]
    offset = float((weights * arm.dh_sign * arm.dh_theta).sum()) + arm.pitch_offset
    if name == "xyz_pitch":
        return _plain(arm, name, 3, weights, [offset])
    roll = np.zeros(arm.n)
    roll[4] = arm.dh_sign[4]
    return _plain(arm, name, 3, [weights, roll], [offset, arm.dh_theta[4]])


# Each gives the task for an arm, or says why it does not fit.
_BUILDERS = {
    "xy": _planar,
    "xy_theta": _planar,
    "xyz": _free,
    "xyz_pitch": _pitch,
    "xyz_pitch_roll": _pitch,
    "xyz_yaw": _yaw,
    "xyz_axis": _free,
    "pose": _free,
}
