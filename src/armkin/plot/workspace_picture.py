"""The cloud of a workspace, and its projections from above and around the base's axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.plot.canvas import INK, SOFT, flat_axes, picture, space_axes, true_proportions

if TYPE_CHECKING:
    from armkin.reachability import Workspace

COLOURS = ("manipulability", "step_error", "reach", "z")
ENOUGH_SAMPLES = 150_000  # samples of a survey that are enough for a picture: more cannot be told apart
_CLOUD = 20_000  # samples of a survey that are drawn in space
_SPOT_SAMPLES = 15  # samples a spot of a projection should have in the mean; below that they are drawn one by one

_LABELS = {
    "manipulability": "manipulability, share of the largest",
    "step_error": "step error / mm",
    "reach": "distance from the base / mm",
    "z": "z / mm",
}


def plot_workspace(workspace: Workspace, out: str, *, colour: str = "manipulability", title: str | None = None) -> None:
    """Draw the samples that a survey kept: in space, from above (xy), and turned about the base (rz).

    colour: a measure of the survey ("manipulability", "step_error"), "reach" or "z". In the
    projections a spot has the mean of the samples that fall on it; few samples are drawn one by one.
    Planar arms are drawn from above.
    """
    if colour not in COLOURS:
        raise UsageError(f"there is no colour '{colour}'; there are {', '.join(COLOURS)}")
    if colour in ("manipulability", "step_error") and colour not in workspace.values:
        raise UsageError(f"the survey has no {colour}; ask for it with measures=['{colour}']")
    if not len(workspace.tips):
        raise UsageError("the survey kept no samples to draw; ask for them with keep=100_000")
    tips, values = workspace.tips, _colour_values(workspace, colour)
    flat_arm = workspace.extent is not None and workspace.extent.dimensions == 2 and _is_level(tips)
    with picture(out, 8.0, 6.2) as figure:
        if flat_arm:
            axes = flat_axes(figure, (0.11, 0.1, 0.72, 0.76), ("x / mm", "y / mm"))
            hexagons = _draw_spots(axes, tips[:, 0], tips[:, 1], values, 140)
            bar = figure.add_axes((0.87, 0.1, 0.022, 0.76))
        else:
            base = workspace.arm.base
            round_base = (tips - base[:3, 3]) @ base[:3, :3]
            cloud = space_axes(figure, (0.01, 0.13, 0.54, 0.76), (20.0, -60.0))
            order = _far_to_near(tips[:_CLOUD], -60.0)
            cloud.scatter(
                *tips[order].T,
                c=values[order],
                s=3.0,
                alpha=0.7,
                linewidths=0,
                cmap="viridis",
                rasterized=True,
            )
            true_proportions(cloud, tips, float(tips[:, 2].min()), ticks=5.5)
            top_axes = flat_axes(figure, (0.675, 0.545, 0.305, 0.345), ("x / mm", "y / mm"), shrink=True)
            hexagons = _draw_spots(top_axes, tips[:, 0], tips[:, 1], values, 90)
            side = flat_axes(figure, (0.675, 0.095, 0.305, 0.345), ("r / mm", "z / mm"), shrink=True)
            _draw_spots(side, np.hypot(round_base[:, 0], round_base[:, 1]), round_base[:, 2], values, 90)
            side.set_xlim(left=min(0.0, side.get_xlim()[0]))  # the base's axis is part of the picture
            bar = figure.add_axes((0.06, 0.1, 0.44, 0.022))
        _draw_bar(figure, bar, hexagons, _LABELS[colour], upright=flat_arm)
        figure.text(0.03, 0.97, workspace.arm.name if title is None else title, fontsize=13, va="top", color=INK)
        figure.text(0.03, 0.92, _caption(workspace), fontsize=10, va="top", color=SOFT)


def _colour_values(workspace: Workspace, colour: str) -> Array:
    if colour == "reach":
        return np.asarray(np.linalg.norm(workspace.tips - workspace.arm.base[:3, 3], axis=1))
    if colour == "z":
        return workspace.tips[:, 2]
    values = workspace.values[colour]
    if colour == "manipulability":
        return values / (workspace.measures[colour][1] or 1.0)
    return values


def _is_level(tips: Array) -> bool:
    return bool(np.ptp(tips[:, 2]) < 1e-6 * max(float(np.ptp(tips[:, :2])), 1.0))


def _far_to_near(tips: Array, azimuth: float) -> Any:
    """Order of drawing: what is nearer to the eye covers what is behind."""
    view_direction = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.35])
    return np.argsort(tips @ view_direction)


def _draw_spots(axes: Any, x: Array, y: Array, values: Array, columns: int) -> Any:
    """Mean value on a grid of hexagons of the same size along both axes."""
    columns = min(columns, int(np.sqrt(len(x) / _SPOT_SAMPLES)))
    if columns < 50:
        return axes.scatter(x, y, c=values, s=4.0, linewidths=0, cmap="viridis", rasterized=True)
    width, height = float(np.ptp(x)) or 1.0, float(np.ptp(y)) or 1.0
    size = max(width, height) / columns
    grid = (max(1, round(width / size)), max(1, round(height / size / np.sqrt(3))))
    hexagons = axes.hexbin(x, y, C=values, gridsize=grid, cmap="viridis", linewidths=0.25, edgecolors="face")
    hexagons.set_clim(float(values.min()), float(values.max()))
    return hexagons


def _draw_bar(figure: Any, place: Any, hexagons: Any, label: str, upright: bool) -> None:
    bar = figure.colorbar(hexagons, cax=place, orientation="vertical" if upright else "horizontal")
    bar.outline.set_visible(False)
    bar.set_label(label, labelpad=5)
    place.tick_params(length=3)


def _caption(workspace: Workspace) -> str:
    parts = [f"{workspace.samples:,} samples"]
    if workspace.extent is not None and workspace.extent.value > 0:
        size = workspace.extent
        power, unit = (9, "m³") if size.dimensions == 3 else (6, "m²")
        parts.append(f"{size.value / 10**power:.4g} {unit} ± {100 * size.error / size.value:.1g} %")
    return ";  ".join(parts)
