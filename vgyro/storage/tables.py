"""Artefacts on disk: Parquet tables and JSON records, written beside and renamed, with units and provenance inside.

Nothing here depends on the clock or on chance: the same columns and provenance give the same bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.errors import DataError
from vgyro.storage.schemas import SCHEMAS, units_of

if TYPE_CHECKING:
    import pandas as pd

METADATA_KEY = b"vgyro"
ROW_GROUP = 1 << 18
HASH_BLOCK = 1 << 20


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
    """

    def __init__(
        self,
        path: str | Path,
        schema: str,
        provenance: Provenance,
        extra: Mapping[str, Any] | None = None,
        compression: str = "zstd",
    ) -> None:
        self._path, self._schema, self._provenance, self._extra = Path(path), schema, provenance, dict(extra or {})
        self._compression = compression
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
        self._writer.write_table(table.cast(self._writer.schema), row_group_size=ROW_GROUP)

    def _open(self, schema: pa.Schema) -> pq.ParquetWriter:
        described = schema.with_metadata({METADATA_KEY: self._metadata(schema.names)})
        # Numbers of a measurement hardly repeat: their bytes, not a dictionary, are what can be compressed.
        numbers = [field.name for field in schema if pa.types.is_floating(field.type)]
        split = numbers if self._compression != "none" else False
        others = [field.name for field in schema if field.name not in numbers]
        return pq.ParquetWriter(
            self._beside,
            described,
            compression=self._compression,
            version="2.6",
            use_dictionary=others,
            use_byte_stream_split=split,
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
    return json.loads(metadata[METADATA_KEY])


def read_columns(path: str | Path, columns: list[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a table as NumPy arrays; list columns come as object arrays of arrays."""
    table = pq.read_table(path, columns=columns)
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


def read_batches(path: str | Path, columns: list[str]) -> Iterator[dict[str, np.ndarray]]:
    """A table's columns as NumPy arrays, ROW_GROUP rows at a time, in order."""
    for batch in pq.ParquetFile(path).iter_batches(ROW_GROUP, columns=columns):
        yield {name: batch.column(name).to_numpy(zero_copy_only=False) for name in columns}


def read_frame(path: str | Path) -> pd.DataFrame:
    """A table as a pandas data frame, for the long tables of figures."""
    return pq.read_table(path).to_pandas()


def write_json(path: str | Path, record: Mapping[str, Any]) -> None:
    """Write a JSON record, atomically, keys in the given order."""
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON record."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, atomically."""
    with atomic_path(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")
