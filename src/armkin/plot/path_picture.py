"""A picture of a planned path: the arm along it, its joints within their limits, how much of them it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armkin.forward import position
from armkin.model import units
from armkin.motion.path_planner.branch_report import deviation_text
from armkin.plot.canvas import flat_axes, picture, space_axes, true_proportions
from armkin.view.skeleton import skeleton

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.motion.plan.path_plan import PathPlan

_SAMPLES = 600  # samples of what is drawn over time
_MAX_TIMES = 160_000  # times, at most, at which speeds and accelerations are looked at
_MANY_POINTS = 20_000  # points of the tool's way beyond which they are thinned out
_POINT_SIZE = 1 / 1500  # size of a box, as a share of what is seen, that is one point
_SMALL_WAY = 1 / 3  # size of a way, as a share of what is seen, below which it is drawn once more, large
_LINE_WIDTH = 84  # characters, at most, of a line above the arm
_INKED, _WIDTHS = 150.0, (0.1, 0.6)  # width [pt] of a line as long as what is seen is wide, half of it ink; widths [pt]
_COLOURS = ("#1f77b4", "#d95f02", "#2ca02c", "#9467bd", "#c03d6b", "#8c6d31", "#17a2b8", "#7f7f7f")
_SINGULAR_COLOUR = "#c0392b"  # colour of a singularity
_STRAIGHT_COLOUR = "#fbe9e7"  # colour behind what is drawn over time, where the wrist passes a singularity
_INK = "#333333"


def plot_path(plan: PathPlan, out: str) -> None:
    """Draw a plan into a .png or .svg file: in space, and over time; of any number of points bounded many."""
    t = np.linspace(0.0, plan.duration, _SAMPLES)
    q = plan.q(t)
    with picture(out, 11.5, 7.2) as figure:
        figure.text(0.03, 0.975, _title(plan), fontsize=11, va="top")
        figure.text(0.03, 0.94, _branch_names(plan), fontsize=9, va="top")
        figure.text(0.03, 0.915, "\n".join([deviation_text(plan), *_wrist_pass_lines(plan)]), fontsize=9, va="top")
        _draw_in_space(plan, figure, q)
        rows = [figure.add_axes((0.60, bottom, 0.37, 0.185)) for bottom in (0.735, 0.51, 0.285, 0.06)]
        _draw_joints(plan, rows[0], t, q)
        fine_times = _fine_times(plan, t)
        speed_shares = np.abs(plan.qd(fine_times)) / plan.arm.max_speed
        accel_shares = np.abs(plan.qdd(fine_times)) / plan.arm.max_accel
        _draw_shares(plan, rows[1], t, _peaks(t, fine_times, speed_shares), "speed / max")
        _draw_shares(plan, rows[2], t, _peaks(t, fine_times, accel_shares), "accel. / max")
        _draw_tool_speed(rows[3], t, fine_times, position(plan.arm, plan.q(fine_times)))
        for axes in rows[:-1]:
            axes.set_xticklabels([])
        rows[-1].set_xlabel("time / s", labelpad=2, fontsize=8)
        passes = [(_time_of(plan, singularity.begin), _time_of(plan, singularity.end)) for singularity in plan.passed]
        for axes in rows:
            axes.set_xlim(0.0, max(plan.duration, 1e-9))
            axes.grid(True, linewidth=0.4)
            axes.tick_params(labelsize=8)
            for time in _break_times(plan):
                axes.axvline(time, color=_SINGULAR_COLOUR, linewidth=0.8, linestyle="--")
            for begin, end in passes:
                axes.axvspan(begin, end, color=_STRAIGHT_COLOUR, linewidth=0)


def _wrist_pass_lines(plan: PathPlan) -> list[str]:
    """How the wrist passes singularities: the first in words, the others in number."""
    if not plan.passed:
        return []
    first, rest_count = plan.passed[0], len(plan.passed) - 1
    turn_text = f"tool turned by {first.turned / units.DEGREE:.2g} deg"
    deviation_text = turn_text if first.turned else f"tip {first.aside:.2g} mm aside"
    place = f"straight through a wrist singularity, {first.begin:.0f} to {first.end:.0f} mm"
    return [f"{place}: {deviation_text}{f'; {rest_count} more' if rest_count else ''}"]


def _fine_times(plan: PathPlan, t: Array) -> Array:
    """Times, more of them where the picture's are far apart beside the motion's own changes."""
    parts = int(np.clip(plan.duration / 0.02 / len(t), 1, _MAX_TIMES // len(t)))
    return np.linspace(0.0, plan.duration, (len(t) - 1) * parts + 1)


def _peaks(t: Array, fine_times: Array, values: Array) -> Array:
    """The greatest of what falls about each of the times t (T,): (F, n) -> (T, n)."""
    greatest = np.zeros((len(t), values.shape[1]))
    np.maximum.at(greatest, np.rint(fine_times / max(t[-1], 1e-300) * (len(t) - 1)).astype(int), values)
    return greatest


def _title(plan: PathPlan) -> str:
    approach_text = "" if plan.approach is None else f", {plan.approach.duration:.2f} s to its start before"
    return f"{plan.arm.name}: {plan.length:.1f} mm of path in {plan.duration:.2f} s{approach_text}"


def _branch_names(plan: PathPlan) -> str:
    """The branches, as many as there is room for beside the joints."""
    names = list(dict.fromkeys(name for run in plan.runs for _, name in run.names if name))
    text = f"on {' | '.join(names)}" if names else ""
    return text if len(text) <= _LINE_WIDTH else f"{text[: _LINE_WIDTH - 4].rstrip(' ,|')} ..."


def _break_times(plan: PathPlan) -> list[float]:
    """When the branch is changed."""
    begins = plan.motion.begins
    times = []
    for reconfiguration in plan.reconfigurations:
        begins_after = [begins[k] for k in sorted(plan.on_path) if plan.s_range(k)[0] >= reconfiguration.s - 1e-6]
        times += begins_after[:1]
    return times


def _draw_in_space(plan: PathPlan, figure: Any, q: Array) -> None:
    """The tip's way, the arm at its start and end, where it is nearest to a singularity, and on other branches."""
    arm = plan.arm
    poses = [*_poses_of_others(plan), *_poses_of_plan(plan, q)]
    bones = [skeleton(arm, pose.q) for pose in poses]
    points = np.concatenate([position(arm, q), arm.base[None, :3, 3], *(bone.path for bone in bones)])
    reach = np.abs(points[:, :2] - arm.base[:2, 3]).max(axis=0)
    size = float((points.max(axis=0) - points.min(axis=0)).max())
    tool_path = _tool_way(plan)
    path_size = float((np.nanmax(tool_path, axis=0) - np.nanmin(tool_path, axis=0)).max()) if len(tool_path) else size
    is_large = path_size >= _SMALL_WAY * size
    tool_path = _thin_out(tool_path, _POINT_SIZE * (size if is_large else path_size))
    low, high = (0.03, 0.76) if is_large else (0.37, 0.44)
    axes = space_axes(figure, (0.0, low, 0.53, high), (22.0, -60.0 if reach[0] >= reach[1] else -30.0))
    for pose, bone in zip(poses, bones, strict=True):
        look = {"color": pose.colour, "linewidth": pose.width, "linestyle": pose.dashes}
        axes.plot(*bone.path.T, **look, label=pose.label, solid_capstyle="round")
        axes.plot(*bone.joints.T, color=pose.colour, marker="o", markersize=4, linestyle="none")
    if not is_large:
        _draw_from_near(plan, figure, tool_path)
    axes.plot(*(tool_path if len(tool_path) else position(arm, q)).T, color=_INK, linewidth=1.2, label="tool")
    for reconfiguration in plan.reconfigurations:
        tip = position(arm, plan.q(_time_of(plan, reconfiguration.s))[None])
        axes.plot(*tip.T, color=_SINGULAR_COLOUR, marker="x", markersize=8, linestyle="none")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.03, 0.88 if plan.passed else 0.90),
        bbox_transform=figure.transFigure,
        fontsize=8,
        frameon=False,
    )
    true_proportions(axes, points, float(arm.base[2, 3]))


