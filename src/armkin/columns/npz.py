"""Tables as numpy's .npz: one array a column."""

import io
import json
import zipfile
from collections.abc import Callable, Iterable
from typing import IO, Any, NamedTuple

import numpy as np

from armkin.columns.table import Column, Table, Words


class _Kept(NamedTuple):
    """A column of a part: where its numbers begin in the file, how many, of which type; words: they are indices."""

    name: str
    offset: int
    rows: int
    dtype: np.dtype[Any]
    words: tuple[str, ...] | None

    @property
    def written_dtype(self) -> np.dtype[Any]:
        """The type that is written."""
        return self.dtype if self.words is None else np.array([*self.words, ""]).dtype

    def read(self, part: IO[bytes]) -> Column:
        """The column's values, (rows,), read from its part of the file."""
        part.seek(self.offset)
        values = np.frombuffer(part.read(self.rows * self.dtype.itemsize), self.dtype)
        return values if self.words is None else Words(values, self.words)


def encode_table(table: Table) -> bytes:
    """A table as a part: a line of JSON about its columns, then their numbers; `write_parts` makes an .npz of parts."""
    columns = [
        (column.index, column.names) if isinstance(column, Words) else (column, None) for column in table.values()
    ]
    head = [[name, len(array), array.dtype.str, words] for name, (array, words) in zip(table, columns, strict=True)]
    return b"".join([json.dumps(head).encode(), b"\n", *(np.ascontiguousarray(values).data for values, _ in columns)])


def decode_table(encoded: bytes) -> Table:
    """The table of a part."""
    part = io.BytesIO(encoded)
    return {column.name: column.read(part) for column in _stored_columns(part)}


def write_parts(file: IO[bytes], parts: Callable[[], Iterable[IO[bytes]]]) -> None:
    """One .npz of several, column by column: memory does not grow with their number."""
    heads = [_stored_columns(part) for part in parts()]
    with zipfile.ZipFile(file, "w") as archive:
        for i, (name, *_) in enumerate(heads[0] if heads else []):
            dtype = np.result_type(*(head[i].written_dtype for head in heads))
            with archive.open(archive_member(name), "w", force_zip64=True) as member_file:
                shape = (sum(head[i].rows for head in heads),)
                array_header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member_file, array_header)
                for part, head in zip(parts(), heads, strict=True):
                    column = head[i].read(part)
                    values = column.texts() if isinstance(column, Words) else column
                    member_file.write(np.ascontiguousarray(values, dtype).view(np.uint8).data)


def archive_member(name: str) -> zipfile.ZipInfo:
    """An archive's entry for a column, with a date of its own, so that the same columns are the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))


def _stored_columns(part: IO[bytes]) -> list[_Kept]:
    """What stands in a part, from where it is read now."""
    head, columns = json.loads(part.readline()), []
    offset = part.tell()
    for name, count, kind, words in head:
        dtype = np.dtype(kind)
        columns.append(_Kept(name, offset, count, dtype, None if words is None else tuple(words)))
        offset += count * dtype.itemsize
    return columns
