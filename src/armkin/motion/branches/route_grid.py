"""Joint values along a route on a grid: exact at the grid points, refined until cubics keep the tolerance between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Int
from armkin.forward import jacobian, position
from armkin.motion.branches.joint_steps import chord_bound, levers
from armkin.motion.branches.solve_on_route import DAMPING, correct_to_route, exact_cubics
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.limit_jerk import Smoothed
from armkin.motion.timing.time_optimal import knots_of_samples
from armkin.motion.tool_path.path_pieces import divide_spans

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.wrist_window import Window
    from armkin.motion.timing.curved_stretch import Curve
    from armkin.motion.tool_path.route import Route

_MAX_POINT_FACTOR = 16.0  # refinement multiplies the number of points by at most this
_MAX_ROUNDS = 8  # most rounds of refinement
_BLOCK_POINTS = 8192  # points evaluated in one call
_COARSE_STEP = 0.05  # chord error [mm] that every interval keeps, if the tolerance is smaller
_MIN_CHORD_TURN = 1.6  # with exact slopes, a chord that turns less than this [rad] may be longer
_MIN_SECTION_POINTS, _MAX_SECTION_POINTS = 4, 64  # fewest points between two breaks, with many sections and with few
_MIN_POINTS = 2  # fewest points of a section with exact slopes
_GROWTH_RATIO = 2.5  # greatest ratio of neighbouring intervals: speed changes quickly near a bend
_EXCESS_FACTOR = 1.3  # excess over that ratio that is not worth a division
_AROUND_LENGTH = 0.5  # search range [mm] to either side of a given point
_FAR_STEPS = 12  # Newton steps, of 1 mm at most, from the middle of a window to where its average is nearest
_SAME_DISTANCE = 1e-3  # distances that differ by less count as equal; the first place is reported
_REST_INTERVALS = 32  # fewest intervals between two rests
_MOTION_SHARE = 0.7  # share of the grid spaced by joint motion; the rest is spaced by length


Missed = tuple[float, float] | None  # the greatest distance of a given point from the motion, and where [mm]


class BranchSamples(NamedTuple):
    """A branch along a route between two lengths, at rest at both ends."""

    route: Route
    s: Array  # (N,) [mm] samples
    q: Array  # (N, n) [rad | mm] the branch there
    begin: float  # [mm]
    end: float
    windows: tuple[Window, ...] = ()  # where the wrist passes a singularity
    stops: Array = np.zeros(0)  # (k,) [mm] where it rests on the way


def refine_grid(
    arm: Arm, branch: BranchSamples, number: int, tolerance: float | None, exact: bool = True
) -> tuple[Knots, Array]:
    """Cubics on a grid along a branch, and how far they may leave the route.

    The grid has `number` points, and more where an interval may leave the route by more than `tolerance` [mm]; None:
    no refinement. exact: whether a fitted route may use the exact slopes of its targets. Returns the cubics, and a
    bound of the deviation of every interval: (M,) [mm].
    """
    route = branch.route
    exact = exact and len(route.spans) > 0 and not branch.windows
    points, breaks = _initial_grid(arm, branch, number, _MIN_POINTS if exact else _MIN_SECTION_POINTS)
    if exact:
        points, breaks = _grade_grid(points, breaks)
    resting = _nearest_indices(points[breaks], branch.stops)
    max_points = _MAX_POINT_FACTOR * len(points)
    for damping in DAMPING:
        coarser_path, previous = None, None
        for _ in range(_MAX_ROUNDS):
            values = _solve_points(arm, branch, points, damping, coarser_path)
            rests = breaks[resting]
            exact_path = exact_cubics(arm, route, points, values, rests, coarser_path) if exact else None
            if exact and exact_path is None:
                return refine_grid(arm, branch, number, tolerance, exact=False)
            path = coarser_path = exact_path or knots_of_samples(points, values, breaks.tolist(), rests.tolist())
            if tolerance is None:
                return path, np.zeros(len(path.h))
            deviations = interval_deviations(arm, route, path, previous)
            previous = path, deviations
            excess = _excess_lengths(arm, path, deviations, tolerance, exact)
            if excess.max() <= 1.0 or len(points) > max_points:
                break
            points, breaks = _divide_intervals(points, breaks, _part_counts(excess, exact))
        if np.delete(deviations, path.rests).max() <= tolerance:
            break
    return path, deviations


def _nearest_indices(ordered: Array, values: Array) -> Int:
    """The index of the nearest of sorted numbers (N,) for each value: (k,)."""
    if not len(values):
        return np.zeros(0, np.intp)
    i = np.clip(np.searchsorted(ordered, values), 1, max(len(ordered) - 1, 1))
    if len(ordered) == 1:
        return np.zeros(len(values), np.intp)
    return np.asarray(np.where(values - ordered[i - 1] < ordered[i] - values, i - 1, i))


def _initial_grid(arm: Arm, branch: BranchSamples, number: int, min_points: int) -> tuple[Array, Int]:
    """Grid lengths (M,) [mm], spaced by length and joint motion, and the indices (K,) of the breaks among them."""
    s, a, b = branch.s, branch.begin, branch.end
    edges = _section_edges(branch)
    motion_by_s = _accumulate_motion(arm, branch.q)
    motion = np.interp(edges, s, motion_by_s)
    total_motion = max(float(motion[-1] - motion[0]), 1e-12)
    share = _MOTION_SHARE * np.diff(motion) / total_motion + (1 - _MOTION_SHARE) * np.diff(edges) / (b - a)
    count = np.maximum((number * share).astype(int), _min_counts(edges, branch.stops, number, min_points))
    # equal steps of a level that grows with joint motion and length, in every section between two edges
    grid = np.unique(np.concatenate([edges, s[(s > a) & (s < b)]]))
    level = _MOTION_SHARE * np.interp(grid, s, motion_by_s) / total_motion + (1 - _MOTION_SHARE) * grid / (b - a)
    level_at_edges = np.interp(edges, grid, level)
    begin = np.cumsum(count) - count
    points = np.append(np.interp(divide_spans(level_at_edges, count), level, grid), b)
    points[begin] = edges[:-1]
    span_ends = np.diff(np.searchsorted(branch.route.spans, points))
    return _divide_intervals(points, begin[1:], np.where(span_ends > 1, span_ends + 1, 1))


def _section_edges(branch: BranchSamples) -> Array:
    """Both ends of the branch, and between them the route's breaks and the windows' ends: ascending [mm]."""
    bends = np.sort(np.concatenate([branch.route.breaks, *([window.begin, window.end] for window in branch.windows)]))
    first, last = np.searchsorted(bends, [branch.begin + 1e-9, branch.end - 1e-9])
    return np.concatenate([[branch.begin], np.unique(bends[first:last]), [branch.end]])


def _accumulate_motion(arm: Arm, q: Array) -> Array:
    """How far the fastest joint has moved up to each sample (N,) [rad | 100 mm]."""
    motion = np.abs(np.diff(q, axis=0)) / np.where(arm.prismatic, 100.0, 1.0)
    return np.concatenate([[0.0], np.cumsum(motion.max(axis=1))])


def _min_counts(edges: Array, stops: Array, number: int, min_points: int) -> Int:
    """The least number of intervals (M,) of each section, so that enough lie between two stops, too."""
    sections = len(edges) - 1
    min_count = np.full(sections, int(np.clip(2 * number / sections, min_points, _MAX_SECTION_POINTS)))
    if not len(stops):
        return min_count
    part = np.searchsorted(stops, (edges[:-1] + edges[1:]) / 2)  # between which stops
    return np.asarray(np.maximum(min_count, -(-_REST_INTERVALS // np.bincount(part)[part])))


def _excess_lengths(arm: Arm, path: Knots, distance: Array, tolerance: float, exact: bool) -> Array:
    """The factor by which each interval without a rest is too long (M,), by its deviation and its chord error."""
    deviations, steps, h = (np.delete(values, path.rests) for values in (distance, _chord_bounds(arm, path), path.h))
    factors = np.sqrt(steps / max(tolerance, _COARSE_STEP))  # the error is of second order in h
    if exact:  # a chord that hardly turns may be longer: 8 steps / h is of first order
        factors = np.minimum(factors, 8 * steps / (h * _MIN_CHORD_TURN))
    return np.maximum(np.cbrt(deviations / tolerance), factors)  # the error is of third order in h


def _part_counts(excess: Array, exact: bool) -> Int:
    """The number of parts into which an interval that is `excess` times too long is divided: (M,)."""
    parts: Int = np.ceil(np.clip(1.15 * excess, 1.0, 6.0)).astype(int)
    if exact:
        return parts
    near_divided = np.maximum(np.append(parts[1:], 1), np.append(1, parts[:-1])) > 2
    return np.asarray(np.maximum(parts, 1 + near_divided))  # slopes from neighbours need similar steps


def _grade_grid(points: Array, breaks: Int) -> tuple[Array, Int]:
    """Add points where an interval is long beside its neighbour, and shift the indices of breaks accordingly."""
    while True:
        h = np.diff(points)
        left, right = _GROWTH_RATIO * np.append(np.inf, h[:-1]), _GROWTH_RATIO * np.append(h[1:], np.inf)
        too_long = np.flatnonzero(h > _EXCESS_FACTOR * np.minimum(left, right))
        if not len(too_long):
            return points, breaks
        new_points = np.where(left <= right, points[:-1] + left, points[1:] - right)[too_long]
        points, breaks = np.insert(points, too_long + 1, new_points), breaks + np.searchsorted(too_long, breaks)


def _divide_intervals(points: Array, breaks: Int, parts: Int) -> tuple[Array, Int]:
    """Divide every interval into its number of parts (N - 1,), and shift the indices of breaks accordingly."""
    begin = np.cumsum(parts) - parts
    return np.append(divide_spans(points, parts), points[-1]), begin[breaks]


def _solve_points(arm: Arm, branch: BranchSamples, points: Array, damping: float, coarser_path: Knots | None) -> Array:
    """Joint values that solve the targets at the points; coarser_path: a solved grid whose points are among them."""
    route, windows = branch.route, branch.windows
    # column order, as joints are evaluated one by one
    values, is_pending = np.empty((len(points), arm.n), order="F"), np.ones(len(points), bool)
    if coarser_path is not None:
        positions = np.searchsorted(points, coarser_path.s)
        values[positions], is_pending[positions] = coarser_path.q, False
    if coarser_path is None or windows:
        guess = np.stack([np.interp(points[is_pending], branch.s, branch.q[:, j]) for j in range(arm.n)], axis=1)
    else:  # its cubics are closer than chords of the samples
        guess, _ = coarser_path.evaluate(points[is_pending])
    values[is_pending] = correct_to_route(arm, route.task, guess, route.targets(points[is_pending]), damping)
    for window in windows:
        if window.detour is not None:  # the targets of the route contain the detour
            continue
        in_window = is_pending & (points > window.begin) & (points < window.end)
        if in_window.any():
            values[in_window] = window.joints(
                arm, route, points[in_window], window.turns_to_copy(arm, guess[in_window[is_pending]][0])
            )
    return values


def route_deviation(arm: Arm, route: Route, path: Knots) -> float:
    """An upper bound of the distance between the tip and the route on a grid's cubics [mm]."""
    return float(interval_deviations(arm, route, path).max(initial=0.0))


