"""The survey of an arm's workspace: one pass over the samples, in chunks, whatever their number."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import position as position_of
from armkin.keep_out.clearance import clear
from armkin.model.arm import actual
from armkin.reachability import cloud as clouds
from armkin.reachability.measures import MEASURES, measure
from armkin.reachability.sampling import Random, Sampling, grid
from armkin.reachability.volume import Extent, extent

if TYPE_CHECKING:
    from armkin.model.arm import Arm


@dataclass(frozen=True)
class Workspace:
    """What the samples and the volume say; lengths in mm."""

    arm: Arm
    samples: int
    low: Array  # (3,) smallest x, y, z of the tip among the samples
    high: Array  # (3,)
    reach: tuple[float, float]  # distance of the tip from the base's origin, least and greatest
    extent: Extent | None  # volume or area; None if it was not asked for
    measures: dict[str, tuple[float, float]]  # least and greatest among the samples
    seconds: float
    joints: Array  # (K, n) [rad | mm] a random choice of the samples, for pictures
    tips: Array  # (K, 3)
    values: dict[str, Array]  # (K,) their measures
    free: int | None = None  # samples that hit nothing; None: the arm has no keep-outs


def workspace(
    arm: Arm,
    samples: int | None = None,
    *,
    grid_points: Sequence[int] | None = None,
    seed: int = 0,
    measures: Sequence[str] = (),
    out: str | None = None,
    volume: bool = True,
    keep: int = 0,
    progress: Callable[[int], None] | None = None,
    position: Callable[[Array], Array] | None = None,
) -> Workspace:
    """Sample an arm's joints within their limits and see where the tip comes.

    samples: how many random poses (100,000 unless a grid is given), the same for the same seed.
    grid_points: points on every joint instead, or one number for all.
    measures: of "manipulability" and "step_error", worked out for every sample.
    out: a .csv, .npz or .ply file for all samples. keep: how many samples the result holds.
    progress: called with the number of samples done. position: the tip (N, 3) for joint values (N, n), by default
    `armkin.forward.position`; `armkin.compile(arm).position` is faster.

    Memory does not grow with the number of samples. The volume does not depend on it from 5,000 on; below,
    its error grows: see `extent`.
    """
    started = time.perf_counter()
    sampling = _sampling(arm, samples, grid_points, seed)
    for name in measures:
        if name not in MEASURES:
            raise UsageError(f"there is no measure '{name}'; there are {', '.join(MEASURES)}")
    functions = [measure(arm, name) for name in measures]
    tip_of = position or partial(position_of, arm)
    tally = _Tally(arm, sampling.count, len(functions), keep, seed)
    with ExitStack() as stack:
        write = None if out is None else stack.enter_context(clouds.cloud(out, arm, sampling.count, measures))
        for q in sampling.chunks():
            tip = tip_of(q)
            values = [function(q) for function in functions]
            tally.add(q, tip, values)
            if write is not None:
                write(q, tip, values)
            if progress is not None:
                progress(tally.done)
        # Within the block: without its volume there is no result, and then no file either.
        size = extent(actual(arm), seed, sampling.count) if volume else None
    return tally.result(measures, size, time.perf_counter() - started)


def _sampling(arm: Arm, samples: int | None, grid_points: Sequence[int] | None, seed: int) -> Sampling:
    if grid_points is None:
        return Random(arm, 100_000 if samples is None else samples, seed)
    if samples is not None:
        raise UsageError("samples (random) and a grid: give one of the two")
    return grid(arm, grid_points)


class _Tally:
    """Bounds so far, and a random choice of the samples."""

    def __init__(self, arm: Arm, count: int, measures: int, keep: int, seed: int) -> None:
        self.arm, self.done, self.free = arm, 0, 0
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.near, self.far = np.inf, 0.0
        self.least, self.most = np.full(measures, np.inf), np.full(measures, -np.inf)
        self._share = keep / count
        self._rng = np.random.default_rng([seed, 1])
        self._kept: list[Array] = []

    def add(self, q: Array, tip: Array, values: list[Array]) -> None:
        self.done += len(q)
        if self.arm.keep_out:
            self.free += int(clear(self.arm, q).sum())
        self.low, self.high = np.minimum(self.low, tip.min(axis=0)), np.maximum(self.high, tip.max(axis=0))
        distance = np.linalg.norm(tip - self.arm.base[:3, 3], axis=1)
        self.near, self.far = min(self.near, float(distance.min())), max(self.far, float(distance.max()))
        for k, value in enumerate(values):
            self.least[k], self.most[k] = min(self.least[k], value.min()), max(self.most[k], value.max())
        if self._share > 0:
            chosen = self._rng.random(len(q)) < self._share if self._share < 1 else slice(None)
            self._kept.append(np.column_stack([q, tip, *values])[chosen])

    def result(self, names: Sequence[str], size: Extent | None, seconds: float) -> Workspace:
        n = self.arm.n
        kept = np.concatenate(self._kept) if self._kept else np.empty((0, n + 3 + len(names)))
        return Workspace(
            arm=self.arm,
            samples=self.done,
            low=self.low,
            high=self.high,
            reach=(self.near, self.far),
            extent=size,
            measures={
                name: (float(low), float(high)) for name, low, high in zip(names, self.least, self.most, strict=True)
            },
            seconds=seconds,
            joints=kept[:, :n],
            tips=kept[:, n : n + 3],
            values={name: kept[:, n + 3 + k] for k, name in enumerate(names)},
            free=self.free if self.arm.keep_out else None,
        )
