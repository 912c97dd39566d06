"""The arm in one pose, in all branches of a target, or along a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import as_joints
from armkin.forward import frames as joint_frames
from armkin.model.limits import outside
from armkin.plot.canvas import FAINT, INK, PALETTE, SOFT, flat, picture, space, true_proportions
from armkin.reach.volume import motion
from armkin.view.skeleton import Skeleton, skeleton

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MOST = 500  # poses that a picture can still tell apart, generously
_AXES = ("#d62728", "#2ca02c", "#1f4fd6")  # x, y, z of a frame


def plot_poses(
    arm: Arm,
    q: ArrayLike,
    out: str,
    *,
    names: Sequence[str] | None = None,
    target: ArrayLike | None = None,
    title: str | None = None,
    frames: bool | None = None,
    view: tuple[float, float] | None = None,
) -> None:
    """Draw an arm in one or several poses into a .png or .svg file.

    q: (n,) or (K, n) [rad | mm]. names: one for each pose, for the legend; without names several poses
    are a path, coloured from its start to its end. target: (3,) [mm] a point to mark. frames: draw the
    joint frames (by default for a single pose only). view: elevation and azimuth of the eye [deg];
    by default from the side of the arm. Arms that move in the xy plane are drawn in that plane.
    """
    poses = np.atleast_2d(as_joints(arm, q))
    if not 1 <= len(poses) <= MOST:
        raise UsageError(f"{len(poses)} poses in one picture: give 1 to {MOST}")
    if not np.all(np.isfinite(poses)):
        raise UsageError("joint values must be finite to be drawn")
    if names is not None and len(names) != len(poses):
        raise UsageError(f"{len(poses)} poses and {len(names)} names: give each pose its name")
    bones = [skeleton(arm, pose) for pose in poses]
    alone = len(poses) == 1
    with_frames = alone if frames is None else frames
    legal = [not outside(arm, pose).any() for pose in poses]
    legend = ["start", "end"]
    if names is not None:
        legend = [name + ("" if ok else " (outside limits)") for name, ok in zip(names, legal, strict=True)]
    with picture(out, 8.0, 5.8) as figure:
        drawing = _Drawing(arm, figure, bones, view, aside=0.0 if alone else 0.16)
        # Branches may lie on each other: each one is drawn wider than those that follow on top of it,
        # and the first one, which is the best, comes last.
        widths = 2.6 + np.minimum(0.9, 4.0 / len(poses)) * np.arange(len(poses))
        several = list(enumerate(bones)) if names is None else list(enumerate(bones))[::-1]
        for k, bone in several:
            if alone:
                drawing.single(bone)
            elif names is None:
                label = legend[k] if k < 1 else legend[1] if k == len(poses) - 1 else None
                drawing.arm(bone, _along(k / (len(poses) - 1)), label, 2.6, dashed=not legal[k])
            else:
                drawing.arm(bone, _apart(k, len(poses)), legend[k], widths[k], dashed=not legal[k])
        if not alone and names is None:
            drawing.track(np.array([bone.tip for bone in bones]))
        if with_frames:
            for pose in poses:
                drawing.frames(pose)
        if target is not None:
            drawing.mark(np.asarray(target, dtype=float))
        notes = []
        if alone:
            notes.append("tip ({:.1f}, {:.1f}, {:.1f}) mm".format(*bones[0].tip + 0.0))
            notes += [] if legal[0] else ["outside the joint limits"]
        if with_frames:
            notes.append("frames: x red, y green" + ("" if drawing.dimensions == 2 else ", z blue"))
        drawing.finish(arm.name if title is None else title, ";  ".join(notes), None if alone else legend)


class _Drawing:
    """Axes in space, or in a plane for an arm that moves in the xy plane."""

    def __init__(
        self, arm: Arm, figure: Any, bones: list[Skeleton], view: tuple[float, float] | None, aside: float
    ) -> None:
        self.robot, self.figure = arm, figure
        self.points = np.concatenate([*(bone.path for bone in bones), arm.base[None, :3, 3]])
        normal, _ = motion(arm)
        self.planar = view is None and normal is not None and bool(abs(normal[2]) > 1 - 1e-9)
        self.size = float(np.ptp(self.points, axis=0).max()) or arm.reach
        if self.planar:
            self.dimensions = 2
            self.axes = flat(figure, (0.11, 0.1, 0.86, 0.76), ("x / mm", "y / mm"))
        else:
            self.dimensions = 3
            self.axes = space(figure, (0.02 + aside, 0.0, 0.96 - aside, 0.9), view or self._from_the_side(bones))
            self.floor = min(float(self.points[:, 2].min()), float(arm.base[2, 3]))

    def _from_the_side(self, bones: list[Skeleton]) -> tuple[float, float]:
        """The eye looks across the plane in which the arm reaches out, but along no wall."""
        x, y, _ = np.mean([bone.tip for bone in bones], axis=0) - self.robot.base[:3, 3]
        if np.hypot(x, y) < 0.02 * self.size:
            return 22.0, -60.0
        azimuths = np.array([-60.0, -30.0, -120.0, -150.0, 30.0, 60.0, 120.0, 150.0])
        sideways = np.abs(np.sin(np.radians(azimuths) - np.arctan2(y, x)))
        return 22.0, float(azimuths[np.argmax(np.round(sideways, 6))])

    def line(self, points: Array, **style: Any) -> None:
        self.axes.plot(*points.T[: self.dimensions], **style)

    def single(self, bone: Skeleton) -> None:
        """One pose: thick links, joints along their axes, a shadow that tells where over the floor it is."""
        if self.dimensions == 3:
            shadow = bone.path.copy()
            shadow[:, 2] = self.floor
            self.line(shadow, color=FAINT, linewidth=3.5, solid_capstyle="round", zorder=1)
        colour = PALETTE[0]
        self._links(bone, colour, 5.0)
        if self.dimensions == 2:
            self._dots(bone, colour, 9.0)
        else:
            for at, axis in zip(bone.joints, bone.axes, strict=True):
                half = 0.035 * self.size * axis
                ends = np.array([at - half, at + half])
                self.line(ends, color=INK, linewidth=9.0, solid_capstyle="butt", zorder=4)
        self.line(bone.tip[None], color=colour, marker="o", markersize=7, zorder=5)

    def arm(self, bone: Skeleton, colour: Any, name: str | None, width: float, dashed: bool) -> None:
        """One pose of several; dashed: it is outside the limits."""
        self._links(bone, colour, width, name, (0, (2.2, 1.2)) if dashed else "solid")
        self._dots(bone, colour, 3.0 + 0.6 * width)
        self.line(bone.tip[None], color=colour, marker="o", markersize=5, zorder=5)

    def _links(self, bone: Skeleton, colour: Any, width: float, name: str | None = None, style: Any = "solid") -> None:
        round_off = {"solid_capstyle": "round", "solid_joinstyle": "round", "dash_capstyle": "butt"}
        for slide in bone.slides:
            self.line(slide, color=colour, linewidth=2.2 * width, alpha=0.35, solid_capstyle="butt", zorder=2)
        self.line(bone.path, color=colour, linewidth=width, linestyle=style, label=name, zorder=3, **round_off)

    def _dots(self, bone: Skeleton, colour: Any, size: float) -> None:
        dots = {"marker": "o", "linestyle": "none", "markeredgecolor": colour, "markeredgewidth": 1.4}
        self.line(bone.joints, color="white", markersize=size, zorder=4, **dots)

    def frames(self, pose: Array) -> None:
        """The base's, every joint's and the tool's frame as short x, y and z axes."""
        length = 0.1 * self.size
        for T in joint_frames(self.robot, pose):
            for k, colour in enumerate(_AXES[: self.dimensions]):
                ends = np.array([T[:3, 3], T[:3, 3] + length * T[:3, k]])
                self.line(ends, color=colour, linewidth=1.6, zorder=6)

    def track(self, tips: Array) -> None:
        """The tip's way along a path."""
        self.line(tips, color=INK, linewidth=1.3, linestyle=(0, (4, 2)), zorder=7)

    def mark(self, point: Array) -> None:
        """A target."""
        self.points = np.concatenate([self.points, point[None]])
        ring = {
            "markerfacecolor": "none",
            "markeredgecolor": INK,
            "markeredgewidth": 1.6,
            "linestyle": "none",
        }
        self.line(point[None], marker="o", markersize=13, label="target", zorder=8, **ring)

    def finish(self, title: str, note: str, order: Sequence[str] | None) -> None:
        """Limits, title and legend."""
        if self.dimensions == 3:
            true_proportions(self.axes, self.points, self.floor)
        else:
            self.axes.margins(0.08)
        self.figure.text(0.03, 0.97, title, fontsize=min(13.0, 800 / max(len(title), 1)), va="top", color=INK)
        self.figure.text(0.03, 0.92, note, fontsize=10, va="top", color=SOFT)
        if order is not None:
            handles, texts = self.axes.get_legend_handles_labels()
            rank = {text: k for k, text in enumerate(order)}
            pairs = sorted(zip(handles, texts, strict=True), key=lambda pair: rank.get(pair[1], len(rank)))
            place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.02, 0.895 if note else 0.935)}
            place |= {"bbox_transform": self.figure.transFigure}
            if self.dimensions == 2:
                place = {"loc": "best", "frameon": True, "facecolor": "white", "edgecolor": FAINT}
            self.axes.legend(*zip(*pairs, strict=True), handlelength=2.6, **place)


def _along(share: float) -> Any:
    """A colour from the start (dark) to the end (light) of a path."""
    import matplotlib as mpl

    return mpl.colormaps["viridis"](0.9 * share)


def _apart(k: int, count: int) -> Any:
    """A colour for one of several branches."""
    if count <= len(PALETTE):
        return PALETTE[k]
    import matplotlib as mpl

    return mpl.colormaps["turbo"]((k + 0.5) / count)
