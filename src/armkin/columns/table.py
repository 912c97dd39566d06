"""A table: columns of one length, by name, in the order in which they are written."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Words:
    """A column of few words: index (N,) into names, -1 where there is none."""

    index: NDArray[np.integer]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.index)

    def texts(self) -> NDArray[np.str_]:
        """The words (N,), "" where there is none."""
        return np.asarray(np.array([*self.names, ""])[self.index])


Column = NDArray[Any] | Words  # numbers: nan is a cell without one
Table = dict[str, Column]


def row_count(table: Table) -> int:
    """How many rows a table has."""
    return len(next(iter(table.values()))) if table else 0


def take_rows(table: Table, rows: slice) -> Table:
    """Some rows of a table."""
    return {
        name: Words(column.index[rows], column.names) if isinstance(column, Words) else column[rows]
        for name, column in table.items()
    }


def join_tables(tables: Sequence[Table]) -> Table:
    """Tables of the same columns, one behind the other."""
    if len(tables) == 1:
        return tables[0]
    return {name: _join_columns([table[name] for table in tables]) for name in tables[0]}


def _join_columns(columns: Sequence[Any]) -> Column:
    if isinstance(columns[0], Words):
        return Words(np.concatenate([column.index for column in columns]), columns[0].names)
    return np.concatenate(columns)


def table_of_records(heading: Sequence[str], records: Sequence[Sequence[Any]]) -> Table:
    """A table of rows of numbers, words and None."""
    columns = zip(*records, strict=True) if records else [()] * len(heading)
    return {name: _column_of_values(values) for name, values in zip(heading, columns, strict=True)}


def _column_of_values(values: Sequence[Any]) -> Column:
    if any(isinstance(value, str) for value in values):
        names = tuple(dict.fromkeys(value for value in values if value is not None))
        place = {name: i for i, name in enumerate(names)} | {None: -1}
        return Words(np.array([place[value] for value in values], dtype=np.int64), names)
    if any(value is None for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(values)
