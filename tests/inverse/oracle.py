"""An independent second opinion on kinematics: screws, matrix exponentials and multi-start Newton.

Nothing here uses `armkin`'s chain. A robot file is read into the screw axes of its joints at zero, by
plain products of DH matrices, and poses are products of exponentials (Lynch & Park, Modern Robotics,
eq. 4.14). The oracle for branches is a damped Newton iteration from many random starts.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]


class Screws(NamedTuple):
    """Joint axes at zero, in the base's axes: directions w (n, 3), points p (n, 3), and the tool's pose M."""

    w: Array
    p: Array
    prismatic: Bool
    M: Array

    @property
    def size(self) -> float:
        """A length of the arm [mm]: how far its points are spread."""
        points = np.concatenate([self.p, self.M[None, :3, 3]])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) or 1.0


def rotation(axis: str, degrees: float) -> Array:
    """Rx, Ry or Rz as 4 x 4."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(4)
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R


def shift(x: float, y: float, z: float) -> Array:
    """A translation as 4 x 4."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def pose_matrix(pose: Any) -> Array:
    """A robot file's pose {xyz, rpy} as 4 x 4."""
    roll, pitch, yaw = pose.rpy
    return shift(*pose.xyz) @ rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)


def screws_of(file: Any) -> Screws:
    """The screw axes of a robot file of any convention."""
    base, tool = pose_matrix(file.base), pose_matrix(file.tool)
    prismatic = np.array([joint.type == "prismatic" for joint in file.joints])
    sign = np.array([joint.sign for joint in file.joints], dtype=float)
    w, p = [], []
    if file.convention == "screws":
        for joint in file.joints:
            axis = np.array(joint.screw.v if joint.type == "prismatic" else joint.screw.w, dtype=float)
            if joint.type == "prismatic":
                point = np.zeros(3)
            elif joint.screw.q is not None:
                point = np.array(joint.screw.q, dtype=float)
            else:
                point = np.cross(axis, np.array(joint.screw.v, dtype=float))
            w.append(base[:3, :3] @ axis)
            p.append(base[:3, :3] @ point + base[:3, 3])
        end = base @ pose_matrix(file.zero_pose) @ tool
    else:
        P = base
        for joint in file.joints:
            turn, along = rotation("z", joint.dh.theta) @ shift(0, 0, joint.dh.d), joint.dh
            twist = shift(along.a, 0, 0) @ rotation("x", along.alpha)
            if file.convention == "modified":
                P = P @ twist
            w.append(P[:3, 2])
            p.append(P[:3, 3])
            P = P @ turn
            if file.convention == "standard":
                P = P @ twist
        end = P @ tool
    return Screws(np.array(w) * sign[:, None], np.array(p), prismatic, end)


def exponential(screw: Screws, joint: int, q: Array) -> Array:
    """exp([S] q) of one joint: (..., 4, 4) (Rodrigues' formula)."""
    E = np.zeros((*q.shape, 4, 4)) + np.eye(4)
    if screw.prismatic[joint]:
        E[..., :3, 3] = q[..., None] * screw.w[joint]
        return E
    p, (once, twice) = screw.p[joint], _generators(screw.w[joint].tobytes())
    s, c1 = np.sin(q)[..., None, None], 2 * np.sin(q / 2)[..., None, None] ** 2
    E[..., :3, :3] += s * once + c1 * twice
    E[..., :3, 3] = p - E[..., :3, :3] @ p
    return E


@lru_cache(maxsize=1024)
def _generators(direction: bytes) -> tuple[Array, Array]:
    """[w] of an axis, and its square."""
    w = np.frombuffer(direction)
    K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return K, K @ K


def forward(screw: Screws, q: Array) -> Array:
    """Tool poses (..., 4, 4) of joint values (..., n)."""
    T = np.broadcast_to(screw.M, (*q.shape[:-1], 4, 4))
    for i in reversed(range(len(screw.prismatic))):
        T = exponential(screw, i, q[..., i]) @ T
    return T


