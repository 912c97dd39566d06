"""The plan of a path: its motion in time and a report on its branches."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array, real_array
from armkin.forward import condition, jacobian
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed, joint_path
from armkin.motion.timing.trajectory import Stretch, Trajectory, group_numbers
from armkin.motion.tool_path.route import ReducedBlends

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

_BLOCK_TIMES = 16_384  # times or grid points evaluated in one call


@dataclass(frozen=True)
class PathRun:
    """A part of the path on one branch."""

    begin: float  # [mm]
    end: float
    names: list[tuple[float, str]]  # length [mm] from which a branch name holds, and the name
    start_joints: Array
    end_joints: Array


@dataclass(frozen=True)
class Reconfiguration:
    """Where a run ends before the path does."""

    s: float  # [mm]
    why: str  # limit, reach, boundary, singularity, hit
    joint: str | None
    index: int | None
    value: float | None  # [rad | mm] the limit
    beyond: str  # status of the inverse kinematics just behind it
    hit: str = ""  # what hits what
    joints: Array | None = None  # (n,) [rad | mm] there


@dataclass(frozen=True)
class Passed:
    """A wrist singularity that the path passes: the tool turns aside a little, or the tip makes a detour."""

    begin: float  # [mm]
    end: float
    turned: float  # [rad] at most
    aside: float  # [mm] at most


@dataclass(frozen=True)
class StartBranch:
    """A branch at the path's start, the length that it carries, and why it ends."""

    name: str
    start_joints: Array
    carries: float  # [mm]
    ends_because: str


@dataclass(frozen=True)
class Marker:
    """Something that happens between two stretches: the gripper (grip), or a rest until Enter (pause)."""

    before: int  # number of the stretch that follows
    kind: str
    value: Any


