"""Published, ours and implied, cell by cell, and how far the first two agree."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from vgyro.papers.beside import ComparedMethod
from vgyro.papers.evidence import Ours, PaperEvidence, look_up
from vgyro.papers.implied import Implied
from vgyro.papers.published import Heading, Paper, PublishedTable, Variant, half_unit

Agreement = Literal["within interval", "within 10 %", "differs", "none"]
NEAR = 0.10
OWN, OF_PAPER = "vgyro, not in the paper", "method of the paper"
CSV_COLUMNS = (
    "paper", "table", "row", "column", "unit", "published", "implied", "implied_how", "variant", "ours", "low", "high",
    "ours_is", "agreement", "source", "reason", "over", "ratio", "ratio_low", "ratio_high", "standing",
)  # fmt: skip


@dataclass(frozen=True)
class ComparedCell:
    """One reading of one cell.

    published : as printed; None in a row or column of ours
    implied   : None in a row or column of ours
    agreement : of ours with published: within our 95 % interval (and the rounding of the print), within 10 %, differs,
                none where one of the two is missing or the reading is of another quantity
    reason    : why there is no figure of ours; empty where there is one
    """

    table: int | str
    row: str
    column: str
    unit: str
    published: str | None
    implied: Implied | None
    variant: str
    ours: Ours
    agreement: Agreement
    reason: str


@dataclass(frozen=True)
class Comparison:
    """All cells of one published table."""

    paper: str
    table: PublishedTable
    cells: tuple[ComparedCell, ...]

    def at(self, row: str, column: str) -> tuple[ComparedCell, ...]:
        """The readings of one cell, the first one first."""
        return tuple(cell for cell in self.cells if (cell.row, cell.column) == (row, column))


def compare(
    paper: Paper, table: PublishedTable, evidence: PaperEvidence, implied: Mapping[tuple[int | str, str, str], Implied]
) -> Comparison:
    """Put every numeric cell of a table beside ours.

    implied : vgyro.papers.implied_cells.implied_cells(paper)
    raises  : KeyError if a published cell has no entry in `implied`
    """
    return Comparison(paper.name, table, tuple(_cells(table, evidence, implied)))


def _cells(
    table: PublishedTable, evidence: PaperEvidence, implied: Mapping[tuple[int | str, str, str], Implied]
) -> Iterator[ComparedCell]:
    for row in (*table.rows, *table.extra_rows):
        for column in (*table.columns, *table.extra_columns):
            ours_alone = row in table.extra_rows or column in table.extra_columns
            published = None if ours_alone else table.text(row.name, column.name)
            if published is None and not ours_alone:
                continue
            follows = None if ours_alone else implied[table.number, row.name, column.name]
            for variant in table.variants:
                if _covers(variant, row, column):
                    ours = look_up(evidence, {**table.select, **row.select, **column.select, **variant.select})
                    unit = table.unit_of(row, column)
                    ours = _in_unit(ours, unit)
                    yield ComparedCell(
                        table.number, row.name, column.name, unit, published, follows, variant.name, ours,
                        agreement(published if variant.compared else None, ours), "" if ours.known else ours.reason,
                    )  # fmt: skip


def _covers(variant: Variant, row: Heading, column: Heading) -> bool:
    return (variant.rows is None or row.name in variant.rows) and (
        variant.columns is None or column.name in variant.columns
    )


def _in_unit(ours: Ours, unit: str) -> Ours:
    """A figure of ours in another unit than the table's is not comparable: say so instead of showing it."""
    if ours.known and ours.unit and ours.unit != unit:
        return Ours(math.nan, source=ours.source, reason=f"ours is in {ours.unit}, the table in {unit}")
    return ours


def agreement(published: str | None, ours: Ours) -> Agreement:
    """How a printed number and ours compare; the print may be off by half a unit of its last digit."""
    if published is None or not ours.known:
        return "none"
    value, rounding = float(published), half_unit(published)
    if ours.low - rounding <= value <= ours.high + rounding or abs(ours.value - value) <= rounding:
        return "within interval"
    return "within 10 %" if abs(ours.value - value) <= NEAR * abs(value) else "differs"


def csv_of(comparisons: Sequence[Comparison], beside: Sequence[ComparedMethod] = ()) -> str:
    """The cells as CSV, one line a reading; an empty field where there is no number.

    beside : methods of ours beside the paper's, of the last table, which go behind the cells
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for comparison in comparisons:
        for cell in comparison.cells:
            writer.writerow(_line(comparison.paper, cell))
    for one in beside:
        writer.writerow(_beside_line(comparisons[-1], one))
    return text.getvalue()


def _line(paper: str, cell: ComparedCell) -> list[Any]:
    follows = cell.implied or Implied(None, "")
    return [
        paper, cell.table, cell.row, cell.column, cell.unit, cell.published or "",
        _digits(follows.value), follows.how, cell.variant,
        _digits(cell.ours.value), _digits(cell.ours.low), _digits(cell.ours.high),
        "simulated" if cell.ours.known else "", cell.agreement, cell.ours.source, cell.reason, "", "", "", "", "",
    ]  # fmt: skip


def _beside_line(comparison: Comparison, one: ComparedMethod) -> list[Any]:
    variant = "; ".join(filter(None, (OWN if one.own else OF_PAPER, one.case)))
    return [
        comparison.paper, comparison.table.number, one.method, one.figure, one.unit, "", "", "", variant,
        _digits(one.value.value), _digits(one.value.low), _digits(one.value.high),
        "simulated" if one.value.known else "", "none", one.value.source, one.value.reason,
        one.over, _digits(one.ratio.value), _digits(one.ratio.low), _digits(one.ratio.high),
        "" if one.standing == "none" else one.standing,
    ]  # fmt: skip


def _digits(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.6g}"
