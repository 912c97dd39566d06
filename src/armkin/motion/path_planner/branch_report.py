"""What was found about a path's branches: noted in the plan, and in words where the path is not carried."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.model import units
from armkin.motion.branches.branch_chains import Chain, end_reason
from armkin.motion.branches.joint_steps import joint_change
from armkin.motion.plan.path_plan import Branch, Passed, PathPlan, PathRun, Reconfiguration
from armkin.motion.plan.trajectory_proof import hit_text

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.branch_chains import Run
    from armkin.motion.branches.branch_columns import Columns
    from armkin.motion.branches.branch_path import CarriedRoute
    from armkin.motion.timing.trajectory import Trajectory

_SAME_POSE = 1e-6  # distance [rad | mm] of two postures that are one
_WHY = {
    "end": "carries all",
    "reach": "the path leaves the reach",
    "boundary": "two branches meet on a boundary",
    "singularity": "the joints would jump at a singularity",
}


def note_runs(plan: PathPlan, carried: CarriedRoute, near: Array) -> None:
    """Add runs, branches and breaks of a group of moves to the plan."""
    c, base, arm = carried.columns, plan.length, plan.arm
    plan.samples += len(c.s)
    plan.complete = plan.complete and c.complete
    if not plan.branches:
        plan.branches = _start_branches(arm, carried, near)
    for k, run in enumerate(carried.runs):
        for window in run.chain.windows:
            if c.s[run.first] <= window.begin and window.end <= c.s[run.last]:
                plan.passed.append(Passed(base + window.begin, base + window.end, window.turned, window.tip_offset))
        q = run.chain.joints(run.first, run.last, near)
        begin, end = base + float(c.s[run.first]), base + float(c.s[run.last])
        if end > begin:
            plan.runs.append(PathRun(begin, end, _branch_names(c, run, base), q[0].copy(), q[-1].copy()))
        if run.last < len(c.s) - 1 or k + 1 < len(carried.runs):
            plan.reconfigurations.append(_reconfiguration_at(arm, c, run.chain, run.first, base))


def _branch_names(c: Columns, run: Run, base: float) -> list[tuple[float, str]]:
    """Where each branch name begins on a run."""
    labels = run.chain.labels[run.first - run.chain.first : run.last - run.chain.first + 1]
    changes = [0, *(1 + np.flatnonzero(np.diff(labels))).tolist()]
    return [(base + float(c.s[run.first + i]), _branch_name(c, int(labels[i]))) for i in changes]


def _start_branches(arm: Arm, carried: CarriedRoute, near: Array) -> list[Branch]:
    """The branches at the start, the one that carries farthest first; of equals the one that is taken."""
    c, ranked, chosen = carried.columns, [], None
    for chain in carried.chains:
        if chain.first == 0:
            e = chain.carries_to(0)
            q = (chain.joints(0, e, near) if e >= 0 else chain.q)[0].copy()  # a view would keep the whole chain
            far = float(c.s[e]) if e >= 0 else 0.0
            why = reason_text(arm, _reconfiguration_at(arm, c, chain, 0, 0.0))
            ranked.append((e, Branch(_branch_name(c, int(chain.labels[0])), q, far, why)))
            if carried.runs and chain is carried.runs[0].chain:
                chosen = ranked[-1][1]
    ranked.sort(key=lambda pair: (-round(pair[1].carries, 2), pair[1] is not chosen))
    distinct: list[Branch] = []  # with and without the wrist straight through a singularity is one branch
    for _, branch in ranked:
        q = branch.start_joints
        if not any(
            b.name == branch.name and np.abs(joint_change(arm, b.start_joints, q)).max() < _SAME_POSE for b in distinct
        ):
            distinct.append(branch)
    return distinct


def _branch_name(c: Columns, label: int) -> str:
    return c.names[label] if 0 <= label < len(c.names) else ""


def _reconfiguration_at(arm: Arm, c: Columns, chain: Chain, first: int, base: float) -> Reconfiguration:
    """Where and why a run from a sample ends."""
    why, joint, value, beyond = end_reason(c, chain, first)
    e = max(chain.carries_to(first), 0)
    q = chain.q[min(e + 1, chain.last) - chain.first].copy() if why == "hit" else None
    hit = "" if q is None else hit_text(arm, q)
    return Reconfiguration(
        base + float(c.s[e]), why, None if joint is None else arm.joint_names[joint], joint, value, beyond, hit, q
    )


def reason_text(arm: Arm, reconfiguration: Reconfiguration) -> str:
    """Why a branch carries no farther."""
    if reconfiguration.hit:
        return reconfiguration.hit
    if reconfiguration.index is None or reconfiguration.value is None:
        return _WHY[reconfiguration.why]
    size, unit = (1.0, "mm") if arm.prismatic[reconfiguration.index] else (units.DEGREE, "deg")
    return f"{reconfiguration.joint} meets its limit {reconfiguration.value / size:.6g} {unit}"


def deviation_text(plan: PathPlan) -> str:
    """How far the motion leaves the path, or the points that it was fitted to."""
    if plan.rounded_most is None:
        bound = np.ceil(plan.deviation * 1e4) / 1e4  # what it says is a bound, too
        return f"at most {bound:.4f} mm from the path; {plan.tolerance:g} allowed"
    return (
        f"points within {plan.deviation:.4f} mm of the motion, the farthest at {plan.rounded_most:.3f} mm; "
        f"{plan.tolerance:g} allowed"
    )


def wrist_pass_lines(plan: PathPlan) -> list[str]:
    """How each wrist singularity is passed straight through."""
    lines = []
    for singularity in plan.passed:
        tip = f"the tip at most {singularity.aside:.2g} mm aside, the tool not turned"
        tool = f"the tip on the path, the tool turned by at most {singularity.turned / units.DEGREE:.2g} deg"
        how = tool if singularity.turned else tip
        lines.append(
            f"a wrist singularity is passed between {singularity.begin:.3f} and {singularity.end:.3f} mm: {how}"
        )
    return lines


def plan_fields(plan: PathPlan) -> dict[str, Any]:
    """A plan as data of JSON [mm, deg, s]; of one that was refused what is known of it."""
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
    """What is known of a plan's motion; keys that are None where there is none."""
    motion, names = plan.motion, plan.arm.joint_names
    return {
        "duration_s": plan.duration,
        "deviation_mm": plan.deviation,
        "start_joints": units.joints_out(plan.arm, motion.start).tolist(),
        "joints": units.joints_out(plan.arm, motion.end).tolist(),
        "limits": {key: dict(zip(names, shares.tolist(), strict=True)) for key, shares in plan.limits.items()},
    }


