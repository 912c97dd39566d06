"""A map of reach in cubic voxels: the section through the arm's plane, and the slice in which most is reached."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.plot.canvas import INK, SOFT, flat_axes, picture
from armkin.reachability import voxels

if TYPE_CHECKING:
    from armkin.reachability.reach_map import Reach

_SHOWN = (("share", "share of orientations"), ("branches", "legal branches"), ("single", "share by one branch alone"))


def plot_reach(reach: Reach, out: str) -> None:
    """Draw share, branches and fragile places (one branch only): above the section, below the slice."""
    if not reach.columns:
        raise UsageError("this map is in a file alone: too many cells for a picture")
    grid = reach.grid
    share = reach.columns["share"]
    fullest_level = _fullest_level(grid.rings[:, 1], share.reshape(-1, grid.azimuths).sum(axis=1))
    side, slab = voxels.section_layer(grid), voxels.level_layer(grid, fullest_level)
    with picture(out, 11.4, 6.6) as figure:
        for column, (name, label) in enumerate(_SHOWN):
            values = np.where(share > 0, reach.columns[name], np.nan)
            left = 0.075 + 0.32 * column
            side_axes = flat_axes(figure, (left, 0.53, 0.195, 0.34), ("x / mm", "z / mm"))
            slab_axes = flat_axes(figure, (left, 0.09, 0.195, 0.34), ("x / mm", "y / mm"))
            greatest = 1.0 if name != "branches" else max(float(np.nanmax(values, initial=1.0)), 1.0)
            mesh = _draw_squares(side_axes, side, values, grid.step, greatest)
            _draw_squares(slab_axes, slab, values, grid.step, greatest)
            place = figure.add_axes((left + 0.205, 0.15, 0.008, 0.66))
            bar = figure.colorbar(mesh, cax=place)
            bar.outline.set_visible(False)
            figure.text(left, 0.9, label, fontsize=10, color=INK)
        orientations_text = f"{reach.orientations:,} orientation{'s' * (reach.orientations != 1)} each"
        cells_text = f"{reach.reached:,} of {reach.cells:,} cells, {orientations_text} ({reach.method})"
        figure.text(0.03, 0.985, grid.arm.name, fontsize=13, va="top", color=INK)
        figure.text(
            0.03,
            0.945,
            f"{cells_text};  above: y = 0;  below: z = {fullest_level * grid.step:g} mm",
            fontsize=9,
            va="top",
            color=SOFT,
        )


def _fullest_level(levels: Array, weight: Array) -> int:
    """The level in which most is reached."""
    names, index = np.unique(levels, return_inverse=True)
    return int(names[np.bincount(index, weight).argmax()])


def _draw_squares(axes: Any, layer: voxels.Layer, values: Array, step: float, greatest: float) -> Any:
    """A plane of voxels: centres at half steps along x, at whole ones along the other axis."""
    table = layer.table(values)
    low = layer.places.min(axis=0)
    x_edges = (low[0] + np.arange(table.shape[1] + 1)) * step
    y_edges = (low[1] - 0.5 + np.arange(table.shape[0] + 1)) * step
    return axes.pcolormesh(x_edges, y_edges, table, vmin=0.0, vmax=greatest, cmap="viridis", rasterized=True)
