"""Joint values along a route on a grid: exact at its points, as fine as the tolerance needs in between."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Int
from armkin.forward import jacobian, position
from armkin.motion.branches.joint_steps import chord_bound, levers
from armkin.motion.branches.solve_on_route import DAMPING, correct_to_route, exact_cubics
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.time_optimal import knots_of_samples
from armkin.motion.tool_path.path_pieces import divide_spans

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.wrist_window import Window
    from armkin.motion.tool_path.route import Route

_MAX_POINT_FACTOR = 16.0  # factor, at most, on the number of points where the tolerance needs more
_MAX_ROUNDS = 8  # rounds in which intervals are divided
_BLOCK_POINTS = 8192  # points looked at together
_COARSE_STEP = 0.05  # step [mm], at most, if the tolerance is not larger
_MIN_CHORD_TURN = 1.6  # turn [rad] of a chord below which a step may be coarser where slopes are exact
_SECTION_POINTS = (4, 64)  # points, at least, of a section between two bends, with many sections and with few
_MIN_POINTS = 2  # points of a section where slopes are exact: they need no neighbours
_GROWTH_RATIO = 2.5  # ratio of an interval to the next one, at most: motions speed up and slow down beside bends
_EXCESS_FACTOR = 1.3  # excess of that ratio, as a factor, that stays: the interval is hardly longer
_AROUND_LENGTH = 0.5  # length [mm] of the way about a given point
_SAME_DISTANCE = 1e-3  # relative difference of distances that are alike: the first place is told
_REST_INTERVALS = 32  # intervals, at least, from rest to rest where there are many rests
_MOTION_SHARE = 0.7  # share of the grid that follows the joints; the rest follows the way


Missed = tuple[float, float] | None  # the greatest distance of a given point from the motion, and where [mm]


class Way(NamedTuple):
    """A branch along a route between two lengths, at rest at both ends."""

    route: Route
    s: Array  # (N,) [mm] samples
    q: Array  # (N, n) [rad | mm] the branch there
    begin: float  # [mm]
    end: float
    windows: tuple[Window, ...] = ()  # where the wrist passes a singularity
    stops: Array = np.zeros(0)  # (k,) [mm] where it rests on the way


def refine_grid(arm: Arm, way: Way, number: int, tolerance: float | None, exact: bool = True) -> tuple[Knots, Array]:
    """A grid along a way: cubics, and how far they may leave the route.

    The grid has `number` points, and more in the intervals that may leave the route by more than `tolerance` [mm];
    None: whatever they do. exact: whether a route of many sections may have the slopes of its targets.
    The last: (M,) [mm] for each interval.
    """
    route = way.route
    exact = exact and len(route.spans) > 0 and not way.windows
    points, breaks = _initial_grid(arm, way, number, _MIN_POINTS if exact else _SECTION_POINTS[0])
    if exact:
        points, breaks = _grade_grid(points, breaks)
    resting = _nearest_indices(points[breaks], way.stops)
    most = _MAX_POINT_FACTOR * len(points)
    for damping in DAMPING:
        solved, before = None, None
        for _ in range(_MAX_ROUNDS):
            values = _solve_points(arm, way, points, damping, solved)
            rests = breaks[resting]
            exact_path = exact_cubics(arm, route, points, values, rests, solved) if exact else None
            if exact and exact_path is None:
                return refine_grid(arm, way, number, tolerance, exact=False)
            path = solved = exact_path or knots_of_samples(points, values, breaks.tolist(), rests.tolist())
            if tolerance is None:
                return path, np.zeros(len(path.h))
            deviations = interval_deviations(arm, route, path, before)
            before = path, deviations
            needed = _excess_lengths(arm, path, deviations, tolerance, exact)
            if needed.max() <= 1.0 or len(points) > most:
                break
            points, breaks = _divide_intervals(points, breaks, _part_counts(needed, exact))
        if np.delete(deviations, path.rests).max() <= tolerance:
            break
    return path, deviations


def _nearest_indices(ordered: Array, values: Array) -> Int:
    """The nearest of sorted numbers (N,) for each of the values: (k,)."""
    if not len(values):
        return np.zeros(0, np.intp)
    i = np.clip(np.searchsorted(ordered, values), 1, max(len(ordered) - 1, 1))
    if len(ordered) == 1:
        return np.zeros(len(values), np.intp)
    return np.asarray(np.where(values - ordered[i - 1] < ordered[i] - values, i - 1, i))


def _initial_grid(arm: Arm, way: Way, number: int, fewest: int) -> tuple[Array, Int]:
    """Grid points that follow way and joints, and which of them are breaks."""
    route, s, q, a, b, windows, stops = way
    bends = np.sort(np.concatenate([route.breaks, *([window.begin, window.end] for window in windows)]))
    first, last = np.searchsorted(bends, [a + 1e-9, b - 1e-9])
    edges = np.concatenate([[a], np.unique(bends[first:last]), [b]])
    moved = np.abs(np.diff(q, axis=0)) / np.where(arm.prismatic, 100.0, 1.0)
    measure = np.concatenate([[0.0], np.cumsum(moved.max(axis=1))])
    levels = np.interp(edges, s, measure)
    total = max(float(levels[-1] - levels[0]), 1e-12)
    least_count = int(np.clip(2 * number / (len(edges) - 1), fewest, _SECTION_POINTS[1]))
    share = _MOTION_SHARE * np.diff(levels) / total + (1 - _MOTION_SHARE) * np.diff(edges) / (b - a)
    least = np.full(len(share), least_count)
    if len(stops):
        section_of = np.searchsorted(stops, (edges[:-1] + edges[1:]) / 2)  # which part between two stops
        least = np.maximum(least, -(-_REST_INTERVALS // np.bincount(section_of)[section_of]))
    count = np.maximum((number * share).astype(int), least)
    # places at equal steps of a level that rises with motion and way, in each section between two edges
    grid = np.unique(np.concatenate([edges, s[(s > a) & (s < b)]]))
    level = _MOTION_SHARE * np.interp(grid, s, measure) / total + (1 - _MOTION_SHARE) * grid / (b - a)
    ends = np.interp(edges, grid, level)
    begin = np.cumsum(count) - count
    points = np.append(np.interp(divide_spans(ends, count), level, grid), b)
    points[begin] = edges[:-1]
    fine = route.spans
    inside = np.diff(np.searchsorted(fine, points))
    return _divide_intervals(points, begin[1:], np.where(inside > 1, inside + 1, 1))


def _excess_lengths(arm: Arm, path: Knots, distance: Array, tolerance: float, exact: bool) -> Array:
    """How many times too long intervals without rests are (M,), by `distance` from the route and the way from their
    chord."""
    deviations, steps, h = (np.delete(values, path.rests) for values in (distance, _chord_bounds(arm, path), path.h))
    coarse = np.sqrt(steps / max(tolerance, _COARSE_STEP))  # the error is of second order in h
    if exact:  # a chord that is so long but hardly turns is well: 8 steps / h, of first order
        coarse = np.minimum(coarse, 8 * steps / (h * _MIN_CHORD_TURN))
    return np.maximum(np.cbrt(deviations / tolerance), coarse)  # the error is of third order in h


def _part_counts(excess: Array, exact: bool) -> Int:
    """Into how many parts each interval is divided, which is `excess` times too long (M,)."""
    parts: Int = np.ceil(np.clip(1.15 * excess, 1.0, 6.0)).astype(int)
    if exact:
        return parts
    beside = np.maximum(np.append(parts[1:], 1), np.append(1, parts[:-1])) > 2
    return np.asarray(np.maximum(parts, 1 + beside))  # slopes that neighbours tell want even steps


def _grade_grid(points: Array, breaks: Int) -> tuple[Array, Int]:
    """Points (N,) with more where an interval is long beside its neighbour; breaks keep their places."""
    while True:
        h = np.diff(points)
        left, right = _GROWTH_RATIO * np.append(np.inf, h[:-1]), _GROWTH_RATIO * np.append(h[1:], np.inf)
        long = np.flatnonzero(h > _EXCESS_FACTOR * np.minimum(left, right))
        if not len(long):
            return points, breaks
        new_points = np.where(left <= right, points[:-1] + left, points[1:] - right)[long]
        points, breaks = np.insert(points, long + 1, new_points), breaks + np.searchsorted(long, breaks)


def _divide_intervals(points: Array, breaks: Int, parts: Int) -> tuple[Array, Int]:
    """Points (N,) with every interval in so many parts (N - 1,); breaks keep their places."""
    begin = np.cumsum(parts) - parts
    return np.append(divide_spans(points, parts), points[-1]), begin[breaks]


def _solve_points(arm: Arm, way: Way, points: Array, damping: float, coarser: Knots | None) -> Array:
    """Joint values at the points, exact to the inverse kinematics; coarser: a grid whose points are among them."""
    route, windows = way.route, way.windows
    values, unsolved = np.empty((len(points), arm.n), order="F"), np.ones(len(points), bool)  # long runs of numbers
    if coarser is not None:
        positions = np.searchsorted(points, coarser.s)
        values[positions], unsolved[positions] = coarser.q, False
    if coarser is None or windows:
        guess = np.stack([np.interp(points[unsolved], way.s, way.q[:, j]) for j in range(arm.n)], axis=1)
    else:  # they are nearer than chords of samples
        guess, _ = coarser.evaluate(points[unsolved])
    values[unsolved] = correct_to_route(arm, route.task, guess, route.targets(points[unsolved]), damping)
    for window in windows:
        if window.detour is not None:  # the route is detoured itself
            continue
        inside = unsolved & (points > window.begin) & (points < window.end)
        if inside.any():
            values[inside] = window.joints(
                arm, route, points[inside], window.turns_to_copy(arm, guess[inside[unsolved]][0])
            )
    return values


def route_deviation(arm: Arm, route: Route, path: Knots) -> float:
    """An upper bound of the distance between the tip and the route on a grid's cubics [mm]."""
    return float(interval_deviations(arm, route, path).max(initial=0.0))


