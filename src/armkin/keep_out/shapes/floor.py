"""A floor: all points below a height."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.robot_file.keep_out_keys import Entry


@dataclass(frozen=True)
class Floor:
    """The half-space z < height."""

    height: float

    def distance(self, a: Array, b: Array) -> Array:
        """Height of a segment's lower end: a, b (3, ...) -> (...)."""
        lower: Array = np.minimum(a[2], b[2])
        return lower - self.height

    def of_points(self, points: Array) -> Array:
        """Height above the floor: (3, ...) -> (...)."""
        return np.asarray(points[2] - self.height)

    def triangles(self, size: float) -> Array:
        """A square with sides of twice the size."""
        corners = np.array([[-size, -size], [size, -size], [size, size], [-size, size]])
        corners = np.column_stack([corners, np.full(4, self.height)])
        return corners[[[0, 1, 2], [0, 2, 3]]]

    def c_function(self) -> tuple[str, list[float]]:
        """The name of the floor's distance function in C, and its height [mm]."""
        return "floor", [self.height]


def read_floor(entry: Entry) -> Floor:
    """The floor of an entry."""
    assert entry.floor is not None
    return Floor(entry.floor)
