"""A picture of a planned path: the arm along it, its joints within their limits, how much of them it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.forward import position
from armkin.model import units
from armkin.plot.canvas import picture, space, true_proportions
from armkin.view.skeleton import skeleton

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.motion.path_plan import PathPlan

_SAMPLES = 600
_WIDE = 84  # characters of a line above the arm
_COLOURS = ("#1f77b4", "#d95f02", "#2ca02c", "#9467bd", "#c03d6b", "#8c6d31", "#17a2b8", "#7f7f7f")
_SINGULAR = "#c0392b"


def plot_path(plan: PathPlan, out: str) -> None:
    """Draw a plan into a .png or .svg file: in space, and over time."""
    t = np.linspace(0.0, plan.duration, _SAMPLES)
    q = plan.q(t)
    with picture(out, 11.5, 7.2) as figure:
        figure.text(0.03, 0.975, _title(plan), fontsize=11, va="top")
        figure.text(0.03, 0.94, _names(plan), fontsize=9, va="top")
        _in_space(plan, figure, q)
        rows = [figure.add_axes((0.60, bottom, 0.37, 0.185)) for bottom in (0.735, 0.51, 0.285, 0.06)]
        _joints(plan, rows[0], t, q)
        _shares(plan, rows[1], t, np.abs(plan.qd(t)) / plan.arm.max_speed, "speed / max")
        _shares(plan, rows[2], t, np.abs(plan.qdd(t)) / plan.arm.max_accel, "accel. / max")
        _tool(rows[3], t, position(plan.arm, q))
        for axes in rows[:-1]:
            axes.set_xticklabels([])
        rows[-1].set_xlabel("time / s", labelpad=2, fontsize=8)
        for axes in rows:
            axes.set_xlim(0.0, max(plan.duration, 1e-9))
            axes.grid(True, linewidth=0.4)
            axes.tick_params(labelsize=8)
            for when in _breaks(plan):
                axes.axvline(when, color=_SINGULAR, linewidth=0.8, linestyle="--")


def _title(plan: PathPlan) -> str:
    return f"{plan.arm.name}: {plan.length:.1f} mm of path in {plan.duration:.2f} s"


def _names(plan: PathPlan) -> str:
    """The branches, as many as there is room for beside the joints."""
    names = list(dict.fromkeys(name for run in plan.runs for _, name in run.names if name))
    text = f"on {' | '.join(names)}" if names else ""
    return text if len(text) <= _WIDE else f"{text[: _WIDE - 4].rstrip(' ,|')} ..."


def _breaks(plan: PathPlan) -> list[float]:
    """When the branch is changed."""
    begins = plan.motion.begins
    found = []
    for one in plan.reconfigurations:
        later = [begins[k] for k in sorted(plan.on_path) if plan.s_range(k)[0] >= one.s - 1e-6]
        found += later[:1]
    return found


def _in_space(plan: PathPlan, figure: Any, q: Array) -> None:
    """The tip's way, the arm at its start and end, where it is nearest to a singularity, and on other branches."""
    arm = plan.arm
    poses: list[tuple[str, Array, str, float, Any]] = [
        ("start", q[0], "#1f77b4", 4.5, "-"),
        ("end", q[-1], "#2ca02c", 2.0, "-"),
    ]
    if plan.nearest_singularity is not None:  # dashed, on top: it may be the end
        s, value, where = plan.nearest_singularity
        label = f"nearest to a singularity: {s:.0f} mm, condition {value:.3g}"
        poses.append((label, where, _SINGULAR, 1.6, (0, (3, 2))))
    others = _others(plan)
    many = len(others) != 1
    label = f"{len(others)} other branch{'es' * many} that {'carry' if many else 'carries'} all, at the path's start"
    poses = [*(("_" * (k > 0) + label, pose, "#b0b0b0", 1.6, "-") for k, pose in enumerate(others)), *poses]
    bones = [(name, skeleton(arm, pose), *look) for name, pose, *look in poses]
    tips = position(arm, q)
    points = np.concatenate([tips, arm.base[None, :3, 3], *(bone.path for _, bone, *_ in bones)])
    reach = np.abs(points[:, :2] - arm.base[:2, 3]).max(axis=0)
    axes = space(figure, (0.0, 0.03, 0.53, 0.78), (22.0, -60.0 if reach[0] >= reach[1] else -30.0))
    for name, bone, colour, width, dashes in bones:
        axes.plot(*bone.path.T, color=colour, linewidth=width, linestyle=dashes, label=name, solid_capstyle="round")
        axes.plot(*bone.joints.T, color=colour, marker="o", markersize=4, linestyle="none")
    axes.plot(*tips.T, color="#333333", linewidth=1.2, label="tool")
    for one in plan.reconfigurations:
        near = int(np.argmin(np.abs(plan.s(np.linspace(0.0, plan.duration, len(q))) - one.s)))
        axes.plot(*tips[near : near + 1].T, color=_SINGULAR, marker="x", markersize=8, linestyle="none")
    axes.legend(
        loc="upper left", bbox_to_anchor=(0.03, 0.92), bbox_transform=figure.transFigure, fontsize=8, frameon=False
    )
    true_proportions(axes, points, float(arm.base[2, 3]))


def _others(plan: PathPlan) -> list[Array]:
    """Joint values at the path's start of the branches that would carry it as well."""
    taken = {run.names[0][1] for run in plan.runs[:1]}
    return [b.start_joints for b in plan.branches if b.carries >= plan.length - 0.01 and b.name not in taken]


def _joints(plan: PathPlan, axes: Any, t: Array, q: Array) -> None:
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


def _shares(plan: PathPlan, axes: Any, t: Array, share: Array, label: str) -> None:
    for j in range(plan.arm.n):
        axes.plot(t, share[:, j], color=_COLOURS[j % len(_COLOURS)], linewidth=1.0)
    axes.axhline(1.0, color="#555555", linewidth=0.8, linestyle=":")
    axes.set_ylim(0.0, 1.12)
    axes.set_ylabel(label, fontsize=8)


def _tool(axes: Any, t: Array, tips: Array) -> None:
    speed = np.linalg.norm(np.gradient(tips, t, axis=0), axis=1)
    axes.plot(t, speed, color="#333333", linewidth=1.0)
    axes.set_ylim(0.0, 1.1 * float(speed.max()) or 1.0)
    axes.set_ylabel("tool / mm/s", fontsize=8)
