"""Exports an arm as numbers for other programs: a JSON object in mm and degrees."""

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
    """Joints with their screws, limits and speeds, DH tables if they exist, and the matrices of the chain.

    The tool's pose by `links` is links[0] Z1(ratio1 q1) links[1] ... Zn(ratio_n q_n) links[n] with Z = Rz or Tz.
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
    """Name, screw, limits and speeds [deg | mm, per s, per s2] of each joint; None for missing numbers."""
    limits, home, unit = units.limits_out(arm), units.home_out(arm), units.unit_names(arm)
    speeds, accels = (units.joints_out(arm, values).tolist() for values in (arm.max_speed, arm.max_accel))
    joints = []
    for index, name in enumerate(arm.joint_names):
        joint = {
            "name": name,
            "type": "prismatic" if arm.prismatic[index] else "revolute",
            "unit": unit[index],
            "screw": screws[index],
            "sign": int(arm.dh_sign[index]),
            "ratio": float(arm.ratio[index]),
            "limits": list(limits[index]) if np.isfinite(limits[index]).all() else None,
            "home": home[index],
            "max_speed": None if np.isnan(speeds[index]) else speeds[index],
            "max_accel": None if np.isnan(accels[index]) else accels[index],
        }
        joints.append(joint)
    return joints


def _dh_table(arm: Arm, *, modified: bool) -> dict[str, Any] | None:
    """A DH table with its base and tool, or None if the arm has none."""
    try:
        keys = conventions.dh(arm, modified=modified)
    except UsageError:
        return None
    rows = [joint["dh"] for joint in keys["joints"]]
    return {"base": keys.get("base", _IDENTITY), "rows": rows, "tool": keys.get("tool", _IDENTITY)}
