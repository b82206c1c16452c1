"""A logged true rate: Parquet or CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vgyro.dataset import FileReference
from vgyro.errors import DataError


def read_reference(path: Path, reference: FileReference) -> tuple[np.ndarray, np.ndarray]:
    """Time, s, ascending, and rate, deg/s, of a logged reference.  raises : DataError"""
    import pandas as pd

    wanted = [reference.time, reference.rate]
    if not path.is_file():
        raise DataError("no such file", str(path), "check `file` of the reference in dataset.yaml")
    try:
        table = pd.read_csv(path) if path.suffix.lower() in {".csv", ".txt", ".gz"} else pd.read_parquet(path)
    except (ValueError, OSError) as error:
        raise DataError(f"neither Parquet nor CSV: {error}", str(path)) from None
    missing = [name for name in wanted if name not in table.columns]
    if missing:
        found = ", ".join(map(str, table.columns))
        raise DataError(f"no column {missing[0]!r}; it has {found}", str(path), "name the columns in dataset.yaml")
    time, rate = (pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=float) for name in wanted)
    known = np.isfinite(time) & np.isfinite(rate)
    time, rate = time[known], rate[known]
    if time.size < 2 or np.any(np.diff(time) <= 0):
        raise DataError(f"{reference.time!r} does not ascend through at least 2 numbers", str(path))
    return time, rate
