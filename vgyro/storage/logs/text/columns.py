"""The columns of one kind of line: what each cell is, and what it is called."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from vgyro.engine.text import Cell, Field, LineForm
from vgyro.storage.logs.table import Kind, LogColumn, LogTable
from vgyro.storage.logs.text.cells import Stamp, is_value, kind_of, labelled, missing, name_of, split
from vgyro.storage.logs.text.delimiter import Signs, holds_value
from vgyro.storage.logs.text.header import header_of, named

KINDS: dict[Cell, Kind] = {
    "number": "number", "hex": "number", "integer": "number", "date": "date", "day": "day", "words": "text",
}  # fmt: skip
VALUES = ("number", "hex", "integer", "date", "day")
FITTING = 0.5
"""Share of a line's numbers that must be there for it to be a row, in the head: a header has none."""


class Part(NamedTuple):
    """A column of a table, and the cells of a line that it is read from: two where date and time stand apart."""

    column: LogColumn
    cells: tuple[int, ...]


@dataclass(frozen=True)
class TableForm:
    """A table of a text log, its lines' form, and where its columns stand in them."""

    table: LogTable
    parts: tuple[Part, ...]
    line: LineForm


@dataclass(frozen=True)
class Typed:
    """What the cells of one kind of line are; labels: the names that stand beside the values."""

    fields: tuple[Field, ...]
    parts: tuple[tuple[int, ...], ...]
    labels: tuple[str, ...]
    stamps: tuple[Stamp, ...]

    @property
    def numbers(self) -> bool:
        """Does any column hold numbers?"""
        return any(self.fields[cells[0]].kind in ("number", "hex", "integer") for cells in self.parts)


def most_common(numbers: Sequence[int]) -> int:
    """The commonest of some numbers; the larger one of equals."""
    counts = Counter(numbers)
    return max(counts, key=lambda one: (counts[one], one))


def typed(rows: Sequence[Sequence[str]], signs: Signs, codec: str, merged: int | None = None) -> Typed:
    """What the cells of rows of equal length are.

    codec  : of the file's bytes
    merged : cell whose fraction of a second is in the next one
    """
    columns = [list(column) for column in zip(*rows, strict=True)]
    if merged is not None:
        columns[merged] = [",".join(pair) for pair in zip(columns[merged], columns[merged + 1], strict=True)]
        del columns[merged + 1]
    fields: list[Field] = []
    names: list[str] = []
    stamps: dict[int, Stamp] = {}
    name = ""
    for place, cells in enumerate(columns):
        if place + 1 < len(columns) and (literal := _literal(cells)):
            fields.append(Field("literal", literal.encode(codec, "replace")))
            names.append("")
            name = name_of(literal)
            continue
        label = labelled(cells)
        if label and signs.delimiter in label.label:
            # In quotes it may; the kernel would end the cell there.
            label = None
        kind, stamp = kind_of(label.values if label else cells, signs.decimal)
        if stamp:
            stamps[place] = stamp
        order = stamp.order if stamp else "ymd"
        fields.append(Field(kind, label.label.encode(codec, "replace") if label else b"", order, place == merged))
        names.append(name_of(label.label) if label else name)
        name = ""
    parts = _parts(fields, stamps)
    return Typed(tuple(fields), parts, tuple(names[cells[0]] for cells in parts), tuple(stamps.values()))


def _literal(cells: Sequence[str]) -> str:
    """A cell that is a label alone, the same in every line: "gx:"."""
    common, count = Counter(cells).most_common(1)[0]
    return common if count == len(cells) and re.fullmatch(r"[^\W\d].*[:=]", common) else ""


def _parts(fields: Sequence[Field], stamps: dict[int, Stamp]) -> tuple[tuple[int, ...], ...]:
    parts: list[tuple[int, ...]] = []
    for place, field in enumerate(fields):
        before = stamps.get(place - 1)
        if field.kind == "day" and before is not None and before.kind == "date" and not before.timed:
            parts[-1] = (place - 1, place)
        elif field.kind != "literal":
            parts.append((place,))
    return tuple(parts)


