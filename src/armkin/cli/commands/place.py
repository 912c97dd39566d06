"""`armkin place`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from armkin.cli.batches import compiled_ik
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import comma_separated, number
from armkin.cli.parsing.options import Cluster, Compiled, Json, Picture, Scene, Workers
from armkin.cli.printing import output, render
from armkin.errors import NoSolutionError, UsageError

if TYPE_CHECKING:
    from armkin.cli.answers import BestPlace, PlacedRobot, PlannedPlace
    from armkin.cli.answers import Place as Answer
    from armkin.engines.ordered_chunks import Engine
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.reachability.place.path_from_place import PathFromPlace
    from armkin.reachability.place.place_search import Place

RobotsAndFile = Annotated[
    list[str], typer.Argument(metavar="ROBOT... FILE", help="Robots, then a CSV of targets or a path (YAML).")
]
Area = Annotated[
    str | None,
    typer.Option("--area", metavar="XMIN,XMAX,YMIN,YMAX", help="Where places may be. [default: all that may reach]"),
]
Step = Annotated[str, typer.Option("--step", metavar="MM", help="Distance between places.")]
YawStep = Annotated[str, typer.Option("--yaw", metavar="DEG", help="Step of the yaws that are tried at each place.")]
Height = Annotated[str, typer.Option("--z", metavar="MM", help="Height of the places.")]
PlacesOut = Annotated[
    str | None,
    typer.Option("--out", "-o", metavar="FILE", help="All places: .npz, .parquet, .csv; after a kill it goes on."),
]


def place(
    words: RobotsAndFile,
    area: Area = None,
    step: Step = "50",
    yaw: YawStep = "15",
    z: Height = "0",
    scene: Scene = None,
    compiled: Compiled = False,
    workers: Workers = 1,
    cluster: Cluster = None,
    out: PlacesOut = None,
    plot: Picture = None,
    json: Json = False,
) -> None:
    """Where to put an arm, for all targets or a whole path.

    Several robots are compared, each by itself. A place is a position on a grid and a yaw, in the targets' frame; the
    best one is farthest from places that do not reach all. Of a path the best places are planned. Exit code 3: no
    place reaches all; the one that reaches most is shown.
    """
    if len(words) < 2:
        raise UsageError("place takes robots, then a file of targets or a path: armkin place ur5e targets.csv")
    from armkin.engines.ordered_chunks import Engine
    from armkin.path_file import drawing_language
    from armkin.reachability.place.place_file import write

    if drawing_language(words[-1]):
        raise UsageError(
            f"{words[-1]}: place takes targets (CSV) or a path (YAML); a drawing does not say where its zero lies"
        )
    arms = [arguments.load_arm(word) for word in words[:-1]]
    settings = _grid_settings(step, z, yaw, area)
    robot_places = _search_places(arms, words[-1], settings, scene, out, Engine(workers, cluster), compiled=compiled)
    if out is not None:
        write(robot_places, out)
    if plot is not None:
        from armkin.plot.place_picture import plot_place

        plot_place(robot_places, plot)
    answer: Answer = {"robots": [_answer(best_places) for best_places in robot_places]}
    with output.destination(None) as say:
        say(f"{render.to_json(answer)}\n" if json else _text(robot_places))
    for best_places in robot_places:
        if best_places.unplanned and best_places.reach_all:
            output.warn(f"the path is not planned from there: {best_places.unplanned}")
    if not any(best_places.reach_all for best_places in robot_places):
        raise _no_place(robot_places, "points of the path on one branch" if _is_path(words[-1]) else "targets")


def _search_places(
    arms: list[Arm],
    source: str,
    settings: dict[str, Any],
    scene: str | None,
    out: str | None,
    engine: Engine,
    *,
    compiled: bool,
) -> list[Place]:
    """The places of arms for the targets of a file, or for a path."""
    from armkin.inverse.solve import ik
    from armkin.reachability.place.place_search import place_several

    targets: list[Any] = [source if _is_path(source) else _targets(arm, source) for arm in arms]
    for arm in arms if compiled else ():
        compiled_ik.build_library(arm)
    with output.progress("positions") as tick:
        return place_several(arms, targets, settings, scene, out, engine, tick, compiled_ik.ik if compiled else ik)


def _grid_settings(step: str, z: str, yaw: str, area: str | None) -> dict[str, Any]:
    """The grid of places: mm, and radians of yaw."""
    size, height, turn = number(step, "--step"), number(z, "--z"), number(yaw, "--yaw")
    if size <= 0 or turn <= 0:
        raise UsageError("--step and --yaw must be above 0")
    bounds = None if area is None else comma_separated(area, ("xmin", "xmax", "ymin", "ymax"), "--area")
    from armkin.model.units import DEGREE

    return {"step": size, "z": height, "area": bounds, "yaw": turn * DEGREE}


def _no_place(places: Sequence[Place], targets: str) -> NoSolutionError:
    """How many of the targets are reached where no place reaches all."""
    best_place = max(places, key=lambda candidate: int(candidate.reached.max()))
    most_reached = int(best_place.reached.max())
    return NoSolutionError(
        f"no place reaches all {best_place.of} {targets}; {best_place.arm.name} reaches {most_reached} at best"
    )


def _is_path(source: str) -> bool:
    return source.lower().endswith((".yaml", ".yml"))


def _targets(arm: Arm, source: str) -> Array:
    """The targets of a file, as the arm's task reads them."""
    import numpy as np

    from armkin.cli.parsing.csv_to_numbers import batch_rows
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.model.target_numbers import targets_in

    task = task_for(arm)
    rows = [chunk.values for chunk in batch_rows(source, task.labels, f"task {task.name} of {arm.name}")]
    return targets_in(task.labels, np.concatenate(rows))


