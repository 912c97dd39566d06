"""`armkin.place`: finds places from which an arm reaches given targets.

A place is a position of the arm's frame (in which its targets are given, before its `base`) on a grid in the xy plane
of the targets' frame, and a yaw about its z axis. If the axis of joint 1 is the z axis of the arm's frame, a yaw
changes joint 1 only, and one solve for each target and position answers all yaws as an arc. Other arms are solved for
each yaw.

A path counts as reached if one branch follows each part of it between joint moves (`branches_from_place`); the path is
then planned from the best places (`path_from_place`). A redundant joint is held at each of the values that
`armkin.path` tries, and the best of them counts.

The robot's own keep-outs move with it; those of a scene are fixed to the targets' frame.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin import __version__, files
from armkin.columns.finished_chunks import Parts, digest
from armkin.columns.formats import ENDINGS
from armkin.columns.table import Table
from armkin.engines.ordered_chunks import Engine
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solve import ik
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import read_targets
from armkin.model.lock_joints import unlock
from armkin.model.units import TURN
from armkin.reachability import kept_chunks
from armkin.reachability.place import path_from_place
from armkin.reachability.place.arm_among_obstacles import split_keep_outs
from armkin.reachability.place.best_place import Room, best_place, limit_rooms, margins
from armkin.reachability.place.path_from_place import PathFromPlace
from armkin.reachability.place.reached_targets import (
    PlaceQuestion,
    Solve,
    at_value,
    each_value,
    free_from,
    positions_of,
    reached_counts,
)
from armkin.reachability.reach_cells import STRAIGHT

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile

MAX_PLACES = 10**7  # most places of a search
SOLVES, ANSWERS = 40_000, 10**7  # solves of a chunk, and its targets times places if most of these need no solve
PLANS, TRIES = 3, 12  # number of plans of a path, and most places that are tried


@dataclass(frozen=True, eq=False)
class Place:
    """Where one arm reaches the targets; lengths in mm, angles in rad.

    Of a path, targets are points along it.

    Attributes:
        arm: the arm that is placed.
        x: (X,) [mm] of the places.
        y: (Y,) [mm].
        yaw: (K,) [rad].
        z: [mm] of all places.
        reached: (X, Y, K) targets reached from each place, of `of`.
        margin: (X, Y, K) [mm] distance to the nearest place of the grid, continued outside the area, at the same yaw,
            that does not reach all.
        of: how many targets there are.
        best: index of the best place in `reached`; ties by margin, then by the least distance to a joint limit.
        positions: (N, 2) or (N, 3) [mm] of the targets.
        postures: (M, n) [rad | mm] for those of them that are reached from the best place.
        planned: of a path the best places, with their plans.
        unplanned: why there are none; empty where there are.
        held: where a redundant joint is held [rad] at the best place.
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
    positions: Array
    postures: Array
    planned: tuple[PathFromPlace, ...] = ()
    unplanned: str = ""
    held: Mapping[str, float] = field(default_factory=dict)

    @property
    def reach_all(self) -> int:
        """How many places reach all targets."""
        return int((self.reached == self.of).sum())

    @property
    def xyz(self) -> Array:
        """(3,) [mm] the best position."""
        return np.array([self.x[self.best[0]], self.y[self.best[1]], self.z])


class PositionChunk(NamedTuple):
    """Some positions (P, 2) [mm] for one arm."""

    number: int
    question: int  # number of the question
    positions: Array


