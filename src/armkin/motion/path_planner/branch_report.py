"""The report on a path's branches: the fields of a plan, and the error text of a path that no branch carries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.model import units
from armkin.motion.branches.branch_chains import BranchChain, end_reason
from armkin.motion.branches.joint_steps import joint_change
from armkin.motion.plan.path_plan import Passed, PathPlan, PathRun, Reconfiguration, StartBranch
from armkin.motion.plan.trajectory_proof import hit_text

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.branch_chains import Run
    from armkin.motion.branches.branch_columns import BranchColumns
    from armkin.motion.branches.branch_path import CarriedRoute
    from armkin.motion.timing.trajectory import Trajectory

_SAME_POSE = 1e-6  # distance [rad | mm] below which two postures count as the same
_WHY = {
    "end": "carries all",
    "reach": "the path leaves the reach",
    "boundary": "two branches meet on a boundary",
    "singularity": "the joints would jump at a singularity",
}


def note_runs(plan: PathPlan, carried_route: CarriedRoute, near: Array) -> None:
    """Add runs, branches and breaks of a group of moves to the plan."""
    columns, offset, arm = carried_route.columns, plan.length, plan.arm
    plan.samples += len(columns.s)
    plan.complete = plan.complete and columns.complete
    if not plan.branches:
        plan.branches = _start_branches(arm, carried_route, near)
    for run_number, run in enumerate(carried_route.runs):
        for window in run.chain.windows:
            if columns.s[run.first] <= window.begin and window.end <= columns.s[run.last]:
                plan.passed.append(Passed(offset + window.begin, offset + window.end, window.turned, window.tip_offset))
        q = run.chain.joints(run.first, run.last, near)
        begin, end = offset + float(columns.s[run.first]), offset + float(columns.s[run.last])
        if end > begin:
            plan.runs.append(PathRun(begin, end, _branch_names(columns, run, offset), q[0].copy(), q[-1].copy()))
        if run.last < len(columns.s) - 1 or run_number + 1 < len(carried_route.runs):
            plan.reconfigurations.append(_reconfiguration_at(arm, columns, run.chain, run.first, offset))


def _branch_names(columns: BranchColumns, run: Run, offset: float) -> list[tuple[float, str]]:
    """The lengths [mm] at which the branch name changes on a run, each with the new name."""
    labels = run.chain.labels[run.first - run.chain.first : run.last - run.chain.first + 1]
    changes = [0, *(1 + np.flatnonzero(np.diff(labels))).tolist()]
    return [
        (offset + float(columns.s[run.first + change]), _branch_name(columns, int(labels[change])))
        for change in changes
    ]


def _start_branches(arm: Arm, carried_route: CarriedRoute, near: Array) -> list[StartBranch]:
    """The branches at the start, sorted by how far each carries; of equal ones the chosen branch comes first."""
    columns, last_and_branch, first_run_branch = carried_route.columns, [], None
    for chain in carried_route.chains:
        if chain.first == 0:
            last = chain.carries_to(0)
            joints = chain.joints(0, last, near) if last >= 0 else chain.q
            q = joints[0].copy()  # a view would keep the whole chain
            length = float(columns.s[last]) if last >= 0 else 0.0
            end_text = reason_text(arm, _reconfiguration_at(arm, columns, chain, 0, 0.0))
            last_and_branch.append(
                (last, StartBranch(_branch_name(columns, int(chain.labels[0])), q, length, end_text))
            )
            if carried_route.runs and chain is carried_route.runs[0].chain:
                first_run_branch = last_and_branch[-1][1]
    last_and_branch.sort(key=lambda pair: (-round(pair[1].carries, 2), pair[1] is not first_run_branch))
    distinct: list[StartBranch] = []  # a branch appears twice if it can also pass a wrist singularity; list it once
    for _, branch in last_and_branch:
        q = branch.start_joints
        if not any(
            b.name == branch.name and np.abs(joint_change(arm, b.start_joints, q)).max() < _SAME_POSE for b in distinct
        ):
            distinct.append(branch)
    return distinct


def _branch_name(columns: BranchColumns, label: int) -> str:
    return columns.names[label] if 0 <= label < len(columns.names) else ""


def _reconfiguration_at(
    arm: Arm, columns: BranchColumns, chain: BranchChain, first: int, offset: float
) -> Reconfiguration:
    """The place and the reason at which a run from sample `first` ends."""
    reason = end_reason(columns, chain, first)
    last_sample = max(chain.carries_to(first), 0)
    q = chain.q[min(last_sample + 1, chain.last) - chain.first].copy() if reason.why == "hit" else None
    hit_words = "" if q is None else hit_text(arm, q)
    return Reconfiguration(
        s=offset + float(columns.s[last_sample]),
        why=reason.why,
        joint=None if reason.joint is None else arm.joint_names[reason.joint],
        index=reason.joint,
        value=reason.limit,
        beyond=reason.status,
        hit=hit_words,
        joints=q,
    )


def reason_text(arm: Arm, reconfiguration: Reconfiguration) -> str:
    """The reason, in words, why a branch ends."""
    if reconfiguration.hit:
        return reconfiguration.hit
    if reconfiguration.index is None or reconfiguration.value is None:
        return _WHY[reconfiguration.why]
    size, unit = (1.0, "mm") if arm.prismatic[reconfiguration.index] else (units.DEGREE, "deg")
    return f"{reconfiguration.joint} meets its limit {reconfiguration.value / size:.6g} {unit}"


def deviation_text(plan: PathPlan) -> str:
    """How far the motion leaves the path, or the points to which it was fitted."""
    if plan.rounded_most is None:
        bound = np.ceil(plan.deviation * 1e4) / 1e4  # round up: the printed number must be a bound as well
        return f"at most {bound:.4f} mm from the path; {plan.tolerance:g} allowed"
    return (
        f"points within {plan.deviation:.4f} mm of the motion, the farthest at {plan.rounded_most:.3f} mm; "
        f"{plan.tolerance:g} allowed"
    )


def wrist_pass_lines(plan: PathPlan) -> list[str]:
    """One line of text for each wrist singularity that the path passes without a flip of the wrist."""
    lines = []
    for singularity in plan.passed:
        tip = f"the tip at most {singularity.aside:.2g} mm aside, the tool not turned"
        tool = f"the tip on the path, the tool turned by at most {singularity.turned / units.DEGREE:.2g} deg"
        deviation = tool if singularity.turned else tip
        lines.append(
            f"a wrist singularity is passed between {singularity.begin:.3f} and {singularity.end:.3f} mm: {deviation}"
        )
    return lines


def plan_fields(plan: PathPlan) -> dict[str, Any]:
    """A plan as JSON data [mm, deg, s]; a refused plan has the fields of its branches and None for its motion."""
    arm = plan.arm
    singularity = None
    if plan.nearest_singularity is not None:
        s, condition, _ = plan.nearest_singularity
        singularity = {"s_mm": s, "condition": condition if np.isfinite(condition) else None}
    return {
        "task": None if plan.task is None else plan.task.name,
        "length_mm": plan.length,
        "duration_s": None,
        "samples": plan.samples,
        "complete": plan.complete,
        "tolerance_mm": plan.tolerance,
        "deviation_mm": None,
        "blends_reduced": plan.reduced.count,
        "joint_units": units.unit_names(arm),
        "start_joints": None,
        "joints": None,
        "runs": [_run_fields(arm, run) for run in plan.runs],
        "reconfigurations": [
            _reconfiguration_fields(arm, reconfiguration) for reconfiguration in plan.reconfigurations
        ],
        "branches": [_branch_fields(arm, branch) for branch in plan.branches],
        "limits": None,
        "nearest_singularity": singularity,
        **({} if plan.trajectory is None else _motion_fields(plan)),
        **_optional_fields(plan),
    }


def _motion_fields(plan: PathPlan) -> dict[str, Any]:
    """The JSON fields of a plan's motion, which `plan_fields` sets to None for a plan without one."""
    motion, names = plan.motion, plan.arm.joint_names
    return {
        "duration_s": plan.duration,
        "deviation_mm": plan.deviation,
        "start_joints": units.joints_out(plan.arm, motion.start).tolist(),
        "joints": units.joints_out(plan.arm, motion.end).tolist(),
        "limits": {key: dict(zip(names, shares.tolist(), strict=True)) for key, shares in plan.limits.items()},
    }


