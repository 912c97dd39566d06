"""matplotlib, imported when the first picture is drawn: figures, true proportions, files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from armkin.errors import MissingExtraError, UsageError
from armkin.files import whole
from armkin.formula.arrays import Array

INK, SOFT, FAINT = "#1b1f24", "#6a737d", "#d5dae0"
# Okabe and Ito's colours, told apart also by the colour-blind (Color Universal Design, 2008).
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c8c00")

_ENDS = (".png", ".svg")
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same picture everywhere
    "font.size": 11,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.labelsize": 11,
    "axes.linewidth": 0.8,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "grid.color": FAINT,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 10.5,
    "svg.hashsalt": "armkin",
    "svg.fonttype": "path",
    "savefig.dpi": 150,
}


def check(path: str) -> str:
    """The kind of picture that a file's name asks for."""
    end = Path(path).suffix.lower()
    if end not in _ENDS:
        raise UsageError(f"{path}: a picture is written as .png or .svg; end the file's name with one of them")
    return end[1:]


def require() -> None:
    """Say at once what to install if there is no matplotlib."""
    try:
        import_module("matplotlib.figure")
        import_module("mpl_toolkits.mplot3d")
    except ImportError as error:
        raise MissingExtraError(
            f"pictures need matplotlib, which cannot be imported ({error}); pip install 'armkin[plot]'"
        ) from None


@contextmanager
def picture(path: str, width: float, height: float) -> Iterator[Any]:
    """A figure [inches] to draw on, saved at the end; the file appears whole or not at all."""
    kind = check(path)
    require()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), facecolor="white")
        yield figure
        # No date and no version of matplotlib in the file.
        blank = {"Date": None, "Creator": "armkin"} if kind == "svg" else {"Software": "armkin"}
        with whole(path, "wb") as file:
            figure.savefig(file, format=kind, metadata=blank)


def space(figure: Any, place: Sequence[float], view: tuple[float, float]) -> Any:
    """Axes in space at (left, bottom, width, height) of the figure; view: elevation, azimuth [deg]."""
    axes = figure.add_axes(place, projection="3d", computed_zorder=False)
    axes.view_init(elev=view[0], azim=view[1])
    axes.set_proj_type("persp", focal_length=1.8)
    for name in "xyz":
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color("white")
        axis.pane.set_edgecolor(FAINT)
        axis._axinfo["grid"].update(color=FAINT, linewidth=0.6)
        axis.line.set_color(SOFT)
        getattr(axes, f"set_{name}label")(f"{name} / mm", labelpad=8 if name == "z" else 5)
        axes.tick_params(axis=name, pad=4 if name == "z" else 1, colors=SOFT)
    axes.zaxis.set_rotate_label(False)
    axes.zaxis.label.set_rotation(90)
    sizes = _on_paper(*view)
    for name, size in zip("xyz", sizes, strict=True):
        axis = getattr(axes, f"{name}axis")
        if size >= 0.1 > sizes.min():  # seen square: nothing slants away from under the ticks
            axis.labelpad = 10
        elif size < 0.1:  # seen end-on: its ticks would lie on each other
            axes.tick_params(axis=name, labelcolor="none", color="none")
            getattr(axes, f"set_{name}label")("")
    return axes


def _on_paper(elevation: float, azimuth: float) -> Array:
    """How long x, y and z of length 1 look from an eye far away at these angles [deg]."""
    up, around = np.radians(elevation), np.radians(azimuth)
    toward = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    seen: Array = np.sqrt(np.maximum(1.0 - toward**2, 0.0))
    return seen


def true_proportions(axes: Any, points: Array, floor: float, ticks: float = 7.5) -> None:
    """Limits that hold all points (N, 3) [mm] and the floor, a millimetre as long on every axis.

    The box fills the place that the axes were given, with room for their labels.
    """
    from matplotlib.ticker import MultipleLocator

    proj3d = import_module("mpl_toolkits.mplot3d.proj3d")
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = min(low[2], floor)
    size = high - low
    most = float(size.max()) or 1.0
    # No side is so short that its ticks would run into each other.
    grow = np.maximum(0.5 * (0.4 * most - size), 0.0) + 0.04 * most
    if low[2] == floor:  # the arm stands on the floor
        low, high = low - grow * [1, 1, 0], high + grow * [1, 1, 2]
    else:
        low, high = low - grow, high + grow
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(a, b)
        getattr(axes, f"{name}axis").set_major_locator(MultipleLocator(tick_step(most, ticks)))

    x0, y0, width, height = axes.get_position().bounds
    square = _on_paper(axes.elev, axes.azim).min() < 0.1
    room = np.array([0.80 * width, (0.72 if square else 0.86) * height])
    middle = np.array([x0 + 0.5 * width, y0 + 0.52 * height])
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    zoom = 1.0
    for _ in range(3):  # perspective: the size on paper is only nearly proportional to the zoom
        axes.set_box_aspect(high - low, zoom=zoom)
        axes.apply_aspect()
        across, up, _ = proj3d.proj_transform(*corners.T, axes.get_proj())
        shown = axes.figure.transFigure.inverted().transform(axes.transData.transform(np.column_stack([across, up])))
        least, greatest = shown.min(axis=0), shown.max(axis=0)
        zoom *= float((room / (greatest - least)).min())
        shift = middle - 0.5 * (least + greatest)
        place = axes.get_position(original=True)
        axes.set_position([place.x0 + shift[0], place.y0 + shift[1], place.width, place.height])


def tick_step(size: float, most: float = 7.5) -> float:
    """The smallest round distance [mm] between ticks that a size [mm] holds at most so often.

    >>> tick_step(400.0), tick_step(1400.0)
    (100.0, 200.0)
    """
    power = 10.0 ** np.floor(np.log10(size / most))
    return float(power * next(m for m in (1, 2, 5, 10) if m * power >= size / most))


def flat(figure: Any, place: Sequence[float], labels: tuple[str, str], shrink: bool = False) -> Any:
    """Axes in a plane, a millimetre as long on both; shrink: the frame to the data, not the reverse."""
    axes = figure.add_axes(place)
    axes.set_aspect("equal", adjustable="box" if shrink else "datalim")
    axes.set_xlabel(labels[0], labelpad=3)
    axes.set_ylabel(labels[1], labelpad=3)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.tick_params(length=3)
    return axes
