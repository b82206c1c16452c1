"""What every family of logs gives: tables of named columns, streamed as record batches.

A log file holds one or more tables: a text file one a kind of line, a bag one a topic, a .mat file one a variable. A
reader of a family is one module with one function `open_log`, and one entry in vgyro.storage.logs.families.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import pyarrow as pa

Kind = Literal["number", "date", "day", "text"]


@dataclass(frozen=True)
class LogColumn:
    """One column of a table.

    name : as the file has it, unique in its table; of arrays of numbers, name[0], name[1], …
    kind : number (Arrow integers or floats); date (date and time: Arrow int64, ns since 1970); day (time of day: int64,
           ns since midnight); text (anything else)
    unit : as the file has it beside the name, such as deg/s in "gx (deg/s)"; empty where there is none
    """

    name: str
    kind: Kind = "number"
    unit: str = ""


@dataclass(frozen=True)
class LogTable:
    """One table of a log.

    name : topic, variable or kind of line; empty where the file holds a single table
    rows : number of rows; None where only reading tells
    text : what a person would be told about its form, as short phrases: "delimiter ;", "decimal comma", "no header"
    """

    name: str
    columns: tuple[LogColumn, ...]
    rows: int | None = None
    text: tuple[str, ...] = ()


@dataclass(frozen=True)
class BadLine:
    """A line (or row) that is damage: place from 1 (a line of a text, else a row), what it holds, what does not fit."""

    place: int
    found: str
    expected: str


class LogRows(NamedTuple):
    """Some rows of a table.

    batch : the wanted columns, in the wanted order; a missing value is null or NaN
    place : line (of a text) or row of the first one, from 1
    bad   : lines before or among them that are damage and are not in the batch; the first 1000 of the file, at most
    """

    batch: pa.RecordBatch
    place: int
    bad: tuple[BadLine, ...] = ()


@dataclass
class Account:
    """What was read, for the integrity record; complete when the last batch was given.

    rows  : rows given;  bad : damaged lines;  other : lines of other kinds, comments and headers (no damage)
    notes : warnings as sentences, such as "the last line has no end: taken, for it has all its fields"
    sha256 : of the file, where it was taken while it was read; else empty
    """

    rows: int = 0
    bad: int = 0
    other: int = 0
    notes: list[str] = field(default_factory=list)
    content_bytes: int = 0
    compression: str = "none"
    sha256: str = ""


class LogFile(Protocol):
    """An opened log. Opening reads its head alone.

    raises : DataError for a file that is not of the family, with the first place that does not fit
    """

    path: Path
    family: str
    account: Account

    @property
    def tables(self) -> tuple[LogTable, ...]:
        """The tables that hold numbers, in the file's order."""

    def rows(self, table: str, columns: Sequence[str]) -> Iterator[LogRows]:
        """Stream some columns of one table, at most about 2^18 rows at a time.

        raises : DataError for a table or column that is not there, and for a file that breaks off with nothing read;
                 one that breaks off later gives what is there, and a note in the account
        """
