"""The description of an arm for the page, to draw it and to label its inputs; lengths in mm, angles in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.inverse.solvers.choose_redundant_joint import redundant_joint
from armkin.inverse.tasks.choose_task import task_for
from armkin.model import units
from armkin.model.arm import actual_arm
from armkin.motors import joints_per_pulse, motor_names, pulse_units
from armkin.view.skeleton import arm_shape

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm


def scene_json(arm: Arm) -> dict[str, Any]:
    """The arm: links and bodies (see `armkin.view.skeleton.arm_shape`), joints, motors."""
    form = arm_shape(arm)
    return {
        "robot": arm.name,
        "robot_file": arm.path,
        "reach": arm.reach,
        "base": arm.base.tolist(),
        "links": arm.link.tolist(),
        "bodies": [body.tolist() for body in form.bodies],
        "joints": _joints_json(arm, form.joint_offsets),
        "poses": units.poses_out(arm),
        "obstacles": _obstacle_triangles(arm),
        **_motors_json(arm),
        "gripper": _gripper_json(arm),
        "lock": first_lock(arm),
        "locks": arm.n > 6 or first_lock(arm) is not None,
    }


def _joints_json(arm: Arm, offsets: Array) -> list[dict[str, Any]]:
    """Each joint's name, limits, home and step [deg | mm]; offsets: (n,) [mm] where on its own axis it sits."""
    names, home, steps = units.unit_names(arm), units.home_out(arm), _joint_steps(arm)
    joints = []
    for i, (low, high) in enumerate(units.limits_out(arm)):
        joint = {
            "name": arm.joint_names[i],
            "unit": names[i],
            "lower": units.finite_or_none(low),
            "upper": units.finite_or_none(high),
            "home": home[i],
            "prismatic": bool(arm.prismatic[i]),
            "ratio": float(arm.ratio[i]),
            "at": float(offsets[i]),
            "step": steps[i],
        }
        joints.append(joint)
    return joints


def first_lock(arm: Arm) -> str | None:
    """The joint that is held when the page opens: the redundant one, or a middle one if several must be held."""
    try:
        task_for(arm)
    except UsageError:
        return arm.joint_names[(arm.n - 1) // 2 - 1] if arm.n > 6 else None
    return redundant_joint(actual_arm(arm), None) or None


def _joint_steps(arm: Arm) -> list[float]:
    """The resolution of each joint [deg | mm]: its largest motion by one pulse; 0.1 without drives."""
    try:
        per_pulse = np.abs(joints_per_pulse(arm)).max(axis=1)
    except UsageError:
        return [0.1] * arm.n
    return [float(step) or 0.1 for step in units.joints_out(arm, per_pulse)]


def _obstacle_triangles(arm: Arm) -> list[float]:
    """The surfaces of all keep-outs, as triangles: nine numbers each, in the frame of targets."""
    if not arm.keep_out:
        return []
    from armkin.keep_out.body_pairs import guard

    surfaces = [obstacle.triangles(1.4 * arm.reach) for _, obstacle in guard(arm).obstacles]
    return [number for triangles in surfaces for number in triangles.round(2).ravel().tolist()]


def tip_jog_axes(arm: Arm) -> list[str]:
    """The axes along which the tip may be jogged; none if no task fits."""
    from armkin.motion.path_planner.jog_line import jog_axes

    try:
        return list(jog_axes(arm))
    except UsageError:
        return []


def _motors_json(arm: Arm) -> dict[str, Any]:
    """The motors' names and units; without drives None, and why."""
    try:
        joints_per_pulse(arm)
    except UsageError as error:
        return {"motors": None, "no_motors": str(error)}
    motors = zip(motor_names(arm), pulse_units(arm), strict=True)
    return {"motors": [{"name": name, "unit": unit} for name, unit in motors], "no_motors": ""}


def _gripper_json(arm: Arm) -> dict[str, Any] | None:
    """How far the gripper opens, and which way it points in the tool's frame; None without one."""
    file = arm.gripper
    if file is None:
        return None
    # The gripper continues the last straight piece of the arm, which is not always along the tool's z axis.
    corners = arm_shape(arm).bodies[-1]
    pieces = [step for step in np.diff(corners, axis=0) if np.linalg.norm(step) > 1e-6 * arm.reach]
    piece = pieces[-1] if pieces else np.array([0.0, 0.0, 1.0])
    direction = arm.link[-1][:3, :3].T @ piece
    return {
        "open": file.open,
        "closed": file.closed,
        "unit": "deg" if file.lead is None else "mm",
        "along": (direction / np.linalg.norm(direction)).tolist(),
    }
