"""Carries a route out in joint space: chooses the branch, fits cubics to its joint values and times them.

The steps are route -> columns of branches -> chains -> runs -> joint values on a grid -> time law -> stretches; the
last three are in this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.forward import jacobian, position
from armkin.inverse.branches.names import find_branches
from armkin.motion.branches.boundary_chains import add_boundary_chains
from armkin.motion.branches.branch_chains import BranchChain, Run, chains_of_columns, fewest_runs
from armkin.motion.branches.branch_columns import BranchColumns
from armkin.motion.branches.joint_steps import joint_change
from armkin.motion.branches.linked_branches import END_ACCURACY, link_branches
from armkin.motion.branches.route_grid import BranchSamples, refine_grid
from armkin.motion.branches.wrist_turn import ASIDE_SHARE, add_wrist_chains, has_wrist
from armkin.motion.branches.wrist_window import add_detours
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.hold_speed_limit import hold_cap
from armkin.motion.timing.limit_jerk import Smoothed, fastest_timing, smoothed, smoothing_window
from armkin.motion.timing.time_optimal import Bounds, optimal_law, refine_knots
from armkin.motion.tool_path.route import Route
from armkin.motors import motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_MIN_GRID_POINTS = 1000  # fewest points of a route's grid
_SAMPLE_STEP = 1.0  # largest distance [mm] between the first samples
_SAMPLE_COUNTS = (200, 20_000)  # fewest and most samples of a route
_MANY_RESTS = 8  # with more rests than this, the parts between them are planned in groups
_CHUNK_SAMPLES = 8192  # samples of such a group
_MAX_DISTANCE = 2.0  # largest distance [mm] between the samples of a route that needs more than the most


@dataclass(frozen=True)
class Pace:
    """The bounds of a motion: fractions of the joints' limits, tool speed, jerk, and tolerances."""

    speed: float = 1.0
    accel: float = 1.0
    tool_speed: float | None = None  # [mm/s]
    jerk: Array | None = None  # (n,) [rad/s3 | mm/s3]
    hold: float | None = None  # bound of a joint's acceleration on a hold, in multiples of max_accel
    tolerance: float = 0.05  # [mm]
    turn: float = 0.0  # [rad] by which the tool may turn aside to pass a wrist singularity


@dataclass(frozen=True)
class CarriedRoute:
    """A route with its branches and the runs that carry it."""

    route: Route
    columns: BranchColumns
    chains: list[BranchChain]
    runs: list[Run]

    @property
    def in_one_run(self) -> bool:
        """Whether a single run carries the whole route."""
        return len(self.runs) == 1 and self.runs[0].first == 0 and self.runs[0].last == len(self.columns.s) - 1

    @property
    def is_covered(self) -> bool:
        """Whether the runs carry the whole route, with reconfigurations between them."""
        if not self.runs or self.runs[0].first != 0 or self.runs[-1].last != len(self.columns.s) - 1:
            return False
        s = self.columns.s  # ends of runs are known to END_ACCURACY
        return all(s[b.first] - s[a.last] <= END_ACCURACY for a, b in pairwise(self.runs))

    @property
    def moving_runs(self) -> list[Run]:
        """The runs that are longer than the accuracy of their ends."""
        s = self.columns.s
        return self.runs if self.in_one_run else [run for run in self.runs if s[run.last] - s[run.first] > END_ACCURACY]


def route_samples(route: Route, count: int | None = None) -> Array:
    """The lengths [mm] at which a route is solved first: evenly spaced, and the ends of its pieces."""
    sample_count = np.clip(np.ceil(route.length / _SAMPLE_STEP), *_SAMPLE_COUNTS)
    number = count or int(max(sample_count, route.length / _MAX_DISTANCE))
    even_lengths = np.linspace(0.0, route.length, max(number, 2))
    return np.asarray(_drop_close_values(np.sort(np.concatenate([even_lengths, route.breaks])), 1e-7 * route.length))


