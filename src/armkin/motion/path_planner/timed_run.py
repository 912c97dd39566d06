"""A run of a route on one branch as timed curves, and how far these leave the route."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.motion.branches.branch_path import Pace, run_stretches
from armkin.motion.branches.route_grid import Missed, largest_miss, route_deviation, smoothing_shift
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed, join_joint_paths
from armkin.motion.tool_path.dense_points import PLAN_SHARES

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.branch_chains import Run
    from armkin.motion.tool_path.route import Route


class TimedRun(NamedTuple):
    """A run as timed curves.

    misses: of the given points, the average that limits the jerk included; shift: [mm] how far that leaves the path.
    """

    curves: list[Curve | Smoothed]
    misses: Missed
    shift: float


def timed_run(arm: Arm, pace: Pace, route: Route, s: Array, run: Run, near: Array, fixed: Array | None) -> TimedRun:
    """A run as timed curves: where given points are missed too far, a smaller tolerance is tried.

    So it is where the average that limits the jerk leaves the path too far, as its window covers more than a rounding.
    """
    has_points = bool(len(route.given_points[0]))
    for share in PLAN_SHARES if has_points else (1.0, *PLAN_SHARES):
        curves = run_stretches(arm, route, s, run, near, replace(pace, tolerance=share * pace.tolerance), fixed=fixed)
        shift = smoothing_shift(arm, curves)
        misses = largest_miss(arm, route, join_joint_paths(curves)) if has_points else None
        if misses is not None:
            misses = misses[0] + shift, misses[1]
        largest = shift if misses is None else misses[0]
        if largest <= pace.tolerance:
            return TimedRun(curves, misses, shift)
    what = f"a given point would lie {largest:.4f} mm off the motion"
    remedy = "tolerance, or fewer points at a time"
    if misses is None:
        what = f"with this jerk the motion would leave its path by {largest:.4f} mm"
        remedy = "tolerance or blend, or more jerk"
    raise NoSolutionError(
        f"{what}, tolerance {pace.tolerance:g} mm: give a larger {remedy}; nothing was moved",
        deviation_mm=largest,
        tolerance_mm=pace.tolerance,
    )


def note_deviation(plan: PathPlan, route: Route, run: TimedRun) -> None:
    """Note how far a run leaves the route, or given points, and how near it comes to a singularity."""
    path, misses = join_joint_paths(run.curves), run.misses
    if misses is None:
        deviation_mm = route.largest_detour + route_deviation(plan.arm, route, path) + run.shift
    else:
        deviation_mm = misses[0]
    if misses is not None and deviation_mm > plan.deviation:
        plan.rounded_most = plan.length + misses[1]
    plan.deviation = max(plan.deviation, deviation_mm)
    plan.note_singularity(path.q, path.s)
