"""Places as a file of columns: .npz, .parquet, .jsonl or .csv."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from armkin import files
from armkin.columns.csv_cells import csv_line
from armkin.columns.finished_chunks import Parts
from armkin.columns.formats import format_of
from armkin.columns.table import Table, Words

if TYPE_CHECKING:
    from armkin.reachability.place_search import Place


def write(places: Sequence[Place], out: str | os.PathLike[str]) -> None:
    """All places as a file of columns: .npz, .parquet, .jsonl or .csv; parts of an unfinished run go."""
    path = os.fspath(out)
    file_format = format_of(path)
    table = place_columns(places)
    with files.write_whole(path, "wb") as file:
        if file_format.name == "csv":
            file.write((csv_line(list(table)) + "\n").encode())
        file_format.write_parts(file, lambda: [io.BytesIO(file_format.encoded(table))])
    Parts(path, {}).remove()


def place_columns(places: Sequence[Place]) -> Table:
    """One row a place: robot, x, y, z [mm], yaw [deg], targets reached, of how many, margin [mm]."""
    names = tuple(dict.fromkeys(place.arm.name for place in places))
    rows = []
    for place in places:
        x, y, yaw = (
            axis.ravel() for axis in np.meshgrid(place.x, place.y, np.degrees(place.yaw).round(9), indexing="ij")
        )
        z, of = np.full(x.shape, place.z), np.full(x.shape, place.of)
        robots = np.full(x.shape, names.index(place.arm.name))
        rows.append([robots, x, y, z, yaw, place.reached.ravel(), of, place.margin.ravel()])
    robot, *numbers = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    named = ("x_mm", "y_mm", "z_mm", "yaw_deg", "reached", "of", "margin_mm")
    return {"robot": Words(robot, names), **dict(zip(named, numbers, strict=True))}
