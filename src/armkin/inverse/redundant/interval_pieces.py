"""Pieces of curves of answers: legal intervals of the redundant joint, and families that have none."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, numbers_within, wrap_angle
from armkin.model.arm import Arm


class Pieces(NamedTuple):
    """P pieces, each a stretch of the parameter of its curve along which the redundant joint is monotone."""

    row: Int  # (P,) whose target
    branch: Int  # (P,) which curve of it
    legal: Bool  # (P,) a legal interval, else a family that has none
    a: Array  # (P,) ends a <= b of the redundant joint [rad]
    b: Array
    first: Array  # (P,) ends of the parameter
    last: Array
    low: Array  # (P,) the parameter of the best sample, and those beside it
    at: Array
    high: Array
    start: Array  # (P, n) the posture of the best sample: the one nearest to near


class Known(NamedTuple):
    """`families.Curves` of N targets, of whose pieces the postures nearest to near are known."""

    pieces: Pieces
    short: Bool
    complete: Bool
    nearest: Array  # (P, n)


def none(n: int) -> Pieces:
    """No piece of an arm of n joints."""
    zero, index = np.zeros(0), np.zeros(0, np.intp)
    return Pieces(index, index, zero > 0, zero, zero, zero, zero, zero, zero, zero, np.zeros((0, n)))


def motion(arm: Arm, q: Array, near: Array) -> Array:
    """Sum of |change| from near [deg | mm]: (..., n) -> (...); inf where there is no posture."""
    total = np.zeros(np.broadcast_shapes(q.shape, near.shape)[:-1])
    for j in range(arm.n):  # joint after joint, as they may stand in memory
        total += motion_of_joint(arm, j, q[..., j], near[..., j])
    return np.where(np.isnan(total), np.inf, total)


def motion_of_joint(arm: Arm, j: int, value: Array, near: Array) -> Array:
    """|change| of joint j from near [deg | mm]."""
    change = np.abs(value - near)
    return change if arm.prismatic[j] else change * (180 / np.pi)


def runs(flags: Bool, breaks: Bool) -> tuple[Int, Int, Int]:
    """Runs of flags (M, K), round the end of the last axis; breaks (M, K): a run that comes there ends before it.

    Returns of each its row, first sample and length. A run of all samples begins at the first one.
    """
    M, K = flags.shape
    begins = flags & (breaks | ~np.roll(flags, 1, axis=1))
    begins[:, 0] |= (flags & ~breaks).all(axis=1)
    row, first = np.nonzero(begins)
    stops = np.flatnonzero(breaks | ~flags)  # samples, counted over all rows, at which a run before them is over
    # the next stop behind the first sample, or round the end the first one of the row
    begin, end = np.searchsorted(stops, K * np.arange(M)), np.append(stops, M * K)
    stop = end[np.searchsorted(stops, K * row + first + 1)]
    wrapped = end[begin[row]]
    length = np.where(stop < K * (row + 1), stop, np.where(wrapped < K * (row + 1), wrapped + K, M * K + K))
    return row, first, np.minimum(length - K * row - first, K)


def holding_none(flags: Bool, row: Int, first: Int, length: Int) -> Bool:
    """Which runs hold none of the flags (M, K): (R,); they may go round the end of the last axis."""
    K = flags.shape[1]
    so_far = np.append(0, np.cumsum(flags))
    begin, end = K * row, K * row + K
    last = begin + first + length
    before_end, past_end = np.minimum(last, end), begin + np.maximum(last - end, 0)
    return np.asarray(so_far[before_end] - so_far[begin + first] + so_far[past_end] - so_far[begin] == 0)


def best_samples(cost: Array, curve: Int, first: Int, count: Int) -> Int:
    """The least costly sample of each run, counted from its first one: cost (M, K), a run goes round the end."""
    index = numbers_within(count)
    K = cost.shape[1]
    sample = np.repeat(first, count) + index
    costs = cost.ravel()[np.repeat(curve * K, count) + np.where(sample < K, sample, sample - K)]
    begin = np.cumsum(count) - count
    min_cost = np.minimum.reduceat(costs, begin)
    least_at = np.flatnonzero(costs == np.repeat(min_cost, count))
    return np.asarray(index[least_at[np.searchsorted(least_at, begin)]])


def margin(arm: Arm, q: Array) -> Array:
    """How far postures (..., n) are within the limits, negative beyond them (...) [rad | mm]; at most a turn."""
    room = np.where(np.isnan(q[..., 0]), np.nan, 2 * np.pi)
    for j in range(arm.n):
        within_limits(arm, j, q[..., j], room)
    return room


def within_limits(arm: Arm, j: int, value: Array, room: Array) -> None:
    """How far values of joint j are within its limits, into room where that is less."""
    lower, upper = float(arm.lower[j]), float(arm.upper[j])
    if not np.isfinite(lower) or not np.isfinite(upper) or (not arm.prismatic[j] and upper - lower >= 2 * np.pi):
        return
    offset = value - 0.5 * (lower + upper)
    offset = np.abs(offset if arm.prismatic[j] else wrap_angle(offset))
    np.minimum(room, 0.5 * (upper - lower) - offset, out=room)


def may_turn_back(values: Array, t: Array) -> Bool:
    """Whether values of one sign at a sample and the next seem to have the other one in between, if they go on as on
    the far sides of both: (N, K, B), at t (N, K) of a turn."""
    width = np.diff(t, axis=1, append=t[:, :1] + 2 * np.pi)[:, :, None]
    following = np.roll(values, -1, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = (following - values) / width
        forward = values + width * np.roll(slope, 1, axis=1)
        backward = following - width * np.roll(slope, -1, axis=1)
        negative, positive = (values < 0) & (following < 0), (values > 0) & (following > 0)
        return np.asarray((negative & (forward > 0) & (backward > 0)) | (positive & (forward < 0) & (backward < 0)))


def golden_section(
    cost: Callable[[Array], Array], low: Array, high: Array, steps: int
) -> tuple[Array, Array, Array, Array]:
    """A minimum each of a cost between low and high (M,): the ends left, the lower of two places between, its cost."""
    ratio = (5**0.5 - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = cost(left), cost(right)
    for _ in range(steps if len(low) else 0):
        go = at_left <= at_right
        low, high = np.where(go, low, left), np.where(go, right, high)
        trial = np.where(go, high - ratio * (high - low), low + ratio * (high - low))
        at_new = cost(trial)
        left, right = np.where(go, trial, right), np.where(go, left, trial)
        at_left, at_right = np.where(go, at_new, at_right), np.where(go, at_left, at_new)
    return low, high, np.where(at_left <= at_right, left, right), np.minimum(at_left, at_right)


def vertex(low: Array, middle: Array, high: Array, at_low: Array, at_middle: Array, at_high: Array) -> Array:
    """Where the parabola through a cost at low, middle and high (M,) is least; middle where that is not between."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a, b = (middle - low) * (at_middle - at_high), (middle - high) * (at_middle - at_low)
        t = middle - 0.5 * ((middle - low) * a - (middle - high) * b) / (a - b)
        return np.asarray(np.where((t > low) & (t < high), t, middle))