class _DrawnPose(NamedTuple):
    """A pose of the arm in the picture."""

    label: str
    q: Array  # (n,) [rad | mm]
    colour: str
    width: float  # [points]
    dashes: Any = "-"  # matplotlib's line style


def _poses_of_plan(plan: PathPlan, q: Array) -> list[_DrawnPose]:
    """The plan's first and last pose, of joint values q (N, n), and the one nearest to a singularity."""
    poses = [_DrawnPose("start", q[0], "#1f77b4", 4.5), _DrawnPose("end", q[-1], "#2ca02c", 2.0)]
    if plan.nearest_singularity is not None:  # dashed, on top: it may be the end
        length, condition, posture = plan.nearest_singularity
        label = f"nearest to a singularity: {length:.0f} mm, condition {condition:.3g}"
        poses.append(_DrawnPose(label, posture, _SINGULAR_COLOUR, 1.6, (0, (3, 2))))
    return poses


def _poses_of_others(plan: PathPlan) -> list[_DrawnPose]:
    """The path's start on the branches that would carry it as well; one of them stands in the legend."""
    starts = _other_starts(plan)
    branches = "1 other branch that carries" if len(starts) == 1 else f"{len(starts)} other branches that carry"
    label = f"{branches} all, at the path's start"
    labels = [label, *[f"_{label}"] * len(starts)]  # matplotlib leaves what begins with _ out of its legend
    return [_DrawnPose(text, start, "#b0b0b0", 1.6) for text, start in zip(labels, starts, strict=False)]


