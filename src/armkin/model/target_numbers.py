"""Converts targets between numbers of the command line, CSV or JSON [mm, deg] and targets of `armkin.ik`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armkin.model.units import DEGREE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from armkin.formula.arrays import Array

_UNITS = dict.fromkeys(("theta", "phi", "roll", "pitch", "yaw"), "deg") | dict.fromkeys(("ax", "ay", "az"), "")


def label_units(labels: Sequence[str]) -> list[str]:
    """Unit of each number of a target: "mm", "deg", or "" for components of a direction."""
    return [_UNITS.get(name, "mm") for name in labels]


def targets_in(labels: Sequence[str], values: ArrayLike) -> Array:
    """Targets of `armkin.ik` from numbers (..., m) of a task [mm, deg].

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
    """Numbers of the command line [mm, deg] from targets (N, m) or (N, 4, 4) of `armkin.ik`."""
    import numpy as np

    if targets.ndim == 3:
        from armkin.model.rotation import rpy

        targets = np.concatenate([targets[:, :3, 3], rpy(targets[:, :3, :3])], axis=1)
    return [list(row) for row in (targets / label_scale(labels) + 0.0).tolist()]


def label_scale(labels: Sequence[str]) -> list[float]:
    """The size of the unit of each number of a target [mm, rad, 1]."""
    return [DEGREE if unit == "deg" else 1.0 for unit in label_units(labels)]
