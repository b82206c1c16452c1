"""rates.parquet as arrays, for the stages that read one array of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import overload

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.metrics.sampling import Sampling
from vgyro.storage.tables import read_batches, read_column, read_metadata

DEVIATION = "sd_{}"
"""Column of fused.parquet with the posterior standard deviation of another one."""


@dataclass(frozen=True)
class ArrayFile:
    """One array of one recording.

    rate [T, N] deg/s, as stored (float32 or float64), each column contiguous; segment [T] int32; at_rest [T] bool.
    Other columns are read from `path` each time they are asked for, so that a long recording need not hold them.
    axis : of the array; the reference counts only if it is about this axis
    """

    rate: np.ndarray
    segment: np.ndarray
    at_rest: np.ndarray
    rate_hz: float
    path: Path
    axis: str

    @property
    def moved(self) -> bool:
        """Did the board move in a recording that is declared to be at rest? As convert found."""
        return has_moved(self.path)

    @property
    def time(self) -> np.ndarray:
        """Time of each sample [T], s. Read from the file."""
        return read_column(self.path, "time", float)

    @property
    def reference(self) -> np.ndarray | None:
        """True rate about this axis [T], deg/s; None where it is not known. Read from the file."""
        known = "reference" in pq.read_schema(self.path).names
        about_axis = known and read_metadata(self.path).get("reference_axis", self.axis) == self.axis
        return read_column(self.path, "reference", float) if about_axis else None

    def sampling(self, most_lost_s: float) -> Sampling:
        """When all samples were taken; losses up to most_lost_s, s, do not end a stretch. Reads the times."""
        border = np.flatnonzero(self.segment[1:] != self.segment[:-1]) + 1
        time = self.time
        steps = np.rint((time[border] - time[border - 1]) * self.rate_hz).astype(np.int64)
        del time
        # Within a segment every sample is there; between two some are lost, or the board began anew.
        lost = np.cumsum(np.maximum(steps, 1) - 1)
        position = np.arange(len(self.segment))
        position += np.repeat(np.append(0, lost), np.diff(np.concatenate([[0], border, [len(position)]])))
        return Sampling.of(self.rate_hz, self.segment, position, most_lost_s)

    def rest_sampling(self, most_lost_s: float) -> Sampling:
        """When the samples at rest were taken; what moves, or was clipped, counts as lost."""
        sampling = self.sampling(most_lost_s)
        return sampling if self.at_rest.all() else sampling.without(~self.at_rest)


def has_moved(path: Path) -> bool:
    """Did the board move in a recording that is declared to be at rest? As convert wrote into rates.parquet."""
    return "moved" in read_metadata(path)


def read_array(path: Path, gyros: list[str], axis: str) -> ArrayFile:
    """Columns of `gyros` from rates.parquet.  raises : DataError if the sample rate is not known"""
    metadata = read_metadata(path)
    if metadata.get("rate_hz") is None:
        raise DataError("rates without a sample rate", str(path), "run the stage `convert` again")
    file = pq.ParquetFile(path)
    samples = file.metadata.num_rows
    kind = np.result_type(np.float32, *(file.schema_arrow.field(gyro).type.to_pandas_dtype() for gyro in gyros))
    rate = np.empty((len(gyros), samples), dtype=kind)
    segment, at_rest = np.empty(samples, dtype=np.int32), np.empty(samples, dtype=bool)
    first = 0
    for batch in read_batches(path, ["segment", "at_rest", *gyros]):
        rows = slice(first, first + len(batch["segment"]))
        segment[rows], at_rest[rows] = batch["segment"], batch["at_rest"]
        for column, gyro in zip(rate, gyros, strict=True):
            column[rows] = batch[gyro]
        first = rows.stop
    return ArrayFile(rate.T, segment, at_rest, float(metadata["rate_hz"]), path, axis)


def thermometers(board: Board, gyros: list[str]) -> list[str]:
    """Columns of rates.parquet with the temperatures of these gyros; of the board where they have none."""
    own = [f"temp_{one.name}" for one in board.temperatures if one.gyro in gyros]
    return own or [f"temp_{one.name}" for one in board.temperatures if one.gyro is None]


def read_temperature(file: ArrayFile, columns: list[str]) -> np.ndarray | None:
    """Mean of some temperatures [T], °C, in single precision; None where there is none."""
    columns = [name for name in columns if name in pq.read_schema(file.path).names]
    if not columns:
        return None
    mean, first = np.empty(len(file.segment), dtype=np.float32), 0
    for batch in read_batches(file.path, columns):
        rows = slice(first, first + len(batch[columns[0]]))
        mean[rows] = sum(batch[name] for name in columns) / len(columns)
        first = rows.stop
    return mean


def stretch_times(file: ArrayFile) -> np.ndarray:
    """Time of the first sample of each gap-free stretch [S], s."""
    return times_at(file.path, np.append(0, np.flatnonzero(np.diff(file.segment)) + 1))


def times_at(path: Path, samples: Sequence[int] | np.ndarray) -> np.ndarray:
    """Times of some samples, s; the times are read piece by piece."""
    wanted = np.asarray(samples, dtype=np.int64)
    found, first = np.full(len(wanted), math.nan), 0
    for batch in read_batches(path, ["time"]):
        inside = (wanted >= first) & (wanted < first + len(batch["time"]))
        found[inside] = batch["time"][wanted[inside] - first]
        first += len(batch["time"])
    return found


def samples_before(path: Path, moments: Sequence[float] | np.ndarray) -> np.ndarray:
    """How many samples lie before each moment, s; the times are read piece by piece."""
    found = np.zeros(len(moments), dtype=np.int64)
    for batch in read_batches(path, ["time"]):
        found += np.searchsorted(batch["time"], moments)
    return found


@dataclass(frozen=True)
class FileColumns(Sequence[np.ndarray]):
    """Columns of numbers of tables, each read when it is asked for.

    places  : file and name of each;  where : [T] samples to take, None: all
    less    : taken off, a number or an array [those samples];  cleaned : what is done to each then, None: nothing
    """

    places: Sequence[tuple[Path, str]]
    where: np.ndarray | None = None
    less: float | np.ndarray = 0.0
    cleaned: Callable[[np.ndarray], np.ndarray] | None = None

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> FileColumns: ...
    def __getitem__(self, index: int | slice) -> np.ndarray | FileColumns:
        if isinstance(index, slice):
            return replace(self, places=self.places[index])
        values = read_column(*self.places[index], float)
        if self.where is not None and not self.where.all():
            values = values[self.where]
        if np.any(self.less):
            values -= self.less
        return values if self.cleaned is None else self.cleaned(values)
