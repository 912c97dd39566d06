"""The arm in one pose, in all branches of a target, or along a path."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import as_joints, fk
from armkin.forward import frames as joint_frames
from armkin.keep_out.clearance import hits, hits_text
from armkin.model.limits import outside_limits
from armkin.plot.canvas import FAINT, INK, PALETTE, SOFT, flat_axes, picture, renderer, space_axes, true_proportions
from armkin.reachability.volume import tip_freedoms
from armkin.view.skeleton import Skeleton, skeleton

if TYPE_CHECKING:
    from armkin.keep_out.clearance import Hit
    from armkin.model.arm import Arm

MAX_POSES = 20_000  # poses, at most, of one path
_DRAWN_POSES = 40  # poses of a path, evenly spaced, that are drawn as arms
_WAY_POINTS = 16  # points of the tip's way from one pose to the next
_ELEVATION, _AZIMUTHS = 22.0, (-60.0, -30.0)  # directions [deg] of the eye
_LINE_WIDTH = 40  # characters of a line that tells what is hit: the legend leaves the arm its room
_HIT, _SOLID = "#d62728", "#7a6a58"  # colours of an arm that hits something and of what it must not touch
_AXES = ("#d62728", "#2ca02c", "#1f4fd6")  # colours of a frame's x, y and z


def plot_poses(
    arm: Arm,
    q: ArrayLike,
    out: str | None,
    *,
    names: Sequence[str] | None = None,
    target: ArrayLike | None = None,
    title: str | None = None,
    frames: bool | None = None,
    view: tuple[float, float] | None = None,
) -> None:
    """Draw an arm in one or several poses into a .png or .svg file.

    q: (n,) or (K, n) [rad | mm]. names: one for each pose, for the legend; without names several poses
    are a path, coloured from its start to its end, with the way of the tip as joints move in between.
    target: (3,) [mm] a point to mark. frames: draw the joint frames (by default for a single pose only).
    view: elevation and azimuth of the eye [deg]. Arms that move in the xy plane are drawn in that plane.
    out: None opens a window.
    """
    poses = _check_poses(arm, q, names)
    is_single = len(poses) == 1
    drawn_poses = poses if names is not None else poses[_spread_indices(len(poses))]
    bones = [skeleton(arm, pose) for pose in drawn_poses]
    is_legal: list[bool] = np.logical_not(outside_limits(arm, drawn_poses).any(axis=1)).tolist()
    hit = _hit_texts(arm, drawn_poses)
    legend = ["start", "end"] if names is None else _legend_texts(names, is_legal, hit)
    with picture(out, 8.0 if is_single else 9.6, 5.8) as figure:
        track = None if is_single or names is not None else fk(arm, _joint_way(poses))[:, :3, 3]
        drawing = _Drawing(arm, figure, bones, view, track)
        drawing.draw_keep_outs()
        notes = []
        if is_single:
            drawing.draw_single(bones[0], _HIT if hit[0] else PALETTE[0])
            drawing.name_joints(bones[0])
            notes = _notes_of_one(bones[0], is_legal[0], hit[0])
        else:
            _draw_several(drawing, bones, legend, is_legal, hit, in_turn=names is None)
        if track is not None:
            drawing.draw_track(track)
        if is_single if frames is None else frames:
            notes.append(drawing.draw_frames(drawn_poses))
        if target is not None:
            drawing.mark_target(np.asarray(target, dtype=float))
        drawing.finish(arm.name if title is None else title, ";  ".join(notes), None if is_single else legend)


def _draw_several(
    drawing: _Drawing,
    bones: list[Skeleton],
    legend: Sequence[str],
    is_legal: Sequence[bool],
    hit: Sequence[str],
    *,
    in_turn: bool,
) -> None:
    """Poses one after another, of which start and end are named, or branches: all are."""
    last = len(bones) - 1
    if in_turn:
        for k, bone in enumerate(bones):
            label = {last: legend[1], 0: legend[0]}.get(k)
            drawing.draw_arm(bone, _HIT if hit[k] else _path_colour(k / last), label, 2.6, dashed=not is_legal[k])
        return
    # Branches may lie on each other: the first one, which is the best, comes last and is the thinnest.
    widths = 2.4 + np.minimum(0.5, 3.0 / len(bones)) * np.arange(len(bones)) + _extra_widths(bones)
    for k in sorted(range(len(bones)), key=lambda k: -widths[k]):
        drawing.draw_arm(
            bones[k], _HIT if hit[k] else _branch_colour(k, len(bones)), legend[k], widths[k], dashed=not is_legal[k]
        )


def _notes_of_one(bone: Skeleton, is_legal: bool, hit: str) -> list[str]:
    """What is noted of a single pose."""
    tip = "tip ({:.1f}, {:.1f}, {:.1f}) mm".format(*np.round(bone.tip, 1) + 0.0)
    return [tip, *(["outside the joint limits"] if not is_legal else []), *([hit] if hit else [])]


def _check_poses(arm: Arm, q: ArrayLike, names: Sequence[str] | None) -> Array:
    """The poses (K, n); raises UsageError for too many, for other names than poses, and for what is not finite."""
    poses = np.atleast_2d(as_joints(arm, q))
    if not 1 <= len(poses) <= MAX_POSES:
        raise UsageError(f"{len(poses)} poses in one picture: give 1 to {MAX_POSES}")
    if not np.all(np.isfinite(poses)):
        raise UsageError("joint values must be finite to be drawn")
    if names is not None and len(names) != len(poses):
        raise UsageError(f"{len(poses)} poses and {len(names)} names: give each pose its name")
    return poses


def _legend_texts(names: Sequence[str], legal: Sequence[bool], hit: Sequence[str]) -> list[str]:
    """Names of poses, with what is wrong with them."""
    legend = [name + ("" if is_legal else " (outside limits)") for name, is_legal in zip(names, legal, strict=True)]
    return ["\n".join([name, *wrap(hit_text, _LINE_WIDTH)]) for name, hit_text in zip(legend, hit, strict=True)]


def _hit_texts(arm: Arm, poses: Array) -> list[str]:
    """What each pose hits, in words: nothing where there are no keep-outs."""
    return [_hit_text(hits_found) for _, hits_found in hits(arm, poses)] if arm.keep_out else [""] * len(poses)


def _hit_text(hits: list[Hit]) -> str:
    """The deepest hit in words, and how many more there are."""
    return hits_text(hits[:1]) + (f" and {len(hits) - 1} more" if len(hits) > 1 else "")


class _Drawing:
    """Axes in space, or in a plane for an arm that moves in the xy plane."""

    def __init__(
        self,
        arm: Arm,
        figure: Any,
        bones: list[Skeleton],
        view: tuple[float, float] | None,
        track: Array | None,
    ) -> None:
        self.robot, self.figure = arm, figure
        tracks = [] if track is None else [track]
        self.points = np.concatenate([*(bone.path for bone in bones), *tracks, arm.base[None, :3, 3]])
        normal, _ = tip_freedoms(arm)
        self.planar = view is None and normal is not None and bool(abs(normal[2]) > 1 - 1e-9)
        self.size = float(np.ptp(self.points, axis=0).max()) or arm.reach
        if self.planar:
            self.dimensions = 2
            self.axes = flat_axes(figure, (0.11, 0.1, 0.86, 0.76), ("x / mm", "y / mm"))
        else:
            self.dimensions = 3
            self.axes = space_axes(figure, (0.02, 0.02, 0.96, 0.88), view or _from_the_side(arm))
            self.floor = min(float(self.points[:, 2].min()), float(arm.base[2, 3]))

    def draw_keep_outs(self) -> None:
        """What the arm must not touch, translucent; a floor is drawn as far as the picture goes."""
        if not self.robot.keep_out or self.dimensions == 2:
            return
        from armkin.keep_out.body_pairs import guard
        from armkin.keep_out.shapes.floor import Floor

        surfaces = import_module("mpl_toolkits.mplot3d.art3d").Poly3DCollection
        shapes = [shape for _, shape in guard(self.robot).obstacles]
        for shape in sorted(shapes, key=lambda form: isinstance(form, Floor)):  # a floor is drawn under all others
            solid = shape.triangles(1.0)
            if isinstance(shape, Floor):
                (x0, y0), (x1, y1) = self.points[:, :2].min(axis=0), self.points[:, :2].max(axis=0)
                z = shape.height
                solid = np.array([[[x0, y0, z], [x1, y0, z], [x1, y1, z]], [[x0, y0, z], [x1, y1, z], [x0, y1, z]]])
            self.points = np.concatenate([self.points, solid.reshape(-1, 3)])
            self.axes.add_collection3d(surfaces(solid, color=_SOLID, alpha=0.16, linewidths=0))

    def name_joints(self, bone: Skeleton) -> None:
        """Each joint's name beside it; joints in one place share a line."""
        groups: list[tuple[Array, list[str]]] = []
        for joint, name in zip(bone.joints, self.robot.joint_names, strict=True):
            for place, names in groups:
                if np.linalg.norm(place - joint) < 0.06 * self.size:
                    names.append(name)
                    break
            else:
                groups.append((joint, [name]))
        for place, names in groups:
            point = place[: self.dimensions]
            halo = import_module("matplotlib.patheffects").withStroke(linewidth=2.5, foreground="white")
            style = {"fontsize": 9.5, "color": INK, "zorder": 9, "path_effects": [halo]}
            if self.dimensions == 2:
                offset = {"xytext": (7, -13), "textcoords": "offset points"}
                self.axes.annotate(", ".join(names), point, **offset, **style)
            else:
                self.axes.text(point[0], point[1], point[2] + 0.035 * self.size, "   " + ", ".join(names), **style)

    def draw_line(self, points: Array, **style: Any) -> None:
        """A line through points, in the plane or in space."""
        self.axes.plot(*points.T[: self.dimensions], **style)

    def draw_single(self, bone: Skeleton, colour: str) -> None:
        """One pose: thick links, joints along their axes, a shadow that tells where over the floor it is."""
        if self.dimensions == 3:
            shadow = bone.path.copy()
            shadow[:, 2] = self.floor
            self.draw_line(shadow, color=FAINT, linewidth=3.5, solid_capstyle="round", zorder=1)
        self._draw_links(bone, colour, 5.0)
        if self.dimensions == 2:
            self._draw_dots(bone, colour, 9.0)
        else:
            for centre, axis in zip(bone.joints, bone.axes, strict=True):
                half_length = 0.035 * self.size * axis
                ends = np.array([centre - half_length, centre + half_length])
                self.draw_line(ends, color=INK, linewidth=9.0, solid_capstyle="butt", zorder=4)
        self.draw_line(bone.tip[None], color=colour, marker="o", markersize=7, zorder=5)

    def draw_arm(self, bone: Skeleton, colour: Any, name: str | None, width: float, dashed: bool) -> None:
        """One pose of several; dashed: it is outside the limits."""
        self._draw_links(bone, colour, width, name, (0, (2.2, 1.2)) if dashed else "solid")
        self._draw_dots(bone, colour, 3.0 + 0.6 * width)
        self.draw_line(bone.tip[None], color=colour, marker="o", markersize=5, zorder=5)

    def _draw_links(
        self, bone: Skeleton, colour: Any, width: float, name: str | None = None, style: Any = "solid"
    ) -> None:
        round_off = {"solid_capstyle": "round", "solid_joinstyle": "round", "dash_capstyle": "butt"}
        for slide in bone.slides:
            self.draw_line(slide, color=colour, linewidth=2.2 * width, alpha=0.35, solid_capstyle="butt", zorder=2)
        self.draw_line(bone.path, color=colour, linewidth=width, linestyle=style, label=name, zorder=3, **round_off)

    def _draw_dots(self, bone: Skeleton, colour: Any, size: float) -> None:
        dots = {"marker": "o", "linestyle": "none", "markeredgecolor": colour, "markeredgewidth": 1.4}
        self.draw_line(bone.joints, color="white", markersize=size, zorder=4, **dots)

    def draw_frames(self, poses: Array) -> str:
        """The base's, every joint's and the tool's frame as short x, y and z axes; returns what is noted of them."""
        length = 0.1 * self.size
        for T in joint_frames(self.robot, poses).reshape(-1, 4, 4):
            for k, colour in enumerate(_AXES[: self.dimensions]):
                ends = np.array([T[:3, 3], T[:3, 3] + length * T[:3, k]])
                self.draw_line(ends, color=colour, linewidth=1.6, zorder=6)
        return "frames: x red, y green" + ("" if self.dimensions == 2 else ", z blue")

    def draw_track(self, tips: Array) -> None:
        """The tip's way along a path."""
        self.draw_line(tips, color=INK, linewidth=1.3, linestyle=(0, (4, 2)), zorder=7)

    def mark_target(self, point: Array) -> None:
        """A target."""
        self.points = np.concatenate([self.points, point[None]])
        ring = {
            "markerfacecolor": "none",
            "markeredgecolor": INK,
            "markeredgewidth": 1.6,
            "linestyle": "none",
        }
        self.draw_line(point[None], marker="o", markersize=13, label="target", zorder=8, **ring)

    def finish(self, title: str, note: str, order: Sequence[str] | None) -> None:
        """Title, legend beside the axes, and limits that fill what is left."""
        self.figure.text(0.03, 0.97, title, fontsize=min(13.0, 800 / max(len(title), 1)), va="top", color=INK)
        self.figure.text(0.03, 0.92, note, fontsize=10, va="top", color=SOFT)
        left = 0.02
        if order is not None:
            left = min(self._draw_legend(order, 0.895 if note else 0.935), 0.5)
        if self.dimensions == 3:
            self.axes.set_position([left, 0.02, 0.98 - left, 0.86])
            true_proportions(self.axes, self.points, self.floor)
        else:
            self.axes.set_position([left + 0.09, 0.1, 0.88 - left, 0.76])
            self.axes.margins(0.08)

    def _draw_legend(self, order: Sequence[str], top: float) -> float:
        """A legend in a column of its own; returns where it ends, as a share of the figure's width."""
        handles, texts = self.axes.get_legend_handles_labels()
        rank = {text: k for k, text in enumerate(order)}
        pairs = sorted(zip(handles, texts, strict=True), key=lambda pair: rank.get(pair[1], len(rank)))
        lines = sum(1 + text.count("\n") for text in texts)
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.02, top)}
        place |= {"bbox_transform": self.figure.transFigure, "fontsize": 9.5 if lines < 18 else 7.5}
        legend = self.axes.legend(*zip(*pairs, strict=True), handlelength=2.6, **place)
        for handle in legend.get_lines():
            handle.set_linewidth(min(handle.get_linewidth(), 4.0))
        box = legend.get_window_extent(renderer(self.figure))
        return float(box.x1 / self.figure.bbox.width) + 0.01