@dataclass
class PathPlan:
    """What `armkin.path` returns: joint values over time, and how they came about.

    Attributes:
        arm: the arm that moves.
        task: what targets prescribe; None: joint moves alone, on an arm that no task fits.
        tolerance: [mm] between plan and path that was allowed.
        speed: [1] fraction of the joints' max_speed, on joint moves.
        length: [mm] of the tool's way.
        samples: targets along the tool's way of which all branches were asked for.
        complete: every isolated branch of these targets is guaranteed to have been found.
        deviation: [mm] a bound of the distance between plan and path, or the greatest distance of a given point from
            the motion where corners are passed by the tolerance.
        rounded_most: [mm] along the way, where a given point lies farthest from the motion; None: no corner is passed
            so.
        reduced: blends that did not fit.
        passed: wrist singularities that are passed straight through.
        runs: parts of the way, each on one branch.
        branches: those at the path's start, how far each carries and why no farther.
        reconfigurations: where a run ends before the path does.
        nearest_singularity: [mm] where, the Jacobian's condition there, and the joint values (n,) [rad | mm].
        markers: what happens between two stretches: the gripper, a pause.
        trajectory: the motion; None: the path was not planned to its end.
        approach: the joint move from where the arm stands to the start, no part of the motion; None: it stands there.
        clearance: where there are keep-outs, mm (a lower bound), s_mm, body, with.
        held: joints that are held all along, and where [rad | mm].
        on_path: number of a stretch on the tool's way -> it, and the way before it [mm].
    """

    arm: Arm
    task: Task | None
    tolerance: float
    speed: float = 1.0
    length: float = 0.0
    samples: int = 0
    complete: bool = True
    deviation: float = 0.0
    rounded_most: float | None = None
    reduced: ReducedBlends = field(default_factory=ReducedBlends)
    passed: list[Passed] = field(default_factory=list)
    runs: list[PathRun] = field(default_factory=list)
    branches: list[StartBranch] = field(default_factory=list)
    reconfigurations: list[Reconfiguration] = field(default_factory=list)
    nearest_singularity: tuple[float, float, Array] | None = None
    markers: list[Marker] = field(default_factory=list)
    trajectory: Trajectory | None = None
    approach: Trajectory | None = None
    clearance: dict[str, Any] | None = None
    held: dict[str, float] = field(default_factory=dict)
    on_path: dict[int, tuple[Stretch, float]] = field(default_factory=dict)

    @property
    def turned(self) -> float | None:
        """The most by which the tool is turned at a wrist singularity [rad]; None: it never is."""
        return max((singularity.turned for singularity in self.passed if singularity.turned), default=None)

    def note_stretch(self, number: int, stretch: Stretch, base: float) -> None:
        """Note that a stretch is on the tool's way.

        Args:
            number: of the stretch in the motion.
            stretch: the stretch itself.
            base: [mm] the tool's way before it.
        """
        self.on_path[number] = (stretch, base)

    def note_singularity(self, q: Array, s: Array) -> None:
        """Note where joint values behind the present end come nearest to a singularity.

        Args:
            q: (N, n) [rad | mm] joint values along the way.
            s: (N,) [mm] the lengths at which they are.
        """
        for i in range(0, len(q), _BLOCK_TIMES):
            candidates = _worst_conditioned(self.arm, q[i : i + _BLOCK_TIMES])
            conditions = condition(self.arm, q[i + candidates])
            k = int(np.argmax(conditions))
            if self.nearest_singularity is None or conditions[k] > self.nearest_singularity[1]:
                index = i + candidates[k]
                self.nearest_singularity = (self.length + float(s[index]), float(conditions[k]), q[index].copy())

    def set_motion(self, start: Array, stretches: Sequence[Stretch], markers: list[Marker]) -> PathPlan:
        """This plan with its motion from a posture on.

        Args:
            start: (n,) [rad | mm] where the motion begins.
            stretches: the motions between rests, in order.
            markers: what happens between them.

        Returns:
            This plan.
        """
        self.trajectory, self.markers = Trajectory(self.arm, start, tuple(stretches)), markers
        return self

    @property
    def motion(self) -> Trajectory:
        """The joints over time, stretch by stretch."""
        assert self.trajectory is not None, "the path was not planned to its end"
        return self.trajectory

    @property
    def duration(self) -> float:
        """[s] of the whole motion."""
        return self.motion.duration

    def q(self, t: ArrayLike) -> Array:
        """Joint values at times; before and behind the motion those at its ends.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad | mm].
        """
        return self.motion.q(t)

    def qd(self, t: ArrayLike) -> Array:
        """Joint speeds at times.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad/s | mm/s].
        """
        return self.motion.qd(t)

    def qdd(self, t: ArrayLike) -> Array:
        """Joint accelerations at times.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad/s2 | mm/s2].
        """
        return self.motion.qdd(t)

    def s(self, t: ArrayLike) -> Array:
        """Way of the tool along its path at times; before, between and behind its stretches it stays.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (...) [mm].
        """
        times = real_array(t, "t").ravel()
        lengths = np.zeros(len(times))
        numbers = sorted(self.on_path)
        begins = self.motion.begins[numbers]
        last = np.searchsorted(begins, times, side="right") - 1  # the stretch at or before each time
        for i, rows in group_numbers(last):
            if i >= 0:
                stretch, base = self._stretch(numbers[i])
                lengths[rows] = base + stretch.lengths(times[rows] - begins[i])
        return lengths.reshape(np.shape(t))

    def s_range(self, number: int) -> tuple[float, float]:
        """Where a stretch on the tool's way begins and ends.

        Args:
            number: of the stretch, a key of `on_path`.

        Returns:
            Begin and end [mm].

        Raises:
            UsageError: no stretch of that number lies on the tool's way.
        """
        stretch, base = self._stretch(number)
        s = joint_path(stretch).s
        return base + float(s[0]), base + float(s[-1])

    def grid(self, number: int) -> Array:
        """Joint values at the grid points of a stretch on the tool's way.

        Args:
            number: of the stretch, a key of `on_path`.

        Returns:
            (N, n) [rad | mm].

        Raises:
            UsageError: no stretch of that number lies on the tool's way.
        """
        return joint_path(self._stretch(number)[0]).q

    def _stretch(self, number: int) -> tuple[Curve | Smoothed, float]:
        """A stretch on the tool's way, and where it begins on it [mm]."""
        if number not in self.on_path:
            numbers = ", ".join(map(str, sorted(self.on_path))) or "none"
            raise UsageError(f"stretch {number} is not on the tool's way; on it are: {numbers}")
        stretch, base = self.on_path[number]
        assert isinstance(stretch, Curve | Smoothed)
        return stretch, base

    @cached_property
    def limits(self) -> dict[str, Array]:
        """Greatest shares of the joints' limits that the motion takes: speed, accel (and jerk): (n,) each."""
        speed, accel, jerk = np.zeros((3, self.arm.n))
        for stretch in self.motion.stretches:
            if isinstance(stretch, Smoothed):
                t = np.linspace(0.0, stretch.duration, min(max(int(stretch.duration / 0.001), 2), 1_000_000))
            elif isinstance(stretch, Curve):
                t = np.concatenate([stretch.times, stretch.times[1:] * (1 - 1e-12)])
            else:
                t = np.linspace(0.0, stretch.duration, 200)
            for i in range(0, len(t) - 1, _BLOCK_TIMES):  # blocks share a time, since jerk is a difference
                part = t[i : i + _BLOCK_TIMES + 1]
                acceleration = stretch.evaluate(part, 2)
                speed = np.maximum(speed, np.abs(stretch.evaluate(part, 1)).max(axis=0))
                accel = np.maximum(accel, np.abs(acceleration).max(axis=0))
                if isinstance(stretch, Smoothed):
                    jerk = np.maximum(jerk, np.abs(np.diff(acceleration, axis=0)).max(axis=0) / (t[1] - t[0]))
        shares = {"speed": speed / self.arm.max_speed, "accel": accel / self.arm.max_accel}
        if np.isfinite(self.arm.max_jerk).all() and jerk.any():
            shares["jerk"] = jerk / self.arm.max_jerk
        return shares


