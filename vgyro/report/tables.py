"""Tables of a page: a small model, and its HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from markupsafe import Markup

from vgyro.report.html import macro
from vgyro.report.numbers import MISSING, with_interval

Tone = Literal["", "good", "bad", "warn", "muted", "best"]


@dataclass(frozen=True)
class TableColumn:
    """One column. unit : printed under the title; numeric : right-aligned, figures of one width; hint : tooltip

    wide : holds sentences; a narrow page scrolls rather than break them into words
    """

    title: str
    unit: str = ""
    numeric: bool = True
    hint: str = ""
    group: str = ""
    wide: bool = False


@dataclass(frozen=True)
class Cell:
    """One cell. text : a plain string, escaped, or Markup

    below : small second line (an interval);  tone : colour by meaning;  shade : -1..1, background of a coloured matrix
    notes : numbers of footnotes;  hint : tooltip;  mark : a short word in a box;  span : columns that it fills
    """

    text: str
    below: str = ""
    tone: Tone = ""
    shade: float | None = None
    notes: tuple[int, ...] = ()
    hint: str = ""
    mark: str = ""
    span: int = 1


@dataclass(frozen=True)
class TableRow:
    """One row. heading : spans the table as a title of the rows below it (cells then stay empty)"""

    cells: tuple[Cell, ...] = ()
    heading: str = ""
    tone: Tone = ""


class Notes:
    """Footnotes of one table: each text once, numbered from 1 in the order of use."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def number(self, text: str) -> tuple[int, ...]:
        """Number of a note, as a tuple for Cell.notes; () for an empty text."""
        if not text:
            return ()
        if text not in self.texts:
            self.texts.append(text)
        return (self.texts.index(text) + 1,)


def number_cell(
    value: float, low: float = float("nan"), high: float = float("nan"), *, tone: Tone = "",
    notes: tuple[int, ...] = (), hint: str = "",
) -> Cell:  # fmt: skip
    """A figure with its interval below it; a dash where it is missing (say why in `notes` or `hint`)."""
    text, interval = with_interval(value, low, high)
    return Cell(text, interval, "muted" if text == MISSING else tone, None, notes, hint)


def render_table(
    columns: Sequence[TableColumn],
    rows: Sequence[TableRow | Sequence[Cell | str]],
    caption: str = "",
    notes: Sequence[str] = (),
    *,
    row_header: bool = True,
    compact: bool = False,
) -> Markup:
    """HTML of a table, in a box that scrolls sideways where the screen is narrow.

    row_header : the first cell of each row names it, and stays in sight when the table scrolls
    raises     : ValueError if a row has not as many cells as there are columns
    """
    return macro(
        "table", columns=tuple(columns), rows=tuple(_row(row, len(columns)) for row in rows), caption=caption,
        notes=tuple(notes), row_header=row_header, compact=compact, groups=_groups(columns),
    )  # fmt: skip


def _row(row: TableRow | Sequence[Cell | str], width: int) -> TableRow:
    if not isinstance(row, TableRow):
        row = TableRow(tuple(cell if isinstance(cell, Cell) else Cell(cell) for cell in row))
    filled = sum(cell.span for cell in row.cells)
    if not row.heading and filled != width:
        raise ValueError(f"a row has {filled} cells, the table has {width} columns: {row.cells[:1]}")
    return row


def _groups(columns: Sequence[TableColumn]) -> tuple[tuple[str, int], ...]:
    """Neighbouring columns of one group: (title, how many); () where no column has a group."""
    groups: list[tuple[str, int]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1] = (column.group, groups[-1][1] + 1)
        else:
            groups.append((column.group, 1))
    return tuple(groups) if any(column.group for column in columns) else ()
