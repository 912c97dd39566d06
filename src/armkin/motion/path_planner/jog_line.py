"""A line that a hand holds down: from where the arm stands along an axis, as far as its branch carries it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.numeric.newton import scaled
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.keep_out.clearance import clearance
from armkin.model.target_numbers import targets_out
from armkin.model.units import radian_or_reach
from armkin.motion.joint_moves import check_rates
from armkin.motion.path_planner.path import path

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

MAX_TOOL_SPEED = 250.0  # speed [mm/s] of the tool at 100 %: ISO 10218-1 allows no more where an arm is guided by hand
MAX_TURN_SPEED = np.deg2rad(60.0)  # speed [rad/s] at which the tool turns at 100 %
MAX_SECONDS = 10.0  # time [s], at most, of a line
POSTURE_STEP = 2.0  # distance [mm], or hundredths of a radian, between postures that are looked at
SLOW_SHARE = 0.1  # share of MAX_TOOL_SPEED: where joints at full speed carry the tool slower, a singularity is near
Frame = Literal["base", "tool"]


def jog_axes(arm: Arm) -> tuple[str, ...]:
    """The axes of a tip that may be jogged: the task's own numbers; of a pose x y z and turns about these.

    None of an arm with a joint to spare: a line of its tip is no one motion.
    """
    task = task_for(arm, None)
    if arm.n > task.constraints:
        return ()
    if task.orientation == "full":
        return ("x", "y", "z", "rx", "ry", "rz")
    return task.labels if task.orientation == "none" else task.labels[: task.position]


def jog_line(arm: Arm, q: Array, axis: str, frame: Frame, share: float) -> tuple[PathPlan, str]:
    """The longest line from joint values (n,) along an axis, and what ends it ("" where it is the time).

    share: -1 to 1, not 0, of MAX_TOOL_SPEED or MAX_TURN_SPEED. The line keeps the arm's branch and ends before a limit,
    a singularity or a hit, at rest. Raises UsageError for an axis that the arm does not have, NoSolutionError
    where no way leads.
    """
    check_rates(arm)
    task = task_for(arm, None)
    if axis not in jog_axes(arm):
        raise UsageError(f"axis: '{axis}' is none of {', '.join(jog_axes(arm))}")
    turns = axis not in ("x", "y", "z")
    top = MAX_TURN_SPEED if turns else MAX_TOOL_SPEED
    step = np.sign(share) * (POSTURE_STEP / 100 if turns else POSTURE_STEP)
    most = max(int(min(MAX_SECONDS * abs(share) * top, np.pi * 0.9 if turns else 2 * arm.reach) / abs(step)), 1)
    count, why = _steps_carried(arm, task, q, axis, frame, step, most)
    while count:
        target = _shift_target(arm, task, q, axis, frame, step * count)
        [line] = targets_out(task.labels, target[None])
        try:
            speed = {"speed": 100 * abs(share)} if turns else {"tool_speed": abs(share) * MAX_TOOL_SPEED}
            plan = path(arm, {"moves": [{"line": list(line)}], **speed}, start=q)
        except NoSolutionError as error:
            count, why = count // 2, error.message  # a hit between two postures, or what the corner of a branch hides
            continue
        return plan, why
    raise NoSolutionError(f"the tip does not move along {axis} of the {frame}: {why}")


def _steps_carried(arm: Arm, task: Task, q: Array, axis: str, frame: Frame, step: float, most: int) -> tuple[int, str]:
    """How many steps the arm's own branch follows, and what ends it."""
    unit, posture = radian_or_reach(arm), q
    top = MAX_TOOL_SPEED if axis in ("x", "y", "z") else MAX_TURN_SPEED
    stuck = bool(arm.keep_out) and float(clearance(arm, q).mm) < 0
    before, leaving = np.inf, False  # an arm that stands near a singularity may leave it
    for k in range(1, most + 1):
        goal = _shift_target(arm, task, q, axis, frame, step * k)[None]
        r, J = scaled(arm, task, posture[None], goal)
        move = np.linalg.lstsq(J[0], r[0], rcond=1e-9)[0]
        blocked = np.linalg.norm(J[0] @ move - r[0]) > 0.1 * np.linalg.norm(r[0])  # no joint speed leads there
        first = move * unit
        slow = float(np.max(np.abs(first) / arm.max_speed)) * SLOW_SHARE * top / abs(step)
        if blocked or (slow > 1.0 and slow >= before):
            return 0 if leaving and k == 2 else k - 1, "a singularity is near"
        before, leaving = slow, slow > 1.0
        posture = posture + first
        for _ in range(3):
            r, J = scaled(arm, task, posture[None], goal)
            posture = posture + np.linalg.lstsq(J[0], r[0], rcond=1e-9)[0] * unit
        if not float(np.abs(scaled(arm, task, posture[None], goal)[0]).max()) < 1e-7:
            return k - 1, "it is out of reach" if k > 1 else "a singularity is near"
        if why := _stop_reason(arm, posture, stuck):
            return k - 1, why
    return most, ""


def _stop_reason(arm: Arm, q: Array, stuck: bool) -> str:
    """The limit or the hit at a posture, in words; stuck: the arm touches something to begin with."""
    outside = (q < arm.lower) | (q > arm.upper)
    if outside.any():
        return f"{arm.joint_names[int(np.argmax(outside))]} is at its limit"
    if arm.keep_out and not arm.ignores_keep_out and not stuck:
        near = clearance(arm, q)
        if float(near.mm) < 0:
            return f"{near.body!s} would hit {near.other!s}"
    return ""


def _shift_target(arm: Arm, task: Task, q: Array, axis: str, frame: Frame, distance: float) -> Array:
    """The target that is `distance` [mm | rad] away along an axis from where joint values (n,) are."""
    T = fk(arm, q)
    target = np.array(targets_of(task, T[None], q[None])[0])
    if axis[-1] not in "xyz":
        target[task.labels.index(axis)] += distance
        return target
    unit: Array = np.eye(3)["xyz".index(axis[-1])]
    if axis[0] == "r":
        turn = _rotation_about(unit, distance)
        target[:3, :3] = T[:3, :3] @ turn if frame == "tool" else turn @ T[:3, :3]
        return target
    way = distance * (T[:3, :3] @ unit if frame == "tool" else unit)
    place = target[:3, 3] if task.orientation == "full" else target[: task.position]
    place += way[: len(place)]
    return target


def _rotation_about(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) by an angle about an axis of the frame (Rodrigues)."""
    K = np.cross(np.eye(3), axis).T
    rotation: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return rotation