def copy_plan(plan: PathPlan) -> PathPlan:
    """A copy of an unfinished plan: moves that are added to one of both leave the other as it is."""
    lists: dict[str, Any] = {
        name: copy(value) for name, value in vars(plan).items() if isinstance(value, list | dict | ReducedBlends)
    }
    return replace(plan, **lists)


def _worst_conditioned(arm: Arm, q: Array) -> NDArray[np.intp]:
    """The rows of joint values (N, n) that may have the greatest condition number; for three joints these are few.

    The squares of three singular values are the eigenvalues of J J', in closed form (Smith, Eigenvalues of a symmetric
    3 x 3 matrix, 1961), accurate to half of the digits. Rows near the greatest value, or beyond that
    accuracy, are the candidates for an exact condition number.
    """
    if arm.n != 3:
        return np.arange(len(q))
    J = jacobian(arm, q)[:, :3]
    a, b, c = np.ascontiguousarray(J.transpose(1, 2, 0)) / arm.reach  # rows, (3, N) each
    aa, bb, cc, ab, ac, bc = ((x * y).sum(axis=0) for x, y in ((a, a), (b, b), (c, c), (a, b), (a, c), (b, c)))
    mean = (aa + bb + cc) / 3
    aa, bb, cc = aa - mean, bb - mean, cc - mean
    size = np.sqrt((aa**2 + bb**2 + cc**2 + 2 * (ab**2 + ac**2 + bc**2)) / 6)
    det = aa * (bb * cc - bc**2) - ab * (ab * cc - bc * ac) + ac * (ab * bc - bb * ac)
    angle = np.arccos(np.clip(det / np.maximum(2 * size**3, 1e-300), -1.0, 1.0)) / 3
    share = (mean + 2 * size * np.cos(angle + 2 * np.pi / 3)) / (mean + 2 * size * np.cos(angle))
    return np.flatnonzero(share <= max(float(share.min()) * (1 + 1e-3), 1e-9))
