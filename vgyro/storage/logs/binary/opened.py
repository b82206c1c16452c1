"""What the readers of binary logs share: checked reading of a table, and the one place where a library's errors end."""

from __future__ import annotations

import io
import logging
import math
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TypeVar

import pyarrow as pa

from vgyro.errors import DataError
from vgyro.storage.logs.table import Account, LogRows, LogTable
from vgyro.validation import did_you_mean

ROWS = 1 << 18
VALUES = 1 << 22
"""Most values of a batch: a wide table has fewer rows in each."""
WIDEST = 4096
"""Most columns of a table: more are time along the wrong axis, pictures or damage."""

DAMAGE: tuple[type[Exception], ...] = (
    ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, MemoryError, NotImplementedError, OSError,
    RecursionError, RuntimeError, SyntaxError, TypeError, ValueError, pa.ArrowException, struct.error, zlib.error,
)  # fmt: skip
"""What libraries raise on damaged files, beside errors of their own: their documentation does not list it."""

LOG = logging.getLogger(__name__)
"""What a library said goes there; people get a sentence of ours."""

T = TypeVar("T")
Errors = tuple[type[Exception], ...]


class Damaged(ValueError):
    """What our own readers find wrong in a file, in words for people."""


def reason(error: Exception) -> str:
    """Why a file cannot be read, in a few words; what a library said of it goes to the log alone."""
    if isinstance(error, Damaged):
        return str(error)
    LOG.info("%s: %s", type(error).__name__, error)
    return "damaged, or cut short"


@contextmanager
def reading(what: str, path: Path, errors: Errors = ()) -> Iterator[None]:
    """Calls of a library that opens a file: its errors become one DataError.

    what   : the kind of file, with its article;  errors : the library's own, beside DAMAGE
    """
    try:
        yield
    except DataError:
        raise
    except (*DAMAGE, *errors) as error:
        raise DataError(
            f"is not a readable {what}: {reason(error)}", str(path), "copy it again from its source"
        ) from None


def until_damage(items: Iterator[T], errors: Errors, broken: list[str]) -> Iterator[T]:
    """Items up to the first one that a library cannot read; then a word on it is in `broken`."""
    while True:
        try:
            item = next(items)
        except StopIteration:
            return
        except DataError:
            raise
        except (*DAMAGE, *errors) as error:
            broken.append(reason(error))
            return
        yield item


@contextmanager
def needed(library: str, purpose: str, path: Path) -> Iterator[None]:
    """Imports of a library that is not always there.  raises : DataError that says how to get it"""
    try:
        yield
    except ImportError:
        what = f"reading {purpose} needs the library {library}"
        raise DataError(what, str(path), "run: pip install 'vgyro[logs]'") from None


def check_not_empty(path: Path) -> None:
    """raises : DataError for a file of 0 bytes"""
    if path.is_file() and path.stat().st_size == 0:
        raise DataError("is empty: 0 bytes", str(path), "copy it again from the logger, or take it off the list")


def rows_at_a_time(width: int) -> int:
    """Rows of a batch of so many values a row."""
    return max(1, min(ROWS, VALUES // max(width, 1)))


@dataclass
class Unique:
    """Gives every name once: the second "x" is "x#1"."""

    taken: set[str] = field(default_factory=set)

    def __call__(self, name: str) -> str:
        """The name, or a free one like it."""
        free = name if name not in self.taken else next(n for k in count(1) if (n := f"{name}#{k}") not in self.taken)
        self.taken.add(free)
        return free


Stream = Callable[["OpenedLog", LogTable, Sequence[str]], Iterable[LogRows]]


@dataclass
class OpenedLog:
    """A log of any family (LogFile): what is in it, and a function that streams one table.

    path   : as people know it;  stream : (the log, table, names of columns) → rows; both are checked before
    broken : why a table could not be read on
    errors : a library's own errors, beside DAMAGE
    """

    path: Path
    family: str
    tables: tuple[LogTable, ...]
    stream: Stream
    account: Account = field(default_factory=Account)
    broken: list[str] = field(default_factory=list)
    errors: Errors = ()

    def __post_init__(self) -> None:
        if not self.tables:
            what = "; ".join(["holds no table of numbers", *self.account.notes])
            raise DataError(
                what, str(self.path), "check that it is the recording's log, and that it was closed properly"
            )
        if not self.account.content_bytes and self.path.is_file():
            self.account.content_bytes = self.path.stat().st_size

    def rows(self, table: str, columns: Sequence[str]) -> Iterator[LogRows]:
        """Stream some columns of a table.  raises : DataError, as LogFile says"""
        return self._read(self._table(table, columns), columns)

    def _read(self, table: LogTable, columns: Sequence[str]) -> Iterator[LogRows]:
        self.broken.clear()
        given = 0
        for rows in until_damage(iter(self.stream(self, table, columns)), self.errors, self.broken):
            given += rows.batch.num_rows
            self.account.rows += rows.batch.num_rows
            self.account.bad += len(rows.bad)
            yield rows
        if self.broken:
            name = f"table {table.name!r} " if table.name else ""
            if not given:
                what = f"{name}cannot be read ({self.broken[0]})"
                raise DataError(what, str(self.path), "copy it again, or repair it with its own tools")
            note = f"{name}breaks off after row {given} ({self.broken[0]}): what is before is taken"
            if note not in self.account.notes:
                self.account.notes.append(note)

    def _table(self, name: str, columns: Sequence[str]) -> LogTable:
        for table in self.tables:
            if table.name == name:
                known = [column.name for column in table.columns]
                for column in columns:
                    if column not in known:
                        raise DataError(f"has no column {column!r}{did_you_mean(column, known)}", str(self.path))
                return table
        names = [table.name for table in self.tables]
        raise DataError(f"has no table {name!r}{did_you_mean(name, names)}", str(self.path))


def batch_of(columns: Sequence[str], arrays: Sequence[pa.Array]) -> pa.RecordBatch:
    """Columns as a record batch, in their order."""
    return pa.RecordBatch.from_arrays(list(arrays), names=list(columns))


class BoundedFile(io.BufferedReader):
    """A file of which nobody reads more than there is, whatever length its damage claims."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._size = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read at most what is left."""
        if size is None or size < 0:
            return super().read()
        return super().read(min(size, max(0, self._size - self.tell())))


def too_many(shape: Sequence[int], item: int, held: int, ratio: int = 1032) -> bool:
    """Does an array claim more values than `held` bytes can hold?

    item  : bytes of a value;  ratio : the most that the format's compression can do (deflate: 1032)
    """
    return math.prod(shape) * item > held * ratio + (1 << 16)
