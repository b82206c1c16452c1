"""Cells of tables of figures: how a value of metrics.parquet reads."""

from __future__ import annotations

from dataclasses import replace

from vgyro.figure import Figure
from vgyro.report.model import Value
from vgyro.report.numbers import MISSING, significant
from vgyro.report.tables import Cell, Notes, TableColumn, number_cell

BAND_LIMITED = "band-limited"
TAKES_PART = "the low-pass takes part"
# Said of nearly every cell: a tooltip will do.
ROUTINE = (
    "bootstrap of blocks",
    "gain ",
    "each pose's own mean",
    "two-sided,",
    "line through",
    "fitted from",
    "limits from the chi²",
    "one-sided ",
    "of the error",
    "low-passed to",
    "forward and back",
    BAND_LIMITED,
    TAKES_PART,
)
ROUTINE_END = ("degrees of freedom", " s.d.")
NOT_GIVEN = {"nees": "the method gives no standard deviation of its rate"}


def remarks(note: str) -> str:
    """What a reader must know of a note: its clauses without those that say how such a figure is always found."""
    clauses = note.split("; ")
    return "; ".join(part for part in clauses if not (part.startswith(ROUTINE) or part.endswith(ROUTINE_END)))


def figure_column(figure: Figure, group: str = "") -> TableColumn:
    """Head of a column of one figure."""
    return TableColumn(figure.title, "" if figure.unit == "1" else figure.unit, hint=figure.meaning, group=group)


def says_limited(value: Value) -> bool:
    """True if a low-pass lowers the figure by itself."""
    return bool(value.flags & {"band_limited", "takes_part"})


def figure_cell(
    value: Value | None, metric: str, notes: Notes, *, gyro: bool = False, best: bool = False, limited: bool = False
) -> Cell:
    """A figure with its interval, or why there is none; factors whose interval holds 1 are grey.

    gyro : the row is that of a single gyro;  best : of its column
    limited : a low-pass lowers it by itself, whether it is flagged or not
    """
    if value is None:
        hint = NOT_GIVEN.get(metric, "not computed")
        if gyro and metric.startswith("if_"):
            hint = "compares a method with the single gyros"
        return Cell("" if gyro and metric.startswith("if_") else MISSING, tone="muted", hint=hint)
    if not value.known:
        return Cell(MISSING, tone="muted", hint=value.note, notes=notes.number(value.note))
    if "not_shown" in value.flags:
        return Cell(f"< {significant(value.high, 2)}", tone="muted", hint=value.note)
    insignificant = "not_significant" in value.flags
    cell = number_cell(
        value.value,
        value.low,
        value.high,
        tone="muted" if insignificant else "best" if best else "",
        notes=() if insignificant else notes.number(remarks(value.note)),
        hint=value.note,
    )
    return replace(cell, mark=BAND_LIMITED) if limited or says_limited(value) else cell
