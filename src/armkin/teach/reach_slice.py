"""The reach in the plane of the arm's links, as cubic voxels with the share of orientations reached, for the page."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.solve import ik
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, move_targets, redundancy
from armkin.inverse.tasks.task import distance
from armkin.keep_out.clearance import hits_nothing
from armkin.model.arm import actual_arm
from armkin.reachability import voxels
from armkin.reachability.reach_cells import Grid
from armkin.reachability.reach_map import reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

VOXELS_ACROSS = 12  # voxels from joint 1's axis to the end of the reach
DIRECTION_COUNT = 12  # directions of the tool's z axis in each voxel
VALUE_COUNT = 12  # values of the redundant joint if the other joints have a closed form; else only home


@lru_cache(maxsize=4)
def reach_slice(arm: Arm) -> dict[str, Any]:
    """size [mm]; frame: the reach frame (4, 4); centres in it [mm], three numbers a voxel; shares above 0; of: how
    many orientations a voxel was asked for; held: the redundant joint, of an arm with one more than its task, else
    None; values: of how many of its values one at least must reach.

    Raises UsageError for an arm without a task of its own.
    """
    real_arm = actual_arm(arm)
    redundant = redundancy(real_arm, None)
    step = arm.reach / VOXELS_ACROSS
    if redundant is None:  # azimuths 0 and 180 degrees alone: the plane
        reach_map = reach(arm, grid=step, azimuths=2, directions=DIRECTION_COUNT, rolls=1, measures=False)
        grid, shares, values = reach_map.grid, reach_map.columns["share"], 0
    else:
        grid = Grid(arm=real_arm, step=step, azimuths=2, directions=DIRECTION_COUNT, rolls=1, tool_down=False)
        values_held = _held_values(real_arm, redundant)
        shares, values = _reached_shares(grid, redundant, values_held), len(values_held)
    plane = voxels.section_layer(grid)
    share = shares[plane.row]
    is_reached = share > 0
    return {
        "size": grid.step,
        "frame": grid.frame.tolist(),
        "centres": plane.centres[is_reached].round(3).ravel().tolist(),
        "shares": share[is_reached].round(4).tolist(),
        "of": grid.orientations,
        "held": None if redundant is None else arm.joint_names[redundant.joint],
        "values": values,
    }


def _held_values(arm: Arm, redundant: Redundancy) -> Array:
    """Values of the redundant joint to test [rad], home first."""
    low, high, home = (float(limit[redundant.joint]) for limit in (arm.lower, arm.upper, arm.home))
    if not redundant.by_formula:
        return np.array([home])
    low, high = (low if np.isfinite(low) else home - np.pi), (high if np.isfinite(high) else home + np.pi)
    return np.append(home, np.linspace(low, high, VALUE_COUNT - 1))


def _reached_shares(grid: Grid, redundant: Redundancy, values: Array) -> Array:
    """The share of each cell's orientations that are reached without a hit at one of the values."""
    arm, joint = grid.arm, redundant.joint
    M, count = grid.azimuths, grid.orientations
    centres = np.repeat(grid.rings, M * count, axis=0)
    azimuth = np.tile(np.repeat(np.arange(M) * (2 * np.pi / M), count), len(grid.rings))
    target = grid.targets(centres, azimuth, np.arange(len(centres)) % count, np.zeros(len(centres)))
    is_reached = np.zeros(len(target), bool)
    near_enough = distance(arm, redundant.task, target) <= 1.0
    for value in values:
        unreached_rows = np.flatnonzero(near_enough & ~is_reached)
        solutions = ik(
            redundant.rest,
            move_targets(arm, redundant, target[unreached_rows], np.full(len(unreached_rows), value)),
            redundant.task.name,
            examine=False,
        )
        is_legal = solutions.within_limits
        if arm.keep_out:
            is_legal = is_legal & hits_nothing(
                arm, np.insert(np.where(is_legal[:, :, None], solutions.q, np.nan), joint, value, axis=2)
            )
        is_reached[unreached_rows] = is_legal.any(axis=1)
    return np.asarray(is_reached.reshape(-1, count).mean(axis=1))
