"""The command line speaks millimetres and degrees, the API millimetres and radians: the one crossing.

(The other one is the robot file's: `armkin.model.arm.build`.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

DEGREE = math.pi / 180
_ANGLES = ("theta", "phi", "roll", "pitch", "yaw")


def names(arm: Arm) -> list[str]:
    """Unit of each joint: "deg" or "mm"."""
    return ["mm" if sliding else "deg" for sliding in arm.prismatic]


def joints_in(arm: Arm, values: ArrayLike) -> Array:
    """Joint values (..., n) from [deg | mm] to [rad | mm]."""
    import numpy as np

    return np.asarray(values, dtype=float) * _scale(arm)


def joints_out(arm: Arm, q: ArrayLike) -> Array:
    """Joint values (..., n) from [rad | mm] to [deg | mm]."""
    import numpy as np

    return np.asarray(q, dtype=float) / _scale(arm) + 0.0  # + 0.0: no -0.0


def limits_out(arm: Arm) -> list[tuple[float, float]]:
    """Limits of each joint [deg | mm], as the robot file has them: 120 and not 119.99999999999999."""
    if arm.file is not None:
        return [(-math.inf, math.inf) if j.limits is None else j.limits for j in arm.file.joints]
    return list(zip(joints_out(arm, arm.lower).tolist(), joints_out(arm, arm.upper).tolist(), strict=True))


def home_out(arm: Arm) -> list[float]:
    """Home pose [deg | mm], as the robot file has it."""
    if arm.file is not None:
        return [joint.home for joint in arm.file.joints]
    return [float(value) for value in joints_out(arm, arm.home)]


def poses_out(arm: Arm) -> dict[str, list[float]]:
    """Named poses [deg | mm], home first, as the robot file has them."""
    if arm.file is not None:
        return {"home": home_out(arm), **{name: list(values) for name, values in (arm.file.poses or {}).items()}}
    return {name: joints_out(arm, q).tolist() for name, q in arm.poses.items()}


def angles_out(angles: ArrayLike) -> Array:
    """Angles from [rad] to [deg]."""
    import numpy as np

    return np.asarray(angles, dtype=float) / DEGREE + 0.0


def label_units(labels: Sequence[str]) -> list[str]:
    """Unit of each of a target's numbers: "mm", "deg", or "" for a direction's components."""
    return ["deg" if name in _ANGLES else "" if name in ("ax", "ay", "az") else "mm" for name in labels]


def targets_in(labels: Sequence[str], values: ArrayLike) -> Array:
    """Targets (..., m) of a task from [mm, deg] to what `armkin.ik` takes.

    labels: the task's names of the numbers; a pose becomes (..., 4, 4), with
    R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    import numpy as np

    numbers = np.asarray(values, dtype=float)
    if list(labels[3:]) == ["roll", "pitch", "yaw"]:
        from armkin.model.rotation import transform

        flat = [transform(row[:3], row[3:]) for row in numbers.reshape(-1, 6).tolist()]
        return np.array(flat).reshape(*numbers.shape[:-1], 4, 4)
    return numbers * [DEGREE if unit == "deg" else 1.0 for unit in label_units(labels)]


def _scale(arm: Arm) -> Array:
    import numpy as np

    return np.where(arm.prismatic, 1.0, DEGREE)