def _tool_way(plan: PathPlan) -> Array:
    """The tool's way on the plan's own grid, its parts behind each other with a gap (nan) between: (N, 3) [mm]."""
    parts: list[Array] = []
    for k in sorted(plan.on_path):
        if parts and k - 1 not in plan.on_path:
            parts.append(np.full((1, 3), np.nan))
        parts.append(position(plan.arm, plan.grid(k)))
    return np.concatenate(parts) if parts else np.zeros((0, 3))


def _thin_out(points: Array, distance: float) -> Array:
    """A way (N, 3) of very many points without those that lie in the same small box as the one before."""
    if len(points) <= _MANY_POINTS:
        return points
    with np.errstate(invalid="ignore"):
        box = np.rint(points / distance)
    return np.asarray(points[np.append(True, (box[1:] != box[:-1]).any(axis=1))])


def _time_of(plan: PathPlan, s: float) -> float:
    """When the tool is at a length of its way [s]."""
    low, high = 0.0, plan.duration
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if float(plan.s(np.array([middle]))[0]) < s else (low, middle)
    return high


def _draw_from_near(plan: PathPlan, figure: Any, tool_path: Array) -> None:
    """A way that is small beside the arm, seen along the axis in which it is thinnest."""
    size = np.nanmax(tool_path, axis=0) - np.nanmin(tool_path, axis=0)
    i, j = sorted(np.argsort(size)[1:].tolist())
    axes = flat_axes(figure, (0.06, 0.055, 0.46, 0.27), (f"{'xyz'[i]} / mm", f"{'xyz'[j]} / mm"), shrink=True)
    length = np.nansum(np.linalg.norm(np.diff(tool_path, axis=0), axis=1))
    line_width = float(np.clip(_INKED * size[i] * size[j] / max(length, 1e-9) / size.max(), *_WIDTHS))
    axes.plot(tool_path[:, i], tool_path[:, j], color=_INK, linewidth=line_width, label="the tool's way")
    if plan.rounded_most is not None:
        rounded_tip = position(plan.arm, plan.q(_time_of(plan, plan.rounded_most)))
        axes.plot(rounded_tip[i], rounded_tip[j], color=_SINGULAR_COLOUR, marker="+", markersize=9, linestyle="none",
                  label="farthest from its point")  # fmt: skip
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=2, fontsize=8, borderpad=0.1)
    axes.tick_params(labelsize=7.5)


def _other_starts(plan: PathPlan) -> list[Array]:
    """Joint values at the path's start of the branches that would carry it as well."""
    first_names = {run.names[0][1] for run in plan.runs[:1]}
    carrying_branches = [branch for branch in plan.branches if branch.carries >= plan.length - 0.01]
    return [branch.start_joints for branch in carrying_branches if branch.name not in first_names]


def _draw_joints(plan: PathPlan, axes: Any, t: Array, q: Array) -> None:
    """Joint values, as shares of their range where they have one."""
    arm = plan.arm
    for j, name in enumerate(arm.joint_names):
        low, high = arm.lower[j], arm.upper[j]
        if np.isfinite(low) and np.isfinite(high):
            y, label = (2 * q[:, j] - low - high) / (high - low), name
        else:
            size = 100.0 if arm.prismatic[j] else 360.0
            y, label = units.joints_out(arm, q)[:, j] / size, f"{name} / {'dm' if arm.prismatic[j] else 'turn'}"
        axes.plot(t, y, color=_COLOURS[j % len(_COLOURS)], linewidth=1.2, label=label)
    axes.axhspan(1.0, 1.15, color="#eeeeee")
    axes.axhspan(-1.15, -1.0, color="#eeeeee")
    axes.set_ylim(-1.15, 1.15)
    axes.set_ylabel("joint in its range", fontsize=8)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=6, fontsize=7.5, frameon=False, handlelength=1.2)


def _draw_shares(plan: PathPlan, axes: Any, t: Array, share: Array, label: str) -> None:
    for j in range(plan.arm.n):
        axes.plot(t, share[:, j], color=_COLOURS[j % len(_COLOURS)], linewidth=1.0)
    axes.axhline(1.0, color="#555555", linewidth=0.8, linestyle=":")
    axes.set_ylim(0.0, 1.12)
    axes.set_ylabel(label, fontsize=8)


def _draw_tool_speed(axes: Any, t: Array, fine_times: Array, tips: Array) -> None:
    speed = np.linalg.norm(np.gradient(tips, fine_times, axis=0), axis=1)
    axes.plot(t, _peaks(t, fine_times, speed[:, None])[:, 0], color=_INK, linewidth=1.0)
    axes.set_ylim(0.0, 1.1 * float(speed.max()) or 1.0)
    axes.set_ylabel("tool / mm/s", fontsize=8)
