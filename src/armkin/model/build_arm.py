"""Builds an arm from a validated robot file; DH tables and screws become a chain of constant links."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.arm import Arm, freeze, from_links
from armkin.model.rotation import FLIP, cos_sin_deg, inverse, transform

if TYPE_CHECKING:
    from armkin.robot_file import Joint, RobotFile
    from armkin.robot_file.robot_keys import Motor
    from armkin.robot_file.scene_file import Scene


def load_arm(path: str | PathLike[str]) -> Arm:
    """Read and validate a robot file, given its path or the name of a shipped robot; a path to a file wins.

    Raises FileError if it cannot be read and RobotFileError if it is not valid.
    """
    from armkin import robot_file

    return arm_of_file(robot_file.read_robot_file(path))


def arm_of_file(file: RobotFile, scene: Scene | None = None, tool: Sequence[float] | None = None) -> Arm:
    """The arm of a validated robot file, with the keep-outs of a scene after its own.

    tool: x, y, z, roll, pitch, yaw [mm, deg] after the last joint, in place of the file's.
    """
    if tool is not None:
        file = file.with_tool(tool)
    base = transform(file.base.xyz, file.base.rpy)
    link, frame = _chain(file, base)
    unit = np.array([1.0 if j.type == "prismatic" else math.pi / 180 for j in file.joints])
    limits = [(-math.inf, math.inf) if j.limits is None else j.limits for j in file.joints] * unit[:, None]
    gain, bias = _motor_gain_and_bias(file, unit)
    chain = from_links(
        link,
        [j.type == "prismatic" for j in file.joints],
        name=file.name,
        limits=limits,
        ratio=[j.ratio for j in file.joints],
        task=file.task,
        motor_gain=gain,
    )
    poses = np.array(list((file.poses or {}).values()), dtype=float).reshape(-1, chain.n)
    return replace(
        chain,
        **_joint_fields(file.joints, unit),
        frame=freeze(frame),
        base=freeze(base),
        pitch_offset=math.radians(file.pitch_offset),
        motor_bias=freeze(bias),
        pose_names=tuple(file.poses or ()),
        pose_joints=freeze(poses * unit),
        motors=file.motor_list(),
        **_keep_outs(file, scene),
        tool=None if tool is None else tuple(map(float, tool)),
        gripper=file.gripper,
        board=file.board,
        path=file.path,
        sha256=file.sha256,
        description=file.description,
        source=file.source,
        file=file,
    )


def _joint_fields(joints: Sequence[Joint], unit: Array) -> dict[str, Any]:
    """The other fields with an entry for each joint; unit: (n,) [rad | mm] of a degree or mm in the file."""
    return {
        "joint_names": tuple(j.name for j in joints),
        "home": freeze(np.array([j.home for j in joints]) * unit),
        "max_speed": freeze(_numbers_or_nan(j.max_speed for j in joints) * unit),
        "max_accel": freeze(_numbers_or_nan(j.max_accel for j in joints) * unit),
        "max_jerk": freeze(_numbers_or_nan(j.max_jerk for j in joints) * unit),
        "dh_sign": freeze([float(j.sign) for j in joints]),
        "dh_theta": freeze([0.0 if j.dh is None else math.radians(j.dh.theta) for j in joints]),
        "homing": tuple(j.homing for j in joints),
        "hard_limits": tuple(j.homing is not None and j.hard_limits is not False for j in joints),
    }


def _chain(file: RobotFile, base: Array) -> tuple[list[Array], list[Array]]:
    """The constant links before, between and after the joints, and each joint's frame after its motion."""
    tool = transform(file.tool.xyz, file.tool.rpy)
    if file.zero_pose is not None:
        tool = transform(file.zero_pose.xyz, file.zero_pose.rpy) @ tool
    joints = [_joint_factors(joint, file.convention) for joint in file.joints]
    inner_links = [joint.after @ following.before for joint, following in pairwise(joints)]
    links = [base @ joints[0].before, *inner_links, joints[-1].after @ tool]
    return links, [joint.frame for joint in joints]


class _JointFactors(NamedTuple):
    """Constant transforms (4, 4) [mm] of a joint, whose whole transform is ``before Z(q) after``."""

    before: Array
    after: Array
    frame: Array  # from the joint's motion to its frame by the convention


def _joint_factors(joint: Joint, convention: str) -> _JointFactors:
    """The factors of a joint by its screw or DH row; sign -1 reverses its axis."""
    modified = convention == "modified"
    factors = _screw_factors(joint) if convention == "screws" else _dh_factors(joint, modified=modified)
    flip = FLIP if joint.sign < 0 else np.eye(4)
    return _JointFactors(factors.before @ flip, flip @ factors.after, flip @ factors.frame)


