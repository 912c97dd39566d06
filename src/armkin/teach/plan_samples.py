"""A plan as the page plays it: between its samples joints go evenly, and the tip shown is off by a bounded length."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.forward import fk
from armkin.model import units
from armkin.motion.plan.playback_times import sample_times

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

SHOWN_DISTANCE = 0.2  # distance [mm] that the tip shown may be off where it is looked at, for less than 0.5 in between
MAX_SAMPLES = 160_000  # samples, at most, of some 80 bytes; a plan that needs more is shown less exactly, as is said


def playback_json(arm: Arm, plan: PathPlan) -> dict[str, Any]:
    """Joint values over time, the tip's way, speeds as shares of the limits; `shown_mm`: what the tip shown is off.

    `approach_s`: of the joint move that comes before it, from where the arm stands to its start.
    """
    begins = [] if plan.trajectory is None else plan.trajectory.begins.tolist()
    t, deviation = sample_times(arm, plan, begins, SHOWN_DISTANCE, MAX_SAMPLES)
    q = plan.q(t)
    with np.errstate(invalid="ignore"):
        shares = np.nan_to_num(np.abs(plan.qd(t)) / arm.max_speed)
    return {
        "duration_s": plan.duration,
        "approach_s": 0.0 if plan.approach is None else plan.approach.duration,
        "length_mm": plan.length,
        "shown_mm": deviation,
        "time": t.round(4).tolist(),
        "joints": units.joints_out(arm, q).round(5).tolist(),
        "tips": fk(arm, q)[:, :3, 3].round(3).tolist(),
        "shares": shares.round(4).T.tolist(),
        "stops": [round(begin, 4) for begin in begins],
    }
