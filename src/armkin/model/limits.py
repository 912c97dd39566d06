"""Joint limits: which joints are outside, and texts about them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.model.units import DEGREE, finite_or_none, joint_as_typed, limits_out

if TYPE_CHECKING:
    from armkin.model.arm import Arm

SLACK = 1e-9  # distance [rad | mm] outside a limit up to which a joint counts as at the limit


def outside_limits(arm: Arm, q: ArrayLike) -> NDArray[np.bool_]:
    """Which joints are outside their limits.

    q: (..., n) [rad | mm]. Returns (..., n); a joint without limits is never outside.

    >>> import armkin, numpy as np
    >>> outside_limits(armkin.load("robots/three_dof.yaml"), np.deg2rad([0, 121, 0])).tolist()
    [False, True, False]
    """
    values = np.asarray(q, dtype=float)
    return (values < arm.lower - SLACK) | (values > arm.upper + SLACK)


def principal_values(value: Array) -> Array:
    """Values [rad] in [-pi, pi], with half a turn as +pi."""
    if value.min(initial=0.0) >= SLACK - np.pi:
        return value
    return np.where(value < SLACK - np.pi, value + 2.0 * np.pi, value)


def limit_fields(arm: Arm, joint: int, value: float) -> dict[str, Any]:
    """Fields of an error about a joint outside its limits: joint, value, lower, upper [deg | mm], None if unlimited."""
    lower, upper = map(finite_or_none, limits_out(arm)[joint])
    return {"joint": arm.joint_names[joint], "value": joint_as_typed(arm, joint, value), "lower": lower, "upper": upper}


def outside_text(arm: Arm, joint: int, value: float) -> str:
    """A text about a joint outside its limits.

    value: [rad | mm].

    >>> import armkin, math
    >>> outside_text(armkin.load("robots/three_dof.yaml"), 1, math.radians(130))
    'q2 = 130 deg is outside -20 to 120 deg'
    """
    size, unit = (1.0, "mm") if arm.prismatic[joint] else (DEGREE, "deg")
    ends = (arm.lower[joint], arm.upper[joint])
    low, high = (f"{end / size + 0.0:.10g}" if math.isfinite(end) else "any" for end in ends)
    return f"{arm.joint_names[joint]} = {value / size:.10g} {unit} is outside {low} to {high} {unit}"


def check_limits(arm: Arm, targets: NDArray[np.float64]) -> None:
    """Raise NoSolutionError, naming row and joint, if a target (w, n) is outside the joint limits.

    A straight line between two postures within the limits is within them, too.
    """
    if targets.shape[-1] != arm.n:
        raise UsageError(f"{arm.name} has {arm.n} joints: expected {arm.n} values, got {targets.shape[-1]}")
    if not np.all(np.isfinite(targets)):
        raise UsageError("joint values must be finite to be sent")
    for row, joint in np.argwhere(outside_limits(arm, targets)):
        waypoint = f"waypoint {row + 1}: " if len(targets) > 1 else ""
        value = targets[row, joint]
        raise NoSolutionError(
            f"{waypoint}{outside_text(arm, joint, value)}: nothing was moved", **limit_fields(arm, joint, value)
        )
