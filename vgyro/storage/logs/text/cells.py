"""Cells of a text: how a line is cut into them, and what those of one column are."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from vgyro.engine.reference.text import date, hexadecimal, integer, time_of_day
from vgyro.engine.text import MISSING, Cell, Order

ENOUGH = 0.75
"""Share of a column's cells that tells what it is; the others are damage."""
EXACT_DIGITS = 15
"""Digits that a double holds for sure; longer integers are kept as integers."""
NUMBERS = {
    sign: re.compile(
        rf"[+-]?(?:(?:[0-9]+(?:{re.escape(sign)}[0-9]*)?|{re.escape(sign)}[0-9]+)(?:[eE][+-]?[0-9]+)?"
        r"|(?i:inf|infinity)|0[xX][0-9A-Fa-f]{1,16})"
    )
    for sign in ".,"
}
"""What reference.text.number takes, by the sign before the decimals; quicker where only the form counts."""
STAMP = re.compile(
    r"(?:\d{4}([-/.])\d{1,2}\1\d{1,2}|\d{8}(?=T)|\d{1,2}[-/. ](?:\d{1,2}|[A-Za-z]{3})[-/. ]\d{2,4})(?:[T_ ]+\d.*)?"
    r"|\d{1,2}:\d\d:\d\d.*"
)
"""What looks like a date, a time of day, or both."""
WORD = re.compile(r"[$!@#>\[]?[^\W\d][\w.\-/\]]*:?")
LABEL = re.compile(r"(\"?[^\W\d][^:=,;\"]{0,60}\"?\s*[:=])\s*(\S.*)?")


def missing(cell: str) -> bool:
    """Does a cell stand for no value?"""
    return cell.lower() in MISSING


def split(line: str, delimiter: str) -> list[str]:
    """Cells of a line without their quotes and blanks. delimiter : one sign; " ": any blanks"""
    if '"' in line:
        if delimiter == " ":
            line = re.sub(r"[ \t]+", " ", line.strip())
        try:
            found = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
        except (csv.Error, StopIteration):
            found = line.split(delimiter)
        return [cell.strip() for cell in found]
    return line.split() if delimiter == " " else [cell.strip() for cell in line.split(delimiter)]


def is_word(cell: str) -> bool:
    """Is a cell a word, which could tell the kind of its line?"""
    return bool(WORD.fullmatch(cell)) and not missing(cell) and not is_number(cell, ".")


def is_number(cell: str, decimal: str) -> bool:
    """Is a cell a number?"""
    return NUMBERS[decimal].fullmatch(cell) is not None


def is_value(cell: str, decimal: str) -> bool:
    """Is a cell a number, or does it look like a stamp?"""
    return is_number(cell, decimal) or STAMP.fullmatch(cell) is not None


class Stamp(NamedTuple):
    """What stamps are. order : of a date's parts;  sure : is it beyond doubt?;  timed : do they hold a time?"""

    kind: Cell
    order: Order = "ymd"
    sure: bool = True
    timed: bool = True


def stamp_of(cells: Sequence[str]) -> Stamp | None:
    """What stamps the cells are, none of them missing; None if they are none."""
    if not cells or not _most(cells[:20], lambda cell: STAMP.fullmatch(cell) is not None):
        return None
    if all(":" in cell for cell in cells) and _most(cells, lambda cell: time_of_day(cell, "") is not None):
        return Stamp("day")
    timed = any(":" in cell or "T" in cell for cell in cells)
    fits = {order: sum(date(cell, order, "") is not None for cell in cells) for order in ("ymd", "dmy", "mdy")}
    if fits["ymd"] >= ENOUGH * len(cells):
        return Stamp("date", "ymd", True, timed)
    best: Order = "mdy" if fits["mdy"] > fits["dmy"] else "dmy"
    if fits[best] < ENOUGH * len(cells):
        return None
    sure = fits["mdy"] != fits["dmy"] or "." in cells[0][:3] or bool(re.search("[A-Za-z]{3}", cells[0]))
    if not sure and re.search("[ap]m", cells[0], re.IGNORECASE):
        # Hours to twelve are written where the month comes first.
        best = "mdy"
    return Stamp("date", best, sure, timed)


def _most(cells: Sequence[str], test: Callable[[str], bool]) -> bool:
    return sum(map(test, cells)) >= ENOUGH * len(cells)


def kind_of(cells: Sequence[str], decimal: str) -> tuple[Cell, Stamp | None]:
    """What the cells of one column are: number, hex, integer, date, day or words, and the form of a stamp.

    An empty column is one of numbers.
    """
    there = [cell for cell in cells if not missing(cell)]
    if not there:
        return "number", None
    if (stamp := stamp_of(there)) is not None:
        return stamp.kind, stamp
    numbers = sum(is_number(cell, decimal) for cell in there)
    if numbers < len(there) and _hexadecimal(there):
        return "hex", None
    if numbers >= ENOUGH * len(there):
        long = any(len(cell.lstrip("+-").lstrip("0")) > EXACT_DIGITS for cell in there if integer(cell) is not None)
        return ("integer" if long and all(integer(cell) is not None for cell in there) else "number"), None
    return "words", None


def _hexadecimal(cells: Sequence[str]) -> bool:
    """Bare hexadecimal numbers: all of one width, with digits and letters."""
    width = Counter(map(len, cells)).most_common(1)[0][0]
    if width < 2 or not _most(cells, lambda cell: len(cell) == width and hexadecimal(cell) is not None):
        return False
    text = "".join(cells).lower()
    return not text.startswith("0x") and any(one in "abcdef" for one in text) and any(one.isdigit() for one in text)


class Labelled(NamedTuple):
    """A label as it stands before its value, such as "gx:", and the values."""

    label: str
    values: list[str]


def labelled(cells: Sequence[str]) -> Labelled | None:
    """Cells that all have the same label; None if they have none, or several."""
    found = [LABEL.fullmatch(cell) for cell in cells]
    labels = Counter(one[1] for one in found if one is not None)
    if not labels:
        return None
    label, count = labels.most_common(1)[0]
    if count < ENOUGH * len(cells):
        return None
    return Labelled(label, [(one[2] or "").strip() for one in found if one is not None and one[1] == label])


def name_of(label: str) -> str:
    """A label without its sign and quotes."""
    return label.rstrip().rstrip(":=").strip().strip('"').strip()