def place(
    arms: Arm | Sequence[Arm],
    targets: ArrayLike | str | os.PathLike[str] | PathFile,
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
    solve: Solve | None = None,
) -> list[Place]:
    """Where each arm, by itself, reaches targets of its task, or carries a path.

    Args:
        arms: the arm, or several.
        targets: (N, m) or (N, 4, 4) [mm, rad]; or a path file's name (.yaml) or model: a place counts only if one
            branch carries each way between joint moves, and the best places are planned (`Place.planned`).
        area: x and y, each from and to [mm]; by default the targets' box grown by the arm's reach.
        step: [mm] between places along x and y.
        yaw: [rad] between places that differ in yaw alone.
        z: [mm] of all places.
        scene: a file of keep-outs that stand with the targets.
        out: what is finished stays beside that file until `armkin.reachability.place.place_file.write` has written it:
            after a kill it goes on.
        workers: processes of this machine.
        cluster: address of a Dask scheduler, tcp://HOST:PORT, in place of workers.
        progress: called with the number of positions done.
        solve: what is asked of an arm, targets and a task, by default `armkin.ik`; one that calls
            `armkin.compile(arm).ik` is quicker (a function of a module, as it travels).

    Returns:
        A `Place` for each arm, in their order.

    Raises:
        UsageError: a number is out of range, a target is malformed, the task does not fit an arm, out has another
            ending, or parts of another question stand beside it.
        FileError: a file cannot be read or written, or another run works on it.
        RobotFileError: the scene is not valid.
        PathFileError: the path file is not valid.
        MissingExtraError: a cluster without Dask.
        ClusterError: the cluster cannot be reached, or a worker fails.

    >>> import armkin
    >>> [found] = armkin.place(armkin.load("three_dof"), [[600, 0, 200], [600, 300, 200]], step=100.0)
    >>> found.reach_all > 0, found.of
    (True, 2)
    """
    arm_list = [arms] if not isinstance(arms, Sequence) else list(arms)
    settings = {"area": area, "step": step, "yaw": yaw, "z": z}
    report = None if progress is None else lambda done, total: progress(done)
    return place_several(
        arm_list, [targets] * len(arm_list), settings, scene, out, Engine(workers, cluster), report, solve or ik
    )


def place_several(
    arms: Sequence[Arm],
    targets: Sequence[ArrayLike | str | os.PathLike[str] | PathFile],
    settings: dict[str, Any],
    scene: str | os.PathLike[str] | None,
    out: str | os.PathLike[str] | None,
    engine: Engine,
    progress: Callable[[int, int], None] | None,
    solve: Solve = ik,
) -> list[Place]:
    """`place` of arms that have their own targets each; settings: area, step, yaw, z; progress: done, of so many."""
    for name in ("step", "yaw"):
        if not (math.isfinite(settings[name]) and settings[name] > 0):
            raise UsageError(f"{name}: {settings[name]:g}; it must be above 0")
    paths = [path_from_place.path_of(goals) for goals in targets]
    per_arm = zip(arms, targets, paths, strict=True)
    questions = [_question(arm, goals, file, settings, scene) for arm, goals, file in per_arm]
    questions = [question._replace(solve=solve) for question in questions]
    grids = [_axes(question, settings["area"], settings["step"]) for question in questions]
    work_list = _chunks(questions, [axes for axes, _ in grids])
    counts = _count_reached(questions, work_list, engine, _parts(questions, settings, out), progress)
    places = []
    for number, (question, grid, file) in enumerate(zip(questions, grids, paths, strict=True)):
        arm_counts = np.concatenate([counts[chunk.number] for chunk in work_list if chunk.question == number])
        places.append(_place_result(question, *grid, arm_counts, settings, file))
    return places


def _count_reached(
    questions: Sequence[PlaceQuestion],
    work_list: Sequence[PositionChunk],
    engine: Engine,
    parts: Parts | None,
    progress: Callable[[int, int], None] | None,
) -> dict[int, NDArray[np.int64]]:
    """Number of targets reached from each position and yaw of a chunk (P K,), by the number of the chunk."""
    done, total = 0, sum(len(chunk.positions) for chunk in work_list)
    counts: dict[int, NDArray[np.int64]] = {}
    with kept_chunks.hold_parts(parts, len(work_list)):
        for number, columns in kept_chunks.chunk_tables(engine, count_chunk, questions, work_list, parts):
            counts[number] = np.asarray(columns["reached"])
            done += len(work_list[number].positions)
            if progress is not None:
                progress(done, total)
    return counts