def interval_deviations(arm: Arm, route: Route, path: Knots, previous: tuple[Knots, Array] | None = None) -> Array:
    """An upper bound of the distance between the tip and the route in every interval of a grid: (N - 1,) [mm].

    The distance e is 0 at both ends of an interval and is evaluated at 1/4 and 3/4. A quadratic through both ends and
    the near quarter is at most 4/3 of that value on its half, and e leaves it by at most h^3 / 96 |e'''|, which
    levers bound. previous: a coarser grid and its distances, which are reused for unchanged cubics.
    """
    lever, deviations = levers(arm), np.zeros(len(path.h))
    is_pending = path.s[1:] > path.s[:-1]
    if previous is not None:
        old_path, distances = previous
        positions = np.searchsorted(path.s, old_path.s)
        positions += (np.diff(old_path.s, prepend=-1.0) == 0) & (
            path.s[np.minimum(positions + 1, len(path.s) - 1)] == old_path.s
        )
        same_slopes = (path.d.T.take(positions, axis=1) == old_path.d.T).all(axis=0)
        unchanged = np.flatnonzero((positions[1:] == positions[:-1] + 1) & same_slopes[1:] & same_slopes[:-1])
        deviations[positions[unchanged]], is_pending[positions[unchanged]] = distances[unchanged], False
    intervals = np.flatnonzero(is_pending)
    for part in (intervals[i : i + _BLOCK_POINTS] for i in range(0, len(intervals), _BLOCK_POINTS)):
        deviations[part] = _deviations(arm, route, path, part, lever)
    return deviations


