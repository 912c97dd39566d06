"""`armkin path` for people: the branches, what is touched, how much of the limits it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from armkin.cli.printing import render

if TYPE_CHECKING:
    from armkin.motion.plan.path_plan import PathPlan


def plan_summary(plan: PathPlan, answer: dict[str, Any]) -> str:
    """The plan for people."""
    parts = [_head_lines(plan, answer)]
    if answer["branches"]:
        rows = [["branch at the start", "carries/mm", ""]]
        rows += [[b["name"] or "unnamed", f"{b['carries_mm']:.3f}", b["ends_because"]] for b in answer["branches"]]
        parts.append(["", render.table(rows, left_aligned=(0, 2))])
    if "clearance" in answer:
        parts.append([_clearance_text(answer["clearance"])])
    if answer["limits"] is not None:
        parts.append(_close_to_limits(plan, answer))
    return "\n".join(line for part in parts for line in part) + "\n"


def _head_lines(plan: PathPlan, answer: dict[str, Any]) -> list[str]:
    """How long it is and takes, what is held, and which branch carries which part of it."""
    from armkin.motion.path_planner.branch_report import reason_text

    lines = [f"{plan.arm.name}: {answer['length_mm']:.3f} mm of path"]
    if answer["duration_s"] is not None:
        lines[0] += f", {answer['duration_s']:.3f} s"
        if answer["segments"] is not None:
            lines[0] += f", {answer['segments']} segments"
        if "approach" in answer:
            lines.append(f"  before it {answer['approach']['duration_s']:.3f} s from where the arm stands to its start")
    if plan.held:
        lines.append(f"  held: {', '.join(f'{name} at {value:.4g}' for name, value in answer['held'].items())}")
    for run in answer["runs"]:
        names = ", then ".join(
            f"{branch['name'] or 'unnamed'}" + (f" from {branch['s_mm']:.3f}" if k else "")
            for k, branch in enumerate(run["branches"])
        )
        lines.append(f"  {run['s_mm'][0]:.3f} to {run['s_mm'][1]:.3f} mm: {names}")
    ends = [f"  at {branch.s:.3f} mm: {reason_text(plan.arm, branch)}" for branch in plan.reconfigurations]
    return lines + list(dict.fromkeys(ends))  # several branches end there for one reason


def _clearance_text(nearest: dict[str, Any]) -> str:
    """Where the arm comes nearest to a keep-out, or hits one."""
    clearance = nearest["mm"]
    if clearance is not None and clearance < 0:
        return f"  at {nearest['s_mm']:.3f} mm: hits {nearest['with']} by up to {-clearance:.1f} mm ({nearest['body']})"
    distance_text = "nothing counts" if clearance is None else f"at least {clearance:.1f} mm"
    return f"  at {nearest['s_mm']:.3f} mm: {nearest['body']} nearest to {nearest['with']}, {distance_text}"


def _close_to_limits(plan: PathPlan, answer: dict[str, Any]) -> list[str]:
    """What it takes of the joints' limits, how near it comes to a singularity and to the path, what was changed."""
    from armkin.motion.path_planner.branch_report import deviation_text, wrist_pass_lines

    rows = [["share of", *plan.arm.joint_names]]
    rows += [[key, *(f"{100 * share:.1f} %" for share in shares.values())] for key, shares in answer["limits"].items()]
    lines = ["", render.table(rows), ""]
    singularity = answer["nearest_singularity"]
    if singularity is not None:
        condition_text = "infinite" if singularity["condition"] is None else f"{singularity['condition']:.1f}"
        lines.append(f"nearest to a singularity at {singularity['s_mm']:.3f} mm: condition {condition_text}")
    lines += [deviation_text(plan), *wrist_pass_lines(plan)]
    reduced = plan.reduced
    if reduced.count:
        lines.append(
            f"{reduced.count} blend{'s' * (reduced.count > 1)} made smaller, to half of a side: "
            f"the smallest from {reduced.wished_radius:g} to {reduced.reduced_radius:.4g} mm"
        )
    return lines