def _answer(place: Place) -> PlacedRobot:
    """A robot's best place as data of JSON [mm, deg]."""
    from armkin.model.units import DEGREE

    i, j, k = place.best
    best_place: BestPlace = {
        "xyz": place.xyz.tolist(),
        "yaw_deg": round(float(place.yaw[k] / DEGREE), 9),
        "reached": int(place.reached[i, j, k]),
        "of": place.of,
        "margin_mm": float(place.margin[i, j, k]),
    }
    if place.held:
        best_place["held"] = _held_values(place)
    counts = {"places": place.reached.size, "reach_all": place.reach_all}
    answer = cast("PlacedRobot", {**render.head(place.arm), "best": best_place, **counts})
    if place.planned:
        answer["planned"] = [_planned_json(place, plan) for plan in place.planned]
    return answer


def _held_values(place: Place) -> dict[str, float]:
    """Where the redundant joint is held at the best place [deg]."""
    from armkin.model.units import DEGREE

    return {name: round(float(value / DEGREE), 9) for name, value in place.held.items()}


def _planned_json(place: Place, plan: PathFromPlace) -> PlannedPlace:
    """A path planned from one place as data of JSON [mm, deg]."""
    from armkin.model.units import DEGREE

    i, j, k = plan.index
    return {
        "xyz": [float(place.x[i]), float(place.y[j]), place.z],
        "yaw_deg": round(float(place.yaw[k] / DEGREE), 9),
        "margin_mm": float(place.margin[i, j, k]),
        "duration_s": None if plan.plan is None else plan.plan.duration,
        "refused": plan.refused or None,
    }


def _text(places: Sequence[Place]) -> str:
    """Tables of each arm's best place [mm, deg], and of the paths that were planned from places."""
    rows = [["robot", "x/mm", "y/mm", "z/mm", "yaw/deg", "reached", "margin/mm", "places that reach all"]]
    for candidate in places:
        i, j, k = candidate.best
        count_text = f"{candidate.reached[i, j, k]} of {candidate.of}"
        numbers = [
            *map(render.short_text, candidate.xyz.tolist()),
            render.short_text(float(candidate.yaw[k]) * 57.29577951308232),
        ]
        rows.append(
            [
                candidate.arm.name,
                *numbers,
                count_text,
                f"{candidate.margin[i, j, k]:.1f}",
                f"{candidate.reach_all:,} of {candidate.reached.size:,}",
            ]
        )
    text = render.table(rows, indent="") + "\n"
    for candidate in places:
        if candidate.held:
            joints = ", ".join(f"{name} at {value:.4g}" for name, value in _held_values(candidate).items())
            text += f"{candidate.arm.name}, held there: {joints}\n"
    if any(candidate.planned for candidate in places):
        rows = [["planned from", "x/mm", "y/mm", "yaw/deg", "margin/mm", "s", ""]]
        for candidate in places:
            for plan in map(_planned_json, [candidate] * len(candidate.planned), candidate.planned):
                seconds = "" if plan["duration_s"] is None else f"{plan['duration_s']:.2f}"
                numbers = [render.short_text(x) for x in (*plan["xyz"][:2], plan["yaw_deg"], plan["margin_mm"])]
                rows.append([candidate.arm.name, *numbers, seconds, plan["refused"] or ""])
        text += "\n" + render.table(rows, left_aligned=(0, 6), indent="") + "\n"
    return text
