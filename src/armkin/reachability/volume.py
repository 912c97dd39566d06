"""Volume or area of the positions that the tool's tip can reach, with an error.

The motion of the first joint is exact: it sweeps the tip along a circle about its axis, or along a line.
The other joints fill a section through the axis of the first joint, with coordinates (r^2/2, z) for a
revolute joint. The section is divided into cells of equal area, so that a cell represents the volume

    cell area x length swept at the cell,

where the length is an angle for a revolute joint (Pappus), or in mm for a prismatic one. Every cell
stores the interval of the starts of its tips along the sweep, one interval for each stretch as long as
the sweep. The union of the swept stretches is then exact, also where the arm reaches the same place
from the front and over the shoulder.

Random sampling finds the cells, with a share of the joints exactly at their limits, followed by growth
from the cells that were found last (Gaussian growth: Peidro, Reinoso, Gil, Marin, Paya,
An improved Monte Carlo method based on Gaussian growth to calculate the workspace of robots,
Engineering Applications of Artificial Intelligence 64, 2017).

A cell on the border is reached in part. Counting all such cells gives an upper bound, counting none a
lower bound, and the result is their mean, as a border may be anywhere in its cells. The error is half
the difference of the bounds, plus the change of the result if the cells are merged to twice their size,
which shows how much the samples have missed. The result comes from the cell size with the least error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.forward import jacobian, position
from armkin.reachability.sampling import sampled_range

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_SIDE = 512  # cells along each side of the section of an arm in space
_LINE = 1 << 14  # cells of a planar arm's section, which is a line
_STRETCHES = 64  # most stretches along the sweep
_UNIFORM, _GROWN = 24, 24  # chunks of random samples, and of variations of them
_CHUNK = 1 << 16  # samples of a chunk
_MIN_CHUNK = 1 << 11  # fewest samples of a chunk
_ALL = 5_000  # samples of a survey from which on its volume gets the full number of postures
_POOL = 1 << 14  # most postures that are varied
_OVERSHOOT = 0.04  # share of the range by which samples exceed a limit before they are clipped to it
_MARGIN = 0.02  # margin around the first samples, as a share of the size of the section


@dataclass(frozen=True)
class Extent:
    """A volume or an area, and its error."""

    dimensions: int  # 3: volume [mm3]; 2: area [mm2]
    value: float
    error: float
    method: str


def extent(arm: Arm, seed: int = 0, samples: int = _ALL) -> Extent:
    """Volume [mm3] of an arm's reach, or area [mm2] if it moves in a plane.

    An arm whose tip has fewer freedoms than the space it moves in (two joints in space sweep a
    surface) has the volume 0. samples: of the survey that asks; for fewer than 5,000 the volume, too, is
    found from proportionally fewer poses, and its error says so.
    """
    normal, freedoms = tip_freedoms(arm)
    dimensions = 3 if normal is None else 2
    if freedoms < dimensions:
        freedom = {0: "does not move", 1: "stays on a curve", 2: "stays on a surface"}[freedoms]
        return Extent(dimensions, 0.0, 0.0, f"exact: the tip {freedom}")
    section = _Section(arm, normal)
    rng = np.random.default_rng(seed)
    look = _Cells(section, *section.outer_corners(), 64)
    chunk = max(_MIN_CHUNK, min(_CHUNK, _CHUNK * samples // _ALL))
    _fill_cells(look, rng, 2, 2, chunk)
    margin = _MARGIN * (look.highest - look.lowest)
    low, high = look.lowest - margin, look.highest + margin
    if section.revolute:
        low[0] = max(low[0], 0.0)
    side = min(_SIDE, math.isqrt(4 * _SIDE**2 * chunk // _CHUNK))  # most cells finer than that stay empty
    cells = _Cells(section, low, high, _LINE if dimensions == 2 else side)
    _fill_cells(cells, rng, _UNIFORM, _GROWN, chunk)
    level = _least_error_level(cells)
    shape = " x ".join(str(k) for k in level.cells.shape)
    sweep = "a full turn" if section.closed else "its range"
    method = (
        f"{shape} cells of equal area in a section, swept exactly by {arm.joint_names[0]} over {sweep}; "
        "border cells count half; the error is that half and the change with cells of twice the size"
    )
    return Extent(dimensions, level.value, level.error, method)


class _Level(NamedTuple):
    """What cells of one size say of the volume or area, and by how much they may be off."""

    cells: _Cells
    value: float
    error: float


def _least_error_level(cells: _Cells) -> _Level:
    """The best of these cells and those of twice, four times, ... the size."""
    levels = [cells]
    while (merged := levels[-1].merge_cells()) is not None:
        levels.append(merged)
    brackets = np.array([level.bracket() for level in levels])
    middles = brackets.mean(axis=1)
    errors = 0.5 * np.diff(brackets, axis=1)[:-1, 0] + np.abs(np.diff(middles))
    best_index = int(np.argmin(errors))
    return _Level(levels[best_index], float(middles[best_index]), float(errors[best_index]))


def tip_freedoms(arm: Arm) -> tuple[Array | None, int]:
    """The normal of the plane in which the tip moves (None: space), and the freedoms of the tip."""
    low, high = sampled_range(arm)
    q = low + (high - low) * np.random.default_rng(1).random((64, arm.n))
    J = jacobian(arm, q)[:, :3] * (high - low)  # [mm] over a joint's whole range
    tolerance = 1e-9 * arm.reach
    freedoms = int((np.linalg.svd(J, compute_uv=False) > tolerance).sum(axis=-1).max())
    directions, sizes, _ = np.linalg.svd(np.moveaxis(J, 1, 0).reshape(3, -1), full_matrices=False)
    planar = sizes[2] <= tolerance * math.sqrt(J.size) if len(sizes) == 3 else True
    return (directions[:, 2] if planar else None), freedoms


class _Section:
    """Coordinates of tips with the first joint at 0: the place in the section, and the place along the sweep."""

    def __init__(self, arm: Arm, normal: Array | None) -> None:
        self.arm = arm
        self.revolute = not arm.prismatic[0]
        self.low, self.high = sampled_range(arm)
        self.sweep = float(self.high[0] - self.low[0])  # [rad | mm]
        self.closed = self.revolute and self.sweep >= 2 * math.pi * (1 - 1e-12)
        to_axis = np.linalg.inv(arm.link[0])
        self._R, self._p = to_axis[:3, :3], to_axis[:3, 3]
        # the section of a planar arm is a line: the radius, or the direction normal to a first prismatic joint
        self.flat = normal is not None
        across = np.array([1.0, 0.0, 0.0])
        if normal is not None and not self.revolute:
            across = np.cross(self._R @ normal, [0.0, 0.0, 1.0])
        self._across = across

    def outer_corners(self) -> tuple[Array, Array]:
        """Corners of a section that contains all tips."""
        reach = self.arm.reach * (1 + 1e-9)
        low, high = np.array([-reach, -reach]), np.array([reach, reach])
        if self.revolute:
            low[0], high[0] = 0.0, 0.5 * reach**2
        return (low[:1], high[:1]) if self.flat else (low, high)

    def place(self, q: Array) -> tuple[list[Array], Array]:
        """Section coordinates, a list of one or two (N,), and the start along the sweep (N,)."""
        x, y, z = (position(self.arm, q) @ self._R.T + self._p).T
        if self.revolute:
            u = 0.5 * (x * x + y * y)
            start = np.zeros(len(q)) if self.closed else np.arctan2(y, x)
            return ([u] if self.flat else [u, z]), start
        if self.flat:
            return [self._across[0] * x + self._across[1] * y], z
        return [x, y], z


class _Cells:
    """The cells of the section, and the starts found in each."""

    def __init__(self, section: _Section, low: Array, high: Array, side: int) -> None:
        self.section = section
        reach = math.pi if section.revolute else section.arm.reach
        # stretches are no longer than the sweep, so that the sweeps of two starts in a stretch always overlap
        count = 1 if section.closed else min(_STRETCHES, math.ceil(2 * reach / section.sweep))
        self.first_start, self.stretch, self.stretches = -reach, 2 * reach / count, count
        if len(low) == 2:
            side = 1 << (min(side, math.isqrt((1 << 20) // count)).bit_length() - 1)
        self.shape = (side,) * len(low)
        self.low, self.high = low, high
        # at least the spacing of floats, as an arm may hardly move
        self.size = np.maximum((high - low) / side, np.spacing(np.maximum(np.abs(low), np.abs(high))))
        cells = math.prod(self.shape) * count
        self.start_low = np.full(cells, np.inf)
        self.start_high = np.full(cells, -np.inf)
        self.lowest, self.highest = np.full(len(low), np.inf), np.full(len(low), -np.inf)
        self._notable = self.stretch / 64

    def add(self, q: Array) -> NDArray[np.bool_]:
        """Enter postures; returns which of them extended an interval."""
        place, start = self.section.place(q)
        cell = np.zeros(len(q), dtype=np.int64)
        for axis, x in enumerate(place):
            self.lowest[axis], self.highest[axis] = min(self.lowest[axis], x.min()), max(self.highest[axis], x.max())
            index = ((x - self.low[axis]) / self.size[axis]).astype(np.int64)
            cell = cell * self.shape[axis] + np.clip(index, 0, self.shape[axis] - 1)
        if self.stretches > 1:
            stretch = ((start - self.first_start) / self.stretch).astype(np.int64)
            cell = cell * self.stretches + np.clip(stretch, 0, self.stretches - 1)
        is_new = start < self.start_low[cell] - self._notable
        is_new |= start > self.start_high[cell] + self._notable
        np.minimum.at(self.start_low, cell, start)
        np.maximum.at(self.start_high, cell, start)
        return np.asarray(is_new)

    def merge_cells(self) -> _Cells | None:
        """Cells of twice the size with the same starts; None for 32 cells or fewer along a side."""
        if self.shape[0] <= 32:
            return None
        merged = _Cells(self.section, self.low, self.high, self.shape[0] // 2)
        pairs = [k for n in merged.shape for k in (n, 2)] + [self.stretches]
        pair_axes = tuple(range(1, 2 * len(self.shape), 2))
        merged.start_low = self.start_low.reshape(pairs).min(axis=pair_axes).ravel()
        merged.start_high = self.start_high.reshape(pairs).max(axis=pair_axes).ravel()
        return merged

    def swept_lengths(self) -> Array:
        """Length swept at each cell: (cells...) [rad | mm]."""
        low = self.start_low.reshape(-1, self.stretches)
        high = self.start_high.reshape(-1, self.stretches)
        sweep = self.section.sweep
        last_end = np.full(len(low), -np.inf)  # end of the previous interval of starts
        first = np.full(len(low), np.inf)
        gaps = np.zeros(len(low))
        for stretch in range(self.stretches):
            is_occupied = np.isfinite(low[:, stretch])
            gap = (
                np.where(is_occupied, low[:, stretch], 0.0) - np.where(np.isfinite(last_end), last_end, np.inf) - sweep
            )
            gaps += np.where(is_occupied, np.maximum(gap, 0.0), 0.0)
            first = np.where(np.isfinite(first), first, low[:, stretch])
            last_end = np.where(is_occupied, high[:, stretch], last_end)
        is_occupied = np.isfinite(first)
        first, last_end = np.where(is_occupied, first, 0.0), np.where(is_occupied, last_end, 0.0)
        # the circle without its gaps, of which one lies between the last and the first interval
        if self.section.revolute:
            total = 2 * math.pi - gaps - np.maximum(first + 2 * math.pi - last_end - sweep, 0.0)
        else:
            total = last_end - first + sweep - gaps
        return np.where(is_occupied, total, 0.0).reshape(self.shape)

    def bracket(self) -> tuple[float, float]:
        """Lower and upper bound of the volume or area."""
        lengths = self.swept_lengths()
        # r = 0 is the axis and no border of the reach
        axis_mode = "edge" if self.section.revolute and self.low[0] == 0.0 else "constant"
        inner_lengths = lengths
        for k in range(lengths.ndim):
            sides: list[tuple[int, int]] = [(0, 0)] * lengths.ndim
            sides[k] = (1, 0)
            padded = np.pad(inner_lengths, sides, mode=axis_mode if k == 0 else "constant")  # type: ignore[call-overload]
            sides[k] = (0, 1)
            padded = np.pad(padded, sides)
            n = self.shape[k]
            inner_lengths = np.minimum(
                np.minimum(padded.take(range(n), k), padded.take(range(1, n + 1), k)),
                padded.take(range(2, n + 2), k),
            )
        cell = float(np.prod(self.size))
        return float(inner_lengths.sum()) * cell, float(lengths.sum()) * cell


def _fill_cells(cells: _Cells, rng: np.random.Generator, uniform: int, grown: int, size: int) -> None:
    """Sample the other joints, first at random, then around the postures that last extended an interval."""
    arm, low, high = cells.section.arm, cells.section.low, cells.section.high
    is_limited = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    width = high - low
    pool = np.empty((0, arm.n))
    for chunk in range(uniform + grown):
        if chunk < uniform:
            q = low - _OVERSHOOT * width + (1 + 2 * _OVERSHOOT) * width * rng.random((size, arm.n))
        else:
            seeds = pool[rng.integers(len(pool), size=size)]
            step = 10.0 ** rng.uniform(-4.0, -0.5, (size, 1))
            q = seeds + step * width * rng.standard_normal((size, arm.n))
        q = np.where(is_limited, np.clip(q, low, high), q)
        q[:, 0] = 0.0
        is_new = cells.add(q)
        pool = np.concatenate([q[is_new], pool])[:_POOL]
