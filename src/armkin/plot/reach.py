"""A map of reach: the section through the arm's plane, and the slice in which most is reached."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.plot.canvas import INK, SOFT, flat, picture

if TYPE_CHECKING:
    from armkin.reachability.map import Reach

_SHOWN = (("share", "share of orientations"), ("branches", "legal branches"), ("single", "share by one branch alone"))


def plot_reach(found: Reach, out: str) -> None:
    """Draw share, branches and fragile places (one branch only): above the section, below the slice."""
    if not found.columns:
        raise UsageError("this map is in a file alone: too many cells for a picture")
    grid = found.grid
    rings, M = grid.rings, grid.azimuths
    share = found.columns["share"].reshape(-1, M)
    level = _fullest(rings[:, 1], share.sum(axis=1))
    with picture(out, 11.4, 6.6) as figure:
        for column, (name, label) in enumerate(_SHOWN):
            values = np.where(share > 0, found.columns[name].reshape(-1, M), np.nan)
            left = 0.075 + 0.32 * column
            side = flat(figure, (left, 0.53, 0.195, 0.34), ("r / mm", "z / mm"))
            slab = flat(figure, (left, 0.09, 0.195, 0.34), ("x / mm", "y / mm"))
            most = 1.0 if name != "branches" else max(float(np.nanmax(values, initial=1.0)), 1.0)
            drawn = _section(side, rings, values, grid.step, most)
            _slice(slab, rings[:, 0], values, rings[:, 1] == level, grid.step, most)
            place = figure.add_axes((left + 0.205, 0.15, 0.008, 0.66))
            bar = figure.colorbar(drawn, cax=place)
            bar.outline.set_visible(False)
            figure.text(left, 0.9, label, fontsize=10, color=INK)
        where = f"{found.reached:,} of {found.cells:,} cells, {found.orientations:,} orientations each ({found.method})"
        figure.text(0.03, 0.985, grid.arm.name, fontsize=13, va="top", color=INK)
        figure.text(0.03, 0.945, f"{where};  below: z = {level * grid.step:g} mm", fontsize=9, va="top", color=SOFT)


def _fullest(levels: Array, weight: Array) -> int:
    """The level in which most is reached."""
    names, index = np.unique(levels, return_inverse=True)
    return int(names[np.bincount(index, weight).argmax()])


def _section(axes: Any, rings: Array, values: Array, step: float, most: float) -> Any:
    """Cells ahead of the arm, and, to the left, behind it."""
    i, j = rings[:, 0], rings[:, 1] - rings[:, 1].min()
    table = np.full((j.max() + 1, 2 * (i.max() + 1)), np.nan)
    table[j, i.max() + 1 + i] = values[:, 0]
    table[j, i.max() - i] = values[:, values.shape[1] // 2]
    across = (np.arange(table.shape[1] + 1) - i.max() - 1) * step
    up = (np.arange(table.shape[0] + 1) + rings[:, 1].min() - 0.5) * step
    return axes.pcolormesh(across, up, table, vmin=0.0, vmax=most, cmap="viridis", rasterized=True)


def _slice(axes: Any, i: Array, values: Array, there: Array, step: float, most: float) -> None:
    """One level, seen along joint 1's axis, in the reach frame."""
    M = values.shape[1]
    table = np.full((i.max() + 1, M), np.nan)
    table[i[there]] = values[there]
    r = np.arange(len(table) + 1)[:, None] * step
    angle = (np.arange(M + 1) - 0.5)[None] * (2 * np.pi / M)
    axes.pcolormesh(r * np.cos(angle), r * np.sin(angle), table, vmin=0.0, vmax=most, cmap="viridis", rasterized=True)
