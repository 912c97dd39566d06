"""Arms with joints held at fixed values, so that `ik` can solve a redundant arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.model.rotation import joint_motion

if TYPE_CHECKING:
    from armkin.model.arm import Arm

# Arrays of `Arm` with a number for each joint.
_JOINT_ARRAYS = (
    "prismatic", "lower", "upper", "home", "max_speed", "max_accel", "max_jerk", "dh_sign", "dh_theta", "ratio",
)  # fmt: skip


def lock(arm: Arm, held: Mapping[str, float]) -> Arm:
    """The arm with some joints held: fewer joints, the held motions folded into its links.

    Branches of the result go back to the full arm with `armkin.unlock`.

    Args:
        arm: the arm, as `armkin.load` gives it.
        held: joint name -> the value that it is held at [rad | mm].

    Returns:
        An arm of n - len(held) joints, `Arm.held` their names.

    Raises:
        UsageError: a joint is unknown, a value is not finite, or no joint is left.

    >>> import armkin
    >>> lock(armkin.load("robots/panda.yaml"), {"J3": 0.35}).joint_names
    ('J1', 'J2', 'J4', 'J5', 'J6', 'J7')
    """
    _check_held(arm, held)
    kept_joints = [i for i, name in enumerate(arm.joint_names) if name not in held]
    return replace(
        arm,
        joint_names=tuple(arm.joint_names[i] for i in kept_joints),
        link=_links_with_held_motions(arm, held),
        frame=arm.frame[kept_joints],
        motor_gain=arm.motor_gain[:, kept_joints],
        pose_joints=arm.pose_joints[:, kept_joints],
        homing=tuple(arm.homing[i] for i in kept_joints),
        hard_limits=tuple(arm.hard_limits[i] for i in kept_joints),
        held=(*arm.held, *held),
        whole=(arm, dict(held)) if arm.keep_out else None,
        **{field: getattr(arm, field)[kept_joints] for field in _JOINT_ARRAYS},
    )


def _check_held(arm: Arm, held: Mapping[str, float]) -> None:
    """Raise UsageError unless the joints exist, their values are finite and at least one joint stays free."""
    for name, value in held.items():
        joint_index(arm, name)
        number = arrays.real_array(value, name)
        if number.ndim or not np.isfinite(number):
            raise UsageError(f"{name} cannot be held at {value}: give one finite number")
    if len(held) >= arm.n:
        raise UsageError(f"{arm.name}: with {', '.join(held)} held no joint is left to solve for")


def _links_with_held_motions(arm: Arm, held: Mapping[str, float]) -> Array:
    """The constant links (free joints + 1, 4, 4) [mm]; the motion of a held joint is part of the previous link."""
    links = [arm.link[0]]
    for i, name in enumerate(arm.joint_names):
        if name in held:
            motion = joint_motion(bool(arm.prismatic[i]), held[name] * arm.ratio[i])
            links[-1] = links[-1] @ motion @ arm.link[i + 1]
        else:
            links.append(arm.link[i + 1])
    return np.array(links)


def unlock(arm: Arm, held: Mapping[str, float], q: ArrayLike) -> Array:
    """Joint values of a locked arm as those of the full one.

    Args:
        arm: the full arm, which `armkin.lock` was given.
        held: joint name -> the value that it is held at [rad | mm], as `armkin.lock` was given it.
        q: (..., n - held) [rad | mm] values of the other joints, in their order.

    Returns:
        (..., n) [rad | mm] values of all joints; of rows with a nan the held values are nan, too.

    Raises:
        UsageError: a joint is unknown, a held value is no number, or q has another number of values.

    >>> import armkin
    >>> unlock(armkin.load("robots/three_dof.yaml"), {"q2": 0.5}, [0.1, 0.2]).tolist()
    [0.1, 0.5, 0.2]
    """
    for name, value in held.items():
        joint_index(arm, name)
        if not isinstance(value, int | float | np.number):
            raise UsageError(f"{name} cannot be held at {value!r}: give a number", joint=name)
    values = arrays.real_array(q, "joint values")
    if values.ndim == 0 or values.shape[-1] != arm.n - len(held):
        raise UsageError(f"expected the {arm.n - len(held)} joint values that are not held, got shape {values.shape}")
    is_missing = np.isnan(values).any(axis=-1)
    joints = np.empty((*values.shape[:-1], arm.n))
    remaining = iter(range(values.shape[-1]))
    for i, name in enumerate(arm.joint_names):
        joints[..., i] = np.where(is_missing, np.nan, held[name]) if name in held else values[..., next(remaining)]
    return joints


def joint_index(arm: Arm, name: str) -> int:
    """Index of a joint by its name; UsageError lists the names."""
    if name in arm.joint_names:
        return arm.joint_names.index(name)
    similar_names = get_close_matches(name, arm.joint_names, 1, 0.5)
    hint = f" (did you mean {similar_names[0]}?)" if similar_names else ""
    raise UsageError(f"{arm.name} has no joint '{name}'{hint}; its joints are {', '.join(arm.joint_names)}")
