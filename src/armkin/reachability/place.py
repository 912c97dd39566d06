"""`armkin.place`: where to put an arm, so that it reaches given targets.

A place is a position of the arm's frame (the one in which its targets are given, before its `base`) on a grid in the
plane of the targets' frame, and a yaw about its z axis. Where joint 1's axis is the frame's z axis, a yaw adds to joint
1 alone: one solve a target and position answers all yaws as an arc. Other arms are asked yaw by yaw.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.engines.run import Engine, in_order
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solutions import Status
from armkin.inverse.solve import ik
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import Task, read_targets
from armkin.model.rotation import rotation_about
from armkin.reachability.answers import TURN, arc, inside, limit_margin
from armkin.reachability.cells import STRAIGHT

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MOST = 10**7  # places
SOLVES = 40_000  # of a chunk
BLOCK = 4_096  # targets solved at once


@dataclass(frozen=True, eq=False)
class Place:
    """Where one arm reaches the targets; lengths in mm, angles in rad.

    x (X,), y (Y,), yaw (K,): the places. reached: (X, Y, K) targets reached from each, of `of`. margin: (X, Y, K)
    distance to the nearest place of the grid, continued outside the area, at the same yaw, that does not reach all.
    best: index of the best place; ties by margin, then by the least distance to a joint limit.
    """

    arm: Arm
    x: Array
    y: Array
    yaw: Array
    z: float
    reached: NDArray[np.int64]
    margin: Array
    of: int
    best: tuple[int, int, int]

    @property
    def reach_all(self) -> int:
        """How many places reach all targets."""
        return int((self.reached == self.of).sum())

    @property
    def xyz(self) -> Array:
        """The best position: (3,)."""
        return np.array([self.x[self.best[0]], self.y[self.best[1]], self.z])


class Question(NamedTuple):
    """Targets of one arm, in the targets' frame."""

    arm: Arm
    task: Task
    targets: Array
    yaws: int
    step: float  # [rad] of the yaw
    z: float

    @property
    def arcs(self) -> bool:
        """Whether a yaw adds to joint 1 alone, and the yaws divide the circle."""
        arm, axis = self.arm, self.arm.link[0]
        upright = np.abs(axis[:2, 2]).max() <= STRAIGHT and np.abs(axis[:2, 3]).max() <= STRAIGHT * arm.reach
        plain = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and not arm.keep_out
        whole = abs(self.yaws * self.step - TURN) < STRAIGHT
        return bool(upright) and plain and whole and arm.n == self.task.constraints


class Chunk(NamedTuple):
    """Some positions: (P, 2) [mm]."""

    number: int
    at: Array


def place(
    arms: Arm | Sequence[Arm],
    targets: ArrayLike,
    *,
    area: Sequence[float] | None = None,
    step: float = 50.0,
    yaw: float = math.radians(15.0),
    z: float = 0.0,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Place]:
    """Where each arm, by itself, reaches the targets (N, m) or (N, 4, 4) [mm, rad] of its task.

    area: x and y, each from and to [mm], by default the targets' box grown by the arm's reach; step [mm] and yaw [rad]
    of the places; z [mm] of all. workers, cluster: see `armkin.reach`; progress gets the positions done.

    >>> import armkin
    >>> [found] = armkin.place(armkin.load("three_dof"), [[600, 0, 200], [600, 300, 200]], step=100.0)
    >>> found.reach_all > 0, found.of
    (True, 2)
    """
    several = [arms] if not isinstance(arms, Sequence) else list(arms)
    return [_placed(arm, targets, area, step, yaw, z, Engine(workers, cluster), progress) for arm in several]


