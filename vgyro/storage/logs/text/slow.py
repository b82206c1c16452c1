"""Lines whose cells have names of their own, in any order and number: JSON, and labels that change. Plain Python."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pyarrow as pa

from vgyro.engine.reference.text import date, hexadecimal, integer, number, time_of_day
from vgyro.engine.text import Cell
from vgyro.storage.logs.table import LogColumn, LogRows, LogTable
from vgyro.storage.logs.text.blocks import Lines
from vgyro.storage.logs.text.cells import LABEL, Stamp, is_value, kind_of, missing, name_of, split
from vgyro.storage.logs.text.columns import KINDS
from vgyro.storage.logs.text.damage import TextDamage
from vgyro.storage.logs.text.delimiter import Signs
from vgyro.storage.logs.text.header import unit_of

ROWS = 1 << 14
MOST_NAMES = 1000
LIKELY = 0.8
DEEPEST = 8
"""Most objects within objects, and arrays within arrays."""
MOST_ITEMS = 64
Value = str | float | int | bool | None


class LineMisfit(Exception):
    """A line that does not fit: what was expected."""


@dataclass(frozen=True)
class NamedForm:
    """A table whose lines name their values. signs : of labelled lines; None: the lines are JSON objects"""

    table: LogTable
    kinds: Mapping[str, tuple[Cell, Stamp | None]]
    signs: Signs | None

    def values(self, line: str) -> dict[str, Value]:
        """Values by name.  raises : Misfit"""
        return _json_values(line) if self.signs is None else _label_values(line, self.signs)


def json_form(lines: Sequence[str]) -> NamedForm | None:
    """The form of lines of JSON objects; None if they are none."""
    found = []
    for line in lines:
        if line.startswith("{"):
            try:
                found.append(_json_values(line))
            except LineMisfit:
                continue
    return _form(found, None, ["JSON lines"]) if found and len(found) >= LIKELY * len(lines) else None


def label_form(lines: Sequence[str], signs: Signs) -> NamedForm | None:
    """The form of labelled lines whose labels change from line to line; None if they do not, or are none."""
    found = []
    for line in lines:
        try:
            found.append(_label_values(line, signs))
        except LineMisfit:
            continue
    if len(found) < LIKELY * len(lines) or len(found) < 2:
        return None
    common = Counter(tuple(values) for values in found).most_common(1)[0][1]
    return _form(found, signs, ["labelled", "labels change"]) if common < LIKELY * len(found) else None


def _form(found: Sequence[Mapping[str, Value]], signs: Signs | None, text: Sequence[str]) -> NamedForm | None:
    names = list(dict.fromkeys(name for values in found for name in values))
    kinds: dict[str, tuple[Cell, Stamp | None]] = {}
    decimal = signs.decimal if signs else "."
    for name in names:
        there = [values[name] for values in found if name in values]
        kinds[name] = kind_of(["" if one is None else _text(one) for one in there], decimal)
    if not any(kind in ("number", "integer", "hex") for kind, _ in kinds.values()) or len(names) > MOST_NAMES:
        return None
    columns = tuple(LogColumn(name, KINDS[kind], unit_of(name)) for name, (kind, _) in kinds.items())
    return NamedForm(LogTable("", columns, None, tuple(text)), kinds, signs)


def _text(value: Value) -> str:
    return str(int(value)) if isinstance(value, bool) else str(value)


def _json_values(line: str) -> dict[str, Value]:
    try:
        # Integers stay exact; a number in quotes is one, too.
        made = json.loads(line)
    except (ValueError, RecursionError):
        raise LineMisfit("expected a JSON object") from None
    if not isinstance(made, dict):
        raise LineMisfit("expected a JSON object")
    values: dict[str, Value] = {}
    _flatten("", made, values, 0)
    return values


def _flatten(name: str, value: object, into: dict[str, Value], depth: int) -> None:
    if depth > DEEPEST:
        raise LineMisfit("expected a JSON object that is not so deep")
    if isinstance(value, dict):
        for key, inner in value.items():
            _flatten(f"{name}.{key}" if name else str(key), inner, into, depth + 1)
    elif isinstance(value, list):
        if len(value) > MOST_ITEMS:
            raise LineMisfit(f"expected arrays of at most {MOST_ITEMS} values")
        for place, inner in enumerate(value):
            _flatten(f"{name}[{place}]", inner, into, depth + 1)
    else:
        assert value is None or isinstance(value, str | float | int)
        into[name] = value


def _label_values(line: str, signs: Signs) -> dict[str, Value]:
    values: dict[str, Value] = {}
    cells = split(line, signs.delimiter)
    if signs.delimiter == " ":
        # "gx: 0.1": the label and its value are two cells.
        cells = re.sub(r"([:=])\s+", r"\1", line).split()
    while cells and not cells[-1]:
        cells.pop()
    for cell in cells:
        found = LABEL.fullmatch(cell)
        if found is None or not (found[2] is None or is_value(found[2].strip(), signs.decimal) or missing(found[2])):
            raise LineMisfit(f"expected values with labels, such as {'gx:0.1'!r}")
        name = name_of(found[1])
        if name in values:
            raise LineMisfit(f"has {name} twice")
        values[name] = (found[2] or "").strip()
    if not values:
        raise LineMisfit("expected values with labels")
    return values


class NamedReader:
    """Reads some columns of such a table."""

    def __init__(self, form: NamedForm, columns: Sequence[str], codec: str) -> None:
        self._form, self._columns, self._codec = form, list(columns), codec
        self._decimal = form.signs.decimal if form.signs else "."

    def rows(self, lines: Lines, damage: TextDamage, eol: bytes, start: int) -> Iterator[LogRows]:
        """All rows, with the damage among them."""
        held: list[list[Value]] = []
        place = 0
        for block in lines.blocks():
            damage.too_long(block.long)
            content = block.data[: block.size].tobytes().split(eol)[:-1]
            for line, raw in enumerate(content, start=block.line):
                if line < start:
                    damage.before_start(line, raw)
                    continue
                last = block.cut and line == block.line + len(content) - 1
                row = self._row(line, raw, damage, last)
                if row is not None:
                    place = place if held else line
                    held.append(row)
                if len(held) == ROWS:
                    yield self._given(held, place, damage)
                    held = []
        rest = self._given(held, place or 1, damage)
        if rest.batch.num_rows or rest.bad:
            yield rest

    def _row(self, line: int, raw: bytes, damage: TextDamage, last: bool) -> list[Value] | None:
        text = raw.decode(self._codec, "replace").strip()
        if not text:
            return None
        try:
            values = self._form.values(text)
            if not any(name in values for name in self._columns):
                damage.account.other += 1
                return None
            row = [self._value(name, values.get(name)) for name in self._columns]
        except LineMisfit as misfit:
            damage.line(line, raw, str(misfit))
            if last:
                damage.cut(line)
            return None
        if last:
            damage.account.notes.append(f"line {line}, the last one, has no end: taken, for it is whole")
        return row

    def _value(self, name: str, value: Value) -> Value:
        kind, stamp = self._form.kinds[name]
        if value is None or (isinstance(value, str) and missing(value)):
            return float("nan") if kind in ("number", "hex") else None
        text = _text(value)
        if kind == "words":
            return text
        found: float | int | None
        if kind in ("number", "hex"):
            found = number(text, self._decimal) if kind == "number" else hexadecimal(text)
        elif kind == "integer":
            found = integer(text)
        elif kind == "date":
            found = date(text, stamp.order if stamp else "ymd", "")
        else:
            found = time_of_day(text, "")
        if found is None:
            raise LineMisfit(f"expected {'a number' if kind in ('number', 'hex', 'integer') else 'a time'} as {name}")
        return found

    def _given(self, held: list[list[Value]], place: int, damage: TextDamage) -> LogRows:
        arrays = []
        for at, name in enumerate(self._columns):
            kind = self._form.kinds[name][0]
            of = pa.string() if kind == "words" else pa.float64() if kind in ("number", "hex") else pa.int64()
            arrays.append(pa.array([row[at] for row in held], of))
        return LogRows(pa.RecordBatch.from_arrays(arrays, names=self._columns), place, damage.taken())
