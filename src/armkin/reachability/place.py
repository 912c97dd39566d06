"""`armkin.place`: where to put an arm, so that it reaches given targets.

A place is a position of the arm's frame (the one in which its targets are given, before its `base`) on a grid in the
plane of the targets' frame, and a yaw about its z axis. Where joint 1's axis is the frame's z axis, a yaw adds to joint
1 alone: one solve a target and position answers all yaws as an arc. Other arms are asked yaw by yaw.

The robot's own keep-outs move with it; those of a scene stand with the targets.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin import files
from armkin.columns.parts import Parts, digest
from armkin.columns.table import Table
from armkin.engines.run import Engine
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Status
from armkin.inverse.solve import ik
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import Task, read_targets
from armkin.model.rotation import rotation_about
from armkin.reachability import keeping
from armkin.reachability.answers import TURN, arc, inside, limit_margin
from armkin.reachability.cells import STRAIGHT
from armkin.reachability.standing import Around, apart, free

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
    around: Around = Around()

    @property
    def arcs(self) -> bool:
        """Whether a yaw adds to joint 1 alone, and the yaws divide the circle."""
        arm, axis = self.arm, self.arm.link[0]
        upright = np.abs(axis[:2, 2]).max() <= STRAIGHT and np.abs(axis[:2, 3]).max() <= STRAIGHT * arm.reach
        free = not arm.keep_out and not self.around.keep_out
        plain = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and free
        whole = abs(self.yaws * self.step - TURN) < STRAIGHT
        return bool(upright) and plain and whole and arm.n == self.task.constraints


class Chunk(NamedTuple):
    """Some positions (P, 2) [mm] of one arm."""

    number: int
    which: int  # of the questions
    at: Array


def place(
    arms: Arm | Sequence[Arm],
    targets: ArrayLike,
    *,
    area: Sequence[float] | None = None,
    step: float = 50.0,
    yaw: float = math.radians(15.0),
    z: float = 0.0,
    scene: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Place]:
    """Where each arm, by itself, reaches the targets (N, m) or (N, 4, 4) [mm, rad] of its task.

    area: x and y, each from and to [mm], by default the targets' box grown by the arm's reach; step [mm] and yaw [rad]
    of the places; z [mm] of all. scene: keep-outs that stand with the targets. out: what is finished stays beside that
    file until `armkin.reachability.place_file.write` has written it: after a kill it goes on. workers, cluster: see
    `armkin.reach`; progress gets the positions done.

    >>> import armkin
    >>> [found] = armkin.place(armkin.load("three_dof"), [[600, 0, 200], [600, 300, 200]], step=100.0)
    >>> found.reach_all > 0, found.of
    (True, 2)
    """
    several = [arms] if not isinstance(arms, Sequence) else list(arms)
    settings = {"area": area, "step": step, "yaw": yaw, "z": z}
    told = None if progress is None else lambda done, total: progress(done)
    return each(several, [targets] * len(several), settings, scene, out, Engine(workers, cluster), told)


def each(
    arms: Sequence[Arm],
    targets: Sequence[ArrayLike],
    settings: dict[str, Any],
    scene: str | os.PathLike[str] | None,
    out: str | os.PathLike[str] | None,
    engine: Engine,
    progress: Callable[[int, int], None] | None,
) -> list[Place]:
    """`place` of arms that have their own targets each; settings: area, step, yaw, z; progress: done, of so many."""
    for name in ("step", "yaw"):
        if not (math.isfinite(settings[name]) and settings[name] > 0):
            raise UsageError(f"{name}: {settings[name]:g}; it must be above 0")
    asked = [_question(arm, some, settings, scene) for arm, some in zip(arms, targets, strict=True)]
    grids = [_axes(one, settings["area"], settings["step"]) for one in asked]
    work_list: list[Chunk] = []
    for i, (one, (axes, _)) in enumerate(zip(asked, grids, strict=True)):
        at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        work_list += [Chunk(len(work_list) + k, i, part) for k, part in enumerate(_blocks(one, at))]
    counts: dict[int, NDArray[np.int64]] = {}
    parts, done, total = _parts(asked, settings, out), 0, sum(len(chunk.at) for chunk in work_list)
    with keeping.holding(parts, len(work_list)):
        for number, columns in keeping.tables(engine, work, asked, work_list, parts):
            counts[number] = np.asarray(columns["reached"])
            done += len(work_list[number].at)
            if progress is not None:
                progress(done, total)
    found = []
    for i, (one, (axes, inner)) in enumerate(zip(asked, grids, strict=True)):
        mine = [counts[chunk.number] for chunk in work_list if chunk.which == i]
        every = np.concatenate(mine).reshape(len(axes[0]), len(axes[1]), one.yaws)
        margin, reached = _margins(every == len(one.targets), settings["step"])[inner], every[inner]
        x, y, yaws = axes[0][inner[0]], axes[1][inner[1]], np.arange(one.yaws) * settings["yaw"]
        best = _best(one, reached, margin, x, y, yaws)
        found.append(Place(one.arm, x, y, yaws, one.z, reached, margin, len(one.targets), best))
    return found


def _question(arm: Arm, targets: ArrayLike, settings: dict[str, Any], scene: str | os.PathLike[str] | None) -> Question:
    """What is asked of one arm: its own keep-outs apart from those of a scene."""
    task = task_for(arm, None)
    arm, around = apart(arm, scene)
    yaws = math.ceil(TURN / settings["yaw"] - STRAIGHT)
    return Question(arm, task, read_targets(task, targets).values, yaws, settings["yaw"], settings["z"], around)


def _parts(questions: list[Question], settings: dict[str, Any], out: str | os.PathLike[str] | None) -> Parts | None:
    """What is answered, kept beside the file until it stands."""
    if out is None:
        return None
    files.check(os.fspath(out))
    robots = [[one.arm.sha256, one.around.sha256, digest(one.targets.tobytes())] for one in questions]
    return Parts(os.fspath(out), {"command": "place", "robots, scene and targets": robots, **settings})


def positions_of(task: Task, targets: Array) -> Array:
    """Positions (N, 2 or 3) of targets."""
    return targets[:, :3, 3] if task.orientation == "full" else targets[:, : task.position]


def _axes(
    question: Question, area: Sequence[float] | None, step: float
) -> tuple[tuple[Array, Array], tuple[slice, slice]]:
    """The grid's x and y, as far as any place can reach all targets, and which of them are in the area."""
    arm = question.arm
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
        if (last + before + behind + 1) ** 2 * question.yaws > 4 * MOST:
            raise UsageError(f"more than {MOST:,} places: take a larger step or a smaller area", most=MOST)
        axes.append(start + np.arange(-before, last + behind + 1) * step)
        inner.append(slice(before, before + last + 1))
    return (axes[0], axes[1]), (inner[0], inner[1])