def _placed(
    arm: Arm,
    targets: ArrayLike,
    area: Sequence[float] | None,
    step: float,
    yaw: float,
    z: float,
    engine: Engine,
    progress: Callable[[int], None] | None,
) -> Place:
    task = task_for(arm, None)
    goals = read_targets(task, targets).values
    for name, value in (("step", step), ("yaw", yaw)):
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"{name}: {value:g}; it must be above 0")
    yaws = np.asarray(np.arange(math.ceil(TURN / yaw - STRAIGHT)) * yaw, dtype=float)
    question = Question(arm, task, goals, len(yaws), yaw, z)
    axes, inner = _axes(arm, question, area, step, len(yaws))
    at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    counts = []
    done = 0
    for part in in_order(engine, work, question, _chunks(question, at)):
        counts.append(part)
        done += len(part)
        if progress is not None:
            progress(done)
    every = np.concatenate(counts).reshape(len(axes[0]), len(axes[1]), len(yaws))
    margin = _margins(every == len(goals), step)[inner]
    reached = every[inner]
    x, y = axes[0][inner[0]], axes[1][inner[1]]
    best = _best(question, reached, margin, x, y, yaws)
    return Place(arm, x, y, yaws, z, reached, margin, len(goals), best)


def positions_of(task: Task, targets: Array) -> Array:
    """Positions (N, 2 or 3) of targets."""
    return targets[:, :3, 3] if task.orientation == "full" else targets[:, : task.position]


def _axes(
    arm: Arm, question: Question, area: Sequence[float] | None, step: float, yaws: int
) -> tuple[tuple[Array, Array], tuple[slice, slice]]:
    """The grid's x and y, as far as any place can reach all targets, and which of them are in the area."""
    p = positions_of(question.task, question.targets)[:, :2]
    far = arm.reach + float(np.linalg.norm(arm.link[0][:2, 3]))
    low, high = p.max(axis=0) - far, p.min(axis=0) + far  # beyond, one target is out of reach
    if area is None:
        area = [v for i in (0, 1) for v in (p[:, i].min() - arm.reach, p[:, i].max() + arm.reach)]
    if len(area) != 4 or not np.isfinite(area).all() or area[1] < area[0] or area[3] < area[2]:
        raise UsageError("area: XMIN,XMAX,YMIN,YMAX in mm, each from the lower to the upper end")
    axes, inner = [], []
    for i, (start, end) in enumerate(((area[0], area[1]), (area[2], area[3]))):
        last = math.floor((end - start) / step + 1e-9)
        before = max(math.ceil((start - low[i]) / step), 0) + 1
        behind = max(math.ceil((high[i] - start) / step) - last, 0) + 1
        if (last + before + behind + 1) ** 2 * yaws > 4 * MOST:
            raise UsageError(f"more than {MOST:,} places: take a larger step or a smaller area", most=MOST)
        axes.append(start + np.arange(-before, last + behind + 1) * step)
        inner.append(slice(before, before + last + 1))
    return (axes[0], axes[1]), (inner[0], inner[1])


