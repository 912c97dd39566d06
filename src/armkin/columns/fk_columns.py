"""Joint values to the columns of `fk` and `pulses`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin import forward, motors
from armkin.columns.joint_columns import joint_columns
from armkin.columns.table import Table
from armkin.model import limits, rotation, units

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool
    from armkin.model.arm import Arm


def pose_columns(arm: Arm, values: Array, T: Array | None = None) -> Table:
    """The columns of fk: values (N, n) [deg | mm]; T: the tool's poses (N, 4, 4), by default worked out."""
    q = units.joints_in(arm, values)
    matrices = (forward.fk(arm, q) if T is None else T) + 0.0  # no -0.0
    table: Table = _named_columns("xyz", matrices[:, :3, 3])
    table |= _named_columns(("roll", "pitch", "yaw"), units.angles_out(rotation.rpy(matrices[:, :3, :3])))
    table["within_limits"] = np.asarray(~limits.outside_limits(arm, q).any(axis=1))
    return _named_columns(joint_columns(arm.joint_names), values) | table


def pulse_columns(arm: Arm, values: Array, best: bool = False) -> tuple[Table, Bool]:
    """The columns of pulses, and which rows (N,) are within limits and what the servos can turn.

    values: (N, n) [deg | mm]; best: see `armkin.best_pulses`.
    """
    q = units.joints_in(arm, values)
    rounding = motors.best_pulses(arm, q).chosen if best else motors.rounding(arm, q)
    table: Table = _named_columns([f"pulses_{name}" for name in motors.motor_names(arm)], rounding.pulses)
    table |= _named_columns(
        [f"actual_{name}" for name in arm.joint_names], units.joints_out(arm, rounding.actual_joints)
    )
    table |= _named_columns("xyz", rounding.actual + 0.0)
    table["error_mm"] = rounding.error
    within_limits = np.asarray(~limits.outside_limits(arm, q).any(axis=1))
    table["within_limits"] = within_limits
    within_travel = ~motors.outside_travel(arm, rounding.pulses).any(axis=1)
    return _named_columns(joint_columns(arm.joint_names), values) | table, within_limits & within_travel


def _named_columns(names: Sequence[str], values: NDArray[Any]) -> Table:
    return {name: np.ascontiguousarray(column) for name, column in zip(names, values.T, strict=True)}