def fraction_at(rows: Sequence[Sequence[str]], signs: Signs) -> int | None:
    """Cell of a stamp whose fraction of a second is the next cell, for a comma stands before it, too."""
    if signs.delimiter != "," or not rows:
        return None
    columns = list(zip(*rows, strict=True))
    for place, (cells, behind) in enumerate(pairwise(columns)):
        whole = all(re.search(r":\d\d$", cell) for cell in cells)
        width = len(behind[0])
        if whole and width in (3, 6, 9) and all(len(one) == width and one.isdigit() for one in behind):
            return place
    return None


def rich(rows: Sequence[Sequence[str]], decimal: str) -> list[Sequence[str]]:
    """The rows that hold about as many values as any: headers hold none."""
    counts = [sum(not missing(cell) and holds_value(cell, decimal) for cell in row) for row in rows]
    most = max(counts, default=0)
    return [row for row, count in zip(rows, counts, strict=True) if count > 0 and count >= FITTING * most]


def fits(cells: Sequence[str], found: Typed, decimal: str, codec: str) -> bool:
    """Could a line with these cells be a row? Most of its values must be values."""
    values = [place for place, field in enumerate(found.fields) if field.kind in VALUES and place < len(cells)]
    right = 0
    for place in values:
        cell, field = cells[place], found.fields[place]
        label = field.label.decode(codec)
        bare = cell[len(label) :].strip() if cell.startswith(label) else "?"
        right += not missing(bare) and is_value(bare, decimal)
        right += field.kind == "hex" and bool(re.fullmatch("[0-9A-Fa-f]+", bare)) and not is_value(bare, decimal)
    empty = sum(missing(cells[place]) for place in values)
    return right > 0 and right >= FITTING * (len(values) - empty)


class Naming(NamedTuple):
    """Names and units, one a column, and whether a header gave them."""

    names: list[str]
    units: list[str]
    header: bool


def naming(before: Sequence[str], found: Typed, signs: Signs) -> Naming | None:
    """Names from a header among the lines before, one a cell or one a column; None if there is none."""
    for count in dict.fromkeys((len(found.fields), len(found.parts))):
        header = header_of(before, signs.delimiter, count, signs.decimal)
        if header is None:
            continue
        names, units = header
        if count != len(found.parts):
            names = [" ".join(names[cell] for cell in cells) for cells in found.parts]
            units = [units[cells[0]] for cells in found.parts]
        return Naming(names, units, True)
    return None


def plain_naming(found: Typed) -> Naming:
    """Names of a table without a header: labels, or c1, c2, … by the cell."""
    names = [
        label or " ".join(f"c{cell + 1}" for cell in cells)
        for label, cells in zip(found.labels, found.parts, strict=True)
    ]
    return Naming(names, [""] * len(names), False)


def table_form(name: str, found: Typed, given: Naming, line: LineForm, text: Sequence[str]) -> TableForm:
    """Columns with their names, as a table."""
    parts = []
    for cells, (called, unit) in zip(found.parts, named(given.names, given.units), strict=True):
        kind = "date" if len(cells) > 1 else KINDS[found.fields[cells[0]].kind]
        parts.append(Part(LogColumn(called, kind, "" if kind in ("date", "day") else unit), cells))
    unsure = [f"date {stamp.order}, which its values do not tell for sure" for stamp in found.stamps if not stamp.sure]
    labels = ["labelled"] if any(found.labels) else []
    header = [] if given.header or labels else ["no header"]
    table = LogTable(name, tuple(part.column for part in parts), None, (*text, *labels, *header, *unsure))
    return TableForm(table, tuple(parts), replace(line, fields=found.fields))


def trimmed(rows: Sequence[Sequence[str]], before: Sequence[str], signs: Signs) -> list[list[str]]:
    """Rows without the empty cells at their end that no header names."""
    count = len(rows[0])
    least = count
    while least > 1 and all(not row[least - 1] for row in rows):
        least -= 1
    for width in range(count, least - 1, -1):
        header = header_of(before, signs.delimiter, width, signs.decimal)
        if header is not None and header[0][-1]:
            return [list(row[:width]) for row in rows]
    return [list(row[:least]) for row in rows]


def cut(line: str, signs: Signs) -> list[str]:
    """Cells of a line."""
    return split(line, signs.delimiter)