def _numbers_or_nan(values: Iterable[float | None]) -> Array:
    """An array of numbers, nan for those that the file omits."""
    return np.array([math.nan if value is None else value for value in values])


def _keep_outs(file: RobotFile, scene: Scene | None) -> dict[str, Any]:
    """The arm's fields about keep-outs; empty without keep-outs."""
    if not file.keep_out and scene is None:
        return {}
    radii = _numbers_or_nan(body.radius if body else None for body in (file.base.body, *(j.body for j in file.joints)))
    fields: dict[str, Any] = {"body_radius": radii, "keep_out": file.keep_out, "clearance": file.clearance}
    if scene is not None:
        fields["keep_out"] = (*file.keep_out, *scene.keep_out)
        fields["clearance"] = max(file.clearance, scene.clearance)
        fields |= {"scene": scene.path, "scene_sha256": scene.sha256, "of_scene": len(scene.keep_out)}
    return fields


def _dh_factors(joint: Joint, *, modified: bool) -> _JointFactors:
    """The factors of a row of a Denavit-Hartenberg table.

    Standard: A = Rz(theta + q) Tz(d) Tx(a) Rx(alpha). Modified (Craig), with a and alpha
    before the joint: A = Rx(alpha) Tx(a) Rz(theta + q) Tz(d).
    """
    assert joint.dh is not None
    dh = joint.dh
    ct, st = cos_sin_deg(dh.theta)
    ca, sa = cos_sin_deg(dh.alpha)
    z_part = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, dh.d], [0, 0, 0, 1.0]])
    x_part = np.array([[1, 0, 0, dh.a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1.0]])
    if modified:
        return _JointFactors(before=x_part, after=z_part, frame=z_part)
    A = z_part @ x_part
    return _JointFactors(before=np.eye(4), after=A, frame=A)


def _screw_factors(joint: Joint) -> _JointFactors:
    """The factors of exp([S] q) = B Z(q) B^-1, B's z axis on the screw axis (Lynch & Park, Modern Robotics, 3.3.2)."""
    assert joint.screw is not None
    axis, moment = (np.array(part, dtype=float) for part in joint.twist())
    if joint.type == "prismatic":
        direction, point = moment, np.zeros(3)
    else:
        direction = axis
        point = np.cross(axis, moment) if joint.screw.q is None else np.array(joint.screw.q, dtype=float)
    B = np.eye(4)
    B[:3, 2] = direction
    B[:3, 0] = _perpendicular(direction)
    B[:3, 1] = np.cross(direction, B[:3, 0])
    B[:3, 3] = point
    frame_after = np.eye(4)
    frame_after[:3, 3] = point
    B_inverse = inverse(B)
    return _JointFactors(before=B, after=B_inverse, frame=B_inverse @ frame_after)


def _perpendicular(z: Array) -> Array:
    """A unit vector perpendicular to z, exact for axis-aligned z."""
    unit_vector = np.zeros(3)
    unit_vector[int(np.argmin(np.abs(z)))] = 1.0
    x = unit_vector - (unit_vector @ z) * z
    return np.asarray(x / np.linalg.norm(x))


def _motor_gain_and_bias(file: RobotFile, unit: Array) -> tuple[Array, Array]:
    """Pulses per rad | mm of every motor and joint, and the pulses at home (servos only).

    A stepper's pulses for a turn of the joint are full_steps x microsteps x gear x pulley,
    counted from home. The pulse width of a servo is linear in its joint over `travel`, and
    the count of a bus servo is linear in its joint from `zero`. For servos `invert` mirrors
    the pulses; for steppers it inverts only the level of DIR.
    """
    index = {joint.name: i for i, joint in enumerate(file.joints)}
    home = [joint.home for joint in file.joints]
    motors = file.motor_list()
    gain = np.zeros((len(motors), len(file.joints)))
    bias = np.zeros(len(motors))
    for number, motor in enumerate(motors):
        direction = -1.0 if motor.kind != "stepper" and motor.invert else 1.0
        for name, weight in motor.joints.items():
            gain[number, index[name]] = direction * weight * motor.pulses_per_unit()
        if (pulses_at_zero := _pulses_at_zero(motor)) is not None:
            bias[number] = pulses_at_zero + gain[number] @ home
    return gain / unit, bias


def _pulses_at_zero(motor: Motor) -> float | None:
    """Pulse width [us] or count of a servo with its joint at 0; None for steppers, which count from home."""
    if motor.kind == "bus":
        return motor.zero
    if motor.kind == "servo" and motor.pulse_us is not None and motor.travel is not None:
        return motor.pulse_us[0] + (motor.zero - motor.travel[0]) * motor.pulses_per_unit()
    return None
