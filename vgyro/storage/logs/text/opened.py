"""An opened text log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from vgyro.errors import DataError
from vgyro.log import TextForm
from vgyro.storage.logs.table import Account, LogRows, LogTable
from vgyro.storage.logs.text.blocks import Lines
from vgyro.storage.logs.text.damage import TextDamage
from vgyro.storage.logs.text.fast import TextReader
from vgyro.storage.logs.text.form import Form, FormFinder
from vgyro.storage.logs.text.head import TextHead, read_head, sample
from vgyro.storage.logs.text.slow import NamedForm, NamedReader, json_form
from vgyro.storage.sources import open_sources
from vgyro.validation import did_you_mean


class TextLog:
    """A text log (LogFile). Its account is that of the last call of `rows`, and begins anew with each.

    path : the file;  family : "text";  account : what was read
    """

    family = "text"

    def __init__(self, path: Path, head: TextHead, form: Form | NamedForm, engine: str, swap: bytes, skip: int) -> None:
        self.path, self._head, self._form, self._engine, self._swap, self._skip = path, head, form, engine, swap, skip
        self.account = Account(compression=open_sources([path]).files[0].compression)

    @property
    def tables(self) -> tuple[LogTable, ...]:
        """The tables that hold numbers, in the file's order."""
        if isinstance(self._form, NamedForm):
            return (self._form.table,)
        return tuple(form.table for form in self._form.tables)

    def rows(self, table: str, columns: Sequence[str]) -> Iterator[LogRows]:
        """Stream some columns of one table, a block of lines at a time.

        raises : DataError for a table or column that is not there, and where no line is a row
        """
        names = [one.name for one in self.tables]
        if table not in names:
            raise DataError(f"has no table {table!r}{did_you_mean(table, names)}", str(self.path))
        known = [column.name for column in self.tables[names.index(table)].columns]
        for column in columns:
            if column not in known:
                raise DataError(f"has no column {column!r}{did_you_mean(column, known)}", str(self.path))
        if not columns or len(set(columns)) < len(columns):
            raise DataError("columns must be named, each once", str(self.path))
        return self._stream(names.index(table), columns)

    def _stream(self, table: int, columns: Sequence[str]) -> Iterator[LogRows]:
        source = open_sources([self.path]).files[0]
        lines = Lines(source, self._head.encoding, self._head.eol)
        # The account itself stays: others may hold it.
        account = self.account
        account.rows = account.bad = account.other = 0
        account.notes.clear()
        form = self._form if isinstance(self._form, Form) else Form((), self._skip + 1)
        damage = TextDamage(account, self._head.codec, form.known, form.cut)
        if isinstance(self._form, NamedForm):
            named = NamedReader(self._form, columns, self._head.codec)
            stream = named.rows(lines, damage, self._head.eol, form.start)
        else:
            reader = TextReader(form.tables[table], columns, self._engine, self._head.codec, self._swap)
            stream = reader.rows(lines, damage, form.start)
        for rows in stream:
            account.rows += rows.batch.num_rows
            yield rows
        account.sha256 = source.sha256
        account.content_bytes = lines.content_bytes + self._head.encoding.mark
        if source.cut_short:
            account.notes.append(f"the {source.compression} data break off: what could be unpacked is read")
        if not account.rows:
            first = damage.first
            place, found = (f", line {first.place}", f"{first.found!r}: {first.expected}") if first else ("", "no row")
            raise DataError(
                f"no line can be read: {found}", f"{self.path}{place}", "check the file, or its form in `text`"
            )


def open_log(path: Path, form: TextForm, engine: str = "native") -> TextLog:
    """Open a text log: any delimited, labelled or JSON lines, of one kind or of several. Only its head is read.

    path   : the file, plain, .gz or .zst;  form : what is known of it, the rest is found from its first 256 KiB
    engine : native or reference
    raises : DataError for a file that is missing, empty, a folder, binary, or whose lines hold no numbers: with the
             first line that does not fit, what was found there, and what was expected
    """
    source = open_sources([path]).files[0]
    swap = (form.delimiter or "").strip(" ").encode()
    swap = swap if len(swap) > 1 else b""
    head = read_head(source, form, swap)
    body = sample([line for _, line in head.body(form.skip)])
    found: Form | NamedForm | None = json_form(body) if form.delimiter is None else None
    if found is None:
        finder = FormFinder(head, form, path)
        found = finder.labels() or finder.find()
    return TextLog(path, head, found, engine, swap, form.skip)
