"""Keeps the results of chunks beside the file that they become, so that an interrupted run can be resumed."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

from armkin.columns import npz
from armkin.columns.finished_chunks import Parts
from armkin.columns.table import Table
from armkin.engines.ordered_chunks import Engine, in_order


class NumberedChunk(Protocol):
    """A part of the work with a number."""

    @property
    def number(self) -> int:
        """The index of the chunk, from 0."""


Chunk = TypeVar("Chunk", bound=NumberedChunk)


@contextmanager
def hold_parts(parts: Parts | None, count: int) -> Iterator[None]:
    """Keep the parts of a file of `count` chunks during the block, unless there is only one."""
    if parts is not None and count > 1:
        parts.begin()
    try:
        yield
    finally:
        if parts is not None:
            parts.leave()


def chunk_tables(
    engine: Engine,
    work: Callable[[Any, Chunk], tuple[int, Table]],
    job: Any,
    chunks: Iterable[Chunk],
    parts: Parts | None,
) -> Iterator[tuple[int, Table]]:
    """Number and columns of all chunks in any order, read if an earlier run kept them, else computed and kept."""
    kept_numbers: deque[int] = deque()

    def missing_chunks() -> Iterator[Chunk]:
        for chunk in chunks:
            if parts is not None and parts.is_held and parts.record_of(chunk.number) is not None:
                kept_numbers.append(chunk.number)
            else:
                yield chunk

    def read_kept() -> Iterator[tuple[int, Table]]:
        while parts is not None and kept_numbers:
            number = kept_numbers.popleft()
            yield number, npz.decode_table(parts.read(number))

    for number, columns in in_order(engine, work, job, missing_chunks()):
        if parts is not None and parts.is_held:
            parts.keep(number, {}, npz.encode_table(columns))
        yield number, columns
        yield from read_kept()
    yield from read_kept()
