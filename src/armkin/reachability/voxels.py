"""Cubic voxels for pictures, from cells that are sectors of rings: a voxel takes the cell that its centre lies in.

Voxels are as large as the cells' grid. Their centres stand at ((a + 1/2) grid, b grid, c grid) of the reach frame, so
that those of the plane y = 0 stand at the centres of cells.
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
    """Voxels of a plane: places (V, 2) along its axes, in steps of the grid; row (V,): the cell of each.

    centres: (V, 3) in the reach frame [mm].
    """

    places: NDArray[np.intp]
    row: NDArray[np.intp]
    centres: Array

    def table(self, column: Array) -> Array:
        """A column of the cells as an image (rows upwards, columns to the right); nan where there is no cell."""
        across, up = (self.places - self.places.min(axis=0)).T
        image = np.full((up.max() + 1, across.max() + 1), np.nan)
        image[up, across] = column[self.row]
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
    """The cell that each point of the reach frame (N, 3) lies in, by its row; -1: in none."""
    x, y, z = points.T
    i = np.floor(np.hypot(x, y) / grid.step).astype(np.intp)
    j = np.rint(z / grid.step).astype(np.intp)
    k = np.rint(np.arctan2(y, x) * (grid.azimuths / TURN)).astype(np.intp) % grid.azimuths
    rings = grid.rings.astype(np.intp)
    most_i, low = rings[:, 0].max(), rings[:, 1].min()
    ring = np.full((most_i + 1, rings[:, 1].max() - low + 1), -1, np.intp)
    ring[rings[:, 0], rings[:, 1] - low] = np.arange(len(rings))
    inside = (i <= most_i) & (j >= low) & (j - low < ring.shape[1])
    ring_numbers = np.where(inside, ring[np.where(inside, i, 0), np.where(inside, j - low, 0)], -1)
    return np.asarray(np.where(ring_numbers < 0, -1, ring_numbers * grid.azimuths + k))


def _square_indices(grid: Grid) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    most = int(grid.rings[:, 0].max()) + 1
    a, b = np.meshgrid(np.arange(-most, most), np.arange(-most, most + 1), indexing="ij")
    return a.ravel(), b.ravel()


def _layer_of_places(grid: Grid, first: NDArray[np.intp], second: NDArray[np.intp], centres: Array) -> Layer:
    row = rows_at(grid, centres)
    inside = row >= 0
    return Layer(np.stack([first, second], axis=1)[inside], row[inside], centres[inside])
