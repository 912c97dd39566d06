"""`armkin workspace`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import is_number, whole_number
from armkin.cli.parsing.options import Cluster, Compiled, Json, Picture, Robot, Scene, Tool, Workers
from armkin.cli.printing import output, render
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.cli.answers import Workspace as Answer
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.reachability import Workspace

Samples = Annotated[
    str | None,
    typer.Option("--samples", metavar="N", help="Random poses within the limits. [default: 100000]"),
]
Grid = Annotated[
    str | None,
    typer.Option(
        "--grid",
        metavar="N[,N...]",
        help="Evenly spaced poses instead: so many on every joint, or on each.",
    ),
]
Seed = Annotated[str, typer.Option("--seed", metavar="N", help="Seed of the random poses.")]
Measures = Annotated[
    list[str] | None,
    typer.Option("--measure", metavar="NAME", help="For each sample: manipulability, step_error. Repeatable."),
]
CloudOut = Annotated[
    str | None,
    typer.Option("--out", "-o", metavar="FILE", help="All samples as .csv, .npz or .ply; whole or not at all."),
]
Color = Annotated[
    str | None,
    typer.Option(
        "--color",
        metavar="NAME",
        help="What colours the picture: manipulability (default), step_error, reach, z.",
    ),
]


def workspace(
    robot: Robot,
    samples: Samples = None,
    grid: Grid = None,
    seed: Seed = "0",
    measure: Measures = None,
    out: CloudOut = None,
    plot: Picture = None,
    color: Color = None,
    scene: Scene = None,
    tool: Tool = None,
    compiled: Compiled = False,
    workers: Workers = 1,
    cluster: Cluster = None,
    json: Json = False,
) -> None:
    """Where the tip can reach: bounds, volume, a cloud of points.

    Memory does not grow with the number of samples. step_error: how far the tip is off with every motor
    half a pulse off, in the worst combination.
    """
    from armkin.reachability import cloud_file
    from armkin.reachability.sampling import MAX_SAMPLES

    arm = arguments.load_arm(robot, scene, tool)
    if out is not None:
        cloud_file.check_cloud(out)
    if plot is None and color is not None:
        raise UsageError("--color is for the picture; add --plot FILE")
    shade = color or "manipulability"
    measures, keep = _measures_and_kept(measure, None if plot is None else shade)
    count = None if samples is None else whole_number(samples, "--samples", 1, MAX_SAMPLES)
    points = None if grid is None else _grid_points(grid)
    total = count or 100_000
    if points is not None:
        total = math.prod(points * arm.n if len(points) == 1 else points)
    with output.progress("samples", total) as tick:
        survey = armkin.workspace(
            arm,
            count,
            grid_points=points,
            seed=whole_number(seed, "--seed", 0, 2**53),
            position=partial(_compiled_tips, arm) if compiled else None,
            measures=measures,
            out=out,
            keep=keep,
            progress=tick,
            workers=workers,
            cluster=cluster,
        )
    if plot is not None:
        from armkin.plot import plot_workspace

        plot_workspace(survey, plot, colour=shade)
    answer = _answer(survey)
    with output.destination(None) as write:
        write(f"{render.to_json(answer)}\n" if json else _text(answer))


def _measures_and_kept(names: list[str] | None, shade: str | None) -> tuple[list[str], int]:
    """What is measured of each sample, and how many samples a picture by the colour `shade` keeps."""
    measures = list(dict.fromkeys(names or ()))
    if shade is None:
        return measures, 0
    from armkin.plot.workspace_picture import ENOUGH_SAMPLES
    from armkin.reachability.dexterity import MEASURES

    if shade in MEASURES and shade not in measures:
        measures.append(shade)
    return measures, ENOUGH_SAMPLES


def _compiled_tips(arm: Arm, q: Array) -> Array:
    """The tip by machine code, which each process builds or finds."""
    return armkin.compile(arm).position(q)


def _grid_points(grid: str) -> list[int]:
    """`--grid 10` or `--grid 10,20,30`."""
    from armkin.reachability.sampling import MAX_SAMPLES

    words = grid.split(",")
    if len(words) == 1 and (parts := grid.lower().replace("*", "x").split("x"))[1:] and all(map(is_number, parts)):
        raise UsageError(f"--grid {grid}: separate the counts with commas: {','.join(part.strip() for part in parts)}")
    return [whole_number(word, "--grid", 1, MAX_SAMPLES) for word in words]


def _answer(survey: Workspace) -> Answer:
    """A survey as data of JSON: ends and reach in mm, its extent in mm^3, or in mm^2 of a planar arm."""
    x, y, z = ([low, high] for low, high in zip((survey.low + 0.0).tolist(), (survey.high + 0.0).tolist(), strict=True))
    head = render.head(survey.arm)
    answer: Answer = {
        "robot": head["robot"],
        "robot_file": head["robot_file"],
        "robot_sha256": head["robot_sha256"],
        "samples": survey.samples,
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
        "reach_mm": list(survey.reach),
        "measures": {name: list(ends) for name, ends in survey.measures.items()},
        "seconds": survey.seconds,
    }
    answer.update(render.scene_and_tool(survey.arm))
    if survey.free is not None:
        answer["free_share"] = survey.free / survey.samples
    if survey.extent is not None:
        extent = survey.extent
        answer["method"] = extent.method
        if extent.dimensions == 3:
            answer["volume_mm3"], answer["volume_error_mm3"] = extent.value, extent.error
        else:
            answer["area_mm2"], answer["area_error_mm2"] = extent.value, extent.error
    return answer


def _text(answer: Mapping[str, Any]) -> str:
    """A survey as a table of its ends and measures, and the volume or area."""
    rows = [["", "least", "greatest", ""]]
    for name in ("x", "y", "z", "reach"):
        low, high = answer[f"{name}_mm"]
        note = "mm from the base" if name == "reach" else "mm"
        rows.append([name, render.fixed_text(low, 2), render.fixed_text(high, 2), note])
    for name, (low, high) in answer["measures"].items():
        rows.append([name.replace("_", " "), f"{low:.4g}", f"{high:.4g}", "mm" if name == "step_error" else ""])
    if "free_share" in answer:
        rows.append(["free", "", f"{100 * answer['free_share']:.1f}", "% of the samples hit nothing"])
    count = answer["samples"]
    text = f"{answer['robot']}: {count:,} sample{'s' * (count != 1)}\n\n{render.table(rows, left_aligned=(0, 3))}\n\n"
    measure, unit = ("volume", "mm3") if "volume_mm3" in answer else ("area", "mm2")
    value, error = answer[f"{measure}_{unit}"], answer[f"{measure}_error_{unit}"]
    error_text = f" +- {100 * error / value:.2g} %" if value else ""
    method_text = answer["method"] if answer["method"].startswith("exact") else f"by {answer['method']}"
    return f"{text}{measure} {value:.6g} {unit}{error_text}\n{render.wrap_text(method_text)}\n"