def _chunks(question: Question, at: Array) -> Iterator[Chunk]:
    each = max(SOLVES // (len(question.targets) * (1 if question.arcs else question.yaws)), 1)
    for number, start in enumerate(range(0, len(at), each)):
        yield Chunk(number, at[start : start + each])


def work(question: Question, chunk: Chunk) -> NDArray[np.int64]:
    """How many targets are reached from each position and yaw: (P, K)."""
    return np.concatenate([_counted(question, at) for at in chunk.at])


def _counted(question: Question, at: Array) -> NDArray[np.int64]:
    """Of one position (2,): (1, K)."""
    arm, K = question.arm, question.yaws
    turns = np.arange(K) * question.step
    if not question.arcs:
        return np.array([[int(_legal(question, at, turn).sum()) for turn in turns]])
    goals = _seen(question, at, 0.0)
    near = np.linalg.norm(positions_of(question.task, goals), axis=1) <= 2 * arm.reach + np.linalg.norm(arm.base[:3, 3])
    legal = np.zeros((len(goals), K), bool)
    if near.all():
        s = ik(arm, goals)
        sense = -1 if arm.link[0][2, 2] > 0 else 1
        allowed = s.valid & inside(arm, s.q, range(1, arm.n))
        first, length = arc(arm, s.q[:, :, 0], 0, K, sense)
        places = (np.arange(K) - first[:, :, None]) % K < np.where(allowed, length, 0)[:, :, None]
        legal = np.asarray(places.any(axis=1))
        for row in np.flatnonzero((s.status == Status.BOUNDARY) | (s.status == Status.SINGULAR)).tolist():
            one = question._replace(targets=question.targets[row : row + 1])
            legal[row] = [bool(_legal(one, at, turn)[0]) for turn in turns]
    else:
        rows = np.flatnonzero(near)
        some = question._replace(targets=question.targets[rows])
        return _counted(some, at) if len(rows) else np.zeros((1, K), np.int64)
    return np.asarray(legal.sum(axis=0, dtype=np.int64)[None])


def _legal(question: Question, at: Array, turn: float) -> NDArray[np.bool_]:
    """Which targets are reached from one place: (N,)."""
    s = ik(question.arm, _seen(question, at, turn))
    legal = s.within_limits & s.clear if question.arm.keep_out else s.within_limits
    return np.asarray(legal.any(axis=1))


def _seen(question: Question, at: Array, turn: float) -> Array:
    """The targets in the frame of an arm at a place."""
    task, targets = question.task, question.targets.copy()
    R = rotation_about(2, -turn)
    shift = np.array([at[0], at[1], question.z])
    if task.orientation == "full":
        targets[:, :3, 3] = (targets[:, :3, 3] - shift) @ R.T
        targets[:, :3, :3] = R @ targets[:, :3, :3]
        return targets
    k = task.position
    targets[:, :k] = (targets[:, :k] - shift[:k]) @ R[:k, :k].T
    if task.orientation == "axis":
        targets[:, 3:6] = targets[:, 3:6] @ R.T
    if task.name in ("xy_theta", "xyz_yaw"):
        targets[:, k] -= turn
    return targets


def _margins(good: NDArray[np.bool_], step: float) -> Array:
    """Distance of each place (X, Y, K) to the nearest one, at the same yaw, that is not good; 0 for these."""
    X, _, K = good.shape
    out = np.zeros(good.shape)
    columns = np.arange(X)[:, None]
    for k in range(K):
        if not good[:, :, k].any():
            continue
        # along y, then across x: the lower envelope of parabolas, here tried row by row
        rows = _along(good[:, :, k])
        out[:, :, k] = np.sqrt(np.min((columns - columns.T)[:, :, None] ** 2 + rows[None] ** 2, axis=1)) * step
    return out


def _along(good: NDArray[np.bool_]) -> Array:
    """How many places along y it is to the nearest one that is not good: (X, Y)."""
    index = np.where(good, np.inf, np.arange(good.shape[1]))
    ahead = np.minimum.accumulate(index[:, ::-1], axis=1)[:, ::-1] - np.arange(good.shape[1])
    behind = np.arange(good.shape[1]) - np.maximum.accumulate(np.where(good, -np.inf, index), axis=1)
    return np.asarray(np.minimum(ahead, behind))


def _best(
    question: Question, reached: NDArray[np.int64], margin: Array, x: Array, y: Array, yaws: Array
) -> tuple[int, int, int]:
    """The place that reaches most, by the greatest margin, then by the greatest distance to a joint limit."""
    most = reached == reached.max()
    tied = np.argwhere(most & (margin >= margin[most].max() - 1e-9))
    if len(tied) > 1 and reached.max():
        spread = tied[:: max(len(tied) // 200, 1)]  # of very many alike, some
        room = [_room(question, np.array([x[i], y[j]]), float(yaws[k])) for i, j, k in spread]
        tied = spread[int(np.argmax(room)) :]
    i, j, k = tied[0].tolist()
    return i, j, k


def _room(question: Question, at: Array, turn: float) -> float:
    """The least, over the targets reached, of the best branch's distance to a limit, as a share of the range."""
    s = ik(question.arm, _seen(question, at, turn))
    margins = np.where(s.within_limits, limit_margin(question.arm, s.q), -np.inf).max(axis=1)
    there = margins[np.isfinite(margins)]
    return float(there.min()) if len(there) else 0.0
