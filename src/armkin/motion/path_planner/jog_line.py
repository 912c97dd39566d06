"""Jogging of the tip: the longest straight line from the present posture along an axis that the branch carries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.numeric.newton import scaled_residual_and_jacobian
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
MAX_SECONDS = 10.0  # longest duration [s] of a line
POSTURE_STEP = 2.0  # distance [mm], or in hundredths of a radian, between the postures that are checked
SLOW_SHARE = 0.1  # share of MAX_TOOL_SPEED; a tool that is slower with joints at full speed is near a singularity
Frame = Literal["base", "tool"]


def jog_axes(arm: Arm) -> tuple[str, ...]:
    """The axes along which the tip may be jogged: the numbers of the task, or x y z rx ry rz where it is a pose.

    A redundant arm has none, since one line of its tip does not determine the motion of its joints.
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
    rotates = axis not in ("x", "y", "z")
    top_speed = MAX_TURN_SPEED if rotates else MAX_TOOL_SPEED
    step = np.sign(share) * (POSTURE_STEP / 100 if rotates else POSTURE_STEP)
    max_distance = min(MAX_SECONDS * abs(share) * top_speed, np.pi * 0.9 if rotates else 2 * arm.reach)
    max_steps = max(int(max_distance / abs(step)), 1)
    count, end_text = _steps_carried(arm, task, q, axis, frame, step, max_steps)
    while count:
        target = _shift_target(arm, task, q, axis, frame, step * count)
        [line] = targets_out(task.labels, target[None])
        try:
            speed = {"speed": 100 * abs(share)} if rotates else {"tool_speed": abs(share) * MAX_TOOL_SPEED}
            plan = path(arm, {"moves": [{"line": list(line)}], **speed}, start=q)
        except NoSolutionError as error:
            count, end_text = count // 2, error.message  # a hit or branch end lies between steps
            continue
        return plan, end_text
    raise NoSolutionError(f"the tip does not move along {axis} of the {frame}: {end_text}")


def _steps_carried(
    arm: Arm, task: Task, q: Array, axis: str, frame: Frame, step: float, max_steps: int
) -> tuple[int, str]:
    """How many steps the present branch carries, and the reason why it ends."""
    unit, posture = radian_or_reach(arm), q
    top_speed = MAX_TOOL_SPEED if axis in ("x", "y", "z") else MAX_TURN_SPEED
    starts_in_hit = bool(arm.keep_out) and float(clearance(arm, q).mm) < 0
    last_slowness, near_singularity = np.inf, False  # an arm that starts near a singularity may move away from it
    for step_number in range(1, max_steps + 1):
        goal = _shift_target(arm, task, q, axis, frame, step * step_number)[None]
        residual, J = scaled_residual_and_jacobian(arm, task, posture[None], goal)
        change = np.linalg.lstsq(J[0], residual[0], rcond=1e-9)[0]
        # no joint motion moves the tip this way
        is_blocked = np.linalg.norm(J[0] @ change - residual[0]) > 0.1 * np.linalg.norm(residual[0])
        joint_step = change * unit
        slowness = float(np.max(np.abs(joint_step) / arm.max_speed)) * SLOW_SHARE * top_speed / abs(step)
        if is_blocked or (slowness > 1.0 and slowness >= last_slowness):
            return 0 if near_singularity and step_number == 2 else step_number - 1, "a singularity is near"
        last_slowness, near_singularity = slowness, slowness > 1.0
        posture = posture + joint_step
        for _ in range(3):
            residual, J = scaled_residual_and_jacobian(arm, task, posture[None], goal)
            posture = posture + np.linalg.lstsq(J[0], residual[0], rcond=1e-9)[0] * unit
        if not float(np.abs(scaled_residual_and_jacobian(arm, task, posture[None], goal)[0]).max()) < 1e-7:
            return step_number - 1, "it is out of reach" if step_number > 1 else "a singularity is near"
        if stop_text := _stop_reason(arm, posture, starts_in_hit):
            return step_number - 1, stop_text
    return max_steps, ""


def _stop_reason(arm: Arm, q: Array, starts_in_hit: bool) -> str:
    """The limit or the hit at a posture, in words; starts_in_hit: the line begins in contact, so hits do not end it."""
    beyond_limits = (q < arm.lower) | (q > arm.upper)
    if beyond_limits.any():
        return f"{arm.joint_names[int(np.argmax(beyond_limits))]} is at its limit"
    if arm.keep_out and not arm.ignores_keep_out and not starts_in_hit:
        body_clearance = clearance(arm, q)
        if float(body_clearance.mm) < 0:
            return f"{body_clearance.body!s} would hit {body_clearance.other!s}"
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
        rotation = _rotation_about(unit, distance)
        target[:3, :3] = T[:3, :3] @ rotation if frame == "tool" else rotation @ T[:3, :3]
        return target
    displacement = distance * (T[:3, :3] @ unit if frame == "tool" else unit)
    tip = target[:3, 3] if task.orientation == "full" else target[: task.position]
    tip += displacement[: len(tip)]
    return target


def _rotation_about(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) by an angle about an axis of the frame (Rodrigues)."""
    K = np.cross(np.eye(3), axis).T
    rotation: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return rotation
