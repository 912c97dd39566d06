"""Which file a name's ending means, and how chunks become such a file."""

import os
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import IO

from armkin.columns import csv_and_json_lines, npz, parquet

Source = Callable[[], Iterable[IO[bytes]]]  # opens the parts, one after the other, as often as it is called


@dataclass(frozen=True)
class Format:
    """A format of files of rows.

    encoded: a chunk's bytes; of text, its parameter `lines` may print them. write_parts: writes the file of all chunks.
    """

    name: str
    encoded: Callable[..., bytes]
    write_parts: Callable[[IO[bytes], Source], None]
    is_text: bool = False


def _join_parts(file: IO[bytes], parts: Source) -> None:
    for part in parts():
        shutil.copyfileobj(part, file, 1 << 20)


CSV = Format("csv", csv_and_json_lines.to_csv, _join_parts, is_text=True)
JSON_LINES = Format("jsonl", csv_and_json_lines.to_json_lines, _join_parts, is_text=True)
_BY_ENDING = {
    ".npz": Format("npz", npz.encode_table, npz.write_parts),
    ".parquet": Format("parquet", parquet.encode_table, parquet.write_parts),
    ".jsonl": JSON_LINES,
    ".csv": CSV,
}
ENDINGS = tuple(_BY_ENDING)


def format_of(path: str | None) -> Format:
    """The format that a file name's ending says; no name, any other ending and a pipe are CSV.

    >>> format_of("poses.npz").name, format_of("-").name, format_of("poses.txt").name
    ('npz', 'csv', 'csv')
    """
    if path is None or (os.path.exists(path) and not os.path.isfile(path)):
        return CSV
    return _BY_ENDING.get(os.path.splitext(path.lower())[1], CSV)
