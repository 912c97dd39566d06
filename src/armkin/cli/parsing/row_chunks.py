"""Poses or targets in chunks of rows, wherever they come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armkin.formula.arrays import Array

CHUNK_ROWS = 32_768  # rows in memory at a time


class Chunk(NamedTuple):
    """Some rows: their numbers in the file, from 1, and their values (N, m)."""

    numbers: Sequence[int]
    values: Array

    def numbers_array(self) -> NDArray[np.integer]:
        """The numbers (N,)."""
        import numpy as np

        numbers = self.numbers
        return np.arange(numbers.start, numbers.stop) if isinstance(numbers, range) else np.array(numbers)


def one_row(values: Sequence[float]) -> Chunk:
    """A chunk of the one row that the command line gives."""
    import numpy as np

    return Chunk([1], np.array([values]))


def all_rows(values: Sequence[Sequence[float]]) -> Iterator[Chunk]:
    """Chunks of rows that are there already."""
    import numpy as np

    for start in range(0, len(values), CHUNK_ROWS):
        part = values[start : start + CHUNK_ROWS]
        yield Chunk(range(start + 1, start + 1 + len(part)), np.array(part))
