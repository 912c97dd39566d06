"""A plan as the page plays it: between its samples joints go evenly, and the tip shown is off by a bounded length."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.forward import fk
from armkin.model import units

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.path_plan import PathPlan

SHOWN = 0.2  # [mm] that the tip shown may be off where it is looked at, so that it is less than 0.5 in between
MOST = 60_000  # samples; a plan that needs more is shown less exactly, and the page says so
_FIRST = 0.5  # [s] between two of the first samples, at most
_INSIDE = (0.21, 0.5, 0.79)  # where between two samples it is looked at


def played(arm: Arm, plan: PathPlan) -> dict[str, Any]:
    """Joint values over time, the tip's way, speeds as shares of the limits; `shown_mm`: what the tip shown is off.

    `approach_s`: of the joint move that comes before it, from where the arm stands to its start.
    """
    begins = [] if plan.trajectory is None else plan.trajectory.begins.tolist()
    t, off = _times(arm, plan, begins)
    q = plan.q(t)
    with np.errstate(invalid="ignore"):
        shares = np.nan_to_num(np.abs(plan.qd(t)) / arm.max_speed)
    return {
        "duration_s": plan.duration,
        "approach_s": 0.0 if plan.approach is None else plan.approach.duration,
        "length_mm": plan.length,
        "shown_mm": off,
        "time": t.round(4).tolist(),
        "joints": units.joints_out(arm, q).round(5).tolist(),
        "tips": fk(arm, q)[:, :3, 3].round(3).tolist(),
        "shares": shares.round(4).T.tolist(),
        "stops": [round(begin, 4) for begin in begins],
    }


def _times(arm: Arm, plan: PathPlan, begins: list[float]) -> tuple[Array, float]:
    """Times [s] between which the tip is off by SHOWN [mm] at most, or by what MOST samples leave; and by how much."""
    count = int(min(MOST / 4, plan.duration / _FIRST)) + 2
    t = np.unique(np.concatenate([np.linspace(0.0, plan.duration, count), begins]))
    a, b = t[:-1], t[1:]  # intervals that are still to be looked at
    done = [t]
    worst = 0.0
    total = len(t)
    while len(a):
        off = _off(arm, plan, a, b)
        bad = (off > SHOWN) & (b - a > 1e-3)
        worst = max(worst, float(off[~bad].max(initial=0.0)))
        if total + bad.sum() > MOST:
            worst = max(worst, float(off.max()))
            break
        middle = (a[bad] + b[bad]) / 2
        done.append(middle)
        total += len(middle)
        a, b = np.concatenate([a[bad], middle]), np.concatenate([middle, b[bad]])
    return np.unique(np.concatenate(done)), worst


def _off(arm: Arm, plan: PathPlan, a: Array, b: Array) -> Array:
    """How far the tip shown is from the tip [mm], the most seen between the times a and b: (k,)."""
    first, last = plan.q(a), plan.q(b)
    tips = [fk(arm, first)[:, :3, 3], fk(arm, last)[:, :3, 3]]
    off = np.zeros(len(a))
    for share in _INSIDE:
        there = fk(arm, plan.q(a + share * (b - a)))[:, :3, 3]
        arms = fk(arm, first + share * (last - first))[:, :3, 3]
        off = np.maximum(off, np.linalg.norm(arms - there, axis=1))
        # The way that is drawn: the distance to the chord.
        way = tips[1] - tips[0]
        long = np.maximum((way * way).sum(axis=1, keepdims=True), 1e-12)
        along = np.clip(((there - tips[0]) * way).sum(axis=1, keepdims=True) / long, 0.0, 1.0)
        off = np.maximum(off, np.linalg.norm(there - tips[0] - along * way, axis=1))
    return np.asarray(off)
