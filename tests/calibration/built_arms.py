"""Built arms for tests: a table with errors in it, and a workshop that measures it.

The truth is made without armkin's calibration: rows of the DH table, offsets and a base are changed, ratios are applied
to what is commanded. Sizes as in the bars: lengths 0.5 mm, twists 0.2 deg, zeros 1 deg, ratios 0.2 %, base 20 mm and
3 deg (standard deviations; the base's in all).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armkin
from armkin import robot_file
from armkin.export import conventions
from armkin.model.build_arm import arm_of_file
from armkin.robot_file.robot_file_text import format_robot_file

Array = NDArray[np.float64]


@dataclass
class Built:
    """An arm as it was built, which nobody knows."""

    arm: armkin.Arm  # with the errors
    ratio: Array

    def tips(self, c: Array) -> Array:
        """True tips (M, 3) for commanded values (M, n)."""
        return armkin.fk(self.arm, c * self.ratio)[:, :3, 3]

    def poses(self, c: Array) -> Array:
        return armkin.fk(self.arm, c * self.ratio)


def build_real_arm(arm: armkin.Arm, seed: int, *, base: bool = True) -> Built:
    """A built arm: every number of its table a bit off."""
    rng = np.random.default_rng(seed)
    data: dict[str, Any] = conventions.dh(arm)
    joints = []
    for joint in data["joints"]:
        row = dict(joint["dh"])
        for key, error in (("a", 0.5), ("d", 0.5), ("alpha", 0.2), ("theta", 1.0)):
            row[key] += error * rng.normal()
        joints.append({key: value for key, value in joint.items() if key not in ("limits", "home")} | {"dh": row})
    base_pose = data.get("base", {"xyz": [0, 0, 0], "rpy": [0, 0, 0]})
    shift = (20 / np.sqrt(3) if base else 0.0) * rng.normal(size=3)
    turn = (3 / np.sqrt(3) if base else 0.0) * rng.normal(size=3)
    changed = {
        "xyz": [float(x) for x in np.add(base_pose["xyz"], shift)],
        "rpy": [float(x) for x in np.add(base_pose["rpy"], turn)],
    }
    keep = {key: value for key, value in data.items() if key in ("name", "convention", "tool")}
    real_arm = arm_of_file(robot_file.parse_robot_file(format_robot_file({**keep, "base": changed, "joints": joints})))
    return Built(real_arm, 1.0 + 0.002 * rng.normal(size=arm.n))


def random_commands(arm: armkin.Arm, count: int, rng: np.random.Generator) -> Array:
    """Random commanded values within limits."""
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    return rng.uniform(low, high, (count, arm.n))


def measure_tips(
    real_arm: Built, c: Array, rng: np.random.Generator, *, noise: float = 0.1, wrong: float = 0.05
) -> Array:
    """Tips as measured: with noise [mm] a coordinate, and a share of rows wrong by 5 mm."""
    x = real_arm.tips(c) + rng.normal(size=(len(c), 3)) * noise
    bad = rng.choice(len(c), round(wrong * len(c)), replace=False)
    direction = rng.normal(size=(len(bad), 3))
    x[bad] += 5 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return x


def rms_distance(a: Array, b: Array) -> float:
    """Root mean square distance of points (M, 3)."""
    return float(np.sqrt(((a - b) ** 2).sum(axis=1).mean()))
