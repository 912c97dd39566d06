"""Chooses the best place: most targets reached, then greatest margin, then greatest distance to joint limits."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.reachability.cell_answers import limit_margin
from armkin.reachability.place.reached_targets import PlaceQuestion, at_value, free_from

Room = Callable[[int, int, int], float]  # index of a place -> distance of its joints to limits, as a share of the range


def margins(is_good: NDArray[np.bool_], step: float) -> Array:
    """Distance of each good place (X, Y, K) to the nearest place of the same yaw that is not good; else 0."""
    X, _, K = is_good.shape
    distances = np.zeros(is_good.shape)
    columns = np.arange(X)[:, None]
    for yaw in range(K):
        if not is_good[:, :, yaw].any():
            continue
        # distance transform, first along y, then along x, where each row gives a parabola
        rows = _depth_along_y(is_good[:, :, yaw])
        distances[:, :, yaw] = np.sqrt(np.min((columns - columns.T)[:, :, None] ** 2 + rows[None] ** 2, axis=1)) * step
    return distances


def _depth_along_y(is_good: NDArray[np.bool_]) -> Array:
    """Number of steps along y to the nearest place that is not good: (X, Y)."""
    index = np.where(is_good, np.inf, np.arange(is_good.shape[1]))
    steps_up = np.minimum.accumulate(index[:, ::-1], axis=1)[:, ::-1] - np.arange(is_good.shape[1])
    steps_down = np.arange(is_good.shape[1]) - np.maximum.accumulate(np.where(is_good, -np.inf, index), axis=1)
    return np.asarray(np.minimum(steps_up, steps_down))


def best_place(room: Room, reached: NDArray[np.int64], margin: Array) -> tuple[int, int, int]:
    """The place with most targets reached, then greatest margin, then greatest distance to joint limits."""
    is_best = reached == reached.max()
    candidates = np.argwhere(is_best & (margin >= margin[is_best].max() - 1e-9))
    if len(candidates) > 1 and reached.max():
        sample = candidates[:: max(len(candidates) // 200, 1)]  # a sample of very many equal places is enough
        candidates = sample[int(np.argmax([room(*index) for index in sample.tolist()])) :]
    i, j, k = candidates[0].tolist()
    return i, j, k


def limit_rooms(question: PlaceQuestion, x: Array, y: Array, yaws: Array) -> Room:
    """`_limit_room` of places by their index, cached."""

    @cache
    def room(i: int, j: int, k: int) -> float:
        return _limit_room(question, np.array([x[i], y[j]]), float(yaws[k]))

    return room


def _limit_room(question: PlaceQuestion, position: Array, yaw: float) -> float:
    """Least distance to a joint limit over the reached targets, each on its best branch, as a share of the range."""
    question = at_value(question, position, yaw)
    solutions, is_legal = free_from(question, position, yaw)
    margins = np.where(is_legal, limit_margin(question.arm, solutions.q), -np.inf).max(axis=1, initial=-np.inf)
    reached_margins = margins[np.isfinite(margins)]
    return float(reached_margins.min()) if len(reached_margins) else 0.0
