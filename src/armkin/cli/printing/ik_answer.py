"""The answer of `armkin ik` as JSON has it: branches, what each misses and hits, or the nearest pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import armkin
from armkin.cli.printing import render
from armkin.model import units

if TYPE_CHECKING:
    from armkin.cli.answers import Branch, Closest, Ik
    from armkin.formula.arrays import Array
    from armkin.inverse import choose_branch
    from armkin.inverse.answers.closest import Closest as NearestPose
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def answer_of(
    request: choose_branch.Request,
    task: Task,
    values: list[float],
    chosen_answer: choose_branch.Answer,
    all_branches: bool,
    turns: bool,
    closest: Closest | None,
) -> Ik:
    """The JSON of one target [mm, deg]: its branches, or the closest pose where none is."""
    arm = request.arm
    branches, best_index = chosen_answer.branches, chosen_answer.best
    if not all_branches:
        branches, best_index = ([], None) if best_index is None else ([branches[best_index]], 0)
    head = render.head(arm)
    answer: Ik = {
        "robot": head["robot"],
        "robot_file": head["robot_file"],
        "robot_sha256": head["robot_sha256"],
        "task": task.name,
        "target": values,
        "target_labels": list(task.labels),
        "near": request.near_out,
        "status": chosen_answer.status,
        "method": chosen_answer.method,
        "why": chosen_answer.why,
        "complete": chosen_answer.complete,
        "joint_units": units.unit_names(arm),
        "branch_count": chosen_answer.total,
        "branches_within_limits": chosen_answer.within_limits,
        "branches": [_branch_json(request, branch, turns) for branch in branches],
        "best": best_index,
        "closest": closest,
        "free_joints": chosen_answer.free,
    }
    answer.update(render.scene_and_tool(arm))
    if arm.keep_out:
        answer["branches_free"] = sum(branch.may_be_taken for branch in chosen_answer.branches)
    return answer


def nearest_to(
    request: choose_branch.Request, targets: Array, answers: Sequence[choose_branch.Answer]
) -> dict[int, NearestPose]:
    """The nearest poses of those targets that no legal branch reaches, all at once."""
    from armkin.inverse import choose_branch

    rows = [k for k, answer in enumerate(answers) if answer.best is None and not answer.within_limits]
    return dict(zip(rows, choose_branch.closest(request, targets[rows]), strict=True)) if rows else {}


def closest_pose(
    request: choose_branch.Request, goal: Array, chosen_answer: choose_branch.Answer, nearest: NearestPose | None = None
) -> Closest | None:
    """The nearest pose within limits; branch: the one it is, where it reaches the target by a way not asked for.

    None where every branch within limits hits something. nearest: if it is known.
    """
    from armkin.inverse import choose_branch

    arm = request.arm
    if chosen_answer.branches and chosen_answer.branches[0].within_limits:  # only the branch asked for is outside
        best_branch = chosen_answer.branches[0]
        if best_branch.hits:
            return None
        answer: Closest = {
            "joints": best_branch.joints,
            "position_mm": (armkin.fk(arm, best_branch.q)[:3, 3] + 0.0).tolist(),
            "distance_mm": best_branch.residual_mm,
            "angle_deg": best_branch.residual_deg,
            "converged": True,
            "branch": best_branch.name,
        }
        answer.update(_near_to(arm, best_branch))
        return answer
    if nearest is None:
        [nearest] = choose_branch.closest(request, goal[None])
    answer = {
        "joints": units.joints_out(arm, nearest.q).tolist(),
        "position_mm": nearest.position.tolist(),
        "distance_mm": nearest.distance,
        "angle_deg": float(units.angles_out(nearest.angle)),
        "converged": nearest.converged,
        "branch": None,
    }
    answer.update(render.near_by(arm, nearest.q[None])[0])
    return answer


def _near_to(arm: Arm, branch: choose_branch.TargetBranch) -> Any:
    """What a branch is near to, where there are keep-outs."""
    return {"clearance_mm": branch.clearance, "hits": list(branch.hits)} if arm.keep_out else {}


def _branch_json(request: choose_branch.Request, branch: choose_branch.TargetBranch, turns: bool) -> Branch:
    """A branch as data of JSON [deg | mm]; turns: with its other turns within limits."""
    arm = request.arm
    row: Branch = {
        "joints": branch.joints,
        "name": branch.name,
        "within_limits": branch.within_limits,
        "violations": [render.violation(arm, i, branch.joints[i]) for i in branch.outside],
        "residual_mm": branch.residual_mm,
        "residual_deg": branch.residual_deg,
        "motion": branch.motion,
    }
    row.update(_near_to(arm, branch))
    from armkin.inverse import choose_branch
    from armkin.inverse.solvers.choose_redundant_joint import redundant_joint

    if branch.interval is not None:
        row["family"] = {
            "joint": redundant_joint(choose_branch.locked_arm(request), request.task),
            "interval": [*branch.interval],
        }
    if turns:
        row["turns"] = choose_branch.turns(request, branch)
    return row
