"""What the kernels of text lines are told and what they return; both engines share it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

Cell = Literal["skip", "number", "hex", "integer", "date", "day", "words", "literal"]
Order = Literal["ymd", "dmy", "mdy"]
ORDERS: tuple[Order, ...] = ("ymd", "dmy", "mdy")

PAD = 64
"""Bytes that must be readable behind the last line."""
NULL = np.iinfo(np.int64).min
"""A missing integer or stamp."""
MISSING = ("", "nan", "null", "na", "n/a", "none", "-nan", "+nan")
"""Cells that hold no value, in small letters."""

CELL, FEW, MANY, QUOTE, LABEL, LEAD, CHECKSUM, KIND = range(1, 9)
"""Why a line does not fit: a cell is not of its kind; too few cells; too many; a quote is not closed; a label is
missing; the sign behind the first cell is; the checksum is wrong; the line begins like a number, not with a word."""


class Field(NamedTuple):
    """One cell of a line.

    kind  : what it becomes: number and hex float64; integer int64; date ns since 1970 and day ns since midnight, int64;
            words [n, 2] offset and size in the buffer; skip nothing; literal nothing, but it must be the label
    label : what stands before the value in the cell, such as b"gx:"
    order : of the parts of a date
    split : a date or time whose fraction of a second is in the next cell, for the delimiter is its decimal sign
    """

    kind: Cell
    label: bytes = b""
    order: Order = "ymd"
    split: bool = False


@dataclass(frozen=True)
class LineForm:
    """How the lines of one table look.

    delimiter : one byte; b" ": any blanks.  decimal : b"." or b",", not the delimiter
    eol       : b"\\n" (b"\\r" before it is a blank), or b"\\r"
    word      : with which each line of the table begins; empty: every line is the table's
    lead      : what ends the first cell instead of the delimiter
    checksum  : lines end with "*" and the XOR of all bytes between "$" and it, as two hexadecimal digits
    """

    fields: tuple[Field, ...]
    delimiter: bytes = b","
    decimal: bytes = b"."
    eol: bytes = b"\n"
    word: bytes = b""
    lead: bytes = b""
    checksum: bool = False


class Parsed(NamedTuple):
    """What some lines hold.

    columns  : one for each field, None where it is skipped or literal; missing numbers are NaN, missing integers NULL
    bad      : int64 [n, 5], lines that do not fit: offset, size, line from 0, field from 0, why
    consumed : bytes done;  lines : lines done, empty ones too
    other    : lines of other kinds;  first : line of the first row, -1 if there is none
    """

    columns: list[np.ndarray | None]
    bad: np.ndarray
    consumed: int
    lines: int
    other: int
    first: int


def check(data: np.ndarray, size: int, form: LineForm) -> None:
    """raises : ValueError if a buffer or a form is none that kernels may be given"""
    if size <= 0 or len(data) < size + PAD or data[size - 1] != form.eol[0]:
        raise ValueError(f"{size} bytes of {len(data)} are no whole lines with {PAD} bytes behind them")
    if form.delimiter == form.decimal or any(len(one) != 1 for one in (form.delimiter, form.decimal, form.eol)):
        raise ValueError(
            f"delimiter {form.delimiter!r}, decimal {form.decimal!r} and end {form.eol!r} are not distinct"
        )
    if form.delimiter.isalnum() or form.delimiter in b'+-."\r\n*$\0':
        raise ValueError(f"{form.delimiter!r} cannot stand between cells")
    if any(one.split and (one.kind not in ("date", "day") or form.delimiter != b",") for one in form.fields):
        raise ValueError("only dates and times are split, and only by a comma")
    if form.delimiter in b"".join(field.label for field in form.fields):
        raise ValueError("a label holds the delimiter")
    if form.eol in form.lead + form.word + b"".join(field.label for field in form.fields):
        raise ValueError("a word, a label or a lead holds the line's end")
