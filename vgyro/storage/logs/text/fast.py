"""Rows of a text log by the engine's kernel: whole lines in, columns out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa

from vgyro import engine as engines
from vgyro.engine.text import CELL, CHECKSUM, FEW, KIND, LABEL, LEAD, MANY, NULL, PAD, QUOTE, Field, Parsed
from vgyro.storage.logs.table import LogRows
from vgyro.storage.logs.text.blocks import Block, Lines
from vgyro.storage.logs.text.columns import Part, TableForm
from vgyro.storage.logs.text.damage import TextDamage

ROWS = 1 << 17
"""Most rows of a batch."""
CALLED = {
    "number": "a number", "hex": "a hexadecimal number", "integer": "a whole number", "date": "a date and time",
    "day": "a time of day", "words": "a text", "literal": "a label", "skip": "a cell",
}  # fmt: skip


class TextReader:
    """Reads some columns of one table of a file."""

    def __init__(self, form: TableForm, columns: Sequence[str], engine: str, codec: str, swap: bytes) -> None:
        parts = {part.column.name: part for part in form.parts}
        self._form, self._parts, self._codec, self._swap = form, [parts[name] for name in columns], codec, swap
        wanted = {cell for part in self._parts for cell in part.cells}
        if all(form.line.fields[cell].kind == "words" for cell in wanted):
            # Any line holds words: numbers tell a row from a header.
            numbers = ("number", "hex", "integer")
            wanted.add(next(cell for cell, field in enumerate(form.line.fields) if field.kind in numbers))
        self._fields = tuple(
            field if cell in wanted or field.split else Field("skip") for cell, field in enumerate(form.line.fields)
        )
        line = type(form.line)(**{**vars(form.line), "fields": self._fields})
        self._parser = engines.get(engine).text.Parser(line)

    def rows(self, lines: Lines, damage: TextDamage, start: int) -> Iterator[LogRows]:
        """All rows, with the damage among them; lines before number `start` are none."""
        for block in lines.blocks(count=False):
            damage.too_long(block.long)
            data, size = self._swapped(block)
            at, line = 0, block.line
            while at < size and line < start:
                end = at + data[at:size].tobytes().index(self._form.line.eol)
                damage.before_start(line, data[at:end].tobytes())
                at, line = end + 1, line + 1
            while at < size:
                found = self._parser.parse(data[at:], size - at, ROWS)
                self._note(found, data, at, line, damage)
                if block.cut and at + found.consumed == size:
                    self._note_last(data[:size], line + found.lines - 1, found, damage)
                first = line + max(found.first, 0)
                at, line = at + found.consumed, line + found.lines
                batch = self._batch(found, data, at - found.consumed)
                bad = damage.taken()
                if batch.num_rows or bad:
                    yield LogRows(batch, first, bad)
            lines.line = line

    def _swapped(self, block: Block) -> tuple[np.ndarray, int]:
        if not self._swap:
            return block.data, block.size
        content = block.data[: block.size].tobytes().replace(self._swap, b"\x1f")
        return np.frombuffer(content + b"\0" * PAD, dtype=np.uint8), len(content)

    def _note(self, found: Parsed, data: np.ndarray, at: int, line: int, damage: TextDamage) -> None:
        damage.account.other += found.other
        for offset, size, number, field, why in found.bad.tolist():
            text = data[at + offset : at + offset + size].tobytes()
            damage.line(line + number, text, self._expected(why, field))

    def _note_last(self, data: np.ndarray, number: int, found: Parsed, damage: TextDamage) -> None:
        """The file's last line, which has no end: a row, or cut within."""
        if len(found.bad) and found.bad[-1, 2] == found.lines - 1:
            damage.cut(number)
            return
        last = data[:-1].tobytes().rsplit(self._form.line.eol, 1)[-1] + self._form.line.eol
        alone = self._parser.parse(np.frombuffer(last + b"\0" * PAD, dtype=np.uint8), len(last), 1)
        if alone.first == 0:
            damage.account.notes.append(f"line {number}, the last one, has no end: taken, for it has all its fields")

    def _expected(self, why: int, field: int) -> str:
        cells = len(self._fields)
        called = CALLED[self._fields[field].kind] if field < cells else "a cell"
        name = next((part.column.name for part in self._form.parts if field in part.cells), f"cell {field + 1}")
        label = self._fields[field].label.decode("utf-8", "replace") if field < cells else ""
        return {
            CELL: f"expected {called} as {name}",
            FEW: f"has {field} cells, expected {cells}",
            MANY: f"has more cells than {cells}",
            QUOTE: f"a quote is not closed where {name} was expected",
            LABEL: f"expected {label!r}",
            LEAD: f"expected {self._form.line.lead.decode('utf-8', 'replace')!r} behind the time",
            CHECKSUM: "expected another checksum at its end",
            KIND: "expected a line that begins with a word",
        }[why]

    def _batch(self, found: Parsed, data: np.ndarray, at: int) -> pa.RecordBatch:
        arrays = [self._array(part, found.columns, data, at) for part in self._parts]
        return pa.RecordBatch.from_arrays(arrays, names=[part.column.name for part in self._parts])

    def _array(self, part: Part, columns: Sequence[np.ndarray | None], data: np.ndarray, at: int) -> pa.Array:
        values = [column for cell in part.cells if (column := columns[cell]) is not None]
        first = values[0]
        if part.column.kind == "text":
            words = [data[at + place : at + place + size].tobytes() for place, size in first.tolist()]
            return pa.array([_word(word, self._codec) for word in words], pa.string())
        if first.dtype == np.float64:
            return pa.array(first)
        missing = np.any([column == NULL for column in values], axis=0)
        total = first if len(values) == 1 else first + values[1]
        return pa.array(total, mask=missing if missing.any() else None)


def _word(word: bytes, codec: str) -> str | None:
    return word.decode(codec, "replace").replace('""', '"') or None
