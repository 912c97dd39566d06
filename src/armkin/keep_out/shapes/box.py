"""A box, in any place."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.rotation import transform

if TYPE_CHECKING:
    from armkin.robot_file.keep_out_keys import Entry


@dataclass(frozen=True, eq=False)
class Box:
    """A box about its own axes."""

    centre: Array  # (3,)
    axes: Array  # (3, 3) its axes as columns
    half: Array  # (3,) half the lengths of its edges

    def distance(self, a: Array, b: Array) -> Array:
        """Least signed distance over segments: a, b (3, ...) -> (...).

        The signed distance to a box is a convex function, so along a segment it has one minimum. Outside, its
        square is a sum of (|p| - h)^2 over the axes on which the point is beyond: the derivative is linear between
        the places where the segment crosses the six planes of the faces. Inside, it is the greatest of six linear
        functions, which is least at an end or where two of them meet.
        """
        lead = a.shape[1:]
        start, way = (self._in_box_axes(part.reshape(3, -1)) for part in (a, b - a))
        start -= (self.axes.T @ self.centre)[:, None]
        distances = np.sqrt(_outer_distance(start, way, self.half))
        if (inside := np.flatnonzero(distances == 0.0)).size:
            distances[inside] = _inner_distance(start[:, inside], way[:, inside], self.half)
        return distances.reshape(lead)

    def of_points(self, p: Array) -> Array:
        """Signed distance of points: (3, ...) -> (...)."""
        flat = self._in_box_axes(p.reshape(3, -1)) - (self.axes.T @ self.centre)[:, None]
        beyond = np.abs(flat) - self.half[:, None]
        inside = np.minimum(beyond.max(axis=0), 0.0)
        np.maximum(beyond, 0.0, out=beyond)
        return np.asarray(np.sqrt(np.einsum("km,km->m", beyond, beyond)) + inside).reshape(p.shape[1:])

    def _in_box_axes(self, v: Array) -> Array:
        """Vectors (3, M) in its own axes."""
        turned: Array = v.copy() if np.array_equal(self.axes, np.eye(3)) else self.axes.T @ v
        return turned

    def corners(self) -> Array:
        """(8, 3)"""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        return np.asarray(self.centre + (signs * self.half) @ self.axes.T)

    def triangles(self, size: float) -> Array:
        """Two a face."""
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return self.corners()[[part for a, b, c, d in faces for part in ((a, b, c), (a, c, d))]]

    def c_function(self) -> tuple[str, list[float]]:
        """The name of the box's distance function in C, and its centre [mm], axes and half sides [mm]."""
        return "box", [*self.centre.tolist(), *self.axes.T.ravel().tolist(), *self.half.tolist()]


def read_box(entry: Entry) -> Box:
    """The box of an entry."""
    box = entry.box
    assert box is not None
    if box.size is not None:
        T = transform(box.xyz, box.rpy)
        return Box(T[:3, 3], T[:3, :3], np.array(box.size) / 2)
    low, high = np.array(box.min), np.array(box.max)
    return Box((low + high) / 2, np.eye(3), (high - low) / 2)


def _outer_distance(start: Array, way: Array, half: Array) -> Array:
    """Least squared distance over segments from `start` by `way` (3, M) to the box: (M,), 0 where one enters it."""
    h = half[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.concatenate([(h - start) / way, (-h - start) / way])  # (6, M) where planes are crossed
    np.clip(np.nan_to_num(crossings, copy=False, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0, out=crossings)
    low, high = np.zeros(start.shape[1]), np.ones(start.shape[1])
    slope_low, slope_high = (_half_slope(t, start, way, h) for t in (low, high))
    for t in crossings:
        slope = _half_slope(t, start, way, h)
        nearer = (slope <= 0.0) & (t > low)
        low, slope_low = np.where(nearer, t, low), np.where(nearer, slope, slope_low)
        nearer = (slope >= 0.0) & (t < high)
        high, slope_high = np.where(nearer, t, high), np.where(nearer, slope, slope_high)
    rise = slope_high - slope_low
    share = np.divide(-slope_low, rise, out=np.zeros_like(rise), where=(rise > 0.0) & (slope_low < 0.0))
    t = low + np.minimum(share, 1.0) * (high - low)
    t = np.where(slope_high <= 0.0, high, np.where(slope_low >= 0.0, low, t))
    beyond = np.maximum(np.abs(start + t * way) - h, 0.0)
    least: Array = np.einsum("km,km->m", beyond, beyond)
    return least


def _half_slope(t: Array, start: Array, way: Array, h: Array) -> Array:
    """Half the derivative of the squared distance along the segments: t (M,) -> (M,)."""
    p = start + t * way
    slope: Array = np.einsum("km,km->m", p - np.clip(p, -h, h), way)
    return slope


def _inner_distance(start: Array, way: Array, half: Array) -> Array:
    """Least signed distance over segments that touch the box: (M,), not positive."""
    signs = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])[:, None]
    height, slope = signs * np.tile(start, (2, 1)) - np.tile(half, 2)[:, None], signs * np.tile(way, (2, 1))
    first, second = np.triu_indices(6, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = (height[second] - height[first]) / (slope[first] - slope[second])
    ends = np.broadcast_to([[0.0], [1.0]], (2, start.shape[1]))
    t = np.clip(np.nan_to_num(np.concatenate([ends, meets]), nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    deepest: Array = (height[:, None] + t * slope[:, None]).max(axis=0).min(axis=0)
    return np.minimum(deepest, 0.0)
