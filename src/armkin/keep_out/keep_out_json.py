"""What `armkin info` tells of an arm's keep-outs, as JSON in mm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.forward import frames
from armkin.keep_out.bodies import segment_ends
from armkin.keep_out.body_pairs import guard
from armkin.keep_out.clearance import hits
from armkin.robot_file.keep_out_keys import keep_out_names

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def keep_out_fields(arm: Arm) -> dict[str, Any]:
    """Bodies with their segments in the frames that they move with, ignored pairs, and hits at home."""
    arm_guard = guard(arm)
    arm_bodies = arm_guard.bodies
    home = arm.home[None]
    poses, begin, end = frames(arm, home)[0], *segment_ends(arm, home)
    bodies = []
    for body, name in enumerate(arm_bodies.names):
        T = poses[body]  # the base's frame, then the joints'
        segments: list[dict[str, Any]] = []
        for segment in np.flatnonzero(arm_bodies.owner == body):
            ends_in_frame = [(T[:3, :3].T @ (point[:, segment, 0] - T[:3, 3]) + 0.0).tolist() for point in (begin, end)]
            fields: dict[str, Any] = {"from": ends_in_frame[0], "to": ends_in_frame[1]}
            segments.append(fields | {"slide": True} if arm_bodies.slide[segment] else fields)
        radius, is_assumed = float(arm_bodies.radius[body]), bool(arm_bodies.assumed[body])
        bodies.append({"name": name, "radius_mm": radius, "assumed": is_assumed, "segments": segments})
    [(_, hits_at_home)] = hits(arm, home)
    return {
        "clearance_mm": arm.clearance,
        "keep_out": keep_out_names(arm.keep_out),
        "bodies": bodies,
        "pairs_left_out": [list(pair) for pair in arm_guard.left_out],
        "hits_at_home": hits_at_home,
    }