def _chord_bounds(arm: Arm, path: Knots) -> Array:
    """Bounds of the tip's distance from its chord in every interval, which the time law needs small: (N - 1,) [mm]."""
    lever, h = levers(arm), path.h[:, None]
    left, right = path.second_derivatives()
    bend = h**2 / 8 * np.maximum(np.abs(left), np.abs(right))
    bounds = chord_bound(lever, np.diff(path.q, axis=0)) + bend @ np.where(arm.prismatic, 1.0, np.diag(lever))
    bounds[path.rests] = 0.0
    return np.asarray(bounds)


def largest_miss(arm: Arm, route: Route, path: Knots) -> Missed:
    """Greatest distance of a given point from the tip's motion on a grid, and where [mm]; None: there is none."""
    s, points = route.given_points
    on_path = (s >= path.s[0] - 1e-9) & (s <= path.s[-1] + 1e-9)
    s, points = s[on_path], points[on_path]
    miss: Missed = None
    for i in range(0, len(s), _BLOCK_POINTS):
        given_points = points[i : i + _BLOCK_POINTS]
        distance = _distances(arm, path, given_points, s[i : i + _BLOCK_POINTS])
        row, checked = -1, set[int]()
        while row not in checked:  # the search may fail in a tight bend: sample around the worst point
            checked.add(row)
            row = int(distance.argmax())
            s_near = np.clip(s[i + row] + np.linspace(-_AROUND_LENGTH, _AROUND_LENGTH, 401), path.s[0], path.s[-1])
            offsets = given_points[row] - position(arm, path.evaluate(s_near)[0])[:, : given_points.shape[1]]
            distance[row] = min(distance[row], float(np.linalg.norm(offsets, axis=1).min()))
        greatest = float(distance[row])
        if miss is None or greatest > miss[0] * (1 + _SAME_DISTANCE):
            miss = greatest, float(s[i + int((distance >= greatest * (1 - _SAME_DISTANCE)).argmax())])
        miss = max(greatest, miss[0]), miss[1]
    return miss


