"""The survey of an arm's workspace in one pass over the samples, in chunks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.engines.ordered_chunks import Engine, in_order
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import position as position_of
from armkin.keep_out.clearance import hits_nothing
from armkin.model.arm import actual_arm
from armkin.reachability import cloud_file as clouds
from armkin.reachability.dexterity import MEASURES, measure_function
from armkin.reachability.sampling import Random, Sampling, joint_grid
from armkin.reachability.volume import Extent, extent

if TYPE_CHECKING:
    from armkin.model.arm import Arm


@dataclass(frozen=True)
class Workspace:
    """What the samples and the volume say; lengths in mm.

    Attributes:
        arm: the arm that was surveyed.
        samples: how many poses there were.
        low: (3,) [mm] smallest x, y, z of the tip among the samples.
        high: (3,) [mm] greatest.
        reach: [mm] distance of the tip from the base's origin, least and greatest.
        extent: volume [mm3] or area [mm2] and its error; None if it was not asked for.
        measures: name -> least and greatest among the samples.
        seconds: [s] that it took.
        joints: (K, n) [rad | mm] a random choice of the samples, for pictures.
        tips: (K, 3) [mm] of these.
        values: name -> (K,) their measures.
        free: samples that hit nothing; None: the arm has no keep-outs.
    """

    arm: Arm
    samples: int
    low: Array
    high: Array
    reach: tuple[float, float]
    extent: Extent | None
    measures: dict[str, tuple[float, float]]
    seconds: float
    joints: Array
    tips: Array
    values: dict[str, Array]
    free: int | None = None


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
    workers: int = 1,
    cluster: str | None = None,
) -> Workspace:
    """Sample an arm's joints within their limits and see where the tip comes.

    Memory does not grow with the number of samples. The volume does not depend on it from 5,000 on; below, its error
    grows: see `armkin.reachability.volume`.

    Args:
        arm: the arm, as `armkin.load` gives it.
        samples: how many random poses; by default 100,000, unless a grid is given.
        grid_points: points on every joint in place of random poses: n numbers, or one that counts for all.
        seed: of the random poses: the same seed has the same ones.
        measures: of "manipulability" and "step_error" [mm], worked out for every sample.
        out: a .csv, .npz or .ply file for all samples.
        volume: whether the volume or area is worked out.
        keep: about how many samples, a random choice, the result holds.
        progress: called with the number of samples done.
        position: the tip (N, 3) [mm] for joint values (N, n), by default `armkin.forward.position`;
            `armkin.compile(arm).position` is faster (with workers or a cluster a function of a module, for it travels).
        workers: processes of this machine: the samples are the same ones.
        cluster: address of a Dask scheduler, tcp://HOST:PORT, in place of workers.

    Returns:
        A `Workspace`: the tip's box `low`, `high` (3,) [mm], its `reach` [mm], the volume as `extent`, and the
        measures.

    Raises:
        UsageError: a number is out of range, samples and a grid are both given, a prismatic joint has no limits, a
            measure is unknown, or out has another ending.
        FileError: the file cannot be written; there is none then.
        MissingExtraError: a cluster without Dask.
        ClusterError: the cluster cannot be reached, or a worker fails.
    """
    start_time = time.perf_counter()
    sampling = _sampling(arm, samples, grid_points, seed)
    for name in measures:
        if name not in MEASURES:
            raise UsageError(f"there is no measure '{name}'; there are {', '.join(MEASURES)}")
    job = Job(sampling, tuple(measures), position or partial(position_of, arm), out is not None or keep > 0)
    tally = _Tally(arm, sampling.count, len(measures), keep, seed)
    with ExitStack() as stack:
        write = None if out is None else stack.enter_context(clouds.open_cloud(out, arm, sampling.count, measures))
        for part in in_order(Engine(workers, cluster), survey_chunk, job, range(sampling.parts)):
            tally.add(part)
            if write is not None:
                write(part.q, part.tip, part.values)
            if progress is not None:
                progress(tally.samples)
        # inside the block, so that an error in the volume leaves no file
        size = extent(actual_arm(arm), seed, sampling.count) if volume else None
    return tally.result(measures, size, time.perf_counter() - start_time)


class Job(NamedTuple):
    """The job for all samples; rows: whether a chunk returns its samples, for a file or a picture."""

    sampling: Sampling
    measures: tuple[str, ...]
    position: Callable[[Array], Array]
    rows: bool


class Part(NamedTuple):
    """The result of a chunk of samples; q, tip, values: empty unless the job asks for rows."""

    samples: int
    free: int
    low: Array
    high: Array
    nearest: float
    farthest: float
    lowest: Array
    highest: Array
    q: Array
    tip: Array
    values: list[Array]


def survey_chunk(job: Job, number: int) -> Part:
    """The result of one chunk; a pure function, whose result does not depend on the engine."""
    arm, q = job.sampling.arm, job.sampling.part(number)
    tip = job.position(q)
    values = [measure_function(arm, name)(q) for name in job.measures]
    distance = np.linalg.norm(tip - arm.base[:3, 3], axis=1)
    rows = slice(None if job.rows else 0)
    return Part(
        samples=len(q),
        free=int(hits_nothing(arm, q).sum()) if arm.keep_out else 0,
        low=tip.min(axis=0),
        high=tip.max(axis=0),
        nearest=float(distance.min()),
        farthest=float(distance.max()),
        lowest=np.array([value.min() for value in values]),
        highest=np.array([value.max() for value in values]),
        q=q[rows],
        tip=tip[rows],
        values=[value[rows] for value in values],
    )


def _sampling(arm: Arm, samples: int | None, grid_points: Sequence[int] | None, seed: int) -> Sampling:
    if grid_points is None:
        return Random(arm, 100_000 if samples is None else samples, seed)
    if samples is not None:
        raise UsageError("samples (random) and a grid: give one of the two")
    return joint_grid(arm, grid_points)


class _Tally:
    """Bounds over all chunks so far, and a random choice of the samples."""

    def __init__(self, arm: Arm, count: int, measures: int, keep: int, seed: int) -> None:
        self.arm, self.samples, self.free = arm, 0, 0
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.nearest, self.farthest = np.inf, 0.0
        self.lowest, self.highest = np.full(measures, np.inf), np.full(measures, -np.inf)
        self._share = keep / count
        self._rng = np.random.default_rng([seed, 1])
        self._chosen_samples: list[Array] = []

    def add(self, part: Part) -> None:
        """Count a part of the samples."""
        self.samples += part.samples
        self.free += part.free
        self.low, self.high = np.minimum(self.low, part.low), np.maximum(self.high, part.high)
        self.nearest, self.farthest = min(self.nearest, part.nearest), max(self.farthest, part.farthest)
        self.lowest, self.highest = np.minimum(self.lowest, part.lowest), np.maximum(self.highest, part.highest)
        if self._share > 0:
            kept_samples = self._rng.random(part.samples) < self._share if self._share < 1 else slice(None)
            self._chosen_samples.append(np.column_stack([part.q, part.tip, *part.values])[kept_samples])

    def result(self, names: Sequence[str], size: Extent | None, seconds: float) -> Workspace:
        """The survey of all samples; names: of the measures, size: the volume or area."""
        n = self.arm.n
        samples = np.concatenate(self._chosen_samples) if self._chosen_samples else np.empty((0, n + 3 + len(names)))
        return Workspace(
            arm=self.arm,
            samples=self.samples,
            low=self.low,
            high=self.high,
            reach=(self.nearest, self.farthest),
            extent=size,
            measures={
                name: (float(low), float(high))
                for name, low, high in zip(names, self.lowest, self.highest, strict=True)
            },
            seconds=seconds,
            joints=samples[:, :n],
            tips=samples[:, n : n + 3],
            values={name: samples[:, n + 3 + k] for k, name in enumerate(names)},
            free=self.free if self.arm.keep_out else None,
        )
