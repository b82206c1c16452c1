"""The map of the fits: how many windows of each gyro, and of DCC, ended as what, and when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from vgyro.report.colours import BAD, GRID, MUTED, series_mark
from vgyro.report.html import definitions, join, paragraph
from vgyro.report.model import Table
from vgyro.report.numbers import MISSING, count, percent
from vgyro.report.plots import Axis, Bars, bar_plot
from vgyro.report.tables import Cell, TableColumn, render_table

DCC = "dcc"
CONVERGED = "converged"
# status → (colour mark, meaning), in the order of legend and table; like boundaries of GARCH and DCC share a colour.
STATUSES = {
    CONVERGED: (GRID, "an optimum inside the bounds; only these have standard errors"),
    "boundary: α = 0": (series_mark(5), "GARCH: no memory of the squares; the variance is constant or a trend"),
    "boundary: β = 0": (series_mark(0), "GARCH: ARCH(1), memory of one sample only"),
    "boundary: α + β = 1": (series_mark(1), "GARCH: integrated, the variance never comes back to a mean"),
    "boundary: ω = 0": (series_mark(2), "GARCH: the variance sinks all the way from where the window begins"),
    "boundary: a = 0": (series_mark(5), "DCC: nothing is gained over a constant correlation, which stands"),
    "boundary: b = 0": (series_mark(0), "DCC: memory of one sample only"),
    "boundary: a + b = 1": (series_mark(1), "DCC: integrated, the correlation never comes back to a mean"),
    "boundary margin": (series_mark(4), "DCC: fitted, but a gyro's GARCH is at a boundary: no two-step errors"),
    "outlier-dominated": (series_mark(3), "one sample holds more than a fifth of the sum of squares"),
    "no variance": (MUTED, "the gyro's output does not change: it has no model, and no weight"),
    "not positive definite": (series_mark(6), "the correlation is singular; the identity stands for it"),
    "one gyro": (MUTED, "fewer than two gyros have a model: there is nothing to correlate"),
    "too short": (MUTED, "too few samples"),
    "failed": (BAD, "no model: the series is not finite, or the optimiser did not end"),
}  # fmt: skip
NO_USE = ("no variance", "outlier-dominated", "not positive definite", "too short", "failed")
ROW, SPACE, LEAST_HEIGHT = 26, 90, 140


def fits_map(anchor: str, gyros: Sequence[str], table: Table) -> Markup:
    """Strips over time, the table of counts, what the statuses mean. table : columns of fits.parquet"""
    subjects = [name for name in (*gyros, DCC) if (table["subject"] == name).any()]
    if not subjects:
        return paragraph("No window was fitted.", "note")
    statuses = [status for status in STATUSES if (table["status"] == status).any()]
    return join(
        _strips(anchor, subjects, statuses, table),
        _counts(subjects, statuses, table),
        definitions([(status, STATUSES[status][1]) for status in statuses]),
    )


def _strips(anchor: str, subjects: Sequence[str], statuses: Sequence[str], table: Table) -> Markup:
    """One strip a gyro and one for DCC; in each bin of time the statuses are stacked by their share."""
    row = np.array([subjects.index(name) for name in table["subject"]], dtype=float)
    windows = table["windows"].astype(float)
    before, total = _stacked(table, row, windows)
    bottom, top = (
        len(subjects) - 1 - row + 0.08 + 0.84 * share for share in (before / total, (before + windows) / total)
    )
    bars = []
    for status in statuses:
        mine = np.flatnonzero(table["status"] == status)
        bars.append(
            Bars(
                status,
                STATUSES[status][0],
                left=table["time_start"][mine],
                right=table["time_stop"][mine],
                bottom=bottom[mine],
                top=top[mine],
                hover={"of": table["subject"][mine], "windows": windows[mine], "in all": total[mine]},
            )
        )
    height = max(LEAST_HEIGHT, SPACE + ROW * len(subjects))
    title = "Statuses of the fits over time, by their share of the windows"
    ticks = [(len(subjects) - 1 - place + 0.5, name) for place, name in enumerate(subjects)]
    return bar_plot(f"fits-{anchor}", title, bars, Axis("time, s"), ticks, height=height)


def _stacked(table: Table, row: np.ndarray, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Windows of earlier statuses in the same bin and strip, and of all statuses there, for each row of the table."""
    order = list(STATUSES)
    rank = np.array([order.index(status) for status in table["status"]])
    sorted_rows = np.lexsort((rank, row, table["time_start"]))
    time, strip, number = table["time_start"][sorted_rows], row[sorted_rows], windows[sorted_rows]
    first = np.append(True, (np.diff(time) != 0) | (np.diff(strip) != 0))
    group = np.cumsum(first) - 1
    running = np.cumsum(number) - number
    before, total = np.empty_like(number), np.empty_like(number)
    before[sorted_rows] = running - running[np.flatnonzero(first)][group]
    total[sorted_rows] = np.bincount(group, weights=number)[group]
    return before, total


def _counts(subjects: Sequence[str], statuses: Sequence[str], table: Table) -> Markup:
    columns = [
        TableColumn("fits of", numeric=False),
        TableColumn("windows"),
        *(TableColumn(status) for status in statuses),
    ]
    rows = []
    for name in subjects:
        found = status_counts(table, name)
        total = sum(found.values())
        rows.append(
            [Cell(name), Cell(count(total)), *(_share_cell(found.get(status, 0), total) for status in statuses)]
        )
    return render_table(columns, rows, "Rolling windows by the status of their fit", compact=True)


def _share_cell(number: int, total: int) -> Cell:
    return Cell(count(number), percent(number / total)) if number else Cell(MISSING, tone="muted")


def status_counts(table: Table, subject: str) -> dict[str, int]:
    """Status → windows, of one gyro or of DCC."""
    found: dict[str, int] = {}
    for index in np.flatnonzero(table["subject"] == subject):
        status = str(table["status"][index])
        found[status] = found.get(status, 0) + int(table["windows"][index])
    return found


def shares(statuses: Mapping[str, int]) -> str:
    """Statuses and their shares in one line, the most frequent first."""
    total = sum(statuses.values())
    return ", ".join(f"{name} {percent(number / total)}" for name, number in statuses.items())