def forward_and_jacobian(screw: Screws, q: Array) -> tuple[Array, Array]:
    """Poses (M, 4, 4) and Jacobians (M, 6, n) of the tool, linear rows first.

    The batch is the last axis: what is constant of an axis times the rotations so far (column, row, M) is one product.
    """
    M, n = q.shape
    s, c1 = np.sin(q.T), 2 * np.sin(q.T / 2) ** 2
    R, position = np.repeat(np.eye(3)[..., None], M, axis=2), np.zeros((3, M))
    axes, points = np.empty((n, 3, M)), np.empty((n, 3, M))
    for i, slides in enumerate(screw.prismatic):
        w, p = screw.w[i], screw.p[i]
        K, twice = _generators(w.tobytes())
        constant = np.column_stack([w, p, K @ p, twice @ p, K, twice])
        moved = (constant.T @ R.reshape(3, -1)).reshape(10, 3, M)
        axes[i], points[i] = moved[0], moved[1] + position
        if slides:
            position = position + q[:, i] * moved[0]
        else:
            R = R + s[i] * moved[4:7] + c1[i] * moved[7:10]
            position = position - s[i] * moved[2] - c1[i] * moved[3]
    T = np.zeros((4, 4, M))
    T[:, :3] = (screw.M[:3].T @ R.reshape(3, -1)).reshape(4, 3, M)
    T[3, :3] += position
    T[3, 3] = 1.0
    lever, slide = T[3, :3] - points, screw.prismatic[:, None, None]
    ahead, behind = [1, 2, 0], [2, 0, 1]
    turned = axes[:, ahead] * lever[:, behind] - axes[:, behind] * lever[:, ahead]
    J = np.concatenate([np.where(slide, axes, turned), np.where(slide, 0.0, axes)], axis=1)
    return np.ascontiguousarray(T.transpose(2, 1, 0)), np.ascontiguousarray(J.transpose(2, 1, 0))


class Goal(NamedTuple):
    """A batch of targets as constraints: coordinates of the position, sums of joints, orientation."""

    position: int  # 2 or 3 coordinates
    sums: Array  # (k, n)
    offsets: Array  # (k,)
    orientation: str  # "none" | "axis" | "full"
    T: Array  # (M, 4, 4): poses that satisfy the targets
    sum_values: Array  # (M, k)

    def take(self, rows: Any) -> Goal:
        return self._replace(T=self.T[rows], sum_values=self.sum_values[rows])

    def array(self) -> Array:
        """The targets as `armkin.ik` takes them."""
        if self.orientation == "full":
            return self.T
        parts = [self.T[:, : self.position, 3], self.sum_values]
        if self.orientation == "axis":
            parts.append(self.T[:, :3, 2])
        return np.concatenate(parts, axis=1)


def goal_of_joints(task: Any, screw: Screws, q: Array) -> Goal:
    """What joint values q reach, in the terms of a task of `armkin`."""
    return Goal(
        task.position,
        task.sums,
        task.offsets,
        task.orientation,
        forward(screw, q),
        q @ task.sums.T + task.offsets,
    )


def pose_error(screw: Screws, goals: Goal, q: Array) -> tuple[Array, Array]:
    """Largest position error [mm] and angle error [rad] of joint values (M, n): (M,), (M,)."""
    T = forward(screw, q)
    mm = np.linalg.norm((T - goals.T)[:, : goals.position, 3], axis=1)
    parts = [np.zeros((len(q), 1))]
    if len(goals.sums):
        error = q @ goals.sums.T + goals.offsets - goals.sum_values
        parts.append(error - 2 * np.pi * np.rint(error / (2 * np.pi)))
    if goals.orientation != "none":
        first = 2 if goals.orientation == "axis" else 0
        parts.append((T - goals.T)[:, :3, first:3].reshape(len(q), 3 * (3 - first)))
    return mm, np.linalg.norm(np.concatenate(parts, axis=1), axis=1)


def _residual(screw: Screws, goals: Goal, q: Array) -> tuple[Array, Array]:
    """Residual (M, r) and its Jacobian (M, r, n), lengths in units of the arm's size."""
    T, J = forward_and_jacobian(screw, q)
    r = [(goals.T - T)[:, : goals.position, 3] / screw.size]
    if len(goals.sums):
        error = goals.sum_values - goals.offsets - q @ goals.sums.T
        r.append(error - 2 * np.pi * np.rint(error / (2 * np.pi)))
    if goals.orientation == "full":
        r.append(0.5 * np.cross(T[:, :3, :3], goals.T[:, :3, :3], axis=1).sum(axis=2))
    if goals.orientation == "axis":
        r.append(np.cross(T[:, :3, 2], goals.T[:, :3, 2]))
    return np.concatenate(r, axis=1), _constrained(screw, goals, T, J)


