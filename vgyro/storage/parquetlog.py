"""Archived Parquet logs → frames: one file, a folder, or folders by date; counts or rates."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.errors import DataError
from vgyro.log import Log as ParquetLog
from vgyro.storage.frames import Frames, channel_watches
from vgyro.storage.integrity import FileRecord, Integrity, Ledger
from vgyro.storage.layout import kept_channels
from vgyro.storage.sources import check_exists
from vgyro.storage.tables import sha256_of_file
from vgyro.storage.verdict import Outcome, conclude, refuse_if_needed
from vgyro.validation import did_you_mean

ROWS = 1 << 18
GAP_PERIODS = 1.5
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def log_files(paths: Sequence[str | Path]) -> list[Path]:
    """Parquet files of a recording: those named, and all in the folders that are named, by path.

    Numbers in a path count as numbers, so that day=9 comes before day=10.
    raises : DataError if a path is missing, a folder holds no Parquet file, a file is not Parquet
    """
    found: list[Path] = []
    for path in map(Path, paths):
        check_exists(path)
        inside = sorted(path.rglob("*.parquet"), key=_natural) if path.is_dir() else [path]
        if not inside:
            raise DataError("holds no .parquet file", str(path), "check `files` in the manifest")
        found += inside
    return found


def _natural(path: Path) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", path.as_posix())
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in parts]


@dataclass
class LogReader:
    """Parquet logs of one recording, streamed. A row is a frame; a row without a value is damage.

    log     : how columns and values are to be understood
    rate_hz : rows a second
    """

    paths: Sequence[str | Path]
    log: ParquetLog
    board: Board
    rate_hz: float
    options: IntegrityOptions
    integrity: Integrity | None = None

    def __post_init__(self) -> None:
        self._files = [_opened(path) for path in log_files(self.paths)]
        self._columns = self._mapped(pq.read_schema(self._files[0]), self._files[0])
        self._ledger = Ledger()
        self._watches = channel_watches(self.board, rates=self.log.values == "rates")
        self._good = self._repeated = 0
        self._rows = 0  # of all files so far, good or not
        self._segment = -1
        self._last: float | None = None  # time of the last good row, s since the first
        self._zero: float | None = None
        self._in_step = 0
        self._in_step_s = 0.0
        self._next_row = 0
        self._raw = 0.0  # time column of the last row
        self._shifted = False  # true once the time column went back

    @property
    def expected_frames(self) -> int:
        """As many as the logs have rows."""
        return sum(pq.read_metadata(path).num_rows for path in self._files)

    def __iter__(self) -> Iterator[Frames]:
        """Read row group by row group.  raises : DataError, Refused"""
        wanted = list(dict.fromkeys([*self._columns.values(), *([self.log.time] if self.log.time else [])]))
        for path in self._files:
            self._check_columns(pq.read_schema(path), path, wanted)
            before = self._rows
            with pq.ParquetFile(path) as file:
                for batch in file.iter_batches(batch_size=ROWS, columns=wanted):
                    yield from self._batch(batch, path, before)
        self._conclude()

    def _batch(self, batch: pa.RecordBatch, path: Path, before: int) -> Iterator[Frames]:
        rows = np.arange(self._rows, self._rows + batch.num_rows)
        self._rows += batch.num_rows
        good = self._whole(batch, path, before, rows)
        values = {name: _numbers(batch, column, good, path) for name, column in self._columns.items()}
        rows = rows[good]
        if not len(rows):
            return
        time, step = self._times(batch, good, rows, path)
        fresh = self._fresh(values, step)
        values = {name: column[fresh] for name, column in values.items()}
        rows, time, step = rows[fresh], time[fresh], step[fresh]
        self._repeated += int(len(fresh) - fresh.sum())
        if not len(rows):
            return
        yield self._frames(values, rows, time, step)

    def _frames(self, values: dict[str, np.ndarray], rows: np.ndarray, time: np.ndarray, step: np.ndarray) -> Frames:
        """Place the rows on the clock; note gaps."""
        period = 1 / self.rate_hz
        missing = np.where(step > GAP_PERIODS * period, np.rint(step / period) - 1, 0).astype(np.int64)
        begins = (missing > 0) | (step <= 0)
        if self._segment < 0:
            begins[0], missing[0] = True, 0
        segment = self._segment + np.cumsum(begins).astype(np.int32)
        counter = self._next_row + np.cumsum(missing) + np.arange(len(rows))
        backward = step <= 0
        for index in np.flatnonzero(begins).tolist():
            if self._segment < 0 and index == 0:
                continue
            last = float(time[index] - step[index]) if not backward[index] else float(time[index]) - period
            if backward[index]:
                self._ledger.add_gap(last + period, None, None, "the time column goes back")
            else:
                lasted, lost = float(step[index]) - period, int(missing[index])
                self._ledger.add_gap(last + period, lasted, lost, self._gap_cause())
        plain = ~begins
        self._in_step += int(plain.sum())
        self._in_step_s += float(step[plain].sum())
        self._good += len(rows)
        self._segment, self._next_row, self._last = int(segment[-1]), int(counter[-1]) + 1, float(time[-1])
        for name, watch in self._watches.items():
            if name in values:
                watch.feed(values[name], time)
        return Frames(values, counter, time, segment)

    def _gap_cause(self) -> str:
        return "the time column jumps" if self.log.time else "rows without a value"

    def _whole(self, batch: pa.RecordBatch, path: Path, before: int, rows: np.ndarray) -> np.ndarray:
        """bool [n]: rows that have a value in every column; the others are written down as damage."""
        good = np.ones(batch.num_rows, dtype=bool)
        for name in batch.schema.names:
            column = batch.column(name)
            good &= ~column.is_null(nan_is_null=pa.types.is_floating(column.type)).to_numpy(zero_copy_only=False)
        bad = np.flatnonzero(~good)
        for run in np.split(bad, np.flatnonzero(np.diff(bad) > 1) + 1) if len(bad) else ():
            first = int(rows[run[0]]) - before
            self._ledger.bad += len(run)
            cause = "rows without a value (start and stop are rows)"
            self._ledger.add_damage(path.name, first, first + len(run), len(run), cause)
        return good

    def _times(
        self, batch: pa.RecordBatch, good: np.ndarray, rows: np.ndarray, path: Path
    ) -> tuple[np.ndarray, np.ndarray]:
        """Time of each good row, s since the first, and the step from the row before; 1 period where time goes back."""
        period = 1 / self.rate_hz
        raw = _seconds(batch, self.log.time, good, path) if self.log.time else rows / self.rate_hz
        if self._zero is None:
            self._zero, self._raw = float(raw[0]), float(raw[0]) - period
        step = np.diff(raw, prepend=self._raw)
        self._raw = float(raw[-1])
        # Where time goes back nothing is known: the row follows a period after the one before.
        forward = np.where(step < 0, period, step)
        start = -period if self._last is None else self._last
        if (step < 0).any() or self._shifted:
            self._shifted = True
            time = start + np.cumsum(forward)
        else:
            time = raw - self._zero
        return time, np.where(step < 0, -1.0, step)

    def _fresh(self, values: dict[str, np.ndarray], step: np.ndarray) -> np.ndarray:
        """bool [n]: false for a row with the time and the values of the row before."""
        same = step == 0
        for column in values.values():
            same[1:] &= column[1:] == column[:-1]
        same[0] = False
        return ~same

    def _mapped(self, schema: pa.Schema, path: Path) -> dict[str, str]:
        """Channel of the board → column of the log."""
        by_gyro = {gyro.name: gyro.field for gyro in self.board.gyros}
        channels = self.board.channels
        named = {}
        for name, column in self.log.columns.items():
            channel = name if name in channels else by_gyro.get(name)
            if channel is None:
                known = [*channels, *by_gyro]
                raise DataError(
                    f"board {self.board.name!r} has no channel {name!r}{did_you_mean(name, known)}", str(path)
                )
            named[channel] = column
        needed = [gyro.field for gyro in self.board.gyros]
        columns = {}
        for channel in kept_channels(self.board):
            column = named.get(channel, channel)
            if channel in named or channel in needed or column in schema.names:
                columns[channel] = column
        self._check_columns(schema, path, [*columns.values(), *([self.log.time] if self.log.time else [])])
        return columns

    def _check_columns(self, schema: pa.Schema, path: Path, columns: list[str]) -> None:
        for column in columns:
            if column not in schema.names:
                near = did_you_mean(column, list(schema.names))
                remedy = "map the board's channels to the log's columns under `parquet.columns` in the manifest"
                raise DataError(f"has no column {column!r}{near}", str(path), remedy)
            kind = schema.field(column).type
            timely = column == self.log.time and pa.types.is_temporal(kind)
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or timely):
                raise DataError(f"column {column!r} holds {kind}, not numbers", str(path), "name another column")

    def _conclude(self) -> None:
        where = str(self.paths[0]) if len(self.paths) == 1 else f"{self.paths[0]} and {len(self.paths) - 1} more"
        measured = self._in_step / self._in_step_s if self.log.time and self._in_step_s > 0 else None
        outcome = Outcome(
            board=self.board,
            values=self.log.values,
            files=[
                FileRecord(
                    _shown(path, self.paths), path.stat().st_size, sha256_of_file(path), "parquet", path.stat().st_size
                )
                for path in self._files
            ],
            good=self._good,
            repeated=self._repeated,
            end_s=self._last,
            declared_rate_hz=self.rate_hz,
            measured_rate_hz=measured,
            segments=self._segment + 1,
        )
        channels = {name: watch.record() for name, watch in self._watches.items() if watch.samples}
        self.integrity = conclude(outcome, self._ledger, channels, self.options, [])
        refuse_if_needed(self.integrity, self.options, where, lambda: "check `parquet` and `rate_hz` in the manifest")


def _shown(path: Path, paths: Sequence[str | Path]) -> str:
    """The file's name, with the date folders it lies in."""
    for folder in map(Path, paths):
        if folder.is_dir() and path.is_relative_to(folder):
            return path.relative_to(folder).as_posix()
    return path.name


