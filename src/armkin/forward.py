"""Forward kinematics and the Jacobian of any arm.

Every arm, whatever its convention, is one chain

    T(q) = link[0] Z1(r1 q1) link[1] Z2(r2 q2) ... Zn(rn qn) link[n],   Z = Rz (revolute) or Tz (prismatic)

(Craig, Introduction to Robotics, eq. 3.6 with the constant factors of neighbouring rows
merged; Lynch & Park, Modern Robotics, eq. 4.14 for screws). The ratios r differ from 1 only for calibrated arms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.array_shapes import Figures, Frames, Jacobians, Joints, Points, Poses
from armkin.formula.arrays import Array, Entry
from armkin.formula.pose import Pose
from armkin.formula.trace import SMALL_BATCH, LazyCode, StraightLineCode

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Motion = Entry | tuple[Entry, Entry]  # a joint value, or the cosine and sine of the actual angle of a revolute joint
FEW_POSES = 16  # poses up to which plain Python is faster than arrays


def fk(arm: Arm, q: ArrayLike) -> Poses:
    """Pose of the tool for joint values.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        (..., 4, 4) [mm] homogeneous transforms of the tool in the frame of targets.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> armkin.fk(arm, np.deg2rad([0, 90, -90]))[:3, 3].round(9).tolist()
    [258.0, 10.0, 367.0]
    """

    values = as_joints(arm, q)
    if values.size == arm.n:
        return _single_pose(arm, values.reshape(arm.n)).reshape(*values.shape[:-1], 4, 4)
    return _run_batched(arm, values, (4, 4), tip_formula)


def position(arm: Arm, q: ArrayLike) -> Points:
    """Position of the tool alone, at about half the cost of `fk`.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        (..., 3) [mm] x, y, z.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.

    >>> import armkin, numpy as np
    >>> position(armkin.load("robots/planar_2dof.yaml"), np.deg2rad([20, 50])).round(6).tolist()
    [290.544567, 350.311815, 0.0]
    """
    return _run_batched(arm, as_joints(arm, q), (3,), point_formula)


def point_numbers(arm: Arm) -> Callable[..., tuple[float, ...]]:
    """`position` in plain Python: takes the n joint values of one pose [rad | mm], returns x, y, z [mm]."""
    return _recorded_code(arm, point_formula).record_now().single_pose_function()


def frames(arm: Arm, q: ArrayLike) -> Frames:
    """Pose of the base, of every joint's frame and of the tool.

    Joint frames are those of the robot file's convention: DH frame i, or with screws the moving body's frame that
    stands on the joint's axis with the base's axes when all joints are zero.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        (..., n + 2, 4, 4) [mm] the base first, then joint after joint, the tool last.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.
    """

    return _run_batched(arm, as_joints(arm, q), (arm.n + 2, 4, 4), _frames_formula)


def jacobian(arm: Arm, q: ArrayLike) -> Jacobians:
    """Geometric Jacobian of the tool in the base's axes, linear rows first (Siciliano et al., Robotics, eq. 3.30).

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        (..., 6, n): rows 0 to 2 are the tool's velocity [mm/rad; 1 for prismatic joints], rows 3 to 5 its angular
        velocity [1; 0 for prismatic joints], a column for the unit speed of each joint.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.
    """

    return _run_batched(arm, as_joints(arm, q), (6, arm.n), jacobian_formula)


def tip_and_jacobian(arm: Arm, q: ArrayLike) -> tuple[Poses, Jacobians]:
    """`fk` and `jacobian` in one, at little more than the cost of the latter: (..., 4, 4) and (..., 6, n)."""
    values = as_joints(arm, q)
    entries = _run_batched(arm, values, (16 + 6 * arm.n,), pose_and_jacobian)
    batch_shape = values.shape[:-1]
    return entries[..., :16].reshape(*batch_shape, 4, 4), entries[..., 16:].reshape(*batch_shape, 6, arm.n)


def tip_and_jacobian_columns(arm: Arm, q: Array) -> Array:
    """The entries of `tip_and_jacobian`, row by row, of many poses q (N, n) in columns: (16 + 6 n, N)."""
    columns = np.empty((16 + 6 * arm.n, len(q)))
    _fill(columns.T, arm, q, pose_and_jacobian)
    return columns


def manipulability(arm: Arm, q: ArrayLike, rows: slice | list[int] | None = None) -> Figures:
    """Yoshikawa's measure ``sqrt(det(J J^T))``, computed as the product of J's singular values.

    Lengths are in mm, so the value carries a power of mm (Yoshikawa, Manipulability of Robotic Mechanisms, 1985, eq.
    13).

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.
        rows: which rows of the Jacobian count; by default the linear ones for up to three joints, else all six.

    Returns:
        (...) [a power of mm] 0 at a singularity, nan where a joint value is not finite.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.
    """
    values = _singular_values(arm, q, rows)
    product: Array = np.prod(values, axis=-1)
    return product


def condition(arm: Arm, q: ArrayLike, rows: slice | list[int] | None = None) -> Figures:
    """Condition number of the Jacobian, its linear rows divided by the arm's reach.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.
        rows: which rows of the Jacobian count; by default the linear ones for up to three joints, else all six.

    Returns:
        (...) [1] from 1; inf or very large at a singularity, nan where a joint value is not finite.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.
    """
    values = _singular_values(arm, q, rows, scale=arm.reach)
    with np.errstate(divide="ignore"):
        ratio: Array = values[..., 0] / values[..., -1]
    return ratio


def _singular_values(arm: Arm, q: ArrayLike, rows: slice | list[int] | None, scale: float = 1.0) -> Array:
    """Singular values (..., k) of the Jacobian's rows, largest first, its linear rows divided by `scale` [mm]."""
    if rows is None:
        rows = slice(0, 3) if arm.n <= 3 else slice(0, 6)
    J = jacobian(arm, q)
    J[..., :3, :] /= scale
    J = J[..., rows, :]
    finite = np.asarray(np.isfinite(J).all(axis=(-2, -1), keepdims=True))  # False for the nan rows of `Solutions.q`
    values = np.linalg.svd(np.where(finite, J, 0.0), compute_uv=False)
    return np.where(finite[..., 0], values, np.nan)


