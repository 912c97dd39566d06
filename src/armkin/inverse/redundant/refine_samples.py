"""Between which samples along the redundant joint more may happen than they show: more are taken there.

A joint comes to a limit and leaves it again, or two branches appear and vanish, only where what is left to it is less
than its bend from sample to sample allows. Where branches merge, and beside a straight shoulder or wrist, joints turn
without bound.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.interval_pieces import within_limits
from armkin.model.arm import Arm

SAFE = 4.0  # times the bend that the samples show
NEAR = 0.3  # [rad] of a limit is what can come to it before the next sample
FAST = 0.2  # [rad] from a sample to the next: beside a straight shoulder or wrist
BESIDE = 0.2  # [rad] beyond its limits a branch may be legal between two samples,
ASIDE = 0.3  # and near its end
PARTS = 8  # of the way between two samples
MOST = 16  # such ways of a target
CLOSER = MOST * (PARTS - 1)  # values of each


def values_between(arm: Arm, columns: list[Array], missed: Array, axes: tuple[int, ...], t: Array) -> Array:
    """Values of the joint between t (K,) that shall be asked, too (S, CLOSER); inf where there are fewer.

    columns: of each joint its values on its own branch axes before targets' samples (S K,); missed: squared.
    """
    K = len(t)
    shape = (*axes, columns[0].shape[-1] // K, K)

    def by_target(x: Array) -> Array:
        return x.reshape(*x.shape[:-1], *shape[-2:])

    there = by_target(missed) <= tol.ACCEPTED**2
    room, may, crossed = np.full(shape, 2 * np.pi), np.zeros(shape, bool), np.zeros(shape, np.int8)
    for j, column in enumerate(columns):
        left = np.full(column.shape, 2 * np.pi)
        within_limits(arm, j, column, left)
        left = by_target(left)
        np.minimum(room, left, out=room)
        may |= _may_touch(left)
        crossed += (left < 0) != _next(left < 0)
    room = np.where(there, room, -np.inf)
    room = np.maximum(room, _next(room))
    gone = ~there & ~_next(there)
    ends = there != _next(there)
    hidden = gone & _may_touch(np.sqrt(by_target(missed)))
    limits = ~gone & ~ends & (may | (crossed > 1)) & (room > -BESIDE)
    often = (limits | (ends & (room > -ASIDE)) | hidden).sum(axis=tuple(range(len(axes))))
    most = np.argsort(-often, axis=1, kind="stable")[:, :MOST]
    begin = np.where(np.take_along_axis(often, most, axis=1) > 0, t[most], np.inf)
    width = np.diff(t, append=t[0] + 2 * np.pi)[most]
    values = begin[:, :, None] + width[:, :, None] * (np.arange(1, PARTS) / PARTS)
    return np.asarray(values.reshape(-1, CLOSER))


def _next(x: NDArray[Any]) -> NDArray[Any]:
    """Of the next sample round the turn."""
    return np.roll(x, -1, axis=-1)


def _may_touch(left: Array) -> Bool:
    """Whether what is left (..., K) may come to nothing and back between a sample and the next."""
    out, values, K = np.abs(_next(left) - left) > FAST, left.ravel(), left.shape[-1]
    some = np.flatnonzero(np.abs(values) < NEAR)
    k = some % K
    before, now, then, behind = (values[some - k + (k + offset) % K] for offset in (-1, 0, 1, 2))
    step = then - now
    bend = SAFE * np.maximum(np.abs(step - (now - before)), np.abs((behind - then) - step))
    least = np.minimum(np.abs(now), np.abs(then))
    out.ravel()[some] |= (least < bend / 8) & (np.abs(step) < bend / 2)
    return out
