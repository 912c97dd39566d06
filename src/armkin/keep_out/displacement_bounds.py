"""How far a body moves at most when joints do: no farther than the sum of |dq_j| times its lever on axis j."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.keep_out.body_pairs import Guard


def levers(guard: Guard, slide_out: Array) -> Array:
    """How far the bodies of every pair come nearer, at most, for a unit of each joint: (n, pairs) [mm/rad, mm/mm].

    out: (n,) [mm] how far a slide is out at most during the motion. Seen from the earlier body (an obstacle: from
    the base) only the joints after it move the later one. A point's distance from axis j is at most the way that
    leads from that axis to it along the chain, each link stretched out; of the first link only the part across
    the axis counts.
    """
    arm, form = guard.arm, guard.bodies
    by_pair = np.zeros((arm.n, len(guard.pairs)))
    of_body = {body: _body_levers(guard, body, slide_out) for body in {pair.body for pair in guard.pairs}}
    for k, pair in enumerate(guard.pairs):
        by_pair[pair.other or 0 :, k] = of_body[pair.body][pair.other or 0 :]
        if pair.other and (form.slide & (form.owner == pair.other)).any():
            by_pair[pair.other - 1, k] = 1.0  # the earlier body's slide grows, seen from its own end
    return by_pair * np.abs(arm.ratio)[:, None]


def _body_levers(guard: Guard, body: int, slide_out: Array) -> Array:
    """Levers of a body on every axis: (n,); 0 on those behind it."""
    arm, form = guard.arm, guard.bodies
    is_own = form.owner == body
    ends = np.concatenate([form.end[is_own], form.begin[is_own & ~form.slide]])
    across, far = float(np.hypot(ends[:, 0], ends[:, 1]).max()), float(np.linalg.norm(ends, axis=1).max())
    by_axis = np.zeros(arm.n)
    for j in range(body - 1, -1, -1):  # axis j is joint j + 1's: `across` it, and `far` from its origin
        by_axis[j] = 1.0 if arm.prismatic[j] else across
        if arm.prismatic[j]:
            far += slide_out[j] * abs(float(arm.ratio[j]))
        if j == body - 1 and (is_own & form.slide).any():  # where a slide begins stands before its motion
            starts = form.begin[is_own & form.slide]
            far = max(far, float(np.linalg.norm(starts, axis=1).max()))
        shift = arm.link[j][:3, 3]
        across = float(np.hypot(shift[0], shift[1])) + far
        far += float(np.linalg.norm(shift))
    return by_axis
