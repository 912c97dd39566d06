"""The best of many places: it reaches most, by the greatest margin, then by the greatest distance to a joint limit."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.reachability.cell_answers import limit_margin
from armkin.reachability.place_targets import PlaceQuestion, at_value, free_from

Room = Callable[[int, int, int], float]  # of a place by its index: how far its joints stay from limits, as a share


def margins(good: NDArray[np.bool_], step: float) -> Array:
    """Distance of each place (X, Y, K) to the nearest one, at the same yaw, that is not good; 0 for these."""
    X, _, K = good.shape
    distances = np.zeros(good.shape)
    columns = np.arange(X)[:, None]
    for k in range(K):
        if not good[:, :, k].any():
            continue
        # along y, then across x: the lower envelope of parabolas, here tried row by row
        rows = _depth_along_y(good[:, :, k])
        distances[:, :, k] = np.sqrt(np.min((columns - columns.T)[:, :, None] ** 2 + rows[None] ** 2, axis=1)) * step
    return distances


def _depth_along_y(good: NDArray[np.bool_]) -> Array:
    """How many places along y it is to the nearest one that is not good: (X, Y)."""
    index = np.where(good, np.inf, np.arange(good.shape[1]))
    ahead = np.minimum.accumulate(index[:, ::-1], axis=1)[:, ::-1] - np.arange(good.shape[1])
    behind = np.arange(good.shape[1]) - np.maximum.accumulate(np.where(good, -np.inf, index), axis=1)
    return np.asarray(np.minimum(ahead, behind))


def best_place(room: Room, reached: NDArray[np.int64], margin: Array) -> tuple[int, int, int]:
    """The place that reaches most, by the greatest margin, then by the greatest distance to a joint limit."""
    most = reached == reached.max()
    tied = np.argwhere(most & (margin >= margin[most].max() - 1e-9))
    if len(tied) > 1 and reached.max():
        spread = tied[:: max(len(tied) // 200, 1)]  # some of very many alike are enough
        tied = spread[int(np.argmax([room(*index) for index in spread.tolist()])) :]
    i, j, k = tied[0].tolist()
    return i, j, k


def limit_rooms(question: PlaceQuestion, x: Array, y: Array, yaws: Array) -> Room:
    """`_limit_room` of places by their index, each asked once."""

    @cache
    def room(i: int, j: int, k: int) -> float:
        return _limit_room(question, np.array([x[i], y[j]]), float(yaws[k]))

    return room


def _limit_room(question: PlaceQuestion, position: Array, turn: float) -> float:
    """The least, over the targets reached, of the best branch's distance to a limit, as a share of the range."""
    question = at_value(question, position, turn)
    s, legal = free_from(question, position, turn)
    margins = np.where(legal, limit_margin(question.arm, s.q), -np.inf).max(axis=1, initial=-np.inf)
    reached_margins = margins[np.isfinite(margins)]
    return float(reached_margins.min()) if len(reached_margins) else 0.0