def _blocks(question: Question, at: Array) -> Iterator[Array]:
    count = max(SOLVES // (len(question.targets) * (1 if question.arcs else question.yaws)), 1)
    for start in range(0, len(at), count):
        yield at[start : start + count]


def work(questions: list[Question], chunk: Chunk) -> tuple[int, Table]:
    """How many targets are reached from each position and yaw: (P K,)."""
    counts = [_counted(questions[chunk.which], at).ravel() for at in chunk.at]
    return chunk.number, {"reached": np.concatenate(counts)}


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
    return np.asarray(_answers(question, at, turn)[1].any(axis=1))


def _answers(question: Question, at: Array, turn: float) -> tuple[Array, NDArray[np.bool_]]:
    """The branches of all targets from one place (N, B, n), and which are within limits and free (N, B)."""
    s = ik(question.arm, _seen(question, at, turn))
    legal = s.within_limits & s.clear if question.arm.keep_out else s.within_limits
    if question.around.keep_out and legal.any():
        place, q = (float(at[0]), float(at[1]), question.z), np.where(legal[:, :, None], s.q, np.nan)
        legal = legal & free(question.arm, question.around, place, turn, q)
    return s.q, np.asarray(legal)


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
    q, legal = _answers(question, at, turn)
    margins = np.where(legal, limit_margin(question.arm, q), -np.inf).max(axis=1, initial=-np.inf)
    there = margins[np.isfinite(margins)]
    return float(there.min()) if len(there) else 0.0
