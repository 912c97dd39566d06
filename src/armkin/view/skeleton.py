"""An arm's pose as lines and points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.formula.arrays import Array
from armkin.forward import as_joints
from armkin.model.rotation import rotation_about

if TYPE_CHECKING:
    from armkin.model.arm import Arm


@dataclass(frozen=True)
class Skeleton:
    """One pose of an arm; all positions in mm."""

    path: Array  # (P, 3) corners from the base to the tip
    joints: Array  # (n, 3) a point on every joint's axis
    axes: Array  # (n, 3) direction of every joint's axis
    slides: list[Array]  # (2, 3) each: how far a prismatic joint is out

    @property
    def tip(self) -> Array:
        """(3,)"""
        return np.asarray(self.path[-1])


def skeleton(arm: Arm, q: ArrayLike) -> Skeleton:
    """The lines of a pose q (n,) [rad | mm].

    A link leads first along its joint's axis (d of a DH row) and then straight to the next joint
    (a of the row), as real arms are built.
    """
    values = as_joints(arm, q)
    T = arm.link[0]
    path, joints, axes, slides = [arm.base[:3, 3], T[:3, 3]], [], [], []
    for i, value in enumerate(values * arm.ratio):
        z, start = T[:3, 2], T[:3, 3]
        joints.append(start)
        axes.append(z)
        move = np.eye(4)
        if arm.prismatic[i]:
            move[2, 3] = value
            path.append(start + value * z)
            slides.append(np.array([start, path[-1]]))
        else:
            move[:3, :3] = rotation_about(2, value)
        T = T @ move
        path.append(T[:3, 3] + arm.link[i + 1][2, 3] * z)
        T = T @ arm.link[i + 1]
        path.append(T[:3, 3])
    keep = [0] + [k for k in range(1, len(path)) if np.linalg.norm(path[k] - path[k - 1]) > 1e-9 * arm.reach]
    return Skeleton(np.array(path)[keep], np.array(joints), np.array(axes), slides)
