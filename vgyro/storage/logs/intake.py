"""Log files → the rows of each stream, as logged: stamps, channels, what is damaged. Nothing is placed in time yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vgyro.arrays import Bools
from vgyro.errors import DataError
from vgyro.log import TO_DEG_S, Log, LogArray, LogTime, RateUnit
from vgyro.storage.integrity import Ledger
from vgyro.storage.logs.spool import Spool
from vgyro.storage.logs.streams import LogStream, column_of, table_of
from vgyro.storage.logs.table import LogFile, LogRows

STAMP, SAME = "\0stamp", "\0same"
"""Columns of a spool beside the channels: the stamp, and whether a row equals the one before in every channel."""

TIME_UNITS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "ms": "ms", "msec": "ms", "millis": "ms", "milliseconds": "ms", "us": "us", "µs": "us", "μs": "us", "usec": "us",
    "micros": "us", "microseconds": "us", "ns": "ns", "nsec": "ns", "nanoseconds": "ns", "min": "min",
}  # fmt: skip


@dataclass
class Intake:
    """The rows of one stream.

    spool   : channels, STAMP (where there is a time column) and SAME
    time    : the time column with its unit as far as the log tells it; None where there is none
    kind    : of that column: number, date or day
    damaged : rows of the spool before which a line is damaged, for a log without stamps
    infinite : channel → values that were infinite, and count as missing
    """

    stream: LogStream
    time: LogTime | None
    kind: str
    spool: Spool = field(default_factory=Spool)
    damaged: list[int] = field(default_factory=list)
    infinite: dict[str, int] = field(default_factory=dict)
    _last: dict[str, np.ndarray] = field(default_factory=dict)

    def take(self, batch: pa.RecordBatch, factors: Mapping[str, float]) -> None:
        """Keep the rows of a batch that belong to the stream."""
        batch = self.own(batch)
        if not batch.num_rows:
            return
        columns = {}
        for channel, column in self.stream.columns.items():
            values = numbers(batch.column(column))
            if values.dtype.kind == "f" and (infinite := int(np.isinf(values).sum())):
                self.infinite[channel] = self.infinite.get(channel, 0) + infinite
                values = np.where(np.isinf(values), np.nan, values)
            columns[channel] = values * factors[channel] if factors.get(channel, 1.0) != 1.0 else values
        same = self._same(columns)
        if self.time is not None:
            columns[STAMP] = numbers(batch.column(self.time.column))
        self.spool.append({**columns, SAME: same})

    def own(self, batch: pa.RecordBatch) -> pa.RecordBatch:
        """The rows that belong to the stream."""
        for column, value in self.stream.where:
            batch = batch.filter(matches(batch.column(column), value))
        return batch

    def _same(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        same = np.ones(len(next(iter(columns.values()))), dtype=bool)
        for channel, values in columns.items():
            before = self._last.get(channel)
            if before is None:
                same[0] = False
            else:
                same[0] &= _equal(values[:1], before)[0]
            same[1:] &= _equal(values[1:], values[:-1])
            # A view would keep its whole block in memory.
            self._last[channel] = values[-1:].copy()
        return same


def _equal(values: np.ndarray, others: np.ndarray) -> Bools:
    equal = values == others
    same: Bools = equal | (np.isnan(values) & np.isnan(others)) if values.dtype.kind == "f" else equal
    return same


def numbers(column: pa.Array) -> np.ndarray:
    """A column of numbers; whole ones stay whole where none is missing, a missing one is NaN.

    raises : ValueError for a column of something else
    """
    kind = column.type
    if pa.types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif pa.types.is_decimal(kind) or pa.types.is_null(kind):
        column = column.cast(pa.float64())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise ValueError(f"a column of {kind} holds no numbers")
    if column.null_count and not pa.types.is_floating(column.type):
        column = column.cast(pa.float64(), safe=False)
    found: np.ndarray = column.to_numpy(zero_copy_only=False)
    return found


def matches(column: pa.Array, value: int | float | str) -> pa.Array:
    """Which rows hold a value, as number or as text: 2, 2.0 and "2" are one."""
    kind = column.type
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        wanted = as_number(value)
        if wanted is None:
            return pa.array(np.zeros(len(column), dtype=bool))
        found = pc.equal(column.cast(pa.float64()), wanted)
    else:
        said = f"{value:g}" if isinstance(value, float) else str(value)
        found = pc.equal(pc.utf8_trim_whitespace(column.cast(pa.string())), said)
    return pc.fill_null(found, False)


def as_number(value: int | float | str) -> float | None:
    """A value of an id column as a number; None for a word."""
    try:
        return float(value)
    except ValueError:
        return None


@dataclass
class Taken:
    """What a recording's files gave. left_out: files that could not be read, or not to their end, as sentences."""

    intakes: list[Intake]
    left_out: list[str]
    notes: list[str]


