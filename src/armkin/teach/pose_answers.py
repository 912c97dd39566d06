"""Answers for one pose or target of the page: tip, branches, limits in words, pulses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.forward import fk
from armkin.inverse import choose_branch
from armkin.inverse.solve import ik
from armkin.inverse.solvers import solver_of_arm
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.keep_out.clearance import hits, hits_text
from armkin.model import units
from armkin.model.limits import outside_limits, outside_text
from armkin.model.rotation import rpy
from armkin.model.target_numbers import label_units, targets_in, targets_out
from armkin.motors import best_pulses, motor_names, outside_travel, pulses, rounding

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.teach.quick_ik import QuickIk


@dataclass(frozen=True)
class Question:
    """A question of the page."""

    q: Array  # (n,) [rad | mm] the pose shown
    target: Sequence[float] | None = None  # [mm, deg] target of the tip; None: its present pose
    held: tuple[str, ...] = ()  # joints that keep their values
    branch: str = ""  # name of the branch to stay on
    best: bool = False  # search for the pulses whose tip is nearest
    nearest: bool = True  # search for the nearest pose within limits if no branch is
    standing_pulses: tuple[int, ...] | None = None  # pulses of the arm's position; None: unknown


def answer_question(arm: Arm, question: Question, quick: QuickIk | None = None) -> dict[str, Any]:
    """The answer as JSON in mm and degrees; quick: solves by machine code, which is built on demand."""
    answer = _branches_json(arm, question, quick)
    q = answer.pop("q", question.q)
    T = fk(arm, q) + 0.0  # no -0.0
    return {
        **answer,
        "q": units.joints_out(arm, q).tolist(),
        "outside": _warnings(arm, q),
        "red": _hit_bodies(arm, q),
        "tip": {
            "position_mm": T[:3, 3].tolist(),
            "rpy_deg": units.angles_out(rpy(T[:3, :3])).tolist(),
        },
        "motors": motors_json(arm, q, question.standing_pulses, best=question.best),
    }


def motors_json(
    arm: Arm, q: Array, standing_pulses: Sequence[int] | None, *, best: bool = False
) -> dict[str, Any] | None:
    """Pulses of a pose, moves from the arm's position (from home if unknown), and the rounding error at the tip."""
    try:
        rounded = best_pulses(arm, q).chosen if best else rounding(arm, q)
    except UsageError:
        return None  # no drives; the scene says why
    start = pulses(arm, arm.home) if standing_pulses is None else np.asarray(standing_pulses)
    names = motor_names(arm)
    return {
        "pulses": rounded.pulses.tolist(),
        "moves": (rounded.pulses - start).tolist(),
        "from": "home" if standing_pulses is None else "arm",
        "error_mm": float(rounded.error),
        "best": best,
        "outside_travel": [names[k] for k in np.flatnonzero(outside_travel(arm, rounded.pulses))],
    }


@lru_cache(maxsize=32)
def _solvable_task(arm: Arm) -> tuple[Task | None, str]:
    """The task that the page solves; None and the reason if branches cannot be listed."""
    try:
        task = task_for(arm)
        solver_of_arm.solver(arm, task.name)
        return task, ""
    except UsageError as error:
        return None, str(error)


def _target_of(arm: Arm, task: Task, question: Question, free_joints: list[int]) -> tuple[list[float], Array]:
    """The target in its labels' units and as an argument of `ik`: the question's own, or that of its pose.

    free_joints: the joints that are not held.
    """
    if question.target is None:
        goal = targets_of(task, fk(arm, question.q)[None], question.q[None, free_joints])[0]
        [values] = targets_out(task.labels, goal[None])
        return values, goal
    values = list(question.target)
    if len(values) != len(task.labels):
        raise UsageError(f"target: task {task.name} takes {len(task.labels)} numbers: {' '.join(task.labels)}")
    return values, targets_in(task.labels, [values])[0]