def _chunks(questions: Sequence[PlaceQuestion], grids: Sequence[tuple[Array, Array]]) -> list[PositionChunk]:
    """All positions of all arms, in chunks."""
    chunks: list[PositionChunk] = []
    for number, (question, axes) in enumerate(zip(questions, grids, strict=True)):
        positions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        chunks += [
            PositionChunk(len(chunks) + offset, number, part)
            for offset, part in enumerate(_position_blocks(question, positions))
        ]
    return chunks


def _place_result(
    question: PlaceQuestion,
    axes: tuple[Array, Array],
    area_slices: tuple[slice, slice],
    counts: NDArray[np.int64],
    settings: dict[str, Any],
    file: PathFile | None,
) -> Place:
    """The result of one arm; counts: (places,) reached targets on the grid, whose part `area_slices` is the area."""
    grid_counts = counts.reshape(len(axes[0]), len(axes[1]), question.yaws)
    reached = grid_counts[area_slices]
    margin = margins(grid_counts == len(question.targets), settings["step"])[area_slices]
    x, y, yaws = axes[0][area_slices[0]], axes[1][area_slices[1]], np.arange(question.yaws) * settings["yaw"]
    room = limit_rooms(question, x, y, yaws)
    best_index = best_place(room, reached, margin)
    goals, no_postures = positions_of(question.task, question.targets), np.zeros((0, question.arm.n))
    place = Place(
        arm=question.arm,
        x=x,
        y=y,
        yaw=yaws,
        z=question.z,
        reached=reached,
        margin=margin,
        of=len(question.targets),
        best=best_index,
        positions=goals,
        postures=no_postures,
    )
    return _add_postures(question, place if file is None else _plan_best_places(question, place, file, room))


def _add_postures(question: PlaceQuestion, place: Place) -> Place:
    """The place with a legal posture, the nearest to home, for each target reached from the best place."""
    position, yaw = place.xyz[:2], float(place.yaw[place.best[2]])
    plan = next((path.plan for path in place.planned if path.index == place.best and path.plan is not None), None)
    if plan is not None and plan.held:
        question = question._replace(values=tuple(plan.held.values()))
    held_question = at_value(question, position, yaw)
    solutions, is_legal = free_from(held_question, position, yaw)
    row = np.flatnonzero(is_legal.any(axis=1))
    q = (
        solutions.q[row, np.where(is_legal, solutions.motion, np.inf)[row].argmin(axis=1)]
        if len(row)
        else place.postures
    )
    if held_question.full_arm is None:
        return replace(place, postures=np.asarray(q))
    held = held_question.full_arm.joints
    return replace(place, postures=unlock(question.arm, held, q) if len(row) else place.postures, held=held)


def _plan_best_places(question: PlaceQuestion, place: Place, file: PathFile, room: Room) -> Place:
    """The place with plans from its best places; a place without a plan does not reach all targets."""
    if reason := path_from_place.missing_rates_text(question.arm):
        return replace(place, unplanned=reason)
    paths: list[PathFromPlace] = []
    untried_counts = place.reached.copy()
    while (
        untried_counts.max() == place.of and len(paths) < TRIES and sum(path.plan is not None for path in paths) < PLANS
    ):
        i, j, k = best_place(room, untried_counts, place.margin)
        xyz, yaw = (float(place.x[i]), float(place.y[j]), place.z), float(place.yaw[k])
        paths.append(path_from_place.plan_from_place(question.arm, question.obstacles, (i, j, k), xyz, yaw, file))
        untried_counts[i, j, k] = -1
        if paths[-1].plan is None:
            place.reached[i, j, k], place.margin[i, j, k] = place.of - 1, 0.0
    best_index = next((path.index for path in paths if path.plan is not None), None)
    if best_index is None:
        best_index = best_place(room, place.reached, place.margin)
    return replace(place, best=best_index, planned=tuple(paths))


