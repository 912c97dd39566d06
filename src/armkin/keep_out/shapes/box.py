"""A box with any position and orientation."""

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
    """A box: its centre, its axes and half its size."""

    centre: Array  # (3,)
    axes: Array  # (3, 3) its axes as columns
    half: Array  # (3,) half the lengths of its edges

    def distance(self, a: Array, b: Array) -> Array:
        """Least signed distance over segments: a, b (3, ...) -> (...).

        The signed distance to a box is a convex function, so it has one minimum along a segment. Outside the box, its
        square is the sum of (|p| - h)^2 over the axes on which the point is beyond a face; the derivative is linear
        between the points where the segment crosses the planes of the six faces. Inside, it is the greatest of six
        linear functions, whose minimum is at an end of the segment or where two of the functions are equal.
        """
        batch_shape = a.shape[1:]
        start, direction = (self._in_box_axes(part.reshape(3, -1)) for part in (a, b - a))
        start -= (self.axes.T @ self.centre)[:, None]
        distances = np.sqrt(_outer_distance(start, direction, self.half))
        if (in_box := np.flatnonzero(distances == 0.0)).size:
            distances[in_box] = _inner_distance(start[:, in_box], direction[:, in_box], self.half)
        return distances.reshape(batch_shape)

    def of_points(self, given_points: Array) -> Array:
        """Signed distance of points: (3, ...) -> (...)."""
        points = self._in_box_axes(given_points.reshape(3, -1)) - (self.axes.T @ self.centre)[:, None]
        excess = np.abs(points) - self.half[:, None]
        depth = np.minimum(excess.max(axis=0), 0.0)
        np.maximum(excess, 0.0, out=excess)
        return np.asarray(np.sqrt(np.einsum("km,km->m", excess, excess)) + depth).reshape(given_points.shape[1:])

    def _in_box_axes(self, vectors: Array) -> Array:
        """Vectors (3, M) in the axes of the box."""
        components: Array = vectors.copy() if np.array_equal(self.axes, np.eye(3)) else self.axes.T @ vectors
        return components

    def corners(self) -> Array:
        """The corners (8, 3) [mm]."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        return np.asarray(self.centre + (signs * self.half) @ self.axes.T)

    def triangles(self, size: float) -> Array:
        """Two triangles for each face."""
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


def _outer_distance(start: Array, direction: Array, half_sizes: Array) -> Array:
    """Least squared distance of segments from `start` along `direction` (3, M) to the box: (M,), 0 inside."""
    half_column = half_sizes[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        # (6, M) parameters where the segment crosses the planes of the faces
        crossings = np.concatenate([(half_column - start) / direction, (-half_column - start) / direction])
    np.clip(np.nan_to_num(crossings, copy=False, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0, out=crossings)
    low, high = np.zeros(start.shape[1]), np.ones(start.shape[1])
    slope_low, slope_high = (_half_slope(t, start, direction, half_column) for t in (low, high))
    for t in crossings:
        slope = _half_slope(t, start, direction, half_column)
        is_closer = (slope <= 0.0) & (t > low)
        low, slope_low = np.where(is_closer, t, low), np.where(is_closer, slope, slope_low)
        is_closer = (slope >= 0.0) & (t < high)
        high, slope_high = np.where(is_closer, t, high), np.where(is_closer, slope, slope_high)
    rise = slope_high - slope_low
    share = np.divide(-slope_low, rise, out=np.zeros_like(rise), where=(rise > 0.0) & (slope_low < 0.0))
    t = low + np.minimum(share, 1.0) * (high - low)
    t = np.where(slope_high <= 0.0, high, np.where(slope_low >= 0.0, low, t))
    excess = np.maximum(np.abs(start + t * direction) - half_column, 0.0)
    square: Array = np.einsum("km,km->m", excess, excess)
    return square


def _half_slope(t: Array, start: Array, direction: Array, half_size: Array) -> Array:
    """Half the derivative of the squared distance along the segments: t (M,) -> (M,)."""
    points = start + t * direction
    slope: Array = np.einsum("km,km->m", points - np.clip(points, -half_size, half_size), direction)
    return slope


def _inner_distance(start: Array, direction: Array, half_sizes: Array) -> Array:
    """Least signed distance of segments that touch the box: (M,), at most 0."""
    signs = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])[:, None]
    height, slope = signs * np.tile(start, (2, 1)) - np.tile(half_sizes, 2)[:, None], signs * np.tile(direction, (2, 1))
    first, second = np.triu_indices(6, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = (height[second] - height[first]) / (slope[first] - slope[second])
    ends = np.broadcast_to([[0.0], [1.0]], (2, start.shape[1]))
    t = np.clip(np.nan_to_num(np.concatenate([ends, meets]), nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    deepest: Array = (height[:, None] + t * slope[:, None]).max(axis=0).min(axis=0)
    return np.minimum(deepest, 0.0)
