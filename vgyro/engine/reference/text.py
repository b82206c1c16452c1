"""Lines of a text log by Python alone: float(), datetime and regular expressions. Slow; it says what the cells mean."""

from __future__ import annotations

import datetime
import re

import numpy as np

from vgyro.engine.text import (
    CELL,
    CHECKSUM,
    FEW,
    KIND,
    LABEL,
    LEAD,
    MANY,
    MISSING,
    NULL,
    QUOTE,
    Field,
    LineForm,
    Parsed,
    check,
)  # fmt: skip

SECOND = 1_000_000_000
WITH_COLONS = r"(?P<h>\d{1,2}):(?P<m>\d\d)(?::(?P<s>\d\d)(?:SIGN(?P<f>\d+))?)?"
WITHOUT = r"(?P<h2>\d\d)(?P<m2>\d\d)(?P<s2>\d\d)(?:SIGN(?P<f2>\d+))?"
TIME = f"(?:{WITH_COLONS}|{WITHOUT})"
HALF = r"(?:[ \t]*(?P<half>[aApP])[mM])?"
ZONE = r"[ \t]*(?P<zone>[zZ]|[uU][tT][cC]|[gG][mM][tT]|[+-]\d\d(?::?\d\d)?)?"
YMD = r"(?P<Y>\d{4})(?:(?P<M>\d\d)(?P<D>\d\d)|(?P<sep>[-/.])(?P<M2>\d{1,2})(?P=sep)(?P<D2>\d{1,2}))"
MIDDLE = r"(?:(?P<sep>[-/.])(?P<B>\d{1,2}|[A-Za-z]{3})(?P=sep)| (?P<named>[A-Za-z]{3}) )"
OTHER = rf"(?P<A>\d{{1,2}}){MIDDLE}(?P<Y>\d{{4}}|\d\d)"
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


class Misfit(Exception):
    """A line does not fit: why, and at which field."""

    def __init__(self, why: int, field: int) -> None:
        super().__init__(why, field)
        self.why, self.field = why, field


