"""Tables as Parquet, by pyarrow: numbers without a value are null."""

import io
from collections.abc import Callable, Iterable
from typing import IO, Any

from armkin.columns.table import Column, Table, Words
from armkin.errors import MissingExtraError


def require_pyarrow() -> Any:
    """pyarrow. Raises MissingExtraError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise MissingExtraError("Parquet needs pyarrow: pip install 'armkin[tables]'") from None
    return pyarrow


def encode_table(table: Table) -> bytes:
    """A table as the bytes of an Arrow stream, which `write_parts` makes a row group of."""
    pa = require_pyarrow()
    arrow_table = pa.table({name: _arrow_array(pa, column) for name, column in table.items()})
    stream_bytes = io.BytesIO()
    with pa.ipc.new_stream(stream_bytes, arrow_table.schema) as stream:
        stream.write_table(arrow_table)
    return stream_bytes.getvalue()


def write_parts(file: IO[bytes], parts: Callable[[], Iterable[IO[bytes]]]) -> None:
    """One Parquet file, a row group a part."""
    pa = require_pyarrow()
    writer = None
    for part in parts():
        table = pa.ipc.open_stream(part.read()).read_all()
        if writer is None:
            words = [field.name for field in table.schema if pa.types.is_string(field.type)]
            # a dictionary of numbers of which no two are equal takes time and room
            writer = pa.parquet.ParquetWriter(file, table.schema, use_dictionary=words)
        writer.write_table(table)
    if writer is not None:
        writer.close()


def _arrow_array(pa: Any, column: Column) -> Any:
    if isinstance(column, Words):
        names = pa.array([*column.names, None], pa.string())
        return names.take(pa.array(column.index % (len(column.names) + 1)))
    return pa.array(column, from_pandas=True)
