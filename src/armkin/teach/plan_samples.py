"""Samples of a plan for playback: joints are interpolated linearly, with a bounded error of the tip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.forward import fk
from armkin.model import units
from armkin.motion.plan.playback_times import sample_times

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

SHOWN_DISTANCE = 0.2  # largest error [mm] of the tip at tested times, below 0.5 between them
MAX_SAMPLES = 160_000  # most samples, of some 80 bytes each; longer plans are less exact


def playback_json(arm: Arm, plan: PathPlan) -> dict[str, Any]:
    """Joint values over time, tip positions, speeds as shares of the limits; `shown_mm`: largest error of the tip.

    `approach_s`: duration of the joint move from the arm's position to the start.
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
