"""Which file a name's ending means, and how chunks become such a file."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from armkin.columns import npz, parquet, text

Source = Callable[[], Iterable[IO[bytes]]]  # opens the parts, one after the other, as often as it is called


@dataclass(frozen=True)
class Format:
    """encoded: a chunk's bytes; of text, `lines` may say what prints them. together: writes the file of all chunks."""

    name: str
    encoded: Callable[..., bytes]
    together: Callable[[IO[bytes], Source], None]
    is_text: bool = False


def _joined(file: IO[bytes], parts: Source) -> None:
    for part in parts():
        shutil.copyfileobj(part, file, 1 << 20)


CSV = Format("csv", text.csv, _joined, is_text=True)
JSON_LINES = Format("jsonl", text.json_lines, _joined, is_text=True)
_BY_ENDING = {
    ".jsonl": JSON_LINES,
    ".npz": Format("npz", npz.encoded, npz.together),
    ".parquet": Format("parquet", parquet.encoded, parquet.together),
}


def format_of(path: str | None) -> Format:
    """By the ending of a file's name; a pipe, no name and every other ending are CSV.

    >>> format_of("poses.npz").name, format_of("-").name, format_of("poses.txt").name
    ('npz', 'csv', 'csv')
    """
    return _BY_ENDING.get(Path(path).suffix.lower(), CSV) if path is not None else CSV