def _opened(path: Path) -> Path:
    if path.stat().st_size == 0:
        raise DataError("is empty: 0 bytes", str(path), "copy it again, or take it off the list")
    try:
        pq.read_schema(path)
    except pa.ArrowInvalid:
        remedy = "take `parquet:` away if it is a dump; else copy it again"
        raise DataError("is not a readable Parquet file", str(path), remedy) from None
    return path


def _numbers(batch: pa.RecordBatch, column: str, good: np.ndarray, path: Path) -> np.ndarray:
    try:
        return batch.column(column).filter(pa.array(good)).to_numpy(zero_copy_only=False)
    except pa.ArrowInvalid as error:
        raise DataError(f"column {column!r} cannot be read: {error}", str(path), "name another column") from None


def _seconds(batch: pa.RecordBatch, column: str, good: np.ndarray, path: Path) -> np.ndarray:
    """The time column in s; Arrow time stamps are converted."""
    kind = batch.schema.field(column).type
    if pa.types.is_temporal(kind):
        if not (pa.types.is_timestamp(kind) or pa.types.is_duration(kind)):
            raise DataError(f"column {column!r} holds {kind}; a time stamp or a number of seconds is needed", str(path))
        ticks = batch.column(column).filter(pa.array(good)).cast(pa.int64()).to_numpy(zero_copy_only=False)
        return ticks * SECONDS[kind.unit]
    return _numbers(batch, column, good, path).astype(np.float64)
