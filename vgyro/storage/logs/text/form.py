"""The form of a text log, from the lines of its head."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vgyro.engine.text import Field, LineForm
from vgyro.errors import DataError
from vgyro.log import TextForm
from vgyro.storage.logs.text import columns as of
from vgyro.storage.logs.text.cells import is_value, is_word, kind_of, missing, stamp_of
from vgyro.storage.logs.text.columns import Naming, TableForm, Typed
from vgyro.storage.logs.text.damage import shown
from vgyro.storage.logs.text.delimiter import Signs, find_signs
from vgyro.storage.logs.text.head import (
    Lead,
    TextHead,
    find_lead,
    has_checksums,
    sample,
    without_checksum,
)  # fmt: skip
from vgyro.storage.logs.text.header import names_in
from vgyro.storage.logs.text.slow import NamedForm, label_form

MOST_KINDS = 64
WORDS = 0.8
"""Share of lines that begin with a word, from which on the word tells the kind of the line."""
LEAST_FIT = 0.5
"""Share of the head's lines that must be rows: with fewer, the form is not understood."""
FEW_LINES = 20
FEW = 100
SWAPPED = "\x1f"
"""What several signs between columns become."""


@dataclass(frozen=True)
class Form:
    """The form of a file.

    start : number of the first line that may be a row
    known : lines before it, which may come again when the logger starts again;  cut : damaged rows among them
    """

    tables: tuple[TableForm, ...]
    start: int
    known: frozenset[str] = frozenset()
    cut: tuple[int, ...] = ()