def interval_deviations(arm: Arm, route: Route, path: Knots, previous: tuple[Knots, Array] | None = None) -> Array:
    """An upper bound of the distance between the tip and the route in every interval of a grid: (N - 1,) [mm].

    The distance e is none at both ends and looked at in both quarters; up to the middle a quadratic through an end,
    the near quarter and the other end is at most 4/3 of what is seen there, and e leaves it by h^3 / 96 |e'''|: the
    tip's is bounded by levers. previous: a coarser grid and its distances; where a cubic is the same, so are they.
    """
    lever, deviations = levers(arm), np.zeros(len(path.h))
    open_ = path.s[1:] > path.s[:-1]
    if previous is not None:
        coarser, distances = previous
        positions = np.searchsorted(path.s, coarser.s)
        positions += (np.diff(coarser.s, prepend=-1.0) == 0) & (
            path.s[np.minimum(positions + 1, len(path.s) - 1)] == coarser.s
        )
        alike = (path.d.T.take(positions, axis=1) == coarser.d.T).all(axis=0)
        same = np.flatnonzero((positions[1:] == positions[:-1] + 1) & alike[1:] & alike[:-1])
        deviations[positions[same]], open_[positions[same]] = distances[same], False
    open_intervals = np.flatnonzero(open_)
    for part in (open_intervals[i : i + _BLOCK_POINTS] for i in range(0, len(open_intervals), _BLOCK_POINTS)):
        deviations[part] = _deviations(arm, route, path, part, lever)
    return deviations