def carry_route(
    arm: Arm,
    route: Route,
    *,
    near: Array,
    tolerance: float,
    pace: Pace,
    fixed: Array | None = None,
    branch: str | None = None,
    count: int | None = None,
) -> CarriedRoute:
    """Solve a route on all branches and choose the runs that carry it.

    near: where the arm comes from; fixed: where it stands at the route's start, if it has no choice; branch: name
    of the branch to start on. Raises UsageError, which lists the names, if there is no branch of that name.
    """
    name = route.task.name
    columns = link_branches(arm, route.targets, route_samples(route, count), task=name, tolerance=tolerance, near=near)
    all_chains = chains_of_columns(arm, columns)
    all_chains = add_boundary_chains(arm, columns, all_chains, fixed, tolerance)
    if route.task.orientation == "full" and has_wrist(arm):
        # a fitted curve has used most of the tolerance
        max_offset = 0.0 if len(route.given_points[0]) else ASIDE_SHARE * tolerance
        all_chains = add_wrist_chains(arm, route, columns, all_chains, pace.turn, max_offset)
    starts = _start_chains(arm, all_chains, fixed)
    if branch is not None:
        labels = find_branches(columns.names, branch)
        starts = [chain for chain in starts if chain.labels[0] in labels]
    end = len(columns.s) - 1
    complete = [Run(chain, 0, end) for chain in starts if chain.carries_to(0) == end]
    if len(complete) > 1:
        complete = [_fastest_run(arm, route, columns.s, complete, near, pace, fixed)]
    return CarriedRoute(route, columns, all_chains, complete or fewest_runs(all_chains, end + 1, starts))


def _start_chains(arm: Arm, chains: list[BranchChain], fixed: Array | None) -> list[BranchChain]:
    """The chains that may begin a route; fixed: (n,) where the arm stands, if it has no choice."""
    starts = [chain for chain in chains if chain.first == 0]
    if fixed is None:
        return starts
    # without a branch there the start is a chain of one sample: the wrist has to turn at rest first
    return [chain for chain in starts if starts_at(chain, fixed)] or [BranchChain(arm, 0, fixed[None], np.full(1, -1))]


def starts_at(chain: BranchChain, q: Array) -> bool:
    """Whether a chain begins at the posture q (n,), up to whole turns."""
    return float(np.abs(joint_change(chain.arm, chain.q[0], q)).max()) < 1e-4


def _fastest_run(
    arm: Arm, route: Route, s: Array, runs: list[Run], near: Array, pace: Pace, fixed: Array | None
) -> Run:
    """The run with the shortest approach among those that take nearly the least time."""
    seconds = np.array([_run_time(arm, route, s, run, near, pace) for run in runs])
    return min(
        (run for run, t in zip(runs, seconds, strict=True) if t <= seconds.min() * 1.0005),
        key=lambda run: _approach_time(run, near, fixed),
    )


def _approach_time(run: Run, near: Array, fixed: Array | None) -> float:
    """A lower bound [s] of the time from `near` to the first posture of a run."""
    speed = np.where(np.isnan(run.chain.arm.max_speed), 1.0, run.chain.arm.max_speed)
    return float((np.abs(run.chain.joints(0, run.last, near, fixed)[0] - near) / speed).max())


def _run_time(arm: Arm, route: Route, s: Array, run: Run, near: Array, pace: Pace) -> float:
    """The time of a run on a coarse grid [s], or the sum of joint motion where the arm has no rates."""
    if np.isnan(arm.max_speed).any() or np.isnan(arm.max_accel).any():
        return float(np.abs(np.diff(run.chain.q, axis=0)).sum())
    return sum(stretch.duration for stretch in run_stretches(arm, route, s, run, near, pace, grid=300))


