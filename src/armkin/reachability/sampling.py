"""Joint values that cover an arm's range: random or a grid, chunk by chunk and repeatable."""

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
MAX_SAMPLES = 10**10  # samples of a survey, at most: about an hour on a desktop computer


def sampled_range(arm: Arm) -> tuple[Array, Array]:
    """Lower and upper end of what is sampled: (n,) twice [rad | mm].

    The limits; for an unlimited revolute joint one turn, -180 to 180 degrees. An unlimited
    prismatic joint has no finite range and is an error.
    """
    endless = [
        name
        for name, slides, low, high in zip(arm.joint_names, arm.prismatic, arm.lower, arm.upper, strict=True)
        if slides and not (math.isfinite(low) and math.isfinite(high))
    ]
    if endless:
        raise UsageError(f"prismatic joint {endless[0]} of {arm.name} has no limits; give it limits: [mm, mm]")
    low = np.where(np.isfinite(arm.lower), arm.lower, -math.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, math.pi)
    return low, high


@dataclass(frozen=True)
class Random:
    """`count` poses, every joint uniform and independent over its range."""

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
        """How many chunks there are."""
        return -(-self.count // CHUNK)

    def part(self, number: int) -> Array:
        """The poses of a chunk, (up to CHUNK, n) [rad | mm], the same ones at every call and wherever it runs."""
        start = number * CHUNK
        bits = np.random.PCG64(self.seed)
        bits.advance(start * self.arm.n)  # a number takes one step of the generator
        low, high = sampled_range(self.arm)
        shape = (min(CHUNK, self.count - start), self.arm.n)
        return np.asarray(low + (high - low) * np.random.Generator(bits).random(shape))


@dataclass(frozen=True)
class JointGrid:
    """Every combination of evenly spaced joint values, the last joint changing fastest.

    Both limits are on the grid. An unlimited joint's turn is half open: -180 is on it, 180 is not.
    A single point stands in the middle of the range.
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
        """Number of poses."""
        return math.prod(self.points)

    @property
    def parts(self) -> int:
        """How many chunks there are."""
        return -(-self.count // CHUNK)

    def part(self, number: int) -> Array:
        """The poses of a chunk, (up to CHUNK, n) [rad | mm]."""
        low, high = sampled_range(self.arm)
        step = np.zeros(self.arm.n)
        first = low.copy()
        for i, k in enumerate(self.points):
            turn = not (np.isfinite(self.arm.lower[i]) and np.isfinite(self.arm.upper[i]))
            if k == 1:
                first[i] = 0.5 * (low[i] + high[i])
            else:
                step[i] = (high[i] - low[i]) / (k if turn else k - 1)
        flat = np.arange(number * CHUNK, min((number + 1) * CHUNK, self.count))
        index = np.stack(np.unravel_index(flat, self.points), axis=-1)
        return np.asarray(np.minimum(first + step * index, high))


Sampling = Random | JointGrid


def joint_grid(arm: Arm, points: Sequence[int]) -> JointGrid:
    """A grid of so many points a joint; a single number counts for every joint."""
    return JointGrid(arm, tuple(points) * arm.n if len(points) == 1 else tuple(points))
