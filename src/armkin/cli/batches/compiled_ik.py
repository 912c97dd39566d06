"""`armkin.ik`, `armkin.fk` and the nearest branch by machine code: functions that other processes find by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import armkin

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armkin.formula.arrays import Array, Bool
    from armkin.inverse.answers.solutions import Solutions
    from armkin.model.arm import Arm


def build_library(arm: Arm, task: str | None = None) -> None:
    """Build the machine code, before there are processes, which then have it, too."""
    armkin.compile(arm, task)


def ik(
    arm: Arm, targets: Array, task: str | None = None, near: Array | None = None, rounding: Array | None = None
) -> Solutions:
    """`armkin.ik`."""
    return armkin.compile(arm, task).ik(targets, task, near, rounding=rounding)


def fk(arm: Arm, q: Array, task: str | None = None) -> Array:
    """`armkin.fk`; task: whose library serves."""
    return armkin.compile(arm, task).fk(q)


def nearest(q: Array, candidates: Bool, near: Array, scale: Array) -> tuple[NDArray[np.intp], Array] | None:
    """`armkin.columns.ik_columns.nearest_branches`, where it serves."""
    from armkin.compiled import least_motion as found

    return found.nearest_branches(q, candidates, near, scale)