class Parser:
    """As vgyro.engine.protocols.reading.LineParser."""

    def __init__(self, form: LineForm) -> None:
        self._form = form
        self._blanks = b" \r" if form.delimiter == b"\t" else b" \r\t"
        self._end = b"*" if form.checksum else form.eol

    def parse(self, data: np.ndarray, size: int, room: int) -> Parsed:
        """As vgyro.engine.protocols.reading.LineParser.parse."""
        check(data, size, self._form)
        raw, at, line, other, first = data[:size].tobytes(), 0, 0, 0, -1
        rows: list[list[object]] = []
        bad: list[tuple[int, int, int, int, int]] = []
        while at < size and len(rows) < room:
            stop = raw.index(self._form.eol, at)
            try:
                row = self._row(raw[at : stop + 1], at)
                if row is None:
                    other += 1
                elif row or raw[at:stop].strip(self._blanks):
                    first = line if first < 0 else first
                    rows.append(row)
            except Misfit as misfit:
                bad.append((at, stop - at, line, misfit.field, misfit.why))
            at, line = stop + 1, line + 1
        wrong = np.array(bad, dtype=np.int64).reshape(-1, 5)
        return Parsed(self._columns(rows), wrong, at, line, other, first)

    def _columns(self, rows: list[list[object]]) -> list[np.ndarray | None]:
        columns: list[np.ndarray | None] = []
        for k, field in enumerate(self._form.fields):
            if field.kind in ("skip", "literal"):
                columns.append(None)
                continue
            kind = np.float64 if field.kind in ("number", "hex") else np.int64
            shape = (-1, 2) if field.kind == "words" else (-1,)
            columns.append(np.array([row[k] for row in rows], dtype=kind).reshape(shape))
        return columns

    def _row(self, line: bytes, offset: int) -> list[object] | None:
        """Values of the cells of a line; empty of an empty line; None of a line of another kind."""
        form, at = self._form, self._pass(line, 0)
        if line[at : at + 1] == form.eol:
            return []
        if form.word:
            behind = at + len(form.word)
            ends = {form.delimiter, self._end, form.eol, *(bytes([one]) for one in self._blanks)}
            if line[at:behind] != form.word or line[behind : behind + 1] not in ends:
                if line[at : at + 1] in b"0123456789.+-":
                    raise Misfit(KIND, 0)
                return None
            start, at = at, self._pass(line, behind)
            if form.delimiter != b" " and line[at : at + 1] == form.delimiter:
                at += 1
        else:
            start, at = at, 0 if form.delimiter != b" " else at
        if form.checksum and not _checked(line[start:-1].rstrip(b" \t\r")):
            raise Misfit(CHECKSUM, 0)
        return self._cells(line, at, offset)

    def _cells(self, line: bytes, at: int, offset: int) -> list[object]:
        form = self._form
        values: list[object] = []
        for k, field in enumerate(form.fields):
            at = self._step(line, at, k) if k else at
            if form.delimiter == b" " and self._stops(line, at):
                raise Misfit(FEW, k)
            first, last, at = self._bounds(line, at, k)
            if field.split and line[at : at + 1] == form.delimiter:
                at = self._cell_end(line, at + 1)
                last = first + len(line[first:at].rstrip(self._blanks))
            if field.label:
                if not line[first:last].startswith(field.label):
                    raise Misfit(LABEL, k)
                first = last - len(line[first + len(field.label) : last].lstrip(self._blanks))
            values.append(self._value(field, line[first:last], offset + first, k))
        while not self._stops(line, at):
            if line[at] not in form.delimiter + self._blanks:
                raise Misfit(MANY, len(form.fields) - 1)
            at += 1
        return values

    def _step(self, line: bytes, at: int, k: int) -> int:
        """Step over what stands before cell k."""
        form = self._form
        if self._stops(line, at):
            raise Misfit(FEW, k)
        if k == 1 and form.lead:
            at += len(form.lead)
        elif form.delimiter != b" ":
            at += 1
        return self._pass(line, at) if form.delimiter == b" " else at

    def _pass(self, line: bytes, at: int) -> int:
        while line[at : at + 1] != self._form.eol and line[at] in self._blanks:
            at += 1
        return at

    def _stops(self, line: bytes, at: int) -> bool:
        return line[at : at + 1] in (self._end, self._form.eol)

    def _cell_end(self, line: bytes, at: int) -> int:
        ends = self._blanks if self._form.delimiter == b" " else self._form.delimiter
        while not self._stops(line, at) and line[at] not in ends:
            at += 1
        return at

    def _bounds(self, line: bytes, at: int, k: int) -> tuple[int, int, int]:
        """First byte of the cell's value, the one behind its last, and where the cell ends."""
        form = self._form
        first = last = at = self._pass(line, at)
        if k == 0 and form.lead:
            at = last = line.find(form.lead, first)
            if at < 0:
                raise Misfit(LEAD, k)
        elif line[at : at + 1] == b'"':
            inner = re.compile(rb'"((?:""|[^"])*)"').match(line, at)
            if inner is None:
                raise Misfit(QUOTE, k)
            (first, last), at = inner.span(1), inner.end()
            if form.delimiter != b" ":
                at = self._pass(line, at)
            if self._cell_end(line, at) != at:
                raise Misfit(QUOTE, k)
        else:
            at = last = self._cell_end(line, at)
        last = first + len(line[first:last].rstrip(self._blanks))
        return last - len(line[first:last].lstrip(self._blanks)), last, at

    def _value(self, field: Field, cell: bytes, offset: int, k: int) -> object:
        text = cell.decode("latin-1")
        split = self._form.delimiter.decode() if field.split else ""
        if field.kind == "words":
            return offset, len(cell)
        if field.kind == "skip" or (field.kind == "literal" and not cell):
            return None
        value: object = None
        missing = text.lower() in MISSING
        if field.kind in ("number", "hex"):
            decimal = self._form.decimal.decode()
            value = np.nan if missing else number(text, decimal) if field.kind == "number" else hexadecimal(text)
        elif field.kind == "integer":
            value = NULL if missing else integer(text)
        elif field.kind == "date":
            value = NULL if missing else date(text, field.order, split)
        elif field.kind == "day":
            value = NULL if missing else time_of_day(text, split)
        if value is None:
            raise Misfit(CELL, k)
        return value