def _distances(arm: Arm, path: Knots, points: Array, nearest: Array, steps: int = 3) -> Array:
    """Distances [mm] of points (M, 2 or 3) from the tip's path, by Newton steps from places (M,) near them."""
    distance = np.full(len(nearest), np.inf)  # least of all steps: in a tight corner the search may move away
    for _ in range(steps):
        q, slope = path.evaluate(np.clip(nearest, path.s[0], path.s[-1]))
        offsets = points - position(arm, q)[:, : points.shape[1]]
        distance = np.minimum(distance, np.linalg.norm(offsets, axis=1))
        tangent = (np.asarray(jacobian(arm, q)[:, : points.shape[1]]) @ slope[:, :, None])[..., 0]
        size = np.maximum((tangent**2).sum(axis=1), 1e-300)
        nearest = nearest + np.clip((offsets * tangent).sum(axis=1) / size, -1.0, 1.0)
    return distance


def smoothing_shift(arm: Arm, curves: Sequence[Curve | Smoothed]) -> float:
    """How far [mm] the moving average that limits the jerk takes the tip from its path, asked twice an interval."""
    shift = 0.0
    for stretch in curves:
        if not isinstance(stretch, Smoothed):
            continue
        grid = stretch.curve.times + 0.5 * stretch.window
        times = np.concatenate([grid, 0.5 * (grid[1:] + grid[:-1])])
        for t in np.array_split(times, -(-len(times) // _BLOCK_POINTS)):
            points = position(arm, stretch.evaluate(t))
            shift = max(shift, float(_distances(arm, stretch.curve.path, points, stretch.lengths(t), _FAR_STEPS).max()))
    return shift


def _deviations(arm: Arm, route: Route, path: Knots, intervals: Int, lever: Array) -> Array:
    """The bound of `interval_deviations` for some intervals (k,); lever: see `levers`."""
    (start, end), (d0, d1), h = path.ends(path.q, intervals), path.ends(path.d, intervals), path.h[intervals]
    d0, d1 = d0 * h, d1 * h
    chord, largest = end - start, np.zeros(len(intervals))
    for f in (0.25, 0.75):
        q = start + f * (d0 + f * (3 * chord - 2 * d0 - d1 + f * (d0 + d1 - 2 * chord)))
        targets = route.targets(path.s[intervals] + f * h)
        targets = targets[:, :3, 3] if route.task.orientation == "full" else targets[:, : route.task.position]
        offsets = (position(arm, q.T)[:, : targets.shape[1]] - targets).T
        largest = np.maximum(largest, np.sqrt((offsets**2).sum(axis=0)))
    # h, h^2 and h^3 times the greatest q', q'' and q''' of each joint
    first = np.maximum(np.maximum(np.abs(d0), np.abs(d1)), np.abs(3 * chord - d0 - d1))
    second = np.maximum(np.abs(6 * chord - 4 * d0 - 2 * d1), np.abs(6 * chord - 2 * d0 - 4 * d1))
    third = np.abs(6 * (d0 + d1 - 2 * chord))
    rotation = np.where(arm.prismatic, 0.0, np.abs(arm.ratio)) @ first * (2.0 if arm.prismatic.any() else 1.0)
    lever_sums = lever.T @ first
    tip = rotation * (lever_sums * first).sum(axis=0) + 3 * (lever_sums * second).sum(axis=0)
    return np.asarray(4 / 3 * largest + (tip + np.where(arm.prismatic, 1.0, np.diag(lever)) @ third) / 96)
