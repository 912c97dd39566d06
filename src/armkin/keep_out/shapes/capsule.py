"""A capsule: all points within a radius of a segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.keep_out.shapes.segment_distances import segment_distance

if TYPE_CHECKING:
    from armkin.robot_file.keep_out_keys import Entry

_ROUND = 24  # corners of a capsule's circles in pictures


@dataclass(frozen=True, eq=False)
class Capsule:
    """A segment with a radius."""

    begin: Array  # (3,)
    end: Array  # (3,)
    radius: float

    def distance(self, a: Array, b: Array) -> Array:
        """Distance of segments to its axis, minus its radius: a, b (3, ...) -> (...)."""
        ends = (end.reshape(3, *[1] * (a.ndim - 1)) for end in (self.begin, self.end))
        return segment_distance(a, b, *ends) - self.radius

    def of_points(self, points: Array) -> Array:
        """Distance of points to its axis, minus its radius: (3, ...) -> (...)."""
        begin, direction = (x.reshape(3, *[1] * (points.ndim - 1)) for x in (self.begin, self.end - self.begin))
        length = float(np.einsum("k...,k...", direction, direction).item())
        share = np.einsum("k...,k...->...", points - begin, direction) / length if length else 0.0
        offset = points - begin - np.clip(share, 0.0, 1.0) * direction
        return np.asarray(np.sqrt(np.einsum("k...,k...->...", offset, offset)) - self.radius)

    def triangles(self, size: float) -> Array:
        """A tube with half spheres at its ends."""
        return tube(self.begin, self.end, self.radius)

    def c_function(self) -> tuple[str, list[float]]:
        """The name of the capsule's distance function in C, and its ends and radius [mm]."""
        return "capsule", [*self.begin.tolist(), *self.end.tolist(), self.radius]


def read_capsule(entry: Entry) -> Capsule:
    """The capsule of an entry."""
    assert entry.capsule is not None
    return Capsule(np.array(entry.capsule.begin), np.array(entry.capsule.end), entry.capsule.radius)


def tube(begin: Array, end: Array, radius: float) -> Array:
    """Triangles (T, 3, 3) of a capsule's surface."""
    direction = end - begin
    length = float(np.linalg.norm(direction))
    z = direction / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    angles = np.linspace(0.0, 2 * np.pi, _ROUND + 1)
    circle = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * np.cross(z, x)
    rings = []
    for centre, heights in ((begin, np.linspace(-np.pi / 2, 0, 5)), (end, np.linspace(0, np.pi / 2, 5))):
        rings += [centre + radius * (np.cos(h) * circle + np.sin(h) * z) for h in heights]
    grid = np.array(rings)
    a, b = grid[:-1, :-1], grid[1:, :-1]
    c, d = grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack(triangle, axis=2).reshape(-1, 3, 3) for triangle in ((a, b, c), (a, c, d))])
