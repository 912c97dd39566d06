"""Where to put arms: a floor coloured by how many targets each place reaches, with the arm drawn at its best."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.plot.canvas import INK, SOFT, flat_axes, picture
from armkin.reachability.place.arm_among_obstacles import Obstacles, arm_at_place
from armkin.view.skeleton import skeleton

if TYPE_CHECKING:
    from armkin.reachability.place.place_search import Place

TARGETS = "#e2572b"


def plot_place(places: Sequence[Place], out: str) -> None:
    """One floor an arm: of each position the share of targets that its best yaw reaches."""
    with picture(out, 5.6 * len(places), 5.4) as figure:
        for number, place in enumerate(places):
            width = 1.0 / len(places)
            axes = flat_axes(figure, ((number + 0.14) * width, 0.12, 0.66 * width, 0.7), ("x / mm", "y / mm"))
            share = place.reached.max(axis=2).T / place.of
            half_step = 0.5 * float(place.x[1] - place.x[0] if len(place.x) > 1 else 50.0)
            corners = (place.x[0] - half_step, place.x[-1] + half_step, place.y[0] - half_step, place.y[-1] + half_step)
            image = axes.imshow(share, origin="lower", extent=corners, vmin=0, vmax=1, cmap="viridis")
            x, y, yaw = *place.xyz[:2], float(place.yaw[place.best[2]])
            size = 0.15 * place.arm.reach
            axes.plot(*_heading_stroke(x, y, yaw, size), color="white", lw=3.5)
            axes.plot(*_heading_stroke(x, y, yaw, size), color=INK, lw=1.5)
            _draw_arm(axes, place)
            axes.plot([x], [y], "o", color=INK, mec="white", ms=8)
            bar = figure.colorbar(image, cax=figure.add_axes(((number + 0.83) * width, 0.15, 0.02 * width, 0.64)))
            bar.outline.set_visible(False)
            left = (number + 0.05) * width
            text = f"best: {x:g}, {y:g} mm, {np.degrees(yaw):g} deg, {int(place.reached[place.best])} of {place.of}"
            figure.text(left, 0.95, place.arm.name, fontsize=12, va="top", color=INK)
            figure.text(left, 0.9, f"share of targets reached;  {text}", fontsize=8.5, va="top", color=SOFT)


def _draw_arm(axes: Any, place: Place) -> None:
    """The targets, and the arm from above at its best place: on a target in the middle, paler on the first and last."""
    count = len(place.postures)
    position = (float(place.xyz[0]), float(place.xyz[1]), place.z)
    stands = arm_at_place(place.arm, Obstacles(), position, float(place.yaw[place.best[2]]))
    are_few = len(place.positions) < 50
    axes.plot(*place.positions[:, :2].T, ".", color=TARGETS, mec="white", mew=0.5 * are_few, ms=7 if are_few else 3)
    middle = count // 2
    for k in dict.fromkeys((0, count - 1, middle)) if count else ():
        line = skeleton(stands, place.postures[k]).path
        opacity = 1.0 if k == middle else 0.45
        axes.plot(*line[:, :2].T, color="white", lw=5.0, alpha=opacity, solid_capstyle="round", solid_joinstyle="round")
        axes.plot(*line[:, :2].T, color=INK, lw=2.4, alpha=opacity, solid_capstyle="round", solid_joinstyle="round")


def _heading_stroke(x: float, y: float, yaw: float, size: float) -> tuple[list[float], list[float]]:
    """A stroke from a place along its x axis."""
    return [x, x + size * float(np.cos(yaw))], [y, y + size * float(np.sin(yaw))]