def _optional_fields(plan: PathPlan) -> dict[str, Any]:
    """The JSON fields that only some plans have: held joints, wrist singularities, approach, clearance."""
    fields: dict[str, Any] = {"held": held_joint_values(plan)} if plan.held else {}
    if plan.turned is not None:
        fields["turned_deg"] = float(np.rad2deg(plan.turned))
    if plan.passed:
        fields["wrists_passed"] = [_singularity_fields(singularity) for singularity in plan.passed]
    if plan.approach is not None:
        fields["approach"] = _approach_fields(plan.approach)
    if plan.clearance is not None:
        fields["clearance"] = plan.clearance
    return fields


def _run_fields(arm: Arm, run: PathRun) -> dict[str, Any]:
    return {
        "s_mm": [run.begin, run.end],
        "branches": [{"s_mm": s, "name": name} for s, name in run.names],
        "start_joints": units.joints_out(arm, run.start_joints).tolist(),
        "end_joints": units.joints_out(arm, run.end_joints).tolist(),
    }


def _reconfiguration_fields(arm: Arm, change: Reconfiguration) -> dict[str, Any]:
    return {
        "s_mm": change.s,
        "why": change.why,
        "joint": change.joint,
        "value": None if change.value is None or change.index is None else _in_units(arm, change.index, change.value),
        "status_beyond": change.beyond,
    }


