"""Artefacts on disk: Parquet tables and JSON records, written beside and renamed, with units and provenance inside.

Nothing here depends on the clock or on chance: the same columns and provenance give the same bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.errors import DataError
from vgyro.storage.schemas import SCHEMAS, units_of

METADATA_KEY = b"vgyro"
ROW_GROUP = 1 << 18
HASH_BLOCK = 1 << 20
COUNTED = ("frames", "rates", "series")
"""Tables whose numbers come from the counts of a converter: few different ones, over and over."""


@dataclass(frozen=True)
class Provenance:
    """Where an artefact comes from: SHA-256 of its inputs (by name), of the options it used and of the code."""

    inputs: Mapping[str, str]
    options: str
    code: str


def sha256_of_file(path: str | Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while block := stream.read(HASH_BLOCK):
            digest.update(block)
    return digest.hexdigest()


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; rename it when the block ends well, remove it when it does not."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.part")
    try:
        yield beside
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)


class TableWriter:
    """Write a table in batches: `with TableWriter(path, "frames", provenance) as writer: writer.append(columns)`.

    Every batch must have the columns and types of the first. Units come from the schema's declaration
    (vgyro.storage.schemas); a column that the schema does not declare is an error. Each batch begins a row group.

    extra       : JSON-able, added to the metadata
    compression : of Parquet; "none" for a file that is read once
    row_group   : most rows in a row group
    """

    def __init__(
        self,
        path: str | Path,
        schema: str,
        provenance: Provenance,
        extra: Mapping[str, Any] | None = None,
        compression: str = "zstd",
        row_group: int = ROW_GROUP,
    ) -> None:
        self._path, self._schema, self._provenance, self._extra = Path(path), schema, provenance, dict(extra or {})
        self._compression, self._row_group = compression, row_group
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> TableWriter:
        self._atomic = atomic_path(self._path)
        self._beside = self._atomic.__enter__()
        return self

    def append(self, columns: Mapping[str, Any] | pa.Table) -> None:
        """Add rows: a mapping of column name to array or list, or an Arrow table."""
        table = columns if isinstance(columns, pa.Table) else pa.table(dict(columns))
        if self._writer is None:
            self._writer = self._open(table.schema)
        self._writer.write_table(table.cast(self._writer.schema), row_group_size=self._row_group)

    @property
    def begun(self) -> bool:
        """Was anything appended, be it an empty table?"""
        return self._writer is not None

    def _open(self, schema: pa.Schema) -> pq.ParquetWriter:
        described = schema.with_metadata({METADATA_KEY: self._metadata(schema.names)})
        # Computed numbers hardly repeat: their bytes, not a dictionary, are what can be compressed.
        counted = self._schema in COUNTED
        floats = [field.name for field in schema if pa.types.is_floating(field.type)]
        # Floats in frames are those of a log, or of a board that sends them: measured values, few of which repeat.
        numbers = [name for name in floats if not counted or name == "time" or self._schema == "frames"]
        encoding = dict.fromkeys(numbers if self._compression != "none" else (), "BYTE_STREAM_SPLIT")
        whole = [field.name for field in schema if counted and pa.types.is_integer(field.type)]
        encoding.update(dict.fromkeys(whole, "DELTA_BINARY_PACKED"))
        others = [field.name for field in schema if field.name not in (*numbers, *whole)]
        return pq.ParquetWriter(
            self._beside,
            described,
            compression=self._compression,
            version="2.6",
            use_dictionary=others,
            column_encoding=encoding or None,
        )

    def _metadata(self, names: list[str]) -> bytes:
        record = {
            "schema": self._schema,
            "version": SCHEMAS[self._schema].version,
            "units": units_of(self._schema, names),
            "provenance": asdict(self._provenance),
            **self._extra,
        }
        return json.dumps(record, sort_keys=True).encode()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.close()
        elif kind is None:
            kind, error = ValueError, ValueError(f"no rows were appended to {self._path}; append an empty table")
        self._atomic.__exit__(kind, error, trace)


def write_table(
    path: str | Path,
    columns: Mapping[str, Any] | pa.Table,
    schema: str,
    provenance: Provenance,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write a whole table at once; `extra` (JSON-able) is added to the metadata. See TableWriter."""
    with TableWriter(path, schema, provenance, extra) as writer:
        writer.append(columns)