def _checked(line: bytes) -> bool:
    stored = re.search(rb"\*([0-9A-Fa-f]{2})$", line)
    if stored is None:
        return False
    total = 0
    for byte in line[line[:1] in (b"$", b"!") : stored.start()]:
        total ^= byte
    return total == int(stored[1], 16)


def number(text: str, decimal: str) -> float | None:
    """A number; None if it is none."""
    if re.fullmatch(r"[+-]?(inf|infinity)", text, re.IGNORECASE):
        return float(text)
    if found := re.fullmatch(r"([+-]?)0[xX]([0-9A-Fa-f]{1,16})", text):
        return float(int(found[2], 16)) * (-1 if found[1] == "-" else 1)
    sign = re.escape(decimal)
    if re.fullmatch(rf"[+-]?([0-9]+({sign}[0-9]*)?|{sign}[0-9]+)([eE][+-]?[0-9]+)?", text):
        return float(text.replace(decimal, "."))
    return None


def hexadecimal(text: str) -> float | None:
    """A bare hexadecimal number; None if it is none."""
    found = re.fullmatch(r"(?:0[xX])?([0-9A-Fa-f]{1,16})", text)
    return float(int(found[1], 16)) if found else None


def integer(text: str) -> int | None:
    """A whole number of at most 19 digits within int64, its least excepted; None if it is none."""
    if not re.fullmatch(r"[+-]?[0-9]{1,19}", text):
        return None
    value = int(text)
    return value if abs(value) < 1 << 63 else None


def _day(found: re.Match[str], order: str) -> int | None:
    parts = found.groupdict()
    year = int(parts["Y"])
    if order == "ymd":
        month, day = int(parts["M"] or parts["M2"]), int(parts["D"] or parts["D2"])
    else:
        name = parts["B"] or parts["named"]
        day, named = int(parts["A"]), not name.isdigit()
        if named and name.lower() not in MONTHS:
            return None
        month = MONTHS.index(name.lower()) + 1 if named else int(name)
        if order == "mdy" and not named:
            day, month = month, day
        if len(parts["Y"]) == 2:
            year += 2000 if year < 70 else 1900
    try:
        return datetime.date(year, month, day).toordinal() - datetime.date(1970, 1, 1).toordinal()
    except ValueError:
        # No such day in the calendar.
        return None


def _time(found: re.Match[str]) -> int | None:
    parts = found.groupdict()
    hour, minute, second = (int(parts[name] or parts[name + "2"] or 0) for name in "hms")
    fraction = parts["f"] or parts["f2"] or ""
    if fraction[9:].strip("0"):
        return None
    if parts["half"]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if parts["half"] in "pP" else 0)
    if hour > 23 or minute > 59 or second > 60:
        return None
    return (hour * 3600 + minute * 60 + second) * SECOND + int(fraction[:9].ljust(9, "0"))


def _zone(text: str | None) -> int | None:
    if not text or text[0] not in "+-":
        return 0
    hours, minutes = int(text[1:3]), int(text[3:].lstrip(":") or 0)
    if hours > 23 or minutes > 59:
        return None
    return (hours * 3600 + minutes * 60) * SECOND * (-1 if text[0] == "-" else 1)


def _signs(split: str) -> str:
    return TIME.replace("SIGN", f"[.,{re.escape(split)}]")


def date(text: str, order: str, split: str) -> int | None:
    """Date, or date and time, ns since 1970; None if it is none."""
    form = YMD if order == "ymd" else OTHER
    found = re.fullmatch(rf"{form}(?P<rest>(?:[tT_]|[ \t]+){_signs(split)}{HALF}{ZONE})?", text, re.ASCII)
    if found is None or (days := _day(found, order)) is None:
        return None
    total = days * 86400 * SECOND
    if found["rest"] is not None:
        time, ahead = _time(found), _zone(found["zone"])
        if time is None or ahead is None:
            return None
        total += time - ahead
    return total if abs(total) < 1 << 63 and abs(days) * 86400 * SECOND < 1 << 63 else None


def time_of_day(text: str, split: str) -> int | None:
    """Time of day, ns since midnight; None if it is none."""
    found = re.fullmatch(_signs(split) + HALF, text, re.ASCII)
    if found is None or (found["s"] is None and found["s2"] is None):
        return None
    return _time(found)
