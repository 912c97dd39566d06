"""A target between the numbers of a command line, a row of CSV or JSON [mm, deg] and what `armkin.ik` takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armkin.model.units import DEGREE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from armkin.formula.arrays import Array

_UNITS = dict.fromkeys(("theta", "phi", "roll", "pitch", "yaw"), "deg") | dict.fromkeys(("ax", "ay", "az"), "")


def label_units(labels: Sequence[str]) -> list[str]:
    """Unit of each of a target's numbers: "mm", "deg", or "" for a direction's components."""
    return [_UNITS.get(name, "mm") for name in labels]


def targets_in(labels: Sequence[str], values: ArrayLike) -> Array:
    """Targets (..., m) of a task from [mm, deg] to what `armkin.ik` takes.

    labels: the task's names of the numbers; a pose becomes (..., 4, 4), with
    R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    import numpy as np

    numbers = np.asarray(values, dtype=float)
    if list(labels[3:]) == ["roll", "pitch", "yaw"]:
        from armkin.model.rotation import transforms

        return transforms(numbers[..., :3], numbers[..., 3:])
    return numbers * label_scale(labels)


def targets_out(labels: Sequence[str], targets: Array) -> list[list[float]]:
    """Targets (N, m) or (N, 4, 4), as `armkin.ik` takes them, in the command line's numbers [mm, deg]."""
    import numpy as np

    if targets.ndim == 3:
        from armkin.model.rotation import rpy

        targets = np.concatenate([targets[:, :3, 3], rpy(targets[:, :3, :3])], axis=1)
    return [list(row) for row in (targets / label_scale(labels) + 0.0).tolist()]


def label_scale(labels: Sequence[str]) -> list[float]:
    """What one unit of each of a target's numbers is in [mm, rad, 1]."""
    return [DEGREE if unit == "deg" else 1.0 for unit in label_units(labels)]
