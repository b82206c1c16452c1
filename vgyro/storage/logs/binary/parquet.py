"""Parquet logs: one table, streamed by row group.

Times keep their ns; lists of numbers are spread over columns name[0], name[1], …; structs over name.field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from vgyro.errors import DataError
from vgyro.storage.logs.binary.opened import (
    WIDEST,
    OpenedLog,
    Unique,
    batch_of,
    check_not_empty,
    reading,
    rows_at_a_time,
)  # fmt: skip
from vgyro.storage.logs.table import Kind, LogColumn, LogRows, LogTable

Take = Callable[[pa.Array], pa.Array]


class ParquetLeaf(NamedTuple):
    """A column of the table, and how it is taken from the file's column number `root`."""

    column: LogColumn
    root: int
    take: Take


def open_log(path: Path) -> OpenedLog:
    """Open a Parquet file; only its footer is read.

    Rows of a list that are shorter than the first one have nulls at their end. Bytes, maps and complex nested types are
    left out.
    raises : DataError for a file that is not Parquet
    """
    import pyarrow.parquet as pq

    check_not_empty(path)
    with reading("Parquet file", path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        schema = file.schema_arrow
        leaves = _leaves(schema, _first_row(file, schema), path)
        count = file.metadata.num_rows
    found = {leaf.column.name: leaf for leaf in leaves}
    table = LogTable("", tuple(leaf.column for leaf in leaves), count)
    tables = (table,) if any(column.kind == "number" for column in table.columns) else ()

    def stream(_: OpenedLog, __: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        return _stream(path, schema, [found[name] for name in columns])

    return OpenedLog(path, "parquet", tables, stream)


def _first_row(file: Any, schema: pa.Schema) -> pa.RecordBatch | None:
    """Some rows of the columns that are lists without a fixed length; None where there are none."""
    names = [field.name for field in schema if _is_list(field.type)]
    if not names:
        return None
    return next(file.iter_batches(batch_size=64, columns=names, use_threads=False), None)


def _is_list(kind: pa.DataType) -> bool:
    lists: bool = pa.types.is_list(kind) or pa.types.is_large_list(kind)
    return lists


def _leaves(schema: pa.Schema, first: pa.RecordBatch | None, path: Path) -> list[ParquetLeaf]:
    unique, leaves = Unique(), list[ParquetLeaf]()
    for root, field in enumerate(schema):
        width = 0
        if first is not None and _is_list(field.type) and (index := first.schema.get_field_index(field.name)) >= 0:
            width = max((len(row) for row in first.column(index) if row.is_valid), default=0)
        for name, kind, unit, take in islice(_spread(field.name, field.type, width), WIDEST + 1):
            said = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
            leaves.append(ParquetLeaf(LogColumn(unique(name), kind, unit or said), root, take))
        if len(leaves) > WIDEST:
            raise DataError(f"has more than {WIDEST} columns", str(path), "save time along the rows")
    return leaves


class _Found(NamedTuple):
    """A column: its name, kind and unit, and how it is taken."""

    name: str
    kind: Kind
    unit: str
    take: Take


def _spread(name: str, kind: pa.DataType, width: int) -> Iterator[_Found]:
    """The columns that one of the file makes."""
    if (found := _plain(kind)) is not None:
        yield _Found(name, *found)
    elif pa.types.is_fixed_size_list(kind) or _is_list(kind):
        fixed = kind.list_size if pa.types.is_fixed_size_list(kind) else width
        if (found := _plain(kind.value_type)) is not None:
            value, unit, inner = found
            for index in range(fixed):
                yield _Found(f"{name}[{index}]", value, unit, _then(partial(_element, index), inner))
    elif pa.types.is_struct(kind):
        for index, field in enumerate(kind):
            for inner_name, value, unit, inner in _spread(f"{name}.{field.name}", field.type, 0):
                yield _Found(inner_name, value, unit, _then(partial(_field, index), inner))


def _field(index: int, array: pa.Array) -> pa.Array:
    import pyarrow.compute as pc

    return pc.struct_field(array, [index])


def _element(index: int, array: pa.Array) -> pa.Array:
    """The values at one place of lists of any length; null where a list is too short.

    Unlike list_element, which raises there.
    """
    import pyarrow.compute as pc

    parts = pc.list_slice(array, index, index + 1, return_fixed_size_list=True)
    return parts.flatten() if not parts.null_count else pc.list_flatten(pc.fill_null(parts, [None]))


def _then(first: Take, second: Take) -> Take:
    return lambda array: second(first(array))


def _plain(kind: pa.DataType) -> tuple[Kind, str, Take] | None:
    """Kind, unit and conversion of a type that makes one column; None for a nested one and for bytes."""
    types = pa.types
    if types.is_dictionary(kind):
        inner = _plain(kind.value_type)
        return inner and (inner[0], inner[1], _then(lambda array: array.dictionary_decode(), inner[2]))
    if types.is_timestamp(kind) or types.is_date(kind):
        return "date", "", lambda array: array.cast(pa.timestamp("ns", getattr(kind, "tz", None))).cast(pa.int64())
    if types.is_time(kind):
        return "day", "", lambda array: array.cast(pa.time64("ns")).cast(pa.int64())
    if types.is_duration(kind):
        return "number", "ns", lambda array: array.cast(pa.duration("ns")).cast(pa.int64())
    if types.is_boolean(kind):
        return "number", "", lambda array: array.cast(pa.uint8())
    if types.is_float16(kind):
        return "number", "", lambda array: array.cast(pa.float32())
    if types.is_decimal(kind):
        return "number", "", lambda array: array.cast(pa.float64())
    if types.is_integer(kind) or types.is_floating(kind):
        return "number", "", lambda array: array
    if types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind):
        # By way of bytes, so that damaged text is found.
        return "text", "", lambda array: array.cast(pa.large_binary()).cast(pa.string())
    return None


def _stream(path: Path, schema: pa.Schema, leaves: Sequence[ParquetLeaf]) -> Iterator[LogRows]:
    import pyarrow.parquet as pq

    names = list(dict.fromkeys(schema.field(leaf.root).name for leaf in leaves))
    place = 1
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        for batch in file.iter_batches(rows_at_a_time(len(leaves)), columns=names, use_threads=False):
            arrays = [leaf.take(_column(batch, schema, leaf.root)) for leaf in leaves]
            yield LogRows(batch_of([leaf.column.name for leaf in leaves], arrays), place)
            place += batch.num_rows


def _column(batch: pa.RecordBatch, schema: pa.Schema, root: int) -> pa.Array:
    """The file's column number `root`, though names may be there twice and the batch holds few of them."""
    name = schema.field(root).name
    before = schema.names[:root].count(name)
    return batch.column([at for at, held in enumerate(batch.schema.names) if held == name][before])
