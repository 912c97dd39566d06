"""The arm: a validated robot file turned into frozen arrays, one chain for all conventions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.rotation import FLIP, inverse
from armkin.soa import Array

if TYPE_CHECKING:
    from armkin.robot_file import Joint, RobotFile


@dataclass(frozen=True, eq=False, repr=False)
class Arm:
    """An arm as arrays, read-only, lengths in mm and angles in rad.

    The tool's pose is ``link[0] Z1(q1) link[1] ... Zn(qn) link[n]`` with Z = Rz or Tz:
    signs, offsets, base and tool are inside `link`.
    """

    name: str
    joint_names: tuple[str, ...]
    prismatic: NDArray[np.bool_]  # (n,)
    link: Array  # (n + 1, 4, 4)
    frame: Array  # (n, 4, 4): reported frame i = chain up to Zi, times frame[i]
    base: Array  # (4, 4)
    lower: Array  # (n,) -inf where unlimited
    upper: Array  # (n,)
    home: Array  # (n,)
    max_speed: Array  # (n,) rad/s | mm/s, nan where the file has none
    max_accel: Array  # (n,)
    dh_sign: Array  # (n,) DH angle = dh_sign * joint value + dh_theta
    dh_theta: Array  # (n,)
    pitch_offset: float  # [rad]
    task: str | None  # as the file says; None: by structure
    motor_gain: Array  # (motors, n) pulses per rad | mm
    motor_bias: Array  # (motors,) pulses at home
    reach: float  # [mm] no point of the chain is farther from its first joint
    path: str = ""  # of the robot file, as given
    sha256: str = ""  # of the robot file's bytes
    file: RobotFile | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    def __repr__(self) -> str:
        """What tells arms apart, without their arrays."""
        return f"<Arm {self.name}: {', '.join(self.joint_names)}>"


def load(path: str | PathLike[str]) -> Arm:
    """Read and validate a robot file.

    Raises FileError if it cannot be read and RobotFileError if it is not valid.
    """
    from armkin import robot_file

    return build(robot_file.read(path))


def build(file: RobotFile) -> Arm:
    """The arm of a validated robot file."""
    base = transform(file.base.xyz, file.base.rpy)
    tool = transform(file.tool.xyz, file.tool.rpy)
    before, after, frame = [], [], []
    for joint in file.joints:
        if file.convention == "screws":
            pre, post, at = _screw(joint)
        else:
            pre, post, at = _dh(joint, modified=file.convention == "modified")
        flip = FLIP if joint.sign < 0 else np.eye(4)
        before.append(pre @ flip)
        after.append(flip @ post)
        frame.append(flip @ at)
    end = tool if file.zero_pose is None else transform(file.zero_pose.xyz, file.zero_pose.rpy) @ tool
    link = [base @ before[0]]
    link += [after[i] @ before[i + 1] for i in range(len(before) - 1)]
    link.append(after[-1] @ end)

    unit = np.array([1.0 if j.type == "prismatic" else math.pi / 180 for j in file.joints])
    gain, bias = _motors(file, unit)
    return from_links(
        link,
        [j.type == "prismatic" for j in file.joints],
        name=file.name,
        joint_names=tuple(j.name for j in file.joints),
        frame=frame,
        base=base,
        limits=[(-math.inf, math.inf) if j.limits is None else j.limits for j in file.joints] * unit[:, None],
        home=np.array([j.home for j in file.joints]) * unit,
        max_speed=np.array([math.nan if j.max_speed is None else j.max_speed for j in file.joints]) * unit,
        max_accel=np.array([math.nan if j.max_accel is None else j.max_accel for j in file.joints]) * unit,
        dh_sign=[float(j.sign) for j in file.joints],
        dh_theta=[0.0 if j.dh is None else math.radians(j.dh.theta) for j in file.joints],
        pitch_offset=math.radians(file.pitch_offset),
        task=file.task,
        motor_gain=gain,
        motor_bias=bias,
        path=file.path,
        sha256=file.sha256,
        file=file,
    )


def from_links(
    link: ArrayLike,
    prismatic: Sequence[bool],
    *,
    name: str = "arm",
    joint_names: tuple[str, ...] = (),
    frame: ArrayLike | None = None,
    base: ArrayLike | None = None,
    limits: ArrayLike | None = None,
    home: ArrayLike | None = None,
    max_speed: ArrayLike | None = None,
    max_accel: ArrayLike | None = None,
    dh_sign: ArrayLike | None = None,
    dh_theta: ArrayLike | None = None,
    pitch_offset: float = 0.0,
    task: str | None = None,
    motor_gain: ArrayLike | None = None,
    motor_bias: ArrayLike | None = None,
    path: str = "",
    sha256: str = "",
    file: RobotFile | None = None,
) -> Arm:
    """An arm from its chain: link (n + 1, 4, 4) [mm], limits (n, 2) [rad | mm], the rest optional."""
    n = len(prismatic)
    links = _frozen(link)
    span = np.broadcast_to([-math.inf, math.inf], (n, 2)) if limits is None else np.asarray(limits, dtype=float)
    gain = np.zeros((0, n)) if motor_gain is None else motor_gain
    sliding = np.abs(np.where(np.isfinite(span), span, 0.0)).max(axis=1)[np.asarray(prismatic, dtype=bool)]
    return Arm(
        name=name,
        joint_names=joint_names or tuple(f"q{i + 1}" for i in range(n)),
        prismatic=_frozen(prismatic, bool),
        link=links,
        frame=_frozen(np.broadcast_to(np.eye(4), (n, 4, 4)) if frame is None else frame),
        base=_frozen(np.eye(4) if base is None else base),
        lower=_frozen(span[:, 0]),
        upper=_frozen(span[:, 1]),
        home=_frozen(np.zeros(n) if home is None else home),
        max_speed=_frozen(np.full(n, math.nan) if max_speed is None else max_speed),
        max_accel=_frozen(np.full(n, math.nan) if max_accel is None else max_accel),
        dh_sign=_frozen(np.ones(n) if dh_sign is None else dh_sign),
        dh_theta=_frozen(np.zeros(n) if dh_theta is None else dh_theta),
        pitch_offset=pitch_offset,
        task=task,
        motor_gain=_frozen(gain),
        motor_bias=_frozen(np.zeros(len(np.asarray(gain))) if motor_bias is None else motor_bias),
        reach=float(np.linalg.norm(links[1:, :3, 3], axis=1).sum() + sliding.sum()) or 1.0,
        path=path,
        sha256=sha256,
        file=file,
    )


def transform(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """4 x 4 transform from a position [mm] and roll, pitch, yaw [deg]: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = cos_sin_deg(rpy[0])
    cp, sp = cos_sin_deg(rpy[1])
    cy, sy = cos_sin_deg(rpy[2])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def cos_sin_deg(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at multiples of 90."""
    quarter, rest = divmod(angle, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return math.cos(math.radians(angle)), math.sin(math.radians(angle))


def _frozen(values: ArrayLike, dtype: type = float) -> NDArray[Any]:
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def _dh(joint: Joint, *, modified: bool) -> tuple[Array, Array, Array]:
    """Constant factors before and after a joint's motion, and its frame after the motion.

    Standard: A = Rz(theta + q) Tz(d) Tx(a) Rx(alpha). Modified (Craig): the row's a and
    alpha stand before the joint: A = Rx(alpha) Tx(a) Rz(theta + q) Tz(d).
    """
    assert joint.dh is not None
    dh = joint.dh
    ct, st = cos_sin_deg(dh.theta)
    ca, sa = cos_sin_deg(dh.alpha)
    z_part = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, dh.d], [0, 0, 0, 1.0]])
    x_part = np.array([[1, 0, 0, dh.a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1.0]])
    if modified:
        return x_part, z_part, z_part
    return np.eye(4), z_part @ x_part, z_part @ x_part


def _screw(joint: Joint) -> tuple[Array, Array, Array]:
    """exp([S] q) = B Z(q) B^-1 with B's z axis on the screw's axis (Lynch & Park, Modern Robotics, 3.3.2)."""
    assert joint.screw is not None
    w, v = (np.array(part, dtype=float) for part in joint.twist())
    if joint.type == "prismatic":
        direction, point = v, np.zeros(3)
    else:
        direction, point = w, np.cross(w, v) if joint.screw.q is None else np.array(joint.screw.q, dtype=float)
    B = np.eye(4)
    B[:3, 2] = direction
    B[:3, 0] = _perpendicular(direction)
    B[:3, 1] = np.cross(direction, B[:3, 0])
    B[:3, 3] = point
    at = np.eye(4)
    at[:3, 3] = point
    back = inverse(B)
    return B, back, back @ at


def _perpendicular(z: Array) -> Array:
    """A unit vector perpendicular to z, exact for axis-aligned z."""
    across = np.zeros(3)
    across[int(np.argmin(np.abs(z)))] = 1.0
    x = across - (across @ z) * z
    return np.asarray(x / np.linalg.norm(x))


def _motors(file: RobotFile, unit: Array) -> tuple[Array, Array]:
    """Pulses per rad | mm of every motor and joint, and the pulses at home (servos only).

    A stepper's pulses per turn of the joint are full_steps x microsteps x gear x pulley,
    counted from home; a servo's pulse width is linear in its joint over `travel`, and
    `invert` mirrors it (for a stepper it is wiring: the level of DIR, not the count).
    """
    index = {joint.name: i for i, joint in enumerate(file.joints)}
    home = [joint.home for joint in file.joints]
    motors = file.motor_list()
    gain = np.zeros((len(motors), len(file.joints)))
    bias = np.zeros(len(motors))
    for k, motor in enumerate(motors):
        servo = motor.travel if motor.kind == "servo" and motor.pulse_us is not None else None
        turn = -1.0 if servo is not None and motor.invert else 1.0
        for name, weight in motor.joints.items():
            gain[k, index[name]] = turn * weight * motor.pulses_per_unit()
        if servo is not None and motor.pulse_us is not None:
            bias[k] = motor.pulse_us[0] + (motor.zero - servo[0]) * motor.pulses_per_unit() + gain[k] @ home
    return gain / unit, bias