def read_metadata(path: str | Path) -> dict[str, Any]:
    """Schema name, version, units per column, provenance and extras of an artefact.

    raises : DataError if the file is not an artefact of vgyro
    """
    metadata = pq.read_schema(path).metadata or {}
    if METADATA_KEY not in metadata:
        raise DataError("not an artefact of vgyro", str(path), "run the stage that makes it again")
    known: dict[str, Any] = json.loads(metadata[METADATA_KEY])
    return known


def read_columns(path: str | Path, columns: list[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a table as NumPy arrays; list columns come as object arrays of arrays."""
    # Not pq.read_table: that loads pyarrow.dataset.
    table = pq.ParquetFile(path).read(columns=columns)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def read_rows(path: str | Path, columns: list[str], start: int, stop: int) -> dict[str, np.ndarray]:
    """Rows start to stop - 1 of some columns, as read_columns gives them; reads only the row groups that hold them.

    Rows that the table does not have are left out.
    """
    file = pq.ParquetFile(path)
    sizes = [file.metadata.row_group(index).num_rows for index in range(file.num_row_groups)]
    edges = np.concatenate([[0], np.cumsum(sizes)])
    groups = np.flatnonzero((edges[:-1] < stop) & (edges[1:] > start))
    table = file.read_row_groups(groups.tolist(), columns=columns)
    first = start - int(edges[groups[0]]) if len(groups) else 0
    table = table.slice(first, max(0, stop - start))
    return {name: table.column(name).to_numpy() for name in columns}


def row_groups(
    path: str | Path, columns: list[str] | None = None, first: int = 0, every: int = 1
) -> Iterator[pa.Table]:
    """The row groups of a table, in order: from number `first` on, each `every`th."""
    # Not iter_batches: that keeps all pages that it has read until the end.
    file = pq.ParquetFile(path)
    for index in range(first, file.num_row_groups, every):
        yield file.read_row_group(index, columns=columns)


def read_batches(path: str | Path, columns: list[str]) -> Iterator[dict[str, np.ndarray]]:
    """Columns of a table as NumPy arrays, a row group at a time, in order."""
    for table in row_groups(path, columns):
        yield {name: table.column(name).to_numpy() for name in columns}


def read_column(path: Path, name: str, kind: type | None = None) -> np.ndarray:
    """One column of numbers of a table [T], read piece by piece: little more memory than it takes itself.

    kind : type of the numbers, None: as stored; as floats, missing ones are NaN
    """
    values = np.empty(pq.read_metadata(path).num_rows, kind or pq.read_schema(path).field(name).type.to_pandas_dtype())
    first = 0
    for batch in read_batches(path, [name]):
        last = first + len(batch[name])
        values[first:last] = batch[name]
        first = last
    return values


class RowStream:
    """Rows of tables that follow each other, taken from the front in any number; holds little more than it gives."""

    def __init__(self, tables: Iterable[pa.Table]) -> None:
        self._tables = iter(tables)
        self._held: list[pa.Table] = []

    def take(self, count: int) -> pa.Table:
        """The next `count` rows, fewer at the end.  raises : ValueError if there is no table at all"""
        while not self._held or sum(table.num_rows for table in self._held) < count:
            table = next(self._tables, None)
            if table is None:
                break
            self._held.append(table)
        if not self._held:
            raise ValueError("no table to take rows from")
        whole = pa.concat_tables(self._held).unify_dictionaries()
        self._held = [whole.slice(count)]
        return whole.slice(0, count)


def words(codes: np.ndarray, names: Sequence[str]) -> pa.DictionaryArray:
    """Codes [T], places in `names`, as a dictionary-encoded column; it holds only the names that occur, sorted."""
    occurring = np.bincount(codes, minlength=len(names)) > 0
    kept = sorted({name for name, there in zip(names, occurring, strict=True) if there})
    places = np.array([kept.index(name) if there else 0 for name, there in zip(names, occurring, strict=True)])
    return pa.DictionaryArray.from_arrays(pa.array(places.astype(np.int32)[codes]), pa.array(kept, pa.string()))


def write_json(path: str | Path, record: Mapping[str, Any]) -> None:
    """Write a JSON record, atomically, keys in the given order."""
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON record."""
    content: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
    return content


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, atomically."""
    with atomic_path(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")
