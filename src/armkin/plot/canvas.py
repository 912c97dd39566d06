"""matplotlib, imported when the first picture is drawn: figures, true proportions, files."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from armkin.errors import MissingExtraError, UsageError
from armkin.files import file_ending, write_whole
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


def check_picture(path: str) -> str:
    """The kind of picture that a file's name asks for."""
    return file_ending(path, "a picture is", _ENDS)[1:]


def require_matplotlib() -> None:
    """Say at once what to install if there is no matplotlib."""
    try:
        import_module("matplotlib.figure")
        import_module("mpl_toolkits.mplot3d")
    except ImportError as error:
        raise MissingExtraError(
            f"pictures need matplotlib, which cannot be imported ({error}); "
            "pip install matplotlib (armkin's extra: plot)"
        ) from None


@contextmanager
def picture(path: str | None, width: float, height: float) -> Iterator[Any]:
    """A figure [inches] to draw on, saved at the end: the file appears whole or not at all; None: in a window."""
    kind = None if path is None else check_picture(path)
    require_matplotlib()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        if path is None:
            plt = window_pyplot()
            yield plt.figure(figsize=(width, height), facecolor="white")
            plt.show()
            return
        figure = Figure(figsize=(width, height), facecolor="white")
        yield figure
        # No date and no version of matplotlib in the file.
        blank = {"Date": None, "Creator": "armkin"} if kind == "svg" else {"Software": "armkin"}
        with write_whole(path, "wb") as file:
            figure.savefig(file, format=kind, metadata=blank)


def window_pyplot() -> Any:
    """matplotlib's pyplot, if it can open a window here.

    Raises UsageError where there is no display, MissingExtraError where there is no toolkit for windows.
    """
    require_matplotlib()
    posix = sys.platform not in ("win32", "darwin")
    if posix and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UsageError("there is no display to open a window on; name a file for the picture, a .png or .svg")
    plt = import_module("matplotlib.pyplot")
    try:
        plt.switch_backend("TkAgg" if plt.get_backend().lower() == "agg" else plt.get_backend())
    except ImportError as error:
        raise MissingExtraError(
            f"matplotlib cannot open a window ({error}); install a toolkit (pip install PyQt6), or name a file"
        ) from None
    return plt


def space_axes(figure: Any, place: Sequence[float], view: tuple[float, float]) -> Any:
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
        getattr(axes, f"set_{name}label")(f"{name} / mm", labelpad=13 if name == "z" else 6)
        axes.tick_params(axis=name, pad=4 if name == "z" else 1, colors=SOFT)
    axes.zaxis.set_rotate_label(False)
    axes.zaxis.label.set_rotation(90)
    sizes = _lengths_on_paper(*view)
    for name, size in zip("xyz", sizes, strict=True):
        axis = getattr(axes, f"{name}axis")
        if size >= 0.1 > sizes.min():  # seen square: nothing slants away from under the ticks
            axis.labelpad = 10
        elif size < 0.1:  # seen end-on: its ticks would lie on each other
            axes.tick_params(axis=name, labelcolor="none", color="none")
            getattr(axes, f"set_{name}label")("")
    return axes


def _lengths_on_paper(elevation: float, azimuth: float) -> Array:
    """How long x, y and z of length 1 look from an eye far away at these angles [deg]."""
    up, around = np.radians(elevation), np.radians(azimuth)
    view_direction = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    lengths: Array = np.sqrt(np.maximum(1.0 - view_direction**2, 0.0))
    return lengths