def move(arm: Arm, P: Pose, joint: int, value: Motion) -> Pose:
    """The pose after the motion of a joint: ``P Z(r q)`` with the joint's ratio r."""
    if arm.prismatic[joint]:
        return pose.slide(P, _actual_slide(arm, joint, value))
    return pose.rotate(P, *_actual_cos_sin(arm, joint, value))


def _actual_slide(arm: Arm, joint: int, value: Any) -> Entry:
    """The actual joint value for a commanded one."""
    ratio = float(arm.ratio[joint])
    return value if ratio == 1.0 else arrays.mul(ratio, value)


def _actual_cos_sin(arm: Arm, joint: int, value: Motion) -> tuple[Entry, Entry]:
    """Cosine and sine of the actual angle for a commanded one."""
    return value if isinstance(value, tuple) else arrays.cos_sin(_actual_slide(arm, joint, value))


def one_pose(arm: Arm, q: ArrayLike, name: str) -> Array:
    """``q`` as the finite joint values (n,) of one pose; name: its name, for the message."""
    values = as_joints(arm, q)
    if values.ndim != 1 or not np.isfinite(values).all():
        raise UsageError(
            f"{name}: expected the {arm.n} finite joint values of one pose, got shape {values.shape} or nan"
        )
    return values


def as_joints(arm: Arm, q: ArrayLike) -> Joints:
    """``q`` as a float array with the arm's number of joints on its last axis."""
    values = arrays.real_array(q, "joint values")
    if values.ndim == 0 or values.shape[-1] != arm.n:
        given_text = "a single number" if values.ndim == 0 else f"{values.shape[-1]}"
        raise UsageError(
            f"{arm.name} has {arm.n} joints ({', '.join(arm.joint_names)}): "
            f"expected {arm.n} values on the last axis, got {given_text}"
        )
    return values


