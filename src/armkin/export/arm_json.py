"""An arm as plain numbers, for other programs: one JSON object in mm and degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.export import conventions
from armkin.model import units

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_IDENTITY = {"xyz": [0, 0, 0], "rpy": [0, 0, 0]}


def arm_numbers(arm: Arm) -> dict[str, Any]:
    """Joints with their screws, limits and speeds, DH tables where there are any, the chain's matrices.

    `links`: the tool's pose is links[0] Z1(ratio1 q1) links[1] ... Zn(ratio_n q_n) links[n], Z = Rz or Tz.
    """
    screws = conventions.screws(arm)
    return {
        "length_unit": "mm",
        "angle_unit": "deg",
        "joints": _joint_objects(arm, [joint["screw"] for joint in screws["joints"]]),
        "base": arm.base.tolist(),
        "zero_pose": screws["zero_pose"],
        "tool": screws.get("tool", _IDENTITY),
        "links": arm.link.tolist(),
        "dh_standard": _dh_table(arm, modified=False),
        "dh_modified": _dh_table(arm, modified=True),
    }


def _joint_objects(arm: Arm, screws: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Each joint's name, screw, limits and speeds [deg | mm, per s, per s2]; None for numbers that it has not."""
    limits, home, unit = units.limits_out(arm), units.home_out(arm), units.unit_names(arm)
    speeds, accels = (units.joints_out(arm, values).tolist() for values in (arm.max_speed, arm.max_accel))
    joints = []
    for i, name in enumerate(arm.joint_names):
        joint = {
            "name": name,
            "type": "prismatic" if arm.prismatic[i] else "revolute",
            "unit": unit[i],
            "screw": screws[i],
            "sign": int(arm.dh_sign[i]),
            "ratio": float(arm.ratio[i]),
            "limits": list(limits[i]) if np.isfinite(limits[i]).all() else None,
            "home": home[i],
            "max_speed": None if np.isnan(speeds[i]) else speeds[i],
            "max_accel": None if np.isnan(accels[i]) else accels[i],
        }
        joints.append(joint)
    return joints


def _dh_table(arm: Arm, *, modified: bool) -> dict[str, Any] | None:
    """A DH table with its base and tool, or None if there is none."""
    try:
        keys = conventions.dh(arm, modified=modified)
    except UsageError:
        return None
    rows = [joint["dh"] for joint in keys["joints"]]
    return {"base": keys.get("base", _IDENTITY), "rows": rows, "tool": keys.get("tool", _IDENTITY)}
