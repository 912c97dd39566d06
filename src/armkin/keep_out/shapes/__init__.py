"""Obstacles around an arm: one file for each shape, with the function that reads its entry in a file.

floor.py, box.py, capsule.py; segment_distances.py: distances between segments

A shape has a signed distance to segments (negative inside), triangles for pictures, and its numbers for C. A new shape
needs a file, a line in `_OF`, its keys in `armkin.robot_file.keep_out_keys` and its distance in C.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from armkin.keep_out.shapes import box, capsule, floor

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.robot_file.keep_out_keys import Entry


class Shape(Protocol):
    """A solid that does not move; lengths in mm, in the frame of the targets."""

    def distance(self, a: Array, b: Array) -> Array:
        """Least signed distance over segments: a, b (3, ...) -> (...)."""

    def of_points(self, points: Array) -> Array:
        """Signed distance of points: (3, ...) -> (...)."""

    def triangles(self, size: float) -> Array:
        """The surface for pictures, triangles (T, 3, 3) [mm]; size: extent [mm] of an unbounded shape."""

    def c_function(self) -> tuple[str, list[float]]:
        """The name of the distance function in C, and its numbers."""


_OF: dict[str, Callable[[Entry], Shape]] = {
    "floor": floor.read_floor,
    "box": box.read_box,
    "capsule": capsule.read_capsule,
}


def shape_of(entry: Entry) -> Shape:
    """The shape of a keep-out entry other than `self`."""
    return _OF[entry.kind](entry)
