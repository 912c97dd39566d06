"""A trajectory: joint values over time, made of stretches from rest to rest.

Its units are those of the joints and seconds. `armkin.board` converts it to counts and clock cycles of a board.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array, real_array
from armkin.forward import frames
from armkin.motion.timing.profile import Profile

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MAX_SECONDS = 86_400  # longest trajectory [s]: a day
BRAKE_SHARE = 0.625  # share of the motors' accelerations that a board uses to stop on a curve


class Stretch(Protocol):
    """Joint values over time from rest to rest."""

    @property
    def duration(self) -> float:
        """Seconds."""

    @property
    def start(self) -> Array:
        """Joint values at the beginning: (n,) [rad | mm]."""

    @property
    def end(self) -> Array:
        """Joint values at the end: (n,)."""

    @property
    def top_speed(self) -> Array:
        """Greatest speed of every joint: (n,) [rad/s | mm/s]."""

    def evaluate(self, t: Array, derivative: int = 0) -> Array:
        """Joint values, or their first or second derivative, at times t [s] since its beginning: (T,) -> (T, n)."""


@dataclass(frozen=True)
class Straight:
    """A straight line in joint space: all joints follow one law."""

    start: Array  # (n,) [rad | mm]
    end: Array  # (n,)
    law: Profile  # law of the line's parameter, 0 to 1

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.law.duration

    @property
    def top_speed(self) -> Array:
        """Greatest speed of every joint: (n,) [rad/s | mm/s]."""
        return np.asarray(np.abs(self.end - self.start) * self.law.peak)

    def evaluate(self, t: Array, derivative: int = 0) -> Array:
        """Joint values, or their first or second derivative, at times t [s] since its beginning: (T,) -> (T, n)."""
        change = self.law.evaluate(t, derivative)[:, None] * (self.end - self.start)
        return np.asarray(self.start + change if derivative == 0 else change)


def brake_share(stretch: Stretch) -> float:
    """The share of the motors' accelerations that a board uses to stop on a stretch: 1 on a straight line."""
    return 1.0 if isinstance(stretch, Straight) else BRAKE_SHARE


@dataclass(frozen=True)
class Trace:
    """A trajectory sampled in time."""

    time: Array  # (T,) [s]
    joints: Array  # (T, n) [rad | mm]
    position: Array  # (T, n + 2, 3) [mm] base, every joint's frame, tool


@dataclass(frozen=True)
class Trajectory:
    """Stretches one after another; the arm is at rest between them.

    Attributes:
        arm: the arm that moves.
        start: (n,) [rad | mm] joint values at the beginning.
        stretches: the motions between two rests, in order.
    """

    arm: Arm
    start: Array
    stretches: tuple[Stretch, ...]

    def __post_init__(self) -> None:
        if not self.duration <= MAX_SECONDS:
            raise UsageError(
                f"the motion takes {self.duration:.6g} s; one plan lasts a day ({MAX_SECONDS} s) at most: "
                "go faster, or in parts"
            )

    @property
    def end(self) -> Array:
        """(n,) [rad | mm] joint values at the end."""
        return self.stretches[-1].end if self.stretches else self.start

    @cached_property
    def begins(self) -> Array:
        """(stretches + 1,) [s] when every stretch begins, and the end."""
        return np.concatenate([[0.0], np.cumsum([stretch.duration for stretch in self.stretches])])

    @property
    def duration(self) -> float:
        """[s] of the whole motion."""
        return float(self.begins[-1])

    @property
    def top_speed(self) -> Array:
        """(n,) [rad/s | mm/s] greatest speed of every joint."""
        return np.max([s.top_speed for s in self.stretches], axis=0) if self.stretches else np.zeros(self.arm.n)

    def q(self, t: ArrayLike) -> Array:
        """Joint values at times; before and behind the motion those at its ends.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad | mm].

        >>> import armkin, numpy as np
        >>> from armkin.motion.joint_moves import plan_joint_moves
        >>> arm = armkin.load("robots/three_dof.yaml")
        >>> p = plan_joint_moves(arm, np.deg2rad([0, 90, -90]), np.deg2rad([60, 90, -90]))
        >>> p.duration, np.rad2deg(p.q([0, 0.75, 1.5]))[:, 0].round(6).tolist()
        (1.5, [0.0, 30.0, 60.0])
        """
        return self._evaluate(t, 0)

    def qd(self, t: ArrayLike) -> Array:
        """Joint speeds at times.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad/s | mm/s].
        """
        return self._evaluate(t, 1)

    def qdd(self, t: ArrayLike) -> Array:
        """Joint accelerations at times.

        Args:
            t: (...) [s] times since the motion began.

        Returns:
            (..., n) [rad/s2 | mm/s2].
        """
        return self._evaluate(t, 2)

    def trace(self, step: float = 0.01) -> Trace:
        """The path in time, evenly sampled, with the end of every stretch.

        Args:
            step: [s] between samples.

        Returns:
            A `Trace`: `time` (T,) [s], `joints` (T, n) [rad | mm], `position` (T, n + 2, 3) [mm] of base, joints and
            tool.
        """
        times, joints = [np.zeros(1)], [self.start[None]]
        for stretch, began in zip(self.stretches, self.begins, strict=False):
            t = np.append(np.arange(step, stretch.duration - step / 4, step), stretch.duration)
            times.append(began + t)
            joints.append(stretch.evaluate(t))
        q = np.concatenate(joints)
        return Trace(np.concatenate(times), q, frames(self.arm, q)[..., :3, 3])

    def _evaluate(self, t: ArrayLike, derivative: int) -> Array:
        times = np.clip(real_array(t, "t"), 0.0, self.duration)
        flat_times = times.ravel()
        values = np.tile(self.start if derivative == 0 else np.zeros(self.arm.n), (len(flat_times), 1))
        numbers = np.searchsorted(self.begins, flat_times, side="right") - 1
        numbers = np.clip(numbers, 0, max(len(self.stretches) - 1, 0))
        for number, rows in group_numbers(numbers) if self.stretches else ():
            values[rows] = self.stretches[number].evaluate(flat_times[rows] - self.begins[number], derivative)
        return values.reshape(*times.shape, self.arm.n)


def group_numbers(numbers: NDArray[np.intp]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """The distinct numbers of an array (N,), each with its indices, in time linear in N."""
    order = np.argsort(numbers, kind="stable")
    edges = [0, *(np.flatnonzero(np.diff(numbers[order])) + 1).tolist(), len(numbers)]
    for a, b in pairwise(edges):
        if b > a:
            yield int(numbers[order[a]]), order[a:b]
