"""Writes places to a file of columns: .npz, .parquet, .jsonl or .csv."""

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
    from armkin.reachability.place.place_search import Place


def write(places: Sequence[Place], out: str | os.PathLike[str]) -> None:
    """Write all places to a file of columns, .npz, .parquet, .jsonl or .csv, and remove parts of unfinished runs."""
    path = os.fspath(out)
    file_format = format_of(path)
    table = place_columns(places)
    with files.write_whole(path, "wb") as file:
        if file_format.name == "csv":
            file.write((csv_line(list(table)) + "\n").encode())
        file_format.write_parts(file, lambda: [io.BytesIO(file_format.encoded(table))])
    Parts(path, {}).remove()


def place_columns(places: Sequence[Place]) -> Table:
    """One row for each place: robot, x, y, z [mm], yaw [deg], targets reached, number of targets, margin [mm]."""
    names = tuple(dict.fromkeys(place.arm.name for place in places))
    rows = []
    for place in places:
        x, y, yaw = (
            axis.ravel() for axis in np.meshgrid(place.x, place.y, np.degrees(place.yaw).round(9), indexing="ij")
        )
        z, target_count = np.full(x.shape, place.z), np.full(x.shape, place.of)
        robots = np.full(x.shape, names.index(place.arm.name))
        rows.append([robots, x, y, z, yaw, place.reached.ravel(), target_count, place.margin.ravel()])
    robot, *numbers = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    column_names = ("x_mm", "y_mm", "z_mm", "yaw_deg", "reached", "of", "margin_mm")
    return {"robot": Words(robot, names), **dict(zip(column_names, numbers, strict=True))}
