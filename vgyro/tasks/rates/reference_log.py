"""A logged true rate: Parquet or CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.arrays import Floats
from vgyro.dataset import FileReference
from vgyro.errors import DataError


def read_reference(path: Path, reference: FileReference) -> tuple[np.ndarray, np.ndarray]:
    """Time, s, ascending, and rate, deg/s, of a logged reference.  raises : DataError"""
    wanted = [reference.time, reference.rate]
    if not path.is_file():
        raise DataError("no such file", str(path), "check `file` of the reference in dataset.yaml")
    try:
        columns = _read(path, wanted)
    except (ValueError, OSError) as error:
        raise DataError(f"neither Parquet nor CSV: {error}", str(path)) from None
    missing = [name for name in wanted if name not in columns]
    if missing:
        found = ", ".join(columns)
        raise DataError(f"no column {missing[0]!r}; it has {found}", str(path), "name the columns in dataset.yaml")
    time, rate = (_numbers(columns[name]) for name in wanted)
    known = np.isfinite(time) & np.isfinite(rate)
    time, rate = time[known], rate[known]
    if time.size < 2 or np.any(np.diff(time) <= 0):
        raise DataError(f"{reference.time!r} does not ascend through at least 2 numbers", str(path))
    return time, rate


def _read(path: Path, wanted: list[str]) -> Mapping[str, Any]:
    """Name → column of all columns; of a Parquet file only those that are wanted are read."""
    if path.suffix.lower() in {".csv", ".txt", ".gz"}:
        import pandas as pd

        table = pd.read_csv(path)
        return {str(name): table[name] for name in table.columns}
    file = pq.ParquetFile(path)
    names = file.schema_arrow.names
    read = file.read(columns=[name for name in wanted if name in names])
    return {name: read.column(name) if name in read.column_names else None for name in names}


def _numbers(column: Any) -> np.ndarray:
    """Floats; NaN for what is none."""
    if isinstance(column, pa.ChunkedArray) and (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        given: Floats = column.to_numpy().astype(float)
        return given
    import pandas as pd

    values = column.to_pandas() if isinstance(column, pa.ChunkedArray) else column
    numbers: Floats = pd.to_numeric(values, errors="coerce").to_numpy(dtype=float)
    return numbers
