"""A second count of reach under keep-outs: random places, multi-start Newton on screws, distances between points.

Nothing of `armkin.inverse` and of the distances of `armkin.keep_out` is used: branches come from `oracle`, and bodies
are rows of points that are held against floors, boxes and each other.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from oracle import Goal, branches, screws_of

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.reachability.reach_cells import Grid

Array = NDArray[np.float64]
TURN = 2 * np.pi
POINTS = 60  # of a segment
CLOSE = 1.0  # [mm] a row of points is not told from its segment below this


class Counted(NamedTuple):
    """Whether poses are reached by a free posture within limits, and whether that can be told (N,)."""

    reached: NDArray[np.bool_]
    known: NDArray[np.bool_]


class Cells(NamedTuple):
    """Cells asked twice: the share that could be told, how many of these differ, the share that is reached."""

    known: float
    different: int
    share: float


class Volume(NamedTuple):
    """Of the ball of the reach, the part that is reached: by the map, and counted, with its standard deviation."""

    map: float
    counted: float
    sigma: float


def count_cells(arm: armkin.Arm, scene: Path, info: dict[str, Any], *, grid: float, count: int, starts: int) -> Cells:
    """Random cells of a map with one orientation a cell, evenly in space."""
    reach_map = armkin.reach(arm, grid=grid, azimuths=24, rolls=1, tool_down=_has_orientation(arm), measures=False)
    cell, rng = reach_map.grid, np.random.default_rng(8)
    weight = np.repeat(cell.rings[:, 0] + 0.5, cell.azimuths)
    sampled = rng.choice(reach_map.cells, count, p=weight / weight.sum())
    turn = np.asarray((sampled % cell.azimuths) * (TURN / cell.azimuths), dtype=float)
    target = cell.targets(cell.rings[sampled // cell.azimuths], turn, np.zeros(count, int), np.zeros(count))
    by_count = count_targets(cell, target, scene_of(scene, info), starts, seed=3)
    differs = by_count.reached != (reach_map.share[sampled] == 1.0)
    return Cells(float(by_count.known.mean()), int((differs & by_count.known).sum()), float(by_count.reached.mean()))


def count_volume(arm: armkin.Arm, scene: Path, info: dict[str, Any], *, grid: float, count: int, starts: int) -> Volume:
    """Random places of the ball, with the map's orientation."""
    reach_map = armkin.reach(arm, grid=grid, azimuths=36, rolls=1, tool_down=_has_orientation(arm), measures=False)
    cell, rng = reach_map.grid, np.random.default_rng(9)
    place: Array = rng.normal(size=(count, 3))
    place *= (rng.uniform(size=count) ** (1 / 3) * arm.reach / np.linalg.norm(place, axis=1))[:, None]
    r, turn = np.hypot(place[:, 0], place[:, 1]), np.arctan2(place[:, 1], place[:, 0])
    ring: Array = np.stack([r / cell.step - 0.5, place[:, 2] / cell.step], axis=1)
    target = cell.targets(ring, turn, np.zeros(count, int), np.zeros(count))
    share = float(count_targets(cell, target, scene_of(scene, info), starts, seed=4).reached.mean())
    ball = 4 / 3 * np.pi * arm.reach**3
    return Volume(reach_map.volume_mm3 / ball, share, float(np.sqrt(share * (1 - share) / count)))


def _has_orientation(arm: armkin.Arm) -> bool:
    return task_for(arm).orientation != "none"


def count_targets(grid: Grid, targets: Array, scene: dict[str, Any], starts: int, seed: int) -> Counted:
    """Targets (N, ...) of `Grid.targets`; scene: floor [mm], boxes [(min, max)], clearance [mm]."""
    arm, task = grid.arm, grid.task
    T = np.tile(np.eye(4), (len(targets), 1, 1))
    if task.orientation == "full":
        T = targets
    else:
        T[:, : targets.shape[1], 3] = targets[:, :3]
    goals = Goal(task.position, task.sums, task.offsets, task.orientation, T, np.zeros((len(T), len(task.sums))))
    reached, is_known = np.zeros(len(T), bool), np.ones(len(T), bool)
    for k, q in enumerate(branches(screws_of(arm.file), goals, starts, seed)):
        far = clearance_depth(arm, legal_postures(arm, q), scene)
        reached[k] = bool((far > 0).any())
        is_known[k] = bool((far > CLOSE).any()) or not (np.abs(far) <= CLOSE).any()
    return Counted(reached, is_known)


def legal_postures(arm: armkin.Arm, q: Array) -> Array:
    """The postures (B, n) that have a copy by whole turns within limits, at that copy."""
    low, high = arm.lower - 1e-9, arm.upper + 1e-9
    turns = np.where(arm.prismatic, 0.0, np.ceil((low - q) / (2 * np.pi)))
    q = q + 2 * np.pi * np.where(np.isfinite(turns), turns, 0.0)
    return np.asarray(q[((q >= low) & (q <= high)).all(axis=1)])


def clearance_depth(arm: armkin.Arm, q: Array, scene: dict[str, Any]) -> Array:
    """The least distance of anything from what it must not touch, `clearance` taken off: (B, n) -> (B,) [mm]."""
    frames = armkin.frames(arm, q)
    t = np.linspace(0.0, 1.0, POINTS)[:, None]
    clouds = []
    for i, body in enumerate(scene["bodies"]):
        ends = [(np.array(segment["from"]), np.array(segment["to"])) for segment in body["segments"]]
        local = np.concatenate([a + t * (b - a) for a, b in ends] or [np.zeros((0, 3))])
        placed = np.einsum("bij,pj->bpi", frames[:, i, :3, :3], local) + frames[:, i, None, :3, 3]
        clouds.append(placed if i else np.broadcast_to(local, (len(q), *local.shape)))
    least = np.full(len(q), np.inf)
    for i, (body, cloud) in enumerate(zip(scene["bodies"], clouds, strict=True)):
        if not i or not cloud.shape[1]:
            continue
        least = np.minimum(least, cloud[:, :, 2].min(axis=1) - scene["floor"] - body["radius_mm"])
        for low, high in scene["boxes"]:
            beyond = np.maximum(low - cloud, cloud - high)
            signed = np.where(
                (beyond > 0).any(axis=2), np.linalg.norm(np.maximum(beyond, 0), axis=2), beyond.max(axis=2)
            )
            least = np.minimum(least, signed.min(axis=1) - body["radius_mm"])
        for j, neighbour in enumerate(scene["bodies"][: i - 1]):  # neighbours are never held against each other
            if clouds[j].shape[1] and {body["name"], neighbour["name"]} not in scene["left_out"]:
                away = np.linalg.norm(cloud[:, :, None] - clouds[j][:, None], axis=3).min(axis=(1, 2))
                least = np.minimum(least, away - body["radius_mm"] - neighbour["radius_mm"])
    return np.asarray(least - scene["clearance"])


def scene_of(path: Path, info: dict[str, Any]) -> dict[str, Any]:
    """What `depth` needs: from the scene's file, and the bodies of `armkin info --json`."""
    document = yaml.safe_load(path.read_text())
    boxes = [
        tuple(np.array(obstacle["box"][end], float) for end in ("min", "max"))
        for obstacle in document["keep_out"]
        if "box" in obstacle
    ]
    floor = next(obstacle["floor"] for obstacle in document["keep_out"] if "floor" in obstacle)
    left_out = [set(pair) for pair in info["pairs_left_out"]]
    return {
        "boxes": boxes, "floor": floor, "clearance": document["clearance"], "left_out": left_out,
        "bodies": info["bodies"],
    }  # fmt: skip
