"""Bounds of the displacement of a body: the sum over all joints of |dq_j| times the body's lever on axis j."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.keep_out.body_pairs import Guard


def approach_rates(guard: Guard, slide_out: Array) -> Array:
    """The greatest approach of the bodies of every pair for a unit of each joint: (n, pairs) [mm/rad, mm/mm].

    slide_out: (n,) [mm] greatest extension of each prismatic joint during the motion. Relative to the earlier body (for
    an obstacle, to the base), only the joints after it move the later body. The distance of a point from axis j is at
    most the sum of the lengths of the links between them; the first link counts with its part normal to the axis.
    """
    arm, arm_bodies = guard.arm, guard.bodies
    by_pair = np.zeros((arm.n, len(guard.pairs)))
    levers_of_body = {body: _body_levers(guard, body, slide_out) for body in {pair.body for pair in guard.pairs}}
    for column, pair in enumerate(guard.pairs):
        by_pair[pair.other or 0 :, column] = levers_of_body[pair.body][pair.other or 0 :]
        if pair.other and (arm_bodies.slide & (arm_bodies.owner == pair.other)).any():
            by_pair[pair.other - 1, column] = 1.0  # the growing segment of the earlier body may reach the later one
    return by_pair * np.abs(arm.ratio)[:, None]


def _body_levers(guard: Guard, body: int, slide_out: Array) -> Array:
    """Levers of a body on every axis: (n,); 0 for the axes after it."""
    arm, arm_bodies = guard.arm, guard.bodies
    is_own = arm_bodies.owner == body
    ends = np.concatenate([arm_bodies.end[is_own], arm_bodies.begin[is_own & ~arm_bodies.slide]])
    radial, length = float(np.hypot(ends[:, 0], ends[:, 1]).max()), float(np.linalg.norm(ends, axis=1).max())
    by_axis = np.zeros(arm.n)
    for joint in range(body - 1, -1, -1):  # `radial` from the joint's axis, `length` from its origin
        by_axis[joint] = 1.0 if arm.prismatic[joint] else radial
        if arm.prismatic[joint]:
            length += slide_out[joint] * abs(float(arm.ratio[joint]))
        # a growing segment begins in the frame before the motion
        if joint == body - 1 and (is_own & arm_bodies.slide).any():
            starts = arm_bodies.begin[is_own & arm_bodies.slide]
            length = max(length, float(np.linalg.norm(starts, axis=1).max()))
        shift = arm.link[joint][:3, 3]
        radial = float(np.hypot(shift[0], shift[1])) + length
        length += float(np.linalg.norm(shift))
    return by_axis