def _chord_bounds(arm: Arm, path: Knots) -> Array:
    """Bounds of how far the tip leaves its chord in every interval: the law of time needs them small (N - 1,) [mm]."""
    lever, h = levers(arm), path.h[:, None]
    left, right = path.second_derivatives()
    bend = h**2 / 8 * np.maximum(np.abs(left), np.abs(right))
    bounds = chord_bound(lever, np.diff(path.q, axis=0)) + bend @ np.where(arm.prismatic, 1.0, np.diag(lever))
    bounds[path.rests] = 0.0
    return np.asarray(bounds)


def largest_miss(arm: Arm, route: Route, path: Knots) -> Missed:
    """Greatest distance of a given point from the tip's motion on a grid, and where [mm]; None: there is none."""
    s, points = route.given_points
    inside = (s >= path.s[0] - 1e-9) & (s <= path.s[-1] + 1e-9)
    s, points = s[inside], points[inside]
    worst: Missed = None
    for i in range(0, len(s), _BLOCK_POINTS):
        nearest, given_points = s[i : i + _BLOCK_POINTS], points[i : i + _BLOCK_POINTS]
        distance = np.full(len(nearest), np.inf)  # the least of what is met: in a tight corner the search may leave it
        for _ in range(3):  # the nearest place is a little before or behind
            q, slope = path.evaluate(np.clip(nearest, path.s[0], path.s[-1]))
            offsets = given_points - position(arm, q)[:, : given_points.shape[1]]
            distance = np.minimum(distance, np.linalg.norm(offsets, axis=1))
            tangent = (np.asarray(jacobian(arm, q)[:, : given_points.shape[1]]) @ slope[:, :, None])[..., 0]
            size = np.maximum((tangent**2).sum(axis=1), 1e-300)
            nearest = nearest + np.clip((offsets * tangent).sum(axis=1) / size, -1.0, 1.0)
        k, sure = -1, set[int]()
        while k not in sure:  # in a tight bend the search may have left it: the worst is looked for place by place
            sure.add(k)
            k = int(distance.argmax())
            near = np.clip(s[i + k] + np.linspace(-_AROUND_LENGTH, _AROUND_LENGTH, 401), path.s[0], path.s[-1])
            offsets = given_points[k] - position(arm, path.evaluate(near)[0])[:, : given_points.shape[1]]
            distance[k] = min(distance[k], float(np.linalg.norm(offsets, axis=1).min()))
        most = float(distance[k])
        if worst is None or most > worst[0] * (1 + _SAME_DISTANCE):
            worst = most, float(s[i + int((distance >= most * (1 - _SAME_DISTANCE)).argmax())])
        worst = max(most, worst[0]), worst[1]
    return worst


def _deviations(arm: Arm, route: Route, path: Knots, intervals: Int, lever: Array) -> Array:
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
    turned = np.where(arm.prismatic, 0.0, np.abs(arm.ratio)) @ first * (2.0 if arm.prismatic.any() else 1.0)
    levered = lever.T @ first
    tip = turned * (levered * first).sum(axis=0) + 3 * (levered * second).sum(axis=0)
    return np.asarray(4 / 3 * largest + (tip + np.where(arm.prismatic, 1.0, np.diag(lever)) @ third) / 96)
