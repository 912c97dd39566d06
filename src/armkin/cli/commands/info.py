"""`armkin info`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import armkin
from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import Json, Robot, Scene, TaskName, TextOut
from armkin.cli.printing import output, render
from armkin.errors import UsageError
from armkin.model import units
from armkin.model.target_numbers import label_units

if TYPE_CHECKING:
    from armkin.cli.answers import Info, KeepOuts, Solving
    from armkin.model.arm import Arm
    from armkin.robot_file import Joint, Motor, RobotFile


def info(robot: Robot, task: TaskName = None, scene: Scene = None, json: Json = False, out: TextOut = None) -> None:
    """What a robot file says, checked.

    DH table or screws, limits and home, the step chain with pulses per turn and degrees per pulse, the
    task of `armkin ik` with its target's numbers, how it is solved, and what pulses, send and home still need.
    """
    arm = arguments.load_arm(robot, scene)
    answer = _answer(arm, task)
    with output.destination(out) as write:
        if json:
            write(f"{render.to_json(answer)}\n")
        else:
            from armkin.cli.printing.info_text import arm_summary

            write(arm_summary(answer))


def _answer(arm: Arm, task: str | None) -> Info:
    """What is known of an arm, as data of JSON [mm, deg]."""
    from armkin.board.backend.missing_keys import lines_to_add, missing_by_command

    file = arm.file
    assert file is not None  # it was read from one
    motors = [_motor_json(motor, file) for motor in file.motor_list()]
    return {
        **render.head(arm),
        "description": file.description,
        "source": file.source,
        "convention": file.convention,
        "joint_units": units.unit_names(arm),
        "joints": [_joint_json(joint) for joint in file.joints],
        "poses": units.poses_out(arm),
        "base": file.base.model_dump(include={"xyz", "rpy"}),
        "tool": file.tool.model_dump(),
        "zero_pose": None if file.zero_pose is None else file.zero_pose.model_dump(),
        **_solving_json(arm, task),
        "pitch_offset": file.pitch_offset,
        "reach_mm": arm.reach if arm.link[1:, :3, 3].any() or arm.prismatic.any() else 0.0,
        "motors": motors,
        "one_to_one": all(list(motor["joints"].values()) == [1.0] for motor in motors),
        "resolution": _resolution(arm),
        "gripper": None if file.gripper is None else file.gripper.model_dump(exclude_none=True),
        "board": None if file.board is None else file.board.model_dump(exclude_none=True),
        "lacks": missing_by_command(arm),
        "lines_to_add": lines_to_add(arm),
        **_keep_outs(arm),
    }


def _keep_outs(arm: Arm) -> KeepOuts:
    """Bodies, pairs that do not count, hits at home; nothing without keep-outs."""
    if not arm.keep_out:
        return {}
    from armkin.keep_out.keep_out_json import keep_out_fields

    return keep_out_fields(arm)  # type: ignore[return-value]


def _joint_json(joint: Joint) -> dict[str, Any]:
    entry = joint.model_dump(exclude={"drive"})
    return {key: value for key, value in entry.items() if key not in ("dh", "screw", "body") or value is not None}


def _motor_json(motor: Motor, file: RobotFile) -> dict[str, Any]:
    """A motor as the file has it, and what its chain multiplies to."""
    entry = motor.model_dump(exclude_none=True)
    if motor.kind == "stepper":
        for key in ("travel", "pulse_us", "zero"):
            entry.pop(key, None)
        entry["pulses_per_turn"] = motor.pulses_per_turn()
    else:
        for key in ("full_steps", "microsteps", "gear", "pulley", "lead"):
            entry.pop(key, None)  # a servo of either kind has none
    types = {joint.name: joint.type for joint in file.joints}
    is_prismatic = all(types[name] == "prismatic" for name in motor.joints)
    per_unit = motor.pulses_per_unit()
    entry["unit"] = "mm" if is_prismatic and motor.kind == "stepper" else "deg"
    entry["pulses_per_unit"] = per_unit
    entry["unit_per_pulse"] = 1.0 / per_unit
    return entry


def _solving_json(arm: Arm, name: str | None) -> Solving:
    """The task and its solver, or why there is none."""
    from armkin.inverse.redundant.families import method_of_families
    from armkin.inverse.solvers.choose_redundant_joint import redundancy
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.model.arm import actual_arm

    try:
        task = task_for(arm, name)
    except UsageError as error:
        if name is not None:
            raise
        return {"task": None, "target_labels": [], "target_units": [], "solver": None, "ik_refuses": str(error)}
    solving: Solving = {
        "task": task.name,
        "target_labels": list(task.labels),
        "target_units": label_units(task.labels),
        "solver": None,
        "ik_refuses": None,
    }
    if redundant := redundancy(actual_arm(arm), task.name):
        method, reason, complete = method_of_families(arm, redundant)
        solving["redundant"] = arm.joint_names[redundant.joint]
        solving["solver"] = {"method": method, "why": reason, "complete": complete}
        return solving
    try:
        method, reason, complete = armkin.method(arm, task.name)
        solving["solver"] = {"method": method, "why": reason, "complete": complete}
    except UsageError as error:
        solving["ik_refuses"] = str(error)
    return solving


def _resolution(arm: Arm) -> list[float] | None:
    """What one pulse is worth at each joint; None for an arm that is not wholly driven."""
    from armkin.motors import resolution

    try:
        return [float(value) for value in units.joints_out(arm, resolution(arm))]
    except UsageError:
        return None