def take_in(
    streams: Sequence[LogStream],
    log: Log,
    array: LogArray | None,
    heads: Mapping[Path, LogFile],
    ledger: Ledger,
    names: Mapping[Path, str],
) -> Taken:
    """Read every file once and sort its rows by stream.

    heads : the opened logs;  ledger : gets the damaged lines;  names : of the files, for people
    raises : DataError where a column is missing, and where no file can be read
    """
    factors = {} if array is None else {gyro.name: factor_of(gyro.unit) for gyro in array.gyros}
    taken = Taken([Intake(stream, *time_of(stream, log, heads)) for stream in streams], [], [])
    groups: dict[tuple[tuple[Path, ...], str | None], list[Intake]] = {}
    for intake in taken.intakes:
        groups.setdefault((intake.stream.files, intake.stream.table), []).append(intake)
    for (files, table), intakes in groups.items():
        for path in files:
            try:
                _read(heads[path], table, intakes, factors, ledger, names[path])
            except DataError as error:
                if len(heads) == 1:
                    raise
                taken.left_out.append(str(error))
            taken.notes += [f"{names[path]}: {note}" for note in heads[path].account.notes]
    if not any(intake.spool.rows for intake in taken.intakes) and taken.left_out:
        raise DataError(taken.left_out[0])
    return taken


def factor_of(unit: RateUnit | None) -> float:
    """deg/s a unit; 1 for counts."""
    return 1.0 if unit is None else TO_DEG_S[unit]


def time_of(stream: LogStream, log: Log, heads: Mapping[Path, LogFile]) -> tuple[LogTime | None, str]:
    """The time column of a stream with its unit, and its kind.  raises : DataError if it is not there"""
    if log.stamp is None:
        return None, ""
    first = heads[stream.files[0]]
    table = table_of(first, stream.table, [log.stamp.column])
    found = column_of(table, log.stamp.column)
    if log.stamp.unit == "auto" and found.kind == "number":
        unit = TIME_UNITS.get(found.unit.strip().lower(), "auto")
        return log.stamp.model_copy(update={"unit": unit}), found.kind
    return log.stamp, found.kind


def _read(
    opened: LogFile,
    table: str | None,
    intakes: Sequence[Intake],
    factors: Mapping[str, float],
    ledger: Ledger,
    shown: str,
) -> None:
    stamps = [intake.time.column for intake in intakes if intake.time is not None]
    tests = [column for intake in intakes for column, _ in intake.stream.where]
    wanted = list(dict.fromkeys([*(one for intake in intakes for one in intake.stream.columns.values()), *stamps]))
    name = table_of(opened, table, wanted, tests).name
    for rows in opened.rows(name, list(dict.fromkeys([*wanted, *tests]))):
        _note(rows, shown, intakes, ledger)
        for intake in intakes:
            intake.take(rows.batch, factors)
    ledger.bad += opened.account.bad


def _note(rows: LogRows, name: str, intakes: Sequence[Intake], ledger: Ledger) -> None:
    for number, line in enumerate(rows.bad):
        ledger.add_damage(name, line.place, line.place + 1, 0, f"{line.found!r}: {line.expected}")
        for intake in intakes:
            if intake.time is None:
                # Lines of other kinds aside, the rows before it in this batch.
                before = min(max(line.place - rows.place - number, 0), rows.batch.num_rows)
                intake.damaged.append(intake.spool.rows + intake.own(rows.batch.slice(0, before)).num_rows)
