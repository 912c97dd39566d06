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
    """Bodies with their segments in the frames that they move with, pairs left out, hits at home."""
    held = guard(arm)
    form = held.bodies
    home = arm.home[None]
    placed, begin, end = frames(arm, home)[0], *segment_ends(arm, home)
    bodies = []
    for k, name in enumerate(form.names):
        T = placed[k]  # base, then every joint's frame
        segments: list[dict[str, Any]] = []
        for s in np.flatnonzero(form.owner == k):
            ends_in_frame = [(T[:3, :3].T @ (point[:, s, 0] - T[:3, 3]) + 0.0).tolist() for point in (begin, end)]
            segments.append(
                {"from": ends_in_frame[0], "to": ends_in_frame[1], **({"slide": True} if form.slide[s] else {})}
            )
        radius, assumed = float(form.radius[k]), bool(form.assumed[k])
        bodies.append({"name": name, "radius_mm": radius, "assumed": assumed, "segments": segments})
    [(_, at_home)] = hits(arm, home)
    return {
        "clearance_mm": arm.clearance,
        "keep_out": keep_out_names(arm.keep_out),
        "bodies": bodies,
        "pairs_left_out": [list(pair) for pair in held.left_out],
        "hits_at_home": at_home,
    }
