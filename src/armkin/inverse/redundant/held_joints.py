"""Joints that are held: the arm of the others, and its targets."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.solvers.redundant import Redundancy, moved, redundancy
from armkin.model.arm import Arm
from armkin.model.lock_joints import lock


@lru_cache(maxsize=128)
def arm_without(arm: Arm, held: tuple[tuple[str, float], ...]) -> Arm:
    """The arm with joints locked at values [rad | mm]; the same object for the same values: it is prepared once."""
    return lock(arm, dict(held)) if held else arm


def redundant_alone(arm: Arm, task_name: str | None, held: Mapping[str, float]) -> Redundancy | None:
    """The redundant joint, if that alone is held: for all its values one arm is prepared once, with other targets."""
    if len(held) != 1 or arm.keep_out or (arm.ratio != 1.0).any():
        return None
    free = redundancy(arm, task_name)
    return free if free is not None and arm.joint_names[free.joint] in held else None


def others(arm: Arm, task_name: str | None, held: Mapping[str, float], targets: Array) -> tuple[Arm, Array]:
    """The arm of the joints that are not held [rad | mm], and targets (N, ...) as its own."""
    free = redundant_alone(arm, task_name, held)
    if free is None:
        return arm_without(arm, tuple(held.items())), targets
    [value] = held.values()
    return free.rest, moved(arm, free, targets, np.full(len(targets), value))