def run_stretches(
    arm: Arm,
    route: Route,
    s: Array,
    run: Run,
    near: Array,
    pace: Pace,
    *,
    fixed: Array | None = None,
    grid: int = _MIN_GRID_POINTS,
) -> list[Curve | Smoothed]:
    """A run as curves from rest to rest, one between each two stops of the route; s: the route's samples."""
    q = run.chain.joints(run.first, run.last, near, fixed)
    route = add_detours(route, run.chain.windows)
    s = s[run.first : run.last + 1]
    stops = [float(route.ends[k]) for k in sorted(route.stops)]
    rests = [s[0], *[x for x in stops if s[0] + 1e-9 < x < s[-1] - 1e-9], s[-1]]
    rests = [begin for begin, end in pairwise(rests) if end - begin > 1e-9] + rests[-1:]
    tolerance = None if grid < _MIN_GRID_POINTS else pace.tolerance - route.largest_detour
    stretches: list[Curve | Smoothed] = []
    for part in _group_rests(rests, s):
        begin, end, inner = part[0], part[-1], np.array(part[1:-1])
        samples = slice(max(int(np.searchsorted(s, begin, side="right")) - 1, 0), int(np.searchsorted(s, end)) + 1)
        sample_count = len(s[samples])  # a route of many turns has more samples, and needs more points
        number = max(int(grid * (end - begin) / route.length), sample_count * grid // (2 * _MIN_GRID_POINTS), 60)
        branch = BranchSamples(
            route=route, s=s[samples], q=q[samples], begin=begin, end=end, windows=run.chain.windows, stops=inner
        )
        path, deviations = refine_grid(arm, branch, number, tolerance)
        _check_deviation(path, deviations + route.largest_detour, pace)
        if stretches:  # consecutive stretches share the posture at rest exactly
            path.q[0] = stretches[-1].end
        stretches += _time_path(arm, route, refine_knots(path), pace)
    return stretches


def _group_rests(edges: list[float], s: Array) -> list[list[float]]:
    """Groups of rests to plan together: each pair of neighbours or, where there are many, longer groups of them."""
    if len(edges) <= _MANY_RESTS:
        return [list(pair) for pair in pairwise(edges)]
    first = np.flatnonzero(np.diff(np.searchsorted(s, edges[:-1]) // _CHUNK_SAMPLES, prepend=-1)).tolist()
    return [edges[a : b + 1] for a, b in pairwise([*first, len(edges) - 1])]


def _check_deviation(path: Knots, deviation: Array, pace: Pace) -> None:
    """Raise NoSolutionError if the cubics of a grid may leave the path by more than the tolerance."""
    i = int(deviation.argmax())
    if deviation[i] > pace.tolerance:
        raise NoSolutionError(
            f"between {path.s[i]:.3f} and {path.s[i + 1]:.3f} mm the plan may leave the path by {deviation[i]:.3g} mm; "
            f"{pace.tolerance:g} are allowed: nothing was moved"
        )


def _time_path(arm: Arm, route: Route, path: Knots, pace: Pace) -> list[Curve | Smoothed]:
    """The time-optimal curves on a grid, one from each rest to the next."""
    cap, fraction = _speed_caps(arm, route, path, pace)
    speed = fraction[:, None] * arm.max_speed

    def timed(share: float) -> list[Curve | Smoothed]:
        accel, most, window = pace.accel * share * arm.max_accel, cap, 0.0
        if pace.jerk is not None:
            window = smoothing_window(accel, pace.jerk)
            most = np.minimum(cap, _smoothing_cap(arm, path, window, pace.tolerance))
        x = optimal_law(path, Bounds(speed, accel, most), coupled_motors(arm, pace.accel * share))
        parts = [
            Curve(Knots(path.s[a:b], path.q[a:b], path.d[a:b]), x[a:b])
            for a, b in pairwise([0, *(path.rests + 1).tolist(), len(x)])
        ]
        return [smoothed(curve, window) for curve in parts]

    return timed(1.0) if pace.jerk is None else fastest_timing(timed)


def _speed_caps(arm: Arm, route: Route, path: Knots, pace: Pace) -> tuple[Array, Array]:
    """Greatest (ds/dt)^2 for the tool's speed and for holds, and the fraction of the joints' speeds: (N,) each."""
    fraction, tool = route.speed_limits(path.s, pace.speed, pace.tool_speed)
    tip = np.linalg.norm(np.diff(position(arm, path.q), axis=0), axis=1) / path.h
    with np.errstate(over="ignore"):
        tool_cap = (tool / np.maximum(tip, 1e-300)) ** 2
    tool_cap = np.where(np.isfinite(tool), tool_cap, np.inf)
    cap, min_fraction = (np.minimum(np.append(x, np.inf), np.append(np.inf, x)) for x in (tool_cap, fraction))
    if pace.hold is not None and len(arm.motor_gain) and arm.motor_gain.any(axis=0).all():
        cap = np.minimum(cap, hold_cap(arm, path, pace.hold))
    return cap, min_fraction


def coupled_motors(arm: Arm, share: float) -> tuple[Array, Array] | None:
    """The gains and greatest accelerations [counts] of motors that drive several joints; None: there are none."""
    coupled = np.flatnonzero(np.count_nonzero(arm.motor_gain, axis=1) > 1)
    return (np.asarray(arm.motor_gain[coupled]), motor_accel(arm)[coupled] * share) if len(coupled) else None


def _smoothing_cap(arm: Arm, path: Knots, mean: float, tolerance: float) -> Array:
    """The (ds/dt)^2 at which the moving average shifts the tip by half the tolerance: (N,).

    The average over T, `mean`, shifts q by T^2/24 (q'' x + q' u); the second part is along the path.
    """
    left, right = path.second_derivatives()
    bend = np.concatenate([left[:1], (left[1:] + right[:-1]) / 2, right[-1:]])
    J = np.asarray(jacobian(arm, path.q)[:, :3])
    shift = np.linalg.norm((J @ bend[:, :, None])[..., 0], axis=1)
    return np.asarray(12 * tolerance / mean**2 / np.maximum(shift, 1e-12))


def _drop_close_values(s: Array, min_step: float) -> Array:
    """Sorted values without those less than `min_step` behind their predecessor; the last value is kept."""
    keep = np.concatenate([[True], np.diff(s) > min_step])
    distinct_values = s[keep]
    distinct_values[-1] = s[-1]
    return np.asarray(distinct_values)