@dataclass(frozen=True)
class FormFinder:
    """Looks for the form of one head."""

    head: TextHead
    given: TextForm
    path: Path

    def find(self) -> Form:
        """The form.  raises : DataError with the first line that does not fit"""
        body = self.head.body(self.given.skip)
        if not body:
            raise DataError(
                f"holds no rows: {len(self.head.lines)} lines, all of them empty or comments", str(self.path),
                "check that the logger wrote its data into it",
            )  # fmt: skip
        texts = sample([line for _, line in body])
        lead = find_lead(texts)
        if lead is not None:
            texts = [rest for line in texts if (rest := lead.strip(line))]
        checked = lead is None and has_checksums([line for line in texts if "*" in line])
        bare = [without_checksum(line) if checked else line for line in texts]
        signs = find_signs(sample(bare, FEW), self._delimiter(), self.given.decimal)
        if lead is None and self._words(bare, signs):
            # Kinds that are rare may be missing among the lines that were looked at.
            first = [line.split(None if signs.delimiter == " " else signs.delimiter, 1)[0].strip() for _, line in body]
            words = [word for word in dict.fromkeys(first) if is_word(word)][:MOST_KINDS]
            return self._kinds(body, words, signs, checked)
        return self._single(body, lead, signs, checked and all("*" in line for line in texts[1:]))

    def labels(self) -> NamedForm | None:
        """The form of lines whose labels change from line to line; None if they are none."""
        texts = sample([line for _, line in self.head.body(self.given.skip)])
        marked = [line for line in texts if ":" in line or "=" in line]
        if len(marked) < WORDS * len(texts) or find_lead(texts) is not None:
            return None
        return label_form(texts, find_signs(sample(texts, FEW), self._delimiter(), self.given.decimal))

    def _delimiter(self) -> str | None:
        given = self.given.delimiter
        if given is None:
            return None
        if given.strip() == self.given.decimal:
            what = f"{given!r} cannot be both the delimiter and the decimal sign"
            raise DataError(what, str(self.path), "correct `delimiter` or `decimal` in the manifest")
        bare = given.strip(" ") or " "
        if len(bare.encode()) > 1:
            return SWAPPED
        if bare.isalnum() or bare in '+-."*$\r\n\0':
            raise DataError(
                f"{given!r} cannot stand between columns", str(self.path), "correct `delimiter` in the manifest"
            )
        return bare

    def _line(self, signs: Signs, lead: Lead | None = None, checksum: bool = False) -> LineForm:
        sign = lead.sign.encode() if lead else b""
        decimal = signs.decimal.encode()
        return LineForm((), signs.delimiter.encode(), decimal, self.head.eol, b"", sign, checksum)

    def _phrases(self, signs: Signs) -> list[str]:
        names = {"\t": "delimiter tab", " ": "delimiter blanks", SWAPPED: f"delimiter {self.given.delimiter}"}
        said = [names.get(signs.delimiter, f"delimiter {signs.delimiter}")]
        said += ["decimal comma"] if signs.decimal == "," else []
        return said + ([] if self.head.encoding.name == "utf-8" else [self.head.encoding.name])

    # --- several kinds of lines

    def _words(self, lines: Sequence[str], signs: Signs) -> bool:
        """Do the first words of the lines tell their kinds?"""
        cells = [of.cut(line, signs) for line in lines]
        words = [row[0] for row in cells if row and is_word(row[0])]
        distinct = list(dict.fromkeys(words))
        if len(words) < WORDS * len(lines) or len(distinct) > MOST_KINDS or self.given.header:
            return False
        if distinct[0].endswith((":", "=")):
            # Labels: "gx: 0.1 gy: 0.2".
            pairs = sum(len(row) > 2 and row[2].endswith(row[0][-1]) for row in cells)
            if pairs > 0.5 * len(cells) or all(len(row) <= 2 for row in cells):
                return False
        first = cells[0]
        others = [row[0] for row in cells[1:] if row and row != first]
        header = first[0] not in others and not any(is_value(cell, signs.decimal) for cell in first)
        # A header with names for all columns: the words are values of the first one.
        names_all = header and len(first) == of.most_common([len(row) for row in cells])
        return not names_all or self.given.header is False

    def _kinds(self, body: Sequence[tuple[int, str]], words: Sequence[str], signs: Signs, checked: bool) -> Form:
        groups: dict[str, list[tuple[str, list[str]]]] = defaultdict(list)
        for _, line in body:
            cells = of.cut(without_checksum(line) if checked else line, signs)
            if cells and cells[0] in words:
                groups[cells[0]].append((line, cells[1:]))
        # A kind that is seen once is likelier the rest of a line.
        groups = {word: rows for word, rows in groups.items() if len(rows) > 1 or len(body) < FEW_LINES}
        tables, known = [], set()
        for word, rows in groups.items():
            summed = checked and sum(line != without_checksum(line) for line, _ in rows) > 0.5 * len(rows)
            form = replace(self._line(signs, None, summed), word=word.encode(self.head.codec, "replace"))
            header = None
            if len(rows) > 1 and not any(is_value(cell, signs.decimal) for cell in rows[0][1]):
                # Names of this kind's columns, perhaps again when the logger starts again.
                header = rows[0][1]
                known.add(rows[0][0])
            cells_of = [cells for _, cells in rows if cells != header]
            if cells_of and (table := self._kind(word.rstrip(":="), cells_of, header, signs, form)) is not None:
                tables.append(table)
        if not tables:
            raise self._unread(body[0], "numbers behind the first word")
        return Form(tuple(tables), self.given.skip + 1, frozenset(known))

    def _kind(
        self, name: str, rows: list[list[str]], header: list[str] | None, signs: Signs, line: LineForm
    ) -> TableForm | None:
        """The table of one kind of line; None if it holds no numbers."""
        count = of.most_common([len(row) for row in rows])
        if not count:
            return None
        full = of.trimmed(sample([row for row in rows if len(row) == count]), [], signs)
        found = of.typed(full, signs, self.head.codec)
        if not found.numbers:
            return None
        given = of.plain_naming(found)
        if header is not None and len(header) >= len(found.fields):
            names = [" ".join(header[cell] for cell in cells) for cells in found.parts]
            given = Naming(names, [""] * len(names), True)
        elif len(self.given.names) == len(given.names):
            given = Naming(list(self.given.names), given.units, True)
        return of.table_form(name, found, given, line, self._phrases(signs))

    # --- one kind of line

    def _single(self, body: list[tuple[int, str]], lead: Lead | None, signs: Signs, checked: bool) -> Form:
        own = [(number, text) for number, line in body if (text := lead.strip(line) if lead else line)]
        cells = [(number, of.cut(without_checksum(text) if checked else text, signs)) for number, text in own]
        if self.given.header and len(cells) > 1:
            header, cells = cells[0], cells[1:]
        else:
            header = None
        count = of.most_common([len(row) for _, row in cells])
        full = [row for _, row in cells if len(row) == count]
        kept = of.rich(sample(full), signs.decimal)
        if not kept:
            raise self._unread(own[0] if own else body[0], "a row of numbers")
        rough = of.typed(kept, signs, self.head.codec)
        start = next(
            (
                number
                for number, row in cells
                if len(row) == count and of.fits(row, rough, signs.decimal, self.head.codec)
            ),
            0,
        )
        if not rough.numbers or not start:
            raise self._unread(own[0] if own else body[0], "a row of numbers")
        before = [] if self.given.header is False else self._before(lead, start)
        behind = sample([row for number, row in cells if number >= start])
        good = [row for row in behind if len(row) == count and of.fits(row, rough, signs.decimal, self.head.codec)]
        if len(good) < LEAST_FIT * len(behind):
            number = next(
                number for number, row in cells
                if number > start and not (len(row) == count and of.fits(row, rough, signs.decimal, self.head.codec))
            )  # fmt: skip
            raise self._unread((number, self.head.lines[number - 1]), f"{count} cells as in line {start}")
        found, naming = self._named(sample(good), before, signs, header)
        if not found.numbers:
            raise self._unread(own[0], "a row of numbers")
        found, naming = _with_lead(found, naming, lead, [line for number, line in body if number >= start])
        if self.given.header is False:
            start = min(number for number, _ in cells)
        table = of.table_form("", found, naming, self._line(signs, lead, checked), self._phrases(signs))
        known = frozenset(line.strip() for line in self.head.lines[self.given.skip : start - 1] if line.strip())
        damaged = tuple(
            number for number, row in cells
            if number < start and len(row) != count and all(is_value(cell, signs.decimal) for cell in row)
        )  # fmt: skip
        return Form((table,), start, known, damaged[-1:])

    def _before(self, lead: Lead | None, start: int) -> list[str]:
        lines = [line.strip() for line in self.head.lines[self.given.skip : start - 1] if line.strip()]
        return [(lead.strip(line) or line) if lead else line for line in lines]

    def _named(
        self, rows: list[list[str]], before: list[str], signs: Signs, header: tuple[int, list[str]] | None
    ) -> tuple[Typed, Naming]:
        """The columns of the rows, and their names."""
        if header is None:
            rows = of.trimmed(rows, before, signs)
        else:
            width = max((place for place, cell in enumerate(header[1], start=1) if cell), default=0)
            rows = [row[:width] if not any(row[width:]) else row for row in rows]
        found = of.typed(rows, signs, self.head.codec)
        naming = of.naming(before, found, signs)
        merged = of.fraction_at(rows, signs) if naming is None else None
        if merged is not None:
            found = of.typed(rows, signs, self.head.codec, merged)
            naming = of.naming(before, found, signs)
        if header is not None:
            naming = self._given_header(header, found)
        if self.given.names:
            naming = self._given_names(found)
        return found, naming or of.plain_naming(found)

    def _given_header(self, header: tuple[int, list[str]], found: Typed) -> Naming:
        number, cells = header
        while len(cells) > len(found.fields) and not cells[-1]:
            cells = cells[:-1]
        if len(cells) == len(found.parts):
            return Naming(cells, [""] * len(cells), True)
        if len(cells) == len(found.fields):
            names = [" ".join(cells[cell] for cell in part) for part in found.parts]
            return Naming(names, [""] * len(names), True)
        others = names_in(" ".join(cells), " ", len(found.parts))
        if others is not None:
            return Naming(others, [""] * len(others), True)
        raise DataError(
            f"the header holds {len(cells)} names, the rows {len(found.fields)} cells", f"{self.path}, line {number}",
            "correct `header`, `delimiter` or `skip` in the manifest",
        )  # fmt: skip

    def _given_names(self, found: Typed) -> Naming:
        names = self.given.names
        if len(names) != len(found.parts):
            raise DataError(
                f"has {len(found.parts)} columns, but the manifest has {len(names)} names", str(self.path),
                "give `names` one name a column",
            )  # fmt: skip
        return Naming(list(names), [""] * len(names), True)

    def _unread(self, line: tuple[int, str], expected: str) -> DataError:
        number, text = line
        what = f"holds no table of numbers that is understood: found {shown(text)!r}, expected {expected}"
        body = self.head.body(self.given.skip)
        if len(body) <= 2 and not any(one.isdigit() for _, one_line in body for one in one_line.split()):
            what = f"holds only a header: found {shown(text)!r}, expected rows of numbers behind it"
        remedy = "set `delimiter`, `decimal`, `header` or `skip` under `text` in the manifest"
        return DataError(what, f"{self.path}, line {number}", remedy)


def _with_lead(found: Typed, naming: Naming, lead: Lead | None, lines: Sequence[str]) -> tuple[Typed, Naming]:
    """Put the receiver's stamp before the other columns, as the column "time"."""
    if lead is None:
        return found, naming
    stamps = [cell for line in lines[:200] if not missing(cell := lead.stamp(line))]
    kind, stamp = kind_of(stamps, ".")
    stamp = stamp_of(stamps) or stamp
    order = stamp.order if stamp else "ymd"
    field = Field(kind, lead.label.encode(), order)
    parts = ((0,), *(tuple(cell + 1 for cell in cells) for cells in found.parts))
    names = ["time", *(name if name != "time" else "time#1" for name in naming.names)]
    stamps_of = (*found.stamps, stamp) if stamp else found.stamps
    made = Typed((field, *found.fields), parts, ("", *found.labels), stamps_of)
    return made, Naming(names, ["", *naming.units], naming.header)