def _branches_json(arm: Arm, question: Question, quick: QuickIk | None) -> dict[str, Any]:
    """All branches of the target; `q` is the pose to show."""
    shown = units.joints_out(arm, question.q).tolist()
    held = {name: shown[arm.joint_names.index(name)] for name in question.held}
    request = choose_branch.Request(arm=arm, near=shown, held=held, ik=quick.ik if quick else ik)
    prepared_arm = choose_branch.prepared_arm(request)
    task, reason = _solvable_task(prepared_arm)
    if task is None:
        return {"task": None, "why": reason, "branches": [], "status": None}
    if quick:
        quick.build(prepared_arm, task.name)
    free_joints = [i for i, name in enumerate(arm.joint_names) if name not in held]
    values, goal = _target_of(arm, task, question, free_joints)
    request = replace(request, task=task.name)
    [answer_set] = choose_branch.solve(request, goal[None])
    return {
        "task": task.name,
        "labels": list(task.labels),
        "units": label_units(task.labels),
        "target": values,
        "status": answer_set.status,
        "method": answer_set.method,
        "complete": answer_set.complete,
        "free": answer_set.free,
        "branches": [_branch_json(arm, branch) for branch in answer_set.branches],
        "names": list(answer_set.names),
        "chosen": None,
        "closest": None,
        **_shown_fields(question, request, goal, answer_set),
    }


def _shown_fields(
    question: Question, request: choose_branch.Request, goal: Array, answer_set: choose_branch.Answer
) -> dict[str, Any]:
    """What is shown of a target: the branch of the pose, the one asked for with its `q`, or the nearest pose."""
    branches = answer_set.branches
    if question.target is None:
        return {"chosen": _branch_of_pose(branches, question.q)}
    if answer_set.within_limits:
        stay = [k for k, branch in enumerate(branches) if branch.within_limits and branch.name == question.branch]
        branch_index = stay[0] if stay else 0  # the first branch, free of hits if possible
        return {"chosen": branch_index, "q": branches[branch_index].q}
    if not question.nearest:
        return {}
    [nearest] = choose_branch.closest(request, goal[None])
    closest = {
        "joints": units.joints_out(request.arm, nearest.q).tolist(),
        "distance_mm": nearest.distance,
        "angle_deg": float(units.angles_out(nearest.angle)),
    }
    return {"closest": closest}


def _branch_json(arm: Arm, branch: choose_branch.TargetBranch) -> dict[str, Any]:
    """A branch as the page lists it."""
    return {
        "name": branch.name,
        "joints": branch.joints,
        "within_limits": branch.within_limits,
        "outside": [outside_text(arm, i, float(branch.q[i])) for i in branch.outside],
        "hits": hits_text(list(branch.hits)),
        "motion": branch.motion,
    }


def _branch_of_pose(branches: Sequence[choose_branch.TargetBranch], q: Array) -> int | None:
    """The index of the branch of a pose; None on a self-motion, which has many poses."""
    for index, branch in enumerate(branches):
        change = np.abs(branch.q - q)
        if np.minimum(change, np.abs(change % (2 * np.pi) - 2 * np.pi)).max() < 1e-6 or change.max() < 1e-6:
            return index
    return None


def _hit_bodies(arm: Arm, q: Array) -> list[int]:
    """Numbers of the bodies that take part in a hit, with 0 for the base."""
    if not arm.keep_out:
        return []
    bodies = ["base", *arm.joint_names]
    hit_names = {name for hit in hits(arm, q[None])[0][1] for name in (hit["body"], hit["with"])}
    return [number for number, name in enumerate(bodies) if name in hit_names]


def _warnings(arm: Arm, q: Array) -> list[str]:
    """The joints outside their limits and the hits of a pose, in words."""
    complaints = [outside_text(arm, int(i), float(q[i])) for i in np.flatnonzero(outside_limits(arm, q))]
    if arm.keep_out and (hit := hits(arm, q[None])[0][1]):
        complaints.append(f"it {hits_text(hit)}")
    return complaints
