"""The arm as frozen arrays, with the same chain for all conventions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.robot_file import Board, Gripper, Homing, Motor, RobotFile
    from armkin.robot_file.keep_out_keys import Entry


@dataclass(frozen=True, eq=False, repr=False)
class Arm:
    """An arm as arrays, read-only, lengths in mm and angles in rad.

    The tool's pose is ``link[0] Z1(r1 q1) link[1] ... Zn(rn qn) link[n]`` with Z = Rz or Tz and the `ratio` r, which is
    1 unless the arm is calibrated. Signs, offsets, base and tool are part of `link`.

    Attributes:
        name: of the robot file.
        joint_names: of all n joints, from the base on.
        prismatic: (n,) whether joints are prismatic; the others are revolute.
        link: (n + 1, 4, 4) [mm] constant transforms between the joints' motions.
        frame: (n, 4, 4) [mm] reported frame i = chain up to Zi, times frame[i].
        base: (4, 4) [mm] of the base in the frame of targets.
        lower: (n,) [rad | mm] limits, -inf where unlimited.
        upper: (n,) [rad | mm] limits, inf where unlimited.
        home: (n,) [rad | mm] joint values.
        max_speed: (n,) [rad/s | mm/s] nan where the file has none.
        max_accel: (n,) [rad/s2 | mm/s2] nan where the file has none.
        max_jerk: (n,) [rad/s3 | mm/s3] nan where the file has none.
        dh_sign: (n,) [1] DH angle = dh_sign * joint value + dh_theta.
        dh_theta: (n,) [rad].
        ratio: (n,) [1] actual turn per commanded turn; joint values are commanded ones.
        pitch_offset: [rad] added to the sum of the parallel joints' angles in the tasks with a pitch.
        task: of the robot file; None: chosen by the structure of the arm.
        motor_gain: (motors, n) [pulses/rad | pulses/mm].
        motor_bias: (motors,) [pulses] at home.
        reach: [mm] bound of the distance of the chain's points from its first joint; 1 if all lengths are zero.
        pose_names: of the robot file's poses, besides home.
        pose_joints: (poses, n) [rad | mm].
        held: names of joints that `armkin.lock` has folded into the links.
        motors: in the order of the pulses; () for an arm without a robot file.
        homing: of every joint, None without homing.
        hard_limits: of every joint, whether its switch stops motions into it.
        body_radius: (n + 1,) [mm] of the base and of each joint's body, nan where the file has none.
        keep_out: of the robot file, then of the scene.
        clearance: [mm] distance to keep from keep-outs.
        ignores_keep_out: whether motions are not checked against keep-outs, at the operator's request.
        scene: the scene's file, as given.
        scene_sha256: of its bytes.
        tool: x, y, z, roll, pitch, yaw [mm, deg] in place of the file's.
        of_scene: number of keep-outs, the last ones, that come from the scene.
        whole: the arguments of `armkin.lock` for an arm with keep-outs.
        gripper: of the robot file.
        board: of the robot file.
        path: of the robot file, as given.
        sha256: of the robot file's bytes.
        description: of the robot file.
        source: origin of the numbers.
        file: the robot file, for printing it; the fields above are sufficient for all computations.
    """

    name: str
    joint_names: tuple[str, ...]
    prismatic: NDArray[np.bool_]
    link: Array
    frame: Array
    base: Array
    lower: Array
    upper: Array
    home: Array
    max_speed: Array
    max_accel: Array
    max_jerk: Array
    dh_sign: Array
    dh_theta: Array
    ratio: Array
    pitch_offset: float
    task: str | None
    motor_gain: Array
    motor_bias: Array
    reach: float
    pose_names: tuple[str, ...]
    pose_joints: Array
    held: tuple[str, ...] = ()
    motors: tuple[Motor, ...] = ()
    homing: tuple[Homing | None, ...] = ()
    hard_limits: tuple[bool, ...] = ()
    body_radius: Array | None = None
    keep_out: tuple[Entry, ...] = ()
    clearance: float = 0.0
    ignores_keep_out: bool = False
    scene: str = ""
    scene_sha256: str = ""
    tool: tuple[float, ...] | None = None
    of_scene: int = 0
    whole: tuple[Arm, Mapping[str, float]] | None = None
    gripper: Gripper | None = None
    board: Board | None = None
    path: str = ""
    sha256: str = ""
    description: str = ""
    source: str = ""
    file: RobotFile | None = None

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make a copied or unpickled arm read-only as well, because caches hold code for its values."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.__dict__.update(state)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    @property
    def poses(self) -> dict[str, Array]:
        """Named joint values (n,) [rad | mm]: `home`, and those of the robot file."""
        return {"home": self.home, **dict(zip(self.pose_names, self.pose_joints, strict=True))}

    def __repr__(self) -> str:
        """The name and the joints."""
        return f"<Arm {self.name}: {', '.join(self.joint_names)}>"


@lru_cache(maxsize=256)
def actual_arm(arm: Arm) -> Arm:
    """The arm in actual joint values, with ratios of 1, and limits, home and speeds of the actual motion.

    An arm whose ratios are all 1 is returned as it is.
    """
    ratio = arm.ratio
    if (ratio == 1.0).all():
        return arm
    return replace(
        arm,
        lower=freeze(arm.lower * ratio),
        upper=freeze(arm.upper * ratio),
        home=freeze(arm.home * ratio),
        pose_joints=freeze(arm.pose_joints * ratio),
        max_speed=freeze(arm.max_speed * ratio),
        max_accel=freeze(arm.max_accel * ratio),
        max_jerk=freeze(arm.max_jerk * ratio),
        ratio=freeze(np.ones(arm.n)),
        motor_gain=freeze(arm.motor_gain / ratio),
    )


def from_links(
    link: ArrayLike,
    prismatic: Sequence[bool] | NDArray[np.bool_],
    *,
    name: str = "arm",
    limits: ArrayLike | None = None,
    max_speed: ArrayLike | None = None,
    max_accel: ArrayLike | None = None,
    ratio: ArrayLike | None = None,
    task: str | None = None,
    motor_gain: ArrayLike | None = None,
) -> Arm:
    """An arm made from its chain: link (n + 1, 4, 4) [mm], limits (n, 2) [rad | mm], the others as in `Arm`.

    All other fields are those of an arm without a robot file: joints q1, q2, ..., 0 at home, no poses, no board.
    """
    n = len(prismatic)
    links = freeze(link)
    slides = freeze(prismatic, bool)
    span = np.broadcast_to([-math.inf, math.inf], (n, 2)) if limits is None else np.asarray(limits, dtype=float)
    gain = _as_array(motor_gain, np.zeros((0, n)))
    return Arm(
        name=name,
        joint_names=tuple(f"q{i + 1}" for i in range(n)),
        prismatic=slides,
        link=links,
        frame=freeze(np.broadcast_to(np.eye(4), (n, 4, 4))),
        base=freeze(np.eye(4)),
        lower=freeze(span[:, 0]),
        upper=freeze(span[:, 1]),
        home=freeze(np.zeros(n)),
        max_speed=_as_array(max_speed, np.full(n, math.nan)),
        max_accel=_as_array(max_accel, np.full(n, math.nan)),
        max_jerk=freeze(np.full(n, math.nan)),
        dh_sign=freeze(np.ones(n)),
        dh_theta=freeze(np.zeros(n)),
        ratio=_as_array(ratio, np.ones(n)),
        pitch_offset=0.0,
        task=task,
        motor_gain=gain,
        motor_bias=freeze(np.zeros(len(gain))),
        reach=_reach(links, span[slides]) or 1.0,
        pose_names=(),
        pose_joints=freeze(np.zeros((0, n))),
        homing=(None,) * n,
        hard_limits=(False,) * n,
    )


def _reach(link: Array, travel: Array) -> float:
    """Sum [mm] of the lengths of the links (n + 1, 4, 4) after the first joint and of the slides' travel (k, 2).

    An infinite limit adds nothing.
    """
    link_lengths = np.linalg.norm(link[1:, :3, 3], axis=1)
    slide_lengths = np.abs(np.where(np.isfinite(travel), travel, 0.0)).max(axis=1)
    return float(link_lengths.sum() + slide_lengths.sum())


def _as_array(values: ArrayLike | None, default: Array) -> Array:
    return freeze(default if values is None else values)


def freeze(values: ArrayLike, dtype: type = float) -> NDArray[Any]:
    """A read-only copy, as caches hold code for the values of an arm."""
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array
