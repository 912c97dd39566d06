"""Converts millimetres and degrees of the command line and JSON to millimetres and radians of the API, and back.

(The robot file's degrees are converted by `armkin.model.build_arm`.)
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

DEGREE = math.pi / 180  # degree [rad]
TURN = 2 * math.pi  # whole turn [rad]

JointUnits = Annotated[list[str], "unit of each joint value: deg or mm"]


def unit_names(arm: Arm) -> list[str]:
    """Unit of each joint: "deg" or "mm"."""
    return ["mm" if sliding else "deg" for sliding in arm.prismatic]


def joints_in(arm: Arm, values: ArrayLike) -> Array:
    """Joint values (..., n) from [deg | mm] to [rad | mm]."""
    import numpy as np

    return np.asarray(values, dtype=float) * joint_scale(arm)


def joints_out(arm: Arm, q: ArrayLike) -> Array:
    """Joint values (..., n) from [rad | mm] to [deg | mm]."""
    import numpy as np

    return np.asarray(q, dtype=float) / joint_scale(arm) + 0.0  # + 0.0 turns -0.0 into 0.0


def joint_as_typed(arm: Arm, joint: int, value: float) -> float:
    """One joint value from [rad | mm] to [deg | mm], with the fewest digits that give it: as it was typed."""
    return _shortest_number(float(value), float(joint_scale(arm)[joint]))


def limits_out(arm: Arm) -> list[tuple[float, float]]:
    """Limits of each joint [deg | mm], as in the robot file: 120 instead of 119.99999999999999."""
    return list(_limits_out(arm))


def home_out(arm: Arm) -> list[float]:
    """Home pose [deg | mm], as in the robot file."""
    return poses_out(arm)["home"]


def poses_out(arm: Arm) -> dict[str, list[float]]:
    """Named poses [deg | mm], home first, as in the robot file."""
    return {name: list(values) for name, values in _poses_out(arm)}


@lru_cache(maxsize=256)
def _limits_out(arm: Arm) -> tuple[tuple[float, float], ...]:
    return tuple(zip(_as_written(arm, arm.lower), _as_written(arm, arm.upper), strict=True))


@lru_cache(maxsize=256)
def _poses_out(arm: Arm) -> tuple[tuple[str, tuple[float, ...]], ...]:
    return tuple((name, _as_written(arm, q)) for name, q in arm.poses.items())


def _as_written(arm: Arm, q: Array) -> tuple[float, ...]:
    """Joint values [deg | mm] with the fewest digits that give q, as written in a file before the conversion."""
    return tuple(
        _shortest_number(value, unit) for value, unit in zip(q.tolist(), joint_scale(arm).tolist(), strict=True)
    )


def _shortest_number(value: float, unit: float) -> float:
    exact = value / unit + 0.0  # + 0.0: no -0.0
    candidates = (float(f"{exact:.{digits}g}") for digits in range(6, 17))
    return next((number for number in candidates if number * unit == value), exact)


def angles_out(angles: ArrayLike) -> Array:
    """Angles from [rad] to [deg]."""
    import numpy as np

    return np.asarray(angles, dtype=float) / DEGREE + 0.0


def finite_or_none(value: float) -> float | None:
    """A number for JSON; None for infinity and nan, which JSON does not have."""
    return float(value) if math.isfinite(value) else None


def joint_scale(arm: Arm) -> Array:
    """The size of the unit of each joint, a degree or a millimetre, in [rad | mm]: (n,)."""
    import numpy as np

    return np.where(arm.prismatic, 1.0, DEGREE)


@lru_cache(maxsize=256)
def radian_or_reach(arm: Arm) -> Array:
    """Units to compare motions of joints: a radian, or the reach [mm] for a prismatic joint: (n,), read-only."""
    import numpy as np

    unit = np.where(arm.prismatic, arm.reach, 1.0)
    unit.flags.writeable = False
    return unit