def _from_the_side(arm: Arm) -> tuple[float, float]:
    """The eye looks across the plane in which the arm reaches out at home: the same in all its pictures."""
    x, y, _ = fk(arm, arm.home)[:3, 3] - arm.base[:3, 3]
    if np.hypot(x, y) < 0.02 * arm.reach:
        return _ELEVATION, _AZIMUTHS[0]
    sideways = np.abs(np.sin(np.radians(_AZIMUTHS) - np.arctan2(y, x)))
    return _ELEVATION, _AZIMUTHS[int(np.argmax(np.round(sideways, 6)))]


def _spread_indices(count: int) -> NDArray[np.int64]:
    """Indices of the poses of a path that are drawn: its ends, and evenly in between."""
    return np.unique(np.linspace(0, count - 1, min(count, _DRAWN_POSES)).round().astype(np.int64))


def _joint_way(poses: Array) -> Array:
    """Joint values along a path (K, n) -> (M, n): straight from each pose to the next, as joints move."""
    step_count = max(1, min(_WAY_POINTS, MAX_POSES // len(poses)))
    share = np.arange(step_count)[:, None] / step_count
    steps = poses[:-1, None] + share * np.diff(poses, axis=0)[:, None]
    return np.concatenate([steps.reshape(-1, poses.shape[1]), poses[-1:]])


def _extra_widths(bones: Sequence[Skeleton]) -> Array:
    """How much wider each skeleton is drawn because it lies on earlier ones: wrist flips move no corner."""
    rank = np.zeros(len(bones))
    for k, bone in enumerate(bones):
        for other_bone in bones[:k]:
            is_same = bone.path.shape == other_bone.path.shape
            rank[k] += is_same and bool(np.allclose(bone.path, other_bone.path, rtol=0, atol=1e-3 * np.ptp(bone.path)))
    return rank * min(3.2, 9.6 / max(float(rank.max()), 1.0))


def _path_colour(share: float) -> Any:
    """A colour from the start (dark) to the end (light) of a path."""
    import matplotlib as mpl

    return mpl.colormaps["viridis"](0.9 * share)


def _branch_colour(k: int, count: int) -> Any:
    """A colour for one of several branches."""
    if count <= len(PALETTE):
        return PALETTE[k]
    import matplotlib as mpl

    return mpl.colormaps["turbo"]((k + 0.5) / count)