def tip_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """The tool's pose, row by row: 16 entries."""
    P = pose.constant(arm.link[0])
    for joint in range(arm.n):
        P = pose.compose(move(arm, P, joint, q[joint]), pose.constant(arm.link[joint + 1]))
    return _matrix_entries(P)


def _frames_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """All frames, row by row: 16 (n + 2) entries."""
    entries = _matrix_entries(pose.constant(arm.base))
    P = pose.constant(arm.link[0])
    for joint in range(arm.n):
        P = move(arm, P, joint, q[joint])
        entries += _matrix_entries(pose.compose(P, pose.constant(arm.frame[joint])))
        P = pose.compose(P, pose.constant(arm.link[joint + 1]))
    return entries + _matrix_entries(P)


def jacobian_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """The Jacobian, row by row: 6 n entries."""
    return pose_and_jacobian(arm, q)[16:]


def pose_and_jacobian(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """The tool's pose and the Jacobian, row by row: 16 + 6 n entries."""
    P = pose.constant(arm.link[0])
    axes = []
    for joint in range(arm.n):
        axes.append((P[6:9], P[9:12]))
        P = pose.compose(move(arm, P, joint, q[joint]), pose.constant(arm.link[joint + 1]))
    columns = []
    for joint, (z, origin) in enumerate(axes):
        lever = arrays.combine(1.0, P[9:12], -1.0, origin)
        column = [*z, 0.0, 0.0, 0.0] if arm.prismatic[joint] else [*arrays.cross(z, lever), *z]
        ratio = float(arm.ratio[joint])
        columns.append(column if ratio == 1.0 else [arrays.mul(ratio, entry) for entry in column])
    return [*_matrix_entries(P), *(column[row] for row in range(6) for column in columns)]


def _matrix_entries(P: Pose) -> list[Entry]:
    """A pose as the 16 entries of its matrix, row by row."""
    return [*P[0::3], *P[1::3], *P[2::3], 0.0, 0.0, 0.0, 1.0]


def point_formula(arm: Arm, q: Sequence[Motion]) -> list[Entry]:
    """The tool's position, computed from the tool to the base, as transforming a point costs less than a pose."""
    point: list[Entry] = [float(x) for x in arm.link[-1][:3, 3]]
    for joint in reversed(range(arm.n)):
        if arm.prismatic[joint]:
            point = [point[0], point[1], arrays.add(point[2], _actual_slide(arm, joint, q[joint]))]
        else:
            c, s = _actual_cos_sin(arm, joint, q[joint])
            x, y, z = point
            point = [arrays.sub(arrays.mul(c, x), arrays.mul(s, y)), arrays.add(arrays.mul(s, x), arrays.mul(c, y)), z]
        point = pose.apply(pose.constant(arm.link[joint]), point)
    return point


def _single_pose(arm: Arm, q: Array) -> Array:
    """The tool's pose for one posture by matrix products, which is faster than a batch of one."""
    T = arm.link[0]
    for joint in range(arm.n):
        Z, value = np.eye(4), arm.ratio[joint] * q[joint]
        if arm.prismatic[joint]:
            Z[2, 3] = value
        else:
            c, s = (math.cos(value), math.sin(value)) if math.isfinite(value) else (math.nan, math.nan)
            Z[0, 0] = Z[1, 1] = c
            Z[0, 1], Z[1, 0] = -s, s
        T = T @ Z @ arm.link[joint + 1]
    return np.asarray(T)


Formula = Callable[["Arm", Sequence[Motion]], list[Entry]]


@lru_cache(maxsize=256)
def _recorded_code(arm: Arm, formula: Formula) -> LazyCode:
    """A formula of an arm's joint values as straight-line code."""
    return LazyCode(lambda q: formula(arm, q), arm.n)


@lru_cache(maxsize=256)
def _recorded_of_turns(arm: Arm, formula: Formula) -> LazyCode:
    """A formula of the result of `_slides_and_turns` as straight-line code."""
    return LazyCode(lambda inputs: formula(arm, _joint_motions(arm, inputs)), 2 * arm.n - int(arm.prismatic.sum()))


@lru_cache(maxsize=256)
def _turn_places(arm: Arm) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows of `_slides_and_turns` with slides and with cosines, and the ratios of the revolute joints (m, 1)."""
    first = np.cumsum([0, *np.where(arm.prismatic, 1, 2)])[:-1]
    return first[arm.prismatic], first[~arm.prismatic], arm.ratio[~arm.prismatic, None]


def _slides_and_turns(arm: Arm, q: Array) -> Array:
    """Slides, or actual cosines and sines, joint by joint: q (N, n) [rad | mm] -> (2 n - slides, N)."""
    slides, turning, ratio = _turn_places(arm)
    values = np.ascontiguousarray(q.T)
    rows = np.empty((len(slides) + 2 * len(turning), len(q)))
    if len(slides):
        rows[slides], values = values[arm.prismatic], values[~arm.prismatic]
    angles: Any = values * ratio
    turns: Any = arrays.cos_sin(angles)
    rows[turning], rows[turning + 1] = turns
    return rows


def _joint_motions(arm: Arm, turns: Iterable[Entry]) -> list[Motion]:
    """The result of `_slides_and_turns` for each joint: a slide, or a cosine and a sine."""
    remaining = iter(turns)
    return [next(remaining) if slides else (next(remaining), next(remaining)) for slides in arm.prismatic.tolist()]


def _run_batched(arm: Arm, values: Array, shape: tuple[int, ...], formula: Formula) -> Array:
    """A formula's entries for every pose: values (..., n) -> (..., *shape)."""
    results = np.empty(values.shape[:-1] + shape)
    _fill(results.reshape(-1, math.prod(shape)), arm, values.reshape(-1, arm.n), formula)
    return results


def _fill(rows: Array, arm: Arm, q: Array, formula: Formula) -> None:
    """Write the entries of poses q (N, n) into rows (N, entries)."""
    if len(q) > SMALL_BATCH:
        _fill_by_chunks(rows, q, _recorded_code(arm, formula).record_now())
    else:
        _fill_small_batch(rows, arm, q, formula)


def _fill_by_chunks(rows: Array, q: Array, code: StraightLineCode) -> None:
    """Write the entries of many poses q (N, n) into rows (N, entries), in chunks that fit the cache."""
    workspace = code.workspace(min(len(q), arrays.CHUNK))
    for start in range(0, len(q), arrays.CHUNK):
        chunk = slice(start, start + arrays.CHUNK)
        columns = np.ascontiguousarray(q[chunk].T)
        if columns.shape[1] < arrays.CHUNK <= len(q):  # the last chunk is shorter
            workspace = code.workspace(columns.shape[1])
        for k, entry in enumerate(code.run(list(columns), workspace)):
            rows[chunk, k] = entry


def _fill_small_batch(rows: Array, arm: Arm, q: Array, formula: Formula) -> None:
    """Write the entries of a few poses q (N, n) into rows (N, entries), all cosines and sines taken at once."""
    turns = _slides_and_turns(arm, q)
    code = _recorded_of_turns(arm, formula).get(len(q))
    if code is not None and len(q) <= FEW_POSES:
        entries_of_pose = code.single_pose_function()
        for k, inputs in enumerate(turns.T.tolist()):
            rows[k] = entries_of_pose(*inputs)
        return
    entries: Any
    if code is None:  # the formula is not recorded yet
        entries = formula(arm, _joint_motions(arm, turns))
    else:
        entries = code.run(list(turns), code.workspace(len(q)))
    for k, entry in enumerate(entries):
        rows[:, k] = entry
