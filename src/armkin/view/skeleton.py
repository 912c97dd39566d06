"""An arm from its axes: rigid bodies that do not depend on the pose, and a pose's lines and points.

Body 0 is at the base. Body i is given in the frame after joint i, whose z is the axis of the joint. It goes along that
axis to the foot of the common normal with the next axis, and then along the normal, as real arms are built.
"""

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

_NEARLY_PARALLEL = 0.05  # sine of the angle between two axes below which their common normal is not used


@dataclass(frozen=True)
class Shape:
    """The bodies of an arm; lengths in mm."""

    bodies: tuple[Array, ...]  # n + 1 of (P, 3): corners of body i in the frame after joint i; body 0 in the world's
    joint_offsets: Array  # (n,) position of each joint along its own axis


@dataclass(frozen=True)
class Skeleton:
    """One pose of an arm; all positions in mm."""

    path: Array  # (P, 3) corners from the base to the tip
    joints: Array  # (n, 3) a point on every joint's axis
    axes: Array  # (n, 3) direction of every joint's axis
    slides: list[Array]  # (2, 3) each: both ends of the motion of a prismatic joint

    @property
    def tip(self) -> Array:
        """Position of the tip (3,) [mm]."""
        return np.asarray(self.path[-1])


def arm_shape(arm: Arm) -> Shape:
    """The bodies of an arm.

    >>> import armkin
    >>> [body.round(6)[-1].tolist() for body in arm_shape(armkin.load("robots/yaw_two_link.yaml")).bodies][1:]
    [[0.0, 0.0, 660.0], [430.0, 0.0, 0.0], [430.0, 0.0, 0.0]]
    """
    bodies = [np.array([arm.base[:3, 3], arm.link[0][:3, 3]])]
    offsets = np.zeros(arm.n)
    for joint in range(arm.n):
        link = arm.link[joint + 1]
        foot, offset = (link[2, 3], 0.0) if joint + 1 == arm.n else _normal_feet(link)
        corner = link[:3, 3] + offset * link[:3, 2]
        bodies.append(np.array([[0.0, 0.0, offsets[joint]], [0.0, 0.0, foot], corner]))
        if joint + 1 < arm.n:
            offsets[joint + 1] = offset
    return Shape(tuple(bodies), offsets)


def skeleton(arm: Arm, q: ArrayLike) -> Skeleton:
    """The lines of a pose q (n,) [rad | mm]."""
    values, shape = as_joints(arm, q), arm_shape(arm)
    T = arm.link[0]
    path = [*shape.bodies[0]]
    joints, axes, slides = [], [], []
    for index, value in enumerate(values * arm.ratio):
        z = T[:3, 2]
        joint = T[:3, 3] + shape.joint_offsets[index] * z
        joints.append(joint)
        axes.append(z)
        move = np.eye(4)
        if arm.prismatic[index]:
            move[2, 3] = value
            slides.append(np.array([joint, joint + value * z]))
        else:
            move[:3, :3] = rotation_about(2, value)
        T = T @ move
        path.extend(shape.bodies[index + 1] @ T[:3, :3].T + T[:3, 3])
        T = T @ arm.link[index + 1]
    kept_corners = [0] + [k for k in range(1, len(path)) if np.linalg.norm(path[k] - path[k - 1]) > 1e-9 * arm.reach]
    return Skeleton(np.array(path)[kept_corners], np.array(joints), np.array(axes), slides)


def _normal_feet(link: Array) -> tuple[float, float]:
    """Positions of the feet of the common normal on two joint axes, from the origins of their frames [mm].

    The axes are the z axes of the frames before and after `link`. For nearly parallel axes the origins of the
    frames count, which a DH row puts on a common normal.
    """
    z, p = link[:3, 2], link[:3, 3]
    squared_sine = 1.0 - z[2] ** 2  # squared sine of the angle between the axes
    if squared_sine < _NEARLY_PARALLEL**2:
        return float(link[2, 3]), 0.0
    # |a e3 - p - b z| is least where both derivatives vanish: a - b z3 = p3, a z3 - b = p z.
    projection = float(p @ z)
    return float((p[2] - z[2] * projection) / squared_sine), float((z[2] * p[2] - projection) / squared_sine)
