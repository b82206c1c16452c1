"""The cross-check: sampled results, computed again by an independent route."""

from __future__ import annotations

import math
from typing import Any

from markupsafe import Markup

from vgyro.report.html import details, join, paragraph
from vgyro.report.model import ArrayPart, rows_of
from vgyro.report.numbers import MISSING, significant
from vgyro.report.tables import Cell, TableColumn, TableRow, render_table

CAPTION = "Sampled results, computed again by the other engine and by independent routes"
WORDS = (
    "Likelihoods are maxima of one function: ours fails where it is smaller than theirs by more than the tolerance, "
    "one millionth a sample; where theirs is smaller, they did not find the maximum. All other figures must agree."
)


def crosscheck_part(array: ArrayPart) -> Markup:
    """The table, closed if every check passed, open and red if not."""
    table = array.tables.get("crosscheck")
    if table is None or not len(table["check"]):
        return paragraph("No cross-check was made.", "note")
    columns = [
        TableColumn("check", numeric=False),
        TableColumn("against", numeric=False),
        TableColumn("window"),
        TableColumn("series", numeric=False),
        TableColumn("ours"),
        TableColumn("theirs"),
        TableColumn("difference"),
        TableColumn("tolerance"),
        TableColumn("unit", numeric=False),
        TableColumn("", numeric=False),
    ]
    rows = [_row(row) for row in rows_of(table)]
    failed = failures(array)
    total = len(rows)
    html = join(render_table(columns, rows, CAPTION, compact=True), paragraph(WORDS, "note"))
    if not failed:
        return details(f"Cross-check: all {total} comparisons passed", html)
    return details(
        f"Cross-check: {failed} of {total} comparisons FAILED",
        join(paragraph("A result differs from its independent recomputation by more than the tolerance.", "bad"), html),
        opened=True,
    )


def failures(array: ArrayPart) -> int:
    """How many comparisons did not pass."""
    table = array.tables.get("crosscheck")
    return 0 if table is None else int((~table["passed"].astype(bool)).sum())


def _row(row: dict[str, Any]) -> TableRow:
    passed = bool(row["passed"])
    numbers = [
        Cell(significant(float(row[name]), digits))
        for name, digits in (("ours", 6), ("theirs", 6), ("difference", 2), ("tolerance", 2))
    ]
    window = "whole" if int(row["window"]) < 0 else str(int(row["window"]))
    verdict = Cell("passed", tone="good") if passed else Cell("FAILED", tone="bad")
    if passed and float(row["difference"]) > float(row["tolerance"]):
        verdict = Cell("passed: theirs is worse", tone="good", hint="a greater likelihood is the better one")
    if not passed and math.isnan(float(row["difference"])):
        verdict = Cell("FAILED: one side has no figure", tone="bad")
    unit = str(row["unit"]) or MISSING
    cells = (Cell(str(row["check"])), Cell(str(row["against"])), Cell(window), Cell(str(row["series"])), *numbers)
    return TableRow((*cells, Cell(unit), verdict), tone="" if passed else "bad")