def _branch_fields(arm: Arm, branch: StartBranch) -> dict[str, Any]:
    return {
        "name": branch.name,
        "start_joints": units.joints_out(arm, branch.start_joints).tolist(),
        "carries_mm": branch.carries,
        "ends_because": branch.ends_because,
    }


def _singularity_fields(singularity: Passed) -> dict[str, Any]:
    return {
        "s_mm": [singularity.begin, singularity.end],
        "turned_deg": singularity.turned / units.DEGREE,
        "aside_mm": singularity.aside,
    }


def held_joint_values(plan: PathPlan) -> dict[str, float]:
    """The joints that are held along a path, each with its value [deg | mm]."""
    return {name: _in_units(plan.arm, plan.arm.joint_names.index(name), value) for name, value in plan.held.items()}


def _approach_fields(move: Trajectory) -> dict[str, Any]:
    return {"from_joints": units.joints_out(move.arm, move.start).tolist(), "duration_s": move.duration}


def _in_units(arm: Arm, joint: int, value: float) -> float:
    """One joint's value in degrees, or mm."""
    return value if arm.prismatic[joint] else value / units.DEGREE


def path_refusal(plan: PathPlan, carried_route: CarriedRoute, branch: str | None = None) -> NoSolutionError:
    """The error of a path that no branch carries, with its plan; branch: the name that the user asked for."""
    best_branch, joints = plan.branches[0] if plan.branches else None, None
    length = carried_route.route.length
    if best_branch is None:
        text = "the path's first point is out of reach"
    elif branch is not None and (not carried_route.runs or carried_route.runs[0].first > 0):
        text = f"branch '{branch}' is not within the limits at the path's start; "
        text += f"{best_branch.name or 'another'} carries {best_branch.carries:.3f} of {length:.3f} mm"
    elif not carried_route.runs or carried_route.runs[0].first > 0:
        text = f"no branch is within the limits at the path's start: {best_branch.ends_because}"
    else:
        carried_length = float(carried_route.columns.s[carried_route.runs[0].last])
        text = f"no branch carries the whole path: {carried_length:.3f} of {length:.3f} mm, then "
        text += reason_text(plan.arm, plan.reconfigurations[0])
        joints = plan.reconfigurations[0].joints
        changes = len(carried_route.runs) - 1
        if carried_route.is_covered:
            text += f"; with {changes} change{'s' * (changes > 1)} of branch it can be done"
    plan.length += length
    fields: dict[str, Any] = {"splittable": carried_route.is_covered}
    if joints is not None:
        fields["joints"] = units.joints_out(plan.arm, joints).tolist()
    error = NoSolutionError(f"{text}: nothing was moved", **fields)
    error.plan = plan
    return error
