"""One pose or one target of the page: where it is, every branch, limits in words, pulses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.forward import fk
from armkin.inverse import recognise
from armkin.inverse.closest import closest
from armkin.inverse.solutions import Solutions, Status
from armkin.inverse.solve import ik
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model import units
from armkin.model.limits import outside, said
from armkin.model.lock import lock, unlock
from armkin.model.rotation import rpy
from armkin.motors import best_pulses, motor_names, outside_travel, pulses, rounding

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


@dataclass(frozen=True)
class Question:
    """What the page wants to know."""

    q: Array  # (n,) [rad | mm] the pose it shows
    target: Sequence[float] | None = None  # [mm, deg] where the tip shall go; None: where it is
    held: tuple[str, ...] = ()  # joints that stay
    branch: str = ""  # name of the branch to stay on
    best: bool = False  # look for the pulses whose tip is nearest
    nearest: bool = True  # look for the nearest pose within limits where no branch is
    stands: tuple[int, ...] | None = None  # pulses where the arm stands; None: not known


def look(arm: Arm, question: Question) -> dict[str, Any]:
    """The answer, as JSON in mm and degrees."""
    solved = _solved(arm, question)
    q = solved.pop("q", question.q)
    T = fk(arm, q) + 0.0  # no -0.0
    return {
        **solved,
        "q": units.joints_out(arm, q).tolist(),
        "outside": _words(arm, q),
        "tip": {
            "position_mm": T[:3, 3].tolist(),
            "rpy_deg": units.angles_out(rpy(T[:3, :3])).tolist(),
        },
        "motors": motors(arm, q, question.stands, best=question.best),
    }


def motors(arm: Arm, q: Array, stands: Sequence[int] | None, *, best: bool = False) -> dict[str, Any] | None:
    """Pulses of a pose, the moves from where the arm stands (unknown: from home), what rounding costs at the tip."""
    try:
        found = best_pulses(arm, q).chosen if best else rounding(arm, q)
    except UsageError:
        return None  # no drives; the scene says why
    start = pulses(arm, arm.home) if stands is None else np.asarray(stands)
    bad = [name for name, out in zip(motor_names(arm), outside_travel(arm, found.pulses), strict=True) if out]
    return {
        "pulses": found.pulses.tolist(),
        "moves": (found.pulses - start).tolist(),
        "from": "home" if stands is None else "arm",
        "error_mm": float(found.error),
        "best": best,
        "outside_travel": bad,
    }


@lru_cache(maxsize=32)
def _locked(arm: Arm, held: tuple[tuple[str, float], ...]) -> Arm:
    """The same arm object for the same values held: what is recorded for it is used again."""
    return lock(arm, dict(held)) if held else arm


@lru_cache(maxsize=32)
def _task(arm: Arm) -> tuple[Task | None, str]:
    """The task that the page solves; None, and why, if no branches can be listed."""
    try:
        task = task_for(arm)
        recognise.solver(arm, task.name)
        return task, ""
    except UsageError as error:
        return None, str(error)


def _solved(arm: Arm, question: Question) -> dict[str, Any]:
    """Every branch of the target; `q` is the pose to show."""
    held = {name: float(question.q[arm.joint_names.index(name)]) for name in question.held}
    kept = [i for i, name in enumerate(arm.joint_names) if name not in held]
    one = _locked(arm, tuple(held.items()))
    task, why = _task(one)
    if task is None:
        return {"task": None, "why": why, "branches": [], "status": None}
    near = question.q[kept]
    if question.target is None:
        goal = targets_of(task, fk(arm, question.q)[None], near[None])[0]
        values = target_out(task, goal)
    else:
        values = list(question.target)
        if len(values) != len(task.labels):
            raise UsageError(f"target: task {task.name} takes {len(task.labels)} numbers: {' '.join(task.labels)}")
        goal = units.targets_in(task.labels, [values])[0]
    s = ik(one, goal, task.name, near=near)
    rows, names = _rows(arm, held, s, near)
    answer: dict[str, Any] = {
        "task": task.name,
        "labels": list(task.labels),
        "units": units.label_units(task.labels),
        "target": values,
        "status": Status(int(s.status)).name.lower(),
        "method": s.method,
        "complete": bool(s.complete),
        "free": [arm.joint_names[kept[i]] for i in np.flatnonzero(s.free)],
        "branches": [row for row, _ in rows],
        "names": names,
        "chosen": None,
        "closest": None,
    }
    if question.target is None:
        answer["chosen"] = _same(rows, question.q)
        return answer
    legal = [k for k, (row, _) in enumerate(rows) if row["within_limits"]]
    stay = [k for k in legal if rows[k][0]["name"] == question.branch]
    if legal:
        answer["chosen"] = (stay or legal)[0]
        answer["q"] = rows[answer["chosen"]][1]
    elif question.nearest:
        near_pose = closest(one, goal, task.name, near=near)
        q = unlock(arm, held, near_pose.q)
        answer["closest"] = {
            "joints": units.joints_out(arm, q).tolist(),
            "distance_mm": near_pose.distance,
            "angle_deg": float(units.angles_out(near_pose.angle)),
        }
    return answer


def _rows(
    arm: Arm, held: Mapping[str, float], s: Solutions, near: Array
) -> tuple[list[tuple[dict[str, Any], Array]], list[str]]:
    """Branches, within limits first and then by motion, each with its joint values [rad | mm]."""
    full = unlock(arm, held, s.q) if held else s.q
    degrees = units.joints_out(arm, full).tolist()
    motion = s.motion.tolist()
    rows = []
    for b in s.order.tolist():
        if s.valid[b]:
            words = _words(arm, full[b])
            row = {
                "name": s.names[s.branch[b]],
                "joints": degrees[b],
                "within_limits": bool(s.within_limits[b]) and not words,
                "outside": words,
                "motion": motion[b],
            }
            rows.append((row, full[b]))
    return rows, list(s.names)


def _same(rows: Sequence[tuple[dict[str, Any], Array]], q: Array) -> int | None:
    """The branch that a pose is on; None on a self-motion, where the pose is one of many."""
    for k, (_, other) in enumerate(rows):
        apart = np.abs(other - q)
        if np.minimum(apart, np.abs(apart % (2 * np.pi) - 2 * np.pi)).max() < 1e-6 or apart.max() < 1e-6:
            return k
    return None


def _words(arm: Arm, q: Array) -> list[str]:
    """Each joint outside its limits, in words."""
    return [said(arm, int(i), float(q[i])) for i in np.flatnonzero(outside(arm, q))]


def target_out(task: Task, goal: Array) -> list[float]:
    """A target as `ik` takes it, in the command line's numbers [mm, deg]."""
    if task.orientation == "full":
        return [*(goal[:3, 3] + 0.0).tolist(), *units.angles_out(rpy(goal[:3, :3])).tolist()]
    scale = [units.DEGREE if unit == "deg" else 1.0 for unit in units.label_units(task.labels)]
    return [float(value) for value in goal / scale + 0.0]
