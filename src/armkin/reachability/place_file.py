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
    format = format_of(path)
    table = columns(places)
    with files.write_whole(path, "wb") as file:
        if format.name == "csv":
            file.write((csv_line(list(table)) + "\n").encode())
        format.write_parts(file, lambda: [io.BytesIO(format.encoded(table))])
    Parts(path, {}).remove()


def columns(places: Sequence[Place]) -> Table:
    """One row a place: robot, x, y, z [mm], yaw [deg], targets reached, of how many, margin [mm]."""
    names = tuple(dict.fromkeys(one.arm.name for one in places))
    rows = []
    for one in places:
        x, y, yaw = (axis.ravel() for axis in np.meshgrid(one.x, one.y, np.degrees(one.yaw).round(9), indexing="ij"))
        z, of = np.full(x.shape, one.z), np.full(x.shape, one.of)
        which = np.full(x.shape, names.index(one.arm.name))
        rows.append([which, x, y, z, yaw, one.reached.ravel(), of, one.margin.ravel()])
    robot, *rest = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    named = ("x_mm", "y_mm", "z_mm", "yaw_deg", "reached", "of", "margin_mm")
    return {"robot": Words(robot, names), **dict(zip(named, rest, strict=True))}
