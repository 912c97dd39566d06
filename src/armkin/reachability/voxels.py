"""Cubic voxels for pictures of cells that are sectors of rings; a voxel shows the cell that contains its centre.

The edges of voxels have the length of the grid. Their centres are at ((a + 1/2) grid, b grid, c grid) in the reach
frame, so that centres in the plane y = 0 are centres of cells.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.model.units import TURN

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.reachability.reach_cells import Grid


class Layer(NamedTuple):
    """Voxels of a plane: places (V, 2) along its axes, in steps of the grid; row (V,): index of the cell.

    centres: (V, 3) in the reach frame [mm].
    """

    places: NDArray[np.intp]
    row: NDArray[np.intp]
    centres: Array

    def table(self, column: Array) -> Array:
        """A column of the cells as an image (rows upwards, columns to the right); nan without a cell."""
        image_column, image_row = (self.places - self.places.min(axis=0)).T
        image = np.full((image_row.max() + 1, image_column.max() + 1), np.nan)
        image[image_row, image_column] = column[self.row]
        return image


def section_layer(grid: Grid) -> Layer:
    """The plane y = 0 of the reach frame: places (a, c)."""
    a, c = _square_indices(grid)
    return _layer_of_places(grid, a, c, np.stack([(a + 0.5) * grid.step, 0.0 * a, c * grid.step], axis=1))


def level_layer(grid: Grid, c: int) -> Layer:
    """The plane z = c grid of the reach frame: places (a, b)."""
    a, b = _square_indices(grid)
    return _layer_of_places(
        grid, a, b, np.stack([(a + 0.5) * grid.step, b * grid.step, 0.0 * a + c * grid.step], axis=1)
    )


def rows_at(grid: Grid, points: Array) -> NDArray[np.intp]:
    """The index of the cell that contains each point of the reach frame (N, 3); -1 for none."""
    x, y, z = points.T
    i = np.floor(np.hypot(x, y) / grid.step).astype(np.intp)
    j = np.rint(z / grid.step).astype(np.intp)
    k = np.rint(np.arctan2(y, x) * (grid.azimuths / TURN)).astype(np.intp) % grid.azimuths
    rings = grid.rings.astype(np.intp)
    last_i, lowest_j = rings[:, 0].max(), rings[:, 1].min()
    ring = np.full((last_i + 1, rings[:, 1].max() - lowest_j + 1), -1, np.intp)
    ring[rings[:, 0], rings[:, 1] - lowest_j] = np.arange(len(rings))
    is_inside = (i <= last_i) & (j >= lowest_j) & (j - lowest_j < ring.shape[1])
    ring_numbers = np.where(is_inside, ring[np.where(is_inside, i, 0), np.where(is_inside, j - lowest_j, 0)], -1)
    return np.asarray(np.where(ring_numbers < 0, -1, ring_numbers * grid.azimuths + k))


def _square_indices(grid: Grid) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    half_width = int(grid.rings[:, 0].max()) + 1
    a, b = np.meshgrid(np.arange(-half_width, half_width), np.arange(-half_width, half_width + 1), indexing="ij")
    return a.ravel(), b.ravel()


def _layer_of_places(grid: Grid, first: NDArray[np.intp], second: NDArray[np.intp], centres: Array) -> Layer:
    row = rows_at(grid, centres)
    has_cell = row >= 0
    return Layer(np.stack([first, second], axis=1)[has_cell], row[has_cell], centres[has_cell])