def _optional_fields(plan: PathPlan) -> dict[str, Any]:
    """Keys that a plan without such things does not have."""
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


def _branch_fields(arm: Arm, branch: Branch) -> dict[str, Any]:
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
    """Joints that are held along a path, and where [deg | mm]."""
    return {name: _in_units(plan.arm, plan.arm.joint_names.index(name), value) for name, value in plan.held.items()}


def _approach_fields(move: Trajectory) -> dict[str, Any]:
    return {"from_joints": units.joints_out(move.arm, move.start).tolist(), "duration_s": move.duration}


def _in_units(arm: Arm, joint: int, value: float) -> float:
    """One joint's value in degrees, or mm."""
    return value if arm.prismatic[joint] else value / units.DEGREE


def path_refusal(plan: PathPlan, carried: CarriedRoute, branch: str | None = None) -> NoSolutionError:
    """The error of a path that is not carried, `branch` being asked for; `plan` of it tells the rest."""
    best, joints = plan.branches[0] if plan.branches else None, None
    length = carried.route.length
    if best is None:
        text = "the path's first point is out of reach"
    elif branch is not None and (not carried.runs or carried.runs[0].first > 0):
        text = f"branch '{branch}' is not within the limits at the path's start; "
        text += f"{best.name or 'another'} carries {best.carries:.3f} of {length:.3f} mm"
    elif not carried.runs or carried.runs[0].first > 0:
        text = f"no branch is within the limits at the path's start: {best.ends_because}"
    else:
        far = float(carried.columns.s[carried.runs[0].last])
        text = f"no branch carries the whole path: {far:.3f} of {length:.3f} mm, then "
        text += reason_text(plan.arm, plan.reconfigurations[0])
        joints = plan.reconfigurations[0].joints
        changes = len(carried.runs) - 1
        if carried.covered:
            text += f"; with {changes} change{'s' * (changes > 1)} of branch it can be done"
    plan.length += length
    fields: dict[str, Any] = {"splittable": carried.covered}
    if joints is not None:
        fields["joints"] = units.joints_out(plan.arm, joints).tolist()
    error = NoSolutionError(f"{text}: nothing was moved", **fields)
    error.plan = plan
    return error