def true_proportions(axes: Any, points: Array, floor: float, ticks: float = 7.5) -> None:
    """Limits that hold all points (N, 3) [mm] and the floor, a millimetre as long on every axis.

    The box, its ticks and its labels fill the place that the axes were given, and nothing leaves it.
    """
    from matplotlib.ticker import FixedLocator

    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = min(low[2], floor)
    size = high - low
    largest = float(size.max()) or 1.0
    # No side is so short that its ticks would run into each other.
    grow = np.maximum(0.5 * (0.5 * largest - size), 0.0) + 0.04 * largest
    if low[2] == floor:  # the arm stands on the floor
        low, high = low - grow * [1, 1, 0], high + grow * [1, 1, 2]
    else:
        low, high = low - grow, high + grow
    step = tick_step(largest, ticks)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(a, b)
        # Where two axes meet, the last tick of one would lie on the first of the other.
        edge = 0.0 if name == "z" else min(0.1 * (b - a), 0.5 * step)
        marks = step * np.arange(np.ceil((a + edge) / step), np.floor((b - edge) / step) + 1)
        getattr(axes, f"{name}axis").set_major_locator(FixedLocator(marks.tolist()))
    _fill_place(axes, high - low)


def renderer(figure: Any) -> Any:
    """What measures text in a figure, before anything is drawn."""
    if hasattr(figure.canvas, "get_renderer"):
        return figure.canvas.get_renderer()
    agg: Any = import_module("matplotlib.backends.backend_agg")
    return agg.FigureCanvasAgg(figure).get_renderer()


def _fill_place(axes: Any, size: Array) -> None:
    """Make the box (size: mm along each axis) as large as its place allows, ticks and labels included."""
    x0, y0, width, height = axes.get_position().bounds
    room, middle = np.array([width, height]), np.array([x0 + 0.5 * width, y0 + 0.5 * height])
    zoom, fits = 1.0, axes.figure.transFigure.inverted()
    for _ in range(5):  # the labels do not grow with the box, and perspective is only nearly proportional
        axes.set_box_aspect(size, zoom=zoom)
        lowest, highest = fits.transform(_visible_corners(axes))
        zoom *= float((room / (highest - lowest)).min())
        place = axes.get_position(original=True)
        shift = middle - 0.5 * (lowest + highest)
        axes.set_position([place.x0 + shift[0], place.y0 + shift[1], place.width, place.height])


def _visible_corners(axes: Any) -> Array:
    """Corners of all that is seen of the axes in space, ticks and labels included: (2, 2) [pixels]."""
    drawer = renderer(axes.figure)
    axes.apply_aspect()
    axes.M = axes.get_proj()
    axes.invM = np.linalg.inv(axes.M)
    boxes = [axis.get_tightbbox(drawer) for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    ends = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    corners = np.array([[x, y, z] for x in ends[0] for y in ends[1] for z in ends[2]])
    x_on_paper, y_on_paper, _ = import_module("mpl_toolkits.mplot3d.proj3d").proj_transform(*corners.T, axes.M)
    points = [axes.transData.transform(np.column_stack([x_on_paper, y_on_paper]))]
    points += [box.get_points() for box in boxes if box is not None and np.isfinite(box.get_points()).all()]
    pixels = np.concatenate(points)
    return np.array([pixels.min(axis=0), pixels.max(axis=0)])


def tick_step(size: float, max_ticks: float = 7.5) -> float:
    """The smallest round distance [mm] between ticks that a size [mm] holds at most so often.

    >>> tick_step(400.0), tick_step(1400.0)
    (100.0, 200.0)
    """
    power = 10.0 ** np.floor(np.log10(size / max_ticks))
    return float(power * next(factor for factor in (1, 2, 5, 10) if factor * power >= size / max_ticks))


def flat_axes(figure: Any, place: Sequence[float], labels: tuple[str, str], shrink: bool = False) -> Any:
    """Axes in a plane, a millimetre as long on both; shrink: the frame to the data, not the reverse."""
    axes = figure.add_axes(place)
    axes.set_aspect("equal", adjustable="box" if shrink else "datalim")
    axes.set_xlabel(labels[0], labelpad=3)
    axes.set_ylabel(labels[1], labelpad=3)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.tick_params(length=3)
    return axes
