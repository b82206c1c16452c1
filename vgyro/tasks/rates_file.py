"""rates.parquet as arrays, for the stages that read one array of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from vgyro.errors import DataError
from vgyro.storage.tables import read_columns, read_metadata


@dataclass(frozen=True)
class ArrayFile:
    """One array of one recording.

    rate [T, N] deg/s; time, segment, at_rest [T]; reference [T] deg/s about this axis, None where it is not known
    """

    rate: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    at_rest: np.ndarray
    reference: np.ndarray | None
    rate_hz: float

    def rest_segment(self) -> np.ndarray:
        """Number [R] of the stretch, at rest and without a gap, of each sample at rest."""
        breaks = np.diff(self.at_rest, prepend=False) | (np.diff(self.segment, prepend=self.segment[:1]) != 0)
        return np.cumsum(breaks)[self.at_rest]


def read_array(path: Path, gyros: list[str], axis: str) -> ArrayFile:
    """Columns of `gyros` from rates.parquet.  raises : DataError if the sample rate is not known"""
    names = pq.read_schema(path).names
    columns = ["time", "segment", "at_rest", *gyros]
    metadata = read_metadata(path)
    about_axis = "reference" in names and metadata.get("reference_axis", axis) == axis
    table = read_columns(path, [*columns, "reference"] if about_axis else columns)
    if metadata.get("rate_hz") is None:
        raise DataError("rates without a sample rate", str(path), "run the stage `convert` again")
    samples = len(table["time"])
    rate = np.column_stack([table[gyro] for gyro in gyros]) if samples else np.empty((0, len(gyros)))
    reference = table["reference"] if about_axis else None
    return ArrayFile(
        rate, table["time"], table["segment"], table["at_rest"].astype(bool), reference, float(metadata["rate_hz"])
    )
