"""Joint values that cover the range of an arm, random or on a grid, in repeatable chunks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.model.arm import Arm

CHUNK = 1 << 16  # samples in memory at once
MAX_SAMPLES = 10**10  # most samples of a survey, about an hour on a desktop computer


def sampled_range(arm: Arm) -> tuple[Array, Array]:
    """Lower and upper end of the sampled range: (n,) twice [rad | mm].

    The ends are the limits, or -180 and 180 degrees for an unlimited revolute joint. An unlimited prismatic joint
    has no finite range and is an error.
    """
    unlimited = np.flatnonzero(arm.prismatic & ~(np.isfinite(arm.lower) & np.isfinite(arm.upper)))
    if len(unlimited):
        name = arm.joint_names[unlimited[0]]
        raise UsageError(f"prismatic joint {name} of {arm.name} has no limits; give it limits: [mm, mm]")
    low = np.where(np.isfinite(arm.lower), arm.lower, -math.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, math.pi)
    return low, high


@dataclass(frozen=True)
class Random:
    """`count` random postures, with each joint uniform and independent over its range."""

    arm: Arm
    count: int
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (("samples", self.count), ("seed", self.seed)):
            if isinstance(value, bool) or not isinstance(value, int | np.integer):
                raise UsageError(f"{name}: {value!r} is no whole number")
        if not 1 <= self.count <= MAX_SAMPLES:
            raise UsageError(f"{self.count} samples: give 1 to {MAX_SAMPLES:,}")
        if self.seed < 0:
            raise UsageError(f"seed {self.seed}: give 0 or more")
        sampled_range(self.arm)

    @property
    def parts(self) -> int:
        """Number of chunks."""
        return -(-self.count // CHUNK)

    def part(self, number: int) -> Array:
        """The postures of a chunk, (up to CHUNK, n) [rad | mm], the same at every call and on every engine."""
        start = number * CHUNK
        bits = np.random.PCG64(self.seed)
        bits.advance(start * self.arm.n)  # each random number takes one step of the generator
        low, high = sampled_range(self.arm)
        shape = (min(CHUNK, self.count - start), self.arm.n)
        return np.asarray(low + (high - low) * np.random.Generator(bits).random(shape))


@dataclass(frozen=True)
class JointGrid:
    """Every combination of evenly spaced joint values, the last joint changing fastest.

    Both limits are on the grid. For an unlimited joint, -180 degrees is on the grid and 180 degrees is not. A single
    point is in the middle of the range.
    """

    arm: Arm
    points: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.points) != self.arm.n:
            raise UsageError(
                f"{self.arm.name} has {self.arm.n} joints ({', '.join(self.arm.joint_names)}): "
                f"a grid needs {self.arm.n} numbers of points, or one for all; got {len(self.points)}"
            )
        if min(self.points) < 1:
            raise UsageError(f"a grid needs at least 1 point on every joint, not {min(self.points)}")
        if self.count > MAX_SAMPLES:
            raise UsageError(f"the grid has {self.count:,} points; {MAX_SAMPLES:,} at most")
        sampled_range(self.arm)

    @property
    def count(self) -> int:
        """Number of postures."""
        return math.prod(self.points)

    @property
    def parts(self) -> int:
        """Number of chunks."""
        return -(-self.count // CHUNK)

    def part(self, number: int) -> Array:
        """The postures of a chunk, (up to CHUNK, n) [rad | mm]."""
        low, high = sampled_range(self.arm)
        step = np.zeros(self.arm.n)
        first = low.copy()
        for joint, points in enumerate(self.points):
            is_unlimited = not (np.isfinite(self.arm.lower[joint]) and np.isfinite(self.arm.upper[joint]))
            if points == 1:
                first[joint] = 0.5 * (low[joint] + high[joint])
            else:
                step[joint] = (high[joint] - low[joint]) / (points if is_unlimited else points - 1)
        positions = np.arange(number * CHUNK, min((number + 1) * CHUNK, self.count))
        index = np.stack(np.unravel_index(positions, self.points), axis=-1)
        return np.asarray(np.minimum(first + step * index, high))


Sampling = Random | JointGrid


def joint_grid(arm: Arm, points: Sequence[int]) -> JointGrid:
    """A grid with a number of points for each joint; a single number counts for every joint."""
    return JointGrid(arm, tuple(points) * arm.n if len(points) == 1 else tuple(points))
