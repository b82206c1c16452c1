"""rates.parquet as arrays, for the stages that read one array of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import overload

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.fusion.samples.missing import fill_missing
from vgyro.metrics.sampling import Sampling
from vgyro.runs import run_starts
from vgyro.storage.tables import read_batches, read_column, read_metadata
from vgyro.tasks.rates.block_means import between

DEVIATION = "sd_{}"
"""Column of fused.parquet with the posterior standard deviation of another one."""


@dataclass(frozen=True)
class ArrayFile:
    """One array of one recording.

    rate [T, N] deg/s, as stored (float32 or float64), each column contiguous; segment [T] int32; at_rest [T] bool,
    false also in the rows in which no gyro of the array has a value: they are lost.
    missing [T, N] bool : where a gyro has no value, and `rate` holds what fill_missing made from the other gyros; None
    where nothing is missing. Figures of a gyro leave these samples out.
    Other columns are read from `path` each time they are asked for, so that a long recording need not hold them.
    axis : of the array; the reference counts only if it is about this axis
    """

    rate: np.ndarray
    segment: np.ndarray
    at_rest: np.ndarray
    rate_hz: float
    path: Path
    axis: str
    missing: np.ndarray | None = None

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
        border = run_starts(self.segment)[1:]
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


def lost_rows(path: Path, gyros: Sequence[str], axis: str) -> np.ndarray | None:
    """bool [T]: the rows in which none of the axis' gyros has a value; None where convert found none."""
    if not read_metadata(path).get("lost_rows", {}).get(axis):
        return None
    parts = [np.logical_and.reduce([np.isnan(batch[gyro]) for gyro in gyros])
             for batch in read_batches(path, list(gyros))]  # fmt: skip
    return np.concatenate(parts)


def incomplete(path: Path, gyros: Sequence[str]) -> list[str]:
    """The gyros that lack values in some samples, as convert counted them."""
    missing = read_metadata(path).get("missing", {})
    return [gyro for gyro in gyros if missing.get(gyro)]


def read_frame(path: Path, gyros: Sequence[str], axis: str) -> ArrayFile:
    """The file without rates of gyros; its lost rows are not at rest.  gyros : of the axis"""
    frame, lost = read_array(path, [], axis), lost_rows(path, gyros, axis)
    return frame if lost is None else replace(frame, at_rest=frame.at_rest & ~lost)


def read_array(path: Path, gyros: list[str], axis: str) -> ArrayFile:
    """Columns of `gyros`, all those of one axis, from rates.parquet; what they lack is filled in, see ArrayFile.

    raises : DataError if the sample rate is not known
    """
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
    rate_hz = float(metadata["rate_hz"])
    missing = fill_missing(rate.T, rate_hz)
    if missing is not None:
        at_rest &= ~missing.all(axis=1)
    return ArrayFile(rate.T, segment, at_rest, rate_hz, path, axis, missing)


def thermometers(board: Board, gyros: list[str]) -> list[str]:
    """Columns of rates.parquet with the temperatures of these gyros; of the board where they have none."""
    own = [f"temp_{one.name}" for one in board.temperatures if one.gyro in gyros]
    return own or [f"temp_{one.name}" for one in board.temperatures if one.gyro is None]


def read_temperature(file: ArrayFile, columns: list[str]) -> np.ndarray | None:
    """Mean of some temperatures [T], °C, in single precision; None where there is none.

    Between the values of a thermometer slower than the gyros: on straight lines, and held at the ends.
    """
    columns = [name for name in columns if name in pq.read_schema(file.path).names]
    if not columns:
        return None
    mean, first = np.empty(len(file.segment), dtype=np.float32), 0
    for batch in read_batches(file.path, columns):
        rows = slice(first, first + len(batch[columns[0]]))
        mean[rows] = sum(batch[name] for name in columns) / len(columns)
        first = rows.stop
    if not np.isnan(mean).any():
        return mean
    return _interpolated(file, columns)


def _interpolated(file: ArrayFile, columns: list[str]) -> np.ndarray | None:
    """Mean of temperatures that lack values, each interpolated in time; None if none has any."""
    time, total, count = file.time, np.zeros(len(file.segment)), 0
    for name in columns:
        values = between(time, read_column(file.path, name, float))
        if np.isfinite(values).all():
            total, count = total + values, count + 1
    return (total / count).astype(np.float32) if count else None


def stretch_times(file: ArrayFile) -> np.ndarray:
    """Time of the first sample of each gap-free stretch [S], s."""
    return times_at(file.path, run_starts(file.segment))


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
    held    : file and name → the column [T], which is not read then
    """

    places: Sequence[tuple[Path, str]]
    where: np.ndarray | None = None
    less: float | np.ndarray = 0.0
    cleaned: Callable[[np.ndarray], np.ndarray] | None = None
    held: Mapping[tuple[Path, str], np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> FileColumns: ...
    def __getitem__(self, index: int | slice) -> np.ndarray | FileColumns:
        if isinstance(index, slice):
            return replace(self, places=self.places[index])
        place = self.places[index]
        values = self.held[place].copy() if place in self.held else read_column(*place, float)
        if self.where is not None and not self.where.all():
            values = values[self.where]
        if np.any(self.less):
            values -= self.less
        return values if self.cleaned is None else self.cleaned(values)
