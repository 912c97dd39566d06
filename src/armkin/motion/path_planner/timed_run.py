"""A run of a route on one branch as timed curves, and how far these leave the route."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

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


def timed_curves(
    arm: Arm, pace: Pace, route: Route, s: Array, run: Run, near: Array, fixed: Array | None
) -> tuple[list[Curve | Smoothed], Missed]:
    """A run as timed curves, and its miss of given points: where that is too large, a smaller tolerance is tried.

    So it is where the average that limits the jerk leaves the path too far, as its window covers more than a rounding.
    """
    if not len(route.given_points[0]):
        return _curves_on_path(arm, pace, route, s, run, near, fixed), None
    for share in PLAN_SHARES:
        tight_pace = replace(pace, tolerance=share * pace.tolerance)
        curves = run_stretches(arm, route, s, run, near, tight_pace, fixed=fixed)
        misses = largest_miss(arm, route, join_joint_paths(curves))
        if misses is not None:
            misses = misses[0] + smoothing_shift(arm, curves), misses[1]
        largest = 0.0 if misses is None else misses[0]
        if largest <= pace.tolerance:
            return curves, misses
    raise NoSolutionError(
        f"a given point would lie {largest:.4f} mm off the motion, tolerance {pace.tolerance:g} mm: give a larger "
        "tolerance, or fewer points at a time; nothing was moved",
        deviation_mm=largest,
        tolerance_mm=pace.tolerance,
    )


def _curves_on_path(
    arm: Arm, pace: Pace, route: Route, s: Array, run: Run, near: Array, fixed: Array | None
) -> list[Curve | Smoothed]:
    """A run as timed curves that stay on their path; arguments as of `timed_curves`."""
    for share in (1.0, *PLAN_SHARES):
        curves = run_stretches(arm, route, s, run, near, replace(pace, tolerance=share * pace.tolerance), fixed=fixed)
        shift = smoothing_shift(arm, curves)
        if shift <= pace.tolerance:
            return curves
    raise NoSolutionError(
        f"with this jerk the motion would leave its path by {shift:.4f} mm, tolerance {pace.tolerance:g} mm: give a "
        "larger tolerance or blend, or more jerk; nothing was moved",
        deviation_mm=shift,
        tolerance_mm=pace.tolerance,
    )


def note_deviation(plan: PathPlan, route: Route, curves: Sequence[Curve | Smoothed], misses: Missed) -> None:
    """Note how far a curve leaves the route, or given points, and how near it comes to a singularity."""
    path = join_joint_paths(curves)
    if misses is None:
        deviation_mm = route.largest_detour + route_deviation(plan.arm, route, path) + smoothing_shift(plan.arm, curves)
    else:
        deviation_mm = misses[0]
    if misses is not None and deviation_mm > plan.deviation:
        plan.rounded_most = plan.length + misses[1]
    plan.deviation = max(plan.deviation, deviation_mm)
    plan.note_singularity(path.q, path.s)
