"""`armkin reach`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import armkin
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import number, whole_number
from armkin.cli.parsing.options import Cluster, Json, Picture, Robot, Scene, Workers
from armkin.cli.printing import output, render

if TYPE_CHECKING:
    from armkin.cli.answers import Reach as Answer
    from armkin.reachability.reach_map import Reach


def reach(
    robot: Robot,
    grid: Annotated[str, typer.Option("--grid", metavar="MM", help="Size of a cell.")] = "50",
    azimuths: Annotated[str, typer.Option("--azimuths", metavar="M", help="Cells of a ring about joint 1.")] = "36",
    directions: Annotated[
        str, typer.Option("--directions", metavar="N", help="Directions of the tool's z axis in each cell.")
    ] = "100",
    rolls: Annotated[str, typer.Option("--rolls", metavar="L", help="Turns about each direction.")] = "12",
    tool_down: Annotated[bool, typer.Option("--tool-down", help="Only with the tool's z axis straight down.")] = False,
    scene: Scene = None,
    workers: Workers = 1,
    cluster: Cluster = None,
    out: Annotated[
        str | None,
        typer.Option("--out", "-o", metavar="FILE", help="All cells: .npz, .parquet, .csv; after a kill it goes on."),
    ] = None,
    plot: Picture = None,
    json: Json = False,
) -> None:
    """Where the arm reaches, with which orientations.

    Cells are sectors of rings about joint 1's axis, so that one solve answers whole arcs of azimuths and rolls,
    exactly. Columns of --out: centre, share of orientations, branches, places that one branch alone reaches, measures.
    """
    from armkin.reachability.reach_cells import MAX_CELLS, Grid

    arm = arguments.load_arm(robot, scene)
    step, ring = number(grid, "--grid"), whole_number(azimuths, "--azimuths", 1, MAX_CELLS)
    direction_count = whole_number(directions, "--directions", 1, MAX_CELLS)
    turns = whole_number(rolls, "--rolls", 1, MAX_CELLS)
    cells = Grid(arm=arm, step=step, azimuths=ring, directions=direction_count, rolls=turns, tool_down=tool_down)
    with output.progress("cells", len(cells.rings) * ring) as tick:
        reach_map = armkin.reach(
            arm,
            grid=step,
            azimuths=ring,
            directions=direction_count,
            rolls=turns,
            tool_down=tool_down,
            out=out,
            workers=workers,
            cluster=cluster,
            progress=tick,
        )
    if plot is not None:
        from armkin.plot.reach_picture import plot_reach

        plot_reach(reach_map, plot)
    answer = _answer(reach_map)
    with output.destination(None) as write:
        write(f"{render.to_json(answer)}\n" if json else _text(answer))


def _answer(reach: Reach) -> Answer:
    """A map as data of JSON."""
    return {
        **render.head(reach.grid.arm),
        "task": reach.grid.task.name,
        "cells": reach.cells,
        "orientations": reach.orientations,
        "answers": reach.answers,
        "solves": reach.solves,
        "method": "arcs" if reach.method == "arcs" else "poses",
        "reached": reach.reached,
        "volume_mm3": reach.volume_mm3,
        "seconds": reach.seconds,
    }


def _text(answer: Answer) -> str:
    share = 100 * answer["reached"] / answer["cells"]
    method_text = "by arcs of joint 1" if answer["method"] == "arcs" else "pose by pose"
    return (
        f"{answer['robot']}: {answer['reached']:,} of {answer['cells']:,} cells reached ({share:.1f} %), "
        f"{answer['volume_mm3'] / 1e9:.4g} m3\n\n"
        f"{answer['answers']:,} poses (task {answer['task']}, {_orientations_text(answer['orientations'])} a cell) "
        f"from {answer['solves']:,} solves {method_text}, in {answer['seconds']:.2f} s\n"
    )


def _orientations_text(count: int) -> str:
    return f"{count:,} orientation{'s' * (count != 1)}"
