"""Columns of numbers from .npz, .parquet and .jsonl, some rows at a time."""

import itertools
import json
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from armkin.columns import parquet
from armkin.columns.joint_columns import places_of_columns
from armkin.errors import FileError, UsageError
from armkin.formula.arrays import Array


def reader_of(path: str) -> Callable[[str, Sequence[str], bool, int], Iterator[Array]] | None:
    """What reads a file of columns, by its ending; None: it is text of rows.

    It is called with the path, the columns wanted, whether these are joints, and how many rows to give at a time, and
    yields (N, columns).
    """
    return {".npz": _read_npz, ".parquet": _read_parquet, ".jsonl": _read_json_lines}.get(Path(path).suffix.lower())


def _wanted_names(path: str, heading: Sequence[str], names: Sequence[str], of_joints: bool) -> list[str]:
    """The file's names of the columns wanted."""
    places_of = places_of_columns(heading, names, of_joints)
    missing_names = [name for name, places_found in places_of.items() if not places_found]
    if missing_names:
        heading_text = ", ".join(heading[:20])
        raise UsageError(
            f"{path} has no column{'s' * (len(missing_names) > 1)} {', '.join(missing_names)}; it has {heading_text}"
        )
    doubled_names = [name for name, places_found in places_of.items() if len(places_found) > 1]
    if doubled_names:
        raise UsageError(f"{path} has two columns {doubled_names[0]}")
    return [heading[places_found[0]] for places_found in places_of.values()]


def _read_npz(path: str, names: Sequence[str], of_joints: bool, rows: int) -> Iterator[Array]:
    """Columns `names` of a .npz, (at most rows, columns) at a time. Raises FileError for what cannot be read."""
    try:
        with ExitStack() as stack:
            archive = stack.enter_context(zipfile.ZipFile(path))
            heading = [name.removesuffix(".npy") for name in archive.namelist()]
            files = [
                stack.enter_context(archive.open(f"{name}.npy"))
                for name in _wanted_names(path, heading, names, of_joints)
            ]
            heads = [_array_head(path, name, file) for name, file in zip(names, files, strict=True)]
            if len({count for count, _ in heads}) > 1:
                raise UsageError(f"{path}: its columns are not of one length")
            for start in range(0, heads[0][0], rows):
                rows_read = min(rows, heads[0][0] - start)
                columns = [
                    np.frombuffer(file.read(rows_read * dtype.itemsize), dtype)
                    for file, (_, dtype) in zip(files, heads, strict=True)
                ]
                yield np.column_stack(columns).astype(float)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, UsageError):
            raise
        raise FileError(f"{path}: cannot read: {getattr(error, 'strerror', None) or error}", file=path) from None


def _array_head(path: str, name: str, file: Any) -> tuple[int, np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    if len(shape) != 1 or dtype.kind not in "iuf":
        raise UsageError(f"{path}: {name} is no column of numbers: its shape is {shape}, its type {dtype}")
    return shape[0], dtype


def _read_parquet(path: str, names: Sequence[str], of_joints: bool, rows: int) -> Iterator[Array]:
    """Blocks of so many rows of a Parquet file: the columns named (N, k)."""
    pa = parquet.require_pyarrow()
    try:
        file = pa.parquet.ParquetFile(path)
        chosen_names = _wanted_names(path, file.schema_arrow.names, names, of_joints)
        for batch in file.iter_batches(batch_size=rows, columns=chosen_names):
            columns = [batch.column(name) for name in chosen_names]
            for name, column in zip(chosen_names, columns, strict=True):
                if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
                    raise UsageError(f"{path}: {name} is no column of numbers: its type is {column.type}")
            yield np.column_stack(
                [column_data.cast(pa.float64()).to_numpy(zero_copy_only=False) for column_data in columns]
            )
    except (OSError, pa.ArrowException) as error:
        raise FileError(f"{path}: cannot read: {getattr(error, 'strerror', None) or error}", file=path) from None


def _read_json_lines(path: str, names: Sequence[str], of_joints: bool, rows: int) -> Iterator[Array]:
    """Blocks of so many rows of a JSON Lines file: the columns named (N, k)."""
    chosen_names: list[str] = []
    try:
        with open(path, encoding="utf-8-sig") as file:
            numbered = ((i, line) for i, line in enumerate(file, 1) if line.strip())
            while lines := list(itertools.islice(numbered, rows)):
                table = []
                for number, line in lines:
                    row = _row_object(path, number, line)
                    chosen_names = chosen_names or _wanted_names(path, list(row), names, of_joints)
                    table.append([_cell_number(path, number, name, row.get(name)) for name in chosen_names])
                yield np.array(table, dtype=float)
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot read: {getattr(error, 'strerror', None) or error}", file=path) from None


def _row_object(path: str, number: int, line: str) -> dict[str, Any]:
    try:
        pairs = json.loads(line, object_pairs_hook=tuple)
    except ValueError:
        pairs = None
    if not isinstance(pairs, tuple):
        raise UsageError(f"{path}: row {number}: this is no JSON object", row=number)
    row = dict(pairs)
    if len(row) < len(pairs):
        doubled = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
        raise UsageError(f"{path}: row {number}: it has {doubled} twice", row=number)
    return row


def _cell_number(path: str, number: int, name: str, value: Any) -> float:
    if value is None:
        return np.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{path}: row {number}: {name}: {json.dumps(value)[:40]} is no number", row=number)
    try:
        cell = float(value)
    except OverflowError:
        cell = np.inf
    if not np.isfinite(cell):
        raise UsageError(
            f"{path}: row {number}: {name}: {value:.10} is not finite"
            if isinstance(value, float)
            else f"{path}: row {number}: {name}: a number of {len(str(value))} digits is too large",
            row=number,
        )
    return cell
