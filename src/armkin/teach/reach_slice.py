"""Where the arm reaches in the plane of its links, with which share of orientations, as cubic voxels for the page."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from armkin.model.lock import lock
from armkin.reachability import voxels
from armkin.reachability.map import reach
from armkin.teach.scene import first_lock

if TYPE_CHECKING:
    from armkin.model.arm import Arm

ACROSS = 12  # voxels from joint 1's axis to the end of the reach
DIRECTIONS = 12  # of the tool's z axis, in each voxel


@lru_cache(maxsize=4)
def reach_slice(arm: Arm) -> dict[str, Any]:
    """size [mm]; frame: the reach frame (4, 4); centres in it [mm], three numbers a voxel; shares above 0; of: how
    many orientations a voxel was asked for; held: the joint that stays at home, of an arm with one more than its task.

    Raises UsageError for an arm without a task of its own.
    """
    held = first_lock(arm)
    asked = arm if held is None else lock(arm, {held: float(arm.home[arm.joint_names.index(held)])})
    found = reach(
        asked, grid=arm.reach / ACROSS, azimuths=2, directions=DIRECTIONS, rolls=1, measures=False
    )  # azimuths 0 and 180 degrees alone: the plane
    plane = voxels.section(found.grid)
    share = found.columns["share"][plane.row]
    there = share > 0
    return {
        "size": found.grid.step,
        "frame": found.grid.frame.tolist(),
        "centres": plane.centres[there].round(3).ravel().tolist(),
        "shares": share[there].round(4).tolist(),
        "of": found.orientations,
        "held": held,
    }
