"""Tables as numpy's .npz: one array a column."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterable
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from armkin.columns.table import Column, Table, Words


def encoded(table: Table) -> bytes:
    """A table as the bytes of an .npz."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, column in table.items():
            with archive.open(member(name), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, _array(column), allow_pickle=False)
    return out.getvalue()


def together(file: IO[bytes], parts: Callable[[], Iterable[IO[bytes]]]) -> None:
    """One .npz of several, column by column: memory does not grow with their number."""
    heads: dict[str, list[tuple[int, np.dtype[Any]]]] = {}
    for part in parts():
        archive = zipfile.ZipFile(part)
        for name in archive.namelist():
            heads.setdefault(name, []).append(_header(archive, name))
    with zipfile.ZipFile(file, "w") as whole:
        for name, each in heads.items():
            dtype = np.result_type(*(dtype for _, dtype in each))
            with whole.open(member(name.removesuffix(".npy")), "w", force_zip64=True) as out:
                shape = (sum(count for count, _ in each),)
                described = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(out, described)
                for part in parts():
                    with zipfile.ZipFile(part).open(name) as source:
                        out.write(np.lib.format.read_array(source).astype(dtype, copy=False).tobytes())


def member(name: str) -> zipfile.ZipInfo:
    """An archive's entry for a column, with a date of its own, so that the same columns are the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))


def _array(column: Column) -> NDArray[Any]:
    return column.texts() if isinstance(column, Words) else column


def _header(archive: zipfile.ZipFile, name: str) -> tuple[int, np.dtype[Any]]:
    with archive.open(name) as file:
        np.lib.format.read_magic(file)
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    return int(shape[0]), dtype