def _constrained(screw: Screws, goals: Goal, T: Array, J: Array) -> Array:
    """Of the Jacobian (M, 6, n) of poses (M, 4, 4) what constraints see: (M, r, n)."""
    rows = [J[:, : goals.position] / screw.size]
    if len(goals.sums):
        rows.append(np.broadcast_to(goals.sums, (len(J), *goals.sums.shape)))
    if goals.orientation == "full":
        rows.append(J[:, 3:])
    if goals.orientation == "axis":
        z = T[:, :3, 2]
        rows.append((np.eye(3) - z[:, :, None] * z[:, None, :]) @ J[:, 3:])
    return np.concatenate(rows, axis=1)


def newton(screw: Screws, goals: Goal, q: Array, steps: int = 40) -> tuple[Array, Array]:
    """Levenberg-Marquardt: joint values (M, n) moved towards their targets, and the residual (M,)."""
    unit = np.where(screw.prismatic, screw.size, 1.0)
    q = q.copy()
    damping = np.full(len(q), 1e-2)
    r, J = _residual(screw, goals, q)
    cost = np.einsum("mr,mr->m", r, r)
    active = np.arange(len(q))
    for _ in range(steps):
        Ja, ra = J[active] * unit, r[active]
        H = np.swapaxes(Ja, 1, 2) @ Ja + damping[active][:, None, None] * np.eye(q.shape[1])
        step = np.linalg.solve(H, (np.swapaxes(Ja, 1, 2) @ ra[:, :, None]))[:, :, 0]
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        trial = q[active] + step * unit
        r_new, J_new = _residual(screw, goals.take(active), trial)
        trial_cost = np.einsum("mr,mr->m", r_new, r_new)
        better = trial_cost < cost[active]
        rows = active[better]
        q[rows], r[rows], J[rows], cost[rows] = trial[better], r_new[better], J_new[better], trial_cost[better]
        damping[active] = np.where(better, damping[active] * 0.1, damping[active] * 8.0)
        damping[active] = np.clip(damping[active], 1e-14, 1e8)
        active = active[(cost[active] > 1e-30) & (damping[active] < 1e6)]
        if not len(active):
            break
    return q, np.sqrt(cost)


def branches(screw: Screws, goals: Goal, starts: int, seed: int) -> list[Array]:
    """For every target the solutions that Newton reaches from that many random starts: (k, n) each."""
    rng = np.random.default_rng(seed)
    n, count = len(screw.prismatic), len(goals.T)
    width = np.where(screw.prismatic, screw.size, np.pi)
    q, size = newton(
        screw, goals.take(np.repeat(np.arange(count), starts)), rng.uniform(-width, width, (count * starts, n))
    )
    mm, rad = pose_error(screw, goals.take(np.repeat(np.arange(count), starts)), q)
    good = (size < 1e-11) & (mm < 1e-8 * screw.size) & (rad < 1e-8)
    sets = []
    for k in range(count):
        rows = q[k * starts : (k + 1) * starts][good[k * starts : (k + 1) * starts]]
        distinct: list[Array] = []
        while len(rows):
            distinct.append(rows[0])
            rows = rows[distance(screw, rows, rows[0]) > 1e-4]
        sets.append(np.array(distinct).reshape(-1, n))
    return sets


def distance(screw: Screws, a: Array, b: Array) -> Array:
    """Largest joint difference modulo whole turns, slides in units of the arm's size; inf where nan."""
    d = a - b
    d = np.where(screw.prismatic, d / screw.size, d - 2 * np.pi * np.rint(d / (2 * np.pi)))
    return np.asarray(np.nan_to_num(np.abs(d).max(axis=-1), nan=np.inf))


def weakness(screw: Screws, goals: Goal, q: Array) -> Array:
    """Smallest singular value of the constraints' Jacobian (M,), lengths and slides in the arm's size."""
    J = _constrained(screw, goals, *forward_and_jacobian(screw, q))
    S = np.linalg.svd(J * np.where(screw.prismatic, screw.size, 1.0), compute_uv=False)
    rank = goals.position + len(goals.sums) + {"none": 0, "axis": 2, "full": 3}[goals.orientation]
    return np.asarray(S[:, min(rank, q.shape[1]) - 1], dtype=float)