def _question(
    arm: Arm, targets: Any, file: PathFile | None, settings: dict[str, Any], scene: str | os.PathLike[str] | None
) -> PlaceQuestion:
    """The question for one arm, with its own keep-outs separated from those of a scene."""
    path_lengths: tuple[int, ...] = ()
    redundant_joint, held_values = "", tuple[float, ...]()
    if file is None:
        task = task_for(arm, None)
    else:
        task, routes = path_from_place.ways_of_path(arm, file)
        targets, path_lengths = np.concatenate(routes), tuple(map(len, routes))
        redundant_joint, held_values = path_from_place.joint_to_hold(arm, file)
    arm, obstacles = split_keep_outs(arm, scene)
    yaws = math.ceil(TURN / settings["yaw"] - STRAIGHT)
    values, *_ = read_targets(task, targets)
    return PlaceQuestion(
        arm=arm,
        task=task,
        targets=values,
        yaws=yaws,
        step=settings["yaw"],
        z=settings["z"],
        obstacles=obstacles,
        path_lengths=path_lengths,
        redundant_joint=redundant_joint,
        values=held_values,
    )


def _parts(
    questions: list[PlaceQuestion], settings: dict[str, Any], out: str | os.PathLike[str] | None
) -> Parts | None:
    """The kept results beside the file, which are removed after it is written."""
    if out is None:
        return None
    files.file_ending(out, "places are", ENDINGS)
    files.check_writable(os.fspath(out))
    robots = [
        [q.arm.sha256, q.obstacles.sha256, digest(q.targets.tobytes()), *q.path_lengths, *q.values] for q in questions
    ]
    inputs = {"command": "place", "armkin": __version__, "robots, scene and targets": robots, **settings}
    inputs["solve"] = [f"{question.solve.__module__}.{question.solve.__qualname__}" for question in questions]
    return Parts(os.fspath(out), inputs)


def _axes(
    question: PlaceQuestion, area: Sequence[float] | None, step: float
) -> tuple[tuple[Array, Array], tuple[slice, slice]]:
    """The x and y of a grid that contains all places with all targets in reach, and the slices in the area."""
    arm = question.arm
    points = positions_of(question.task, question.targets)[:, :2]
    distance = arm.reach + float(np.linalg.norm(arm.link[0][:2, 3]))
    # outside this box some target is out of reach
    low, high = points.max(axis=0) - distance, points.min(axis=0) + distance
    if area is None:
        lowest, highest = points.min(axis=0) - arm.reach, points.max(axis=0) + arm.reach
        area = [lowest[0], highest[0], lowest[1], highest[1]]
    if len(area) != 4 or not np.isfinite(area).all() or area[1] < area[0] or area[3] < area[2]:
        raise UsageError("area: XMIN,XMAX,YMIN,YMAX in mm, each from the lower to the upper end")
    axes, area_slices = [], []
    for axis, (start, end) in enumerate(((area[0], area[1]), (area[2], area[3]))):
        last = math.floor((end - start) / step + 1e-9)
        count_below = max(math.ceil((start - low[axis]) / step), 0) + 1
        count_above = max(math.ceil((high[axis] - start) / step) - last, 0) + 1
        if (last + count_below + count_above + 1) ** 2 * question.yaws > 4 * MAX_PLACES:
            raise UsageError(f"more than {MAX_PLACES:,} places: take a larger step or a smaller area", most=MAX_PLACES)
        axes.append(start + np.arange(-count_below, last + count_above + 1) * step)
        area_slices.append(slice(count_below, count_below + last + 1))
    return (axes[0], axes[1]), (area_slices[0], area_slices[1])


def _position_blocks(question: PlaceQuestion, positions: Array) -> Iterator[Array]:
    first = next(each_value(question))
    solves = len(first.targets) * (1 if first.by_arcs else first.yaws) * max(len(question.values), 1)
    count = max((ANSWERS // len(first.targets) // first.yaws if first.by_distance_alone else SOLVES // solves), 1)
    for start in range(0, len(positions), count):
        yield positions[start : start + count]


def count_chunk(questions: list[PlaceQuestion], chunk: PositionChunk) -> tuple[int, Table]:
    """Number of targets reached from each position and yaw: (P K,)."""
    return chunk.number, {"reached": reached_counts(questions[chunk.question], chunk.positions).ravel()}
