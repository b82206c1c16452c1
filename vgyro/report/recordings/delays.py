"""Delays between the gyros of one array, as they were found and taken out."""

from __future__ import annotations

import math
from typing import Any

from markupsafe import Markup

from vgyro.report.html import details, join, paragraph
from vgyro.report.model import ArrayPart, RecordingPart
from vgyro.report.numbers import duration, plain
from vgyro.report.tables import Cell, TableColumn, TableRow, number_cell, render_table

COLUMNS = (
    TableColumn("gyro", numeric=False),
    TableColumn("delay", "ms", hint="positive: later than the others; 95 % interval below"),
    TableColumn("taken out", numeric=False),
    TableColumn("noise left", hint="share of the variance of white noise that the interpolation leaves"),
)
FOUND = "found"


def delays_part(recording: RecordingPart, array: ArrayPart) -> Markup:
    """Table of the delays, open where one was taken out; nothing where they could not be looked for."""
    if recording.rates is None or array.axis not in recording.rates.delays:
        return Markup("")
    found = recording.rates.delays[array.axis]
    if found["status"] != FOUND:
        return paragraph(f"Delays between the gyros are not known: {found['status']}.", "note")
    rows = [TableRow(_cells(name, entry)) for name, entry in found["gyros"].items()]
    late = [name for name, entry in found["gyros"].items() if entry["removed"]]
    table = render_table(COLUMNS, rows, f"from {duration(float(found['moving_s']))} of motion", compact=True)
    title = f"Delays between the gyros: {', '.join(late)} late, taken out" if late else "Delays between the gyros: none"
    return join(details(title, table, opened=bool(late)))


def _cells(name: str, entry: dict[str, Any]) -> tuple[Cell, ...]:
    limits = [math.nan if entry[key] is None else 1e3 * float(entry[key]) for key in ("delay_s", "low_s", "high_s")]
    removed = bool(entry["removed"])
    return (
        Cell(name), number_cell(*limits, tone="warn" if removed else ""), Cell("yes" if removed else "no"),
        Cell(plain(float(entry["noise_gain"]), 3)),
    )  # fmt: skip
