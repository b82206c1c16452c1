"""Which columns of which files hold the channels of a board; channels of one table and one sensor are a stream."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.log import Log, LogArray, Place
from vgyro.storage.layout import kept_channels
from vgyro.storage.logs.table import LogColumn, LogFile, LogTable
from vgyro.validation import did_you_mean

Where = tuple[tuple[str, int | float | str], ...]


@dataclass(frozen=True)
class LogStream:
    """Channels that are sampled together.

    files   : in order, one after the other in time
    table   : of each file;  where : column and value of the rows that belong to it
    columns : channel → column
    """

    files: tuple[Path, ...]
    table: str | None
    where: Where
    columns: Mapping[str, str]

    @property
    def where_it_is(self) -> str:
        """The same with the path of its first file, for messages."""
        return f"{self.files[0]}{self.name.removeprefix(self.files[0].name)}"

    @property
    def name(self) -> str:
        """What tells it from the others of its recording, for people."""
        rows = ", ".join(f"{column} = {value}" for column, value in self.where)
        return " ".join(part for part in (self.files[0].name, self.table or "", rows) if part)


def streams_of(
    files: Sequence[Path],
    log: Log,
    board: Board,
    array: LogArray | None,
    heads: Mapping[Path, LogFile],
    left_out: Sequence[str] = (),
) -> list[LogStream]:
    """The streams of a recording, in the order of the board's gyros.

    files  : of the recording, in order, folders opened;  heads : those that can be read;  left_out : why not others
    raises : DataError if a gyro has no column; a thermometer or another channel without one is left out
    """
    readable = [path for path in files if path in heads]
    needed = {gyro.field for gyro in board.gyros}
    grouped: dict[tuple[tuple[Path, ...], str | None, Where], dict[str, str]] = {}
    order = [gyro.field for gyro in board.gyros]
    for channel in dict.fromkeys([*order, *kept_channels(board)]):
        place, said = place_of(channel, log, board, array)
        chosen = _files_of(place, readable, files, left_out)
        table = place.table if place.table is not None else log.table
        if channel not in needed and not said and not _has(heads[chosen[0]], table, place.column):
            continue
        # A thermometer of the log's only table goes with the gyros that are there, whatever tells these apart.
        key = (chosen, _table(heads[chosen[0]], table, place.column), tuple(place.where.items()))
        grouped.setdefault(key, {})[channel] = place.column
    return [LogStream(files, table, where, columns) for (files, table, where), columns in grouped.items()]


def place_of(channel: str, log: Log, board: Board, array: LogArray | None) -> tuple[Place, bool]:
    """Where a channel stands, and whether the manifest says so: by its own or its gyro's name, else by the same one."""
    names = [channel, *(gyro.name for gyro in board.gyros if gyro.field == channel)]
    for name in names:
        if (place := log.place(name)) is not None:
            return place, True
    if array is not None and channel in array.columns:
        return Place(column=array.columns[channel]), True
    return Place(column=channel), False


def _files_of(
    place: Place, readable: Sequence[Path], files: Sequence[Path], left_out: Sequence[str]
) -> tuple[Path, ...]:
    if place.file is None:
        return tuple(readable)
    chosen = [path for path in readable if _fits(path, place.file)]
    if not chosen:
        unread = [
            why for path, why in zip(files_left(files, readable), left_out, strict=False) if _fits(path, place.file)
        ]
        if unread:
            what = f"gyros stand in {place.file}, which cannot be read: {unread[0]}"
            raise DataError(what, None, "mend the file, or take its gyros out of the manifest")
        near = did_you_mean(place.file, [path.name for path in files])
        raise DataError(f"no readable file of the recording fits {place.file!r}{near}", None, "correct `file` in `log`")
    return tuple(chosen)


def _fits(path: Path, pattern: str) -> bool:
    return fnmatch.fnmatch(path.name, pattern) or path.match(pattern)


def files_left(files: Sequence[Path], readable: Sequence[Path]) -> list[Path]:
    """Files that cannot be read, in order."""
    return [path for path in files if path not in readable]


def _has(log: LogFile, table: str | None, column: str) -> bool:
    return any(one.name == column for known in log.tables if table in (None, known.name) for one in known.columns)


def _table(log: LogFile, table: str | None, column: str) -> str:
    """The table that holds a column.  raises : DataError if there is none, or several without a name given"""
    return table_of(log, table, [column]).name


def table_of(log: LogFile, table: str | None, columns: Sequence[str], ids: Sequence[str] = ()) -> LogTable:
    """The table of a log that holds some columns; `table`: by that name.

    ids    : columns that tell rows apart, which may hold text
    raises : DataError that lists what is there
    """
    where = str(log.path)
    if table is not None:
        for known in log.tables:
            if known.name == table:
                _check(known, columns, ids, where)
                return known
        names = [known.name for known in log.tables]
        raise DataError(f"has no table {table!r}{did_you_mean(table, names)}", where, "correct `table` in `log`")
    wanted = {*columns, *ids}
    fitting = [known for known in log.tables if wanted <= {column.name for column in known.columns}]
    if len(fitting) == 1:
        _check(fitting[0], columns, ids, where)
        return fitting[0]
    if fitting:
        listed = ", ".join(known.name for known in fitting)
        raise DataError(
            f"has several tables with a column {columns[0]!r}: {listed}", where, "name one: `table` in `log`"
        )
    largest = max(log.tables, key=lambda known: len(known.columns))
    _check(largest, columns, ids, where)
    raise DataError(f"has no table with the columns {', '.join(columns)}", where, "name the tables in `log.columns`")


def _check(table: LogTable, columns: Sequence[str], ids: Sequence[str], where: str) -> None:
    names = [column.name for column in table.columns]
    for column in [*columns, *ids]:
        if column not in names:
            remedy = "name the log's columns in the manifest, under `log.columns` or `array`"
            raise DataError(f"has no column {column!r}{did_you_mean(column, names)}", where, remedy)
        if column not in ids and column_of(table, column).kind == "text":
            raise DataError(f"column {column!r} holds text, not numbers", where, "name another column")


def column_of(table: LogTable, name: str) -> LogColumn:
    """The column of that name; it must be there."""
    return next(column for column in table.columns if column.name == name)
