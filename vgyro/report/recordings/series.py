"""Rates and temperatures over time, and the correlation matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from vgyro.report.envelope import broken
from vgyro.report.html import join, paragraph
from vgyro.report.model import ArrayPart, RecordingPart, Table, rows_of
from vgyro.report.numbers import duration, rounded
from vgyro.report.plots import Axis, Curve, PlotFrame, PlotMarks, curve_plot
from vgyro.report.recordings.faults import fault_times
from vgyro.report.tables import Cell, TableColumn, render_table

TIME = Axis("time, s")
RATE = Axis("rate, deg/s")
REFERENCE = "reference"


def rates_plots(recording: RecordingPart, array: ArrayPart) -> Markup:
    """Rates of one array over time, with the rest stretches marked; rest alone below it where the board also moves."""
    rates = recording.rates
    if rates is None:
        return Markup("")
    if rates.spans:
        share = duration(float(sum(stop - start for start, stop in rates.spans)))
        words = f"tinted: {len(rates.spans)} stretches at rest, {share} together"
    else:
        words = "at rest throughout" if rates.still else "never known to be at rest"
    summary = f"{words}; each point is the least or greatest value of a short run of samples"
    title = f"Rates, axis {array.axis}"
    curves = _rate_curves(rates.time, rates.gyros, array)
    if rates.reference is not None:
        curves.append(Curve(REFERENCE, REFERENCE, rates.time, rates.reference, ink=True, width=1))
    spans, faults = rates.spans, fault_times(array)
    summary += "; dashed: begin and end of faults" if faults else ""
    whole = curve_plot(
        PlotFrame(f"rates-{array.anchor}", title, TIME, RATE, summary=summary),
        curves,
        PlotMarks(spans=spans, lines=faults),
    )
    if not spans:
        return whole
    still = _rate_curves(rates.time, rates.rest, array)
    return join(
        whole,
        curve_plot(
            PlotFrame(f"rest-{array.anchor}", f"{title}, at rest only", TIME, RATE), still, PlotMarks(spans=spans)
        ),
    )


def _rate_curves(time: np.ndarray, columns: Table, array: ArrayPart) -> list[Curve]:
    time, values = broken(time, np.column_stack([columns[name] for name in array.gyros]))
    return [
        Curve(name, name, time, values[:, i], colour=i, width=1, behind=_spread(values[:, i]))
        for i, name in enumerate(array.gyros)
    ]


def _spread(values: np.ndarray) -> float:
    """How wide a noisy curve is drawn: its mean step from one point to the next."""
    steps = np.abs(np.diff(values))
    return float(np.nanmean(steps)) if np.isfinite(steps).any() else 0.0


def temperature_plot(recording: RecordingPart) -> Markup:
    """Temperatures of a recording over time; nothing where none is logged."""
    rates = recording.rates
    if rates is None or not rates.temperatures:
        return Markup("")
    curves = [
        Curve(name, name, rates.temperature_time, values, colour=i, width=1.2)
        for i, (name, values) in enumerate(rates.temperatures.items())
    ]
    identifier = f"temperature-{recording.name}"
    return curve_plot(PlotFrame(identifier, "Temperature", TIME, Axis("temperature, °C"), height=240), curves)


def correlation_table(recording: RecordingPart, array: ArrayPart) -> Markup:
    """Correlation matrix of the gyros' noise as a coloured table, limits below each factor."""
    table = array.tables.get("correlation")
    if table is None or len(array.gyros) < 2:
        return paragraph("One gyro: there is no correlation matrix.", "note")
    found = {(row["gyro"], row["other"]): row for row in rows_of(table)}
    columns = [TableColumn("", numeric=False), *(TableColumn(name) for name in array.gyros)]
    rows = [
        [Cell(name), *(_correlation_cell(found.get((name, other)), name == other) for other in array.gyros)]
        for name in array.gyros
    ]
    still = recording.rates is None or recording.rates.still > 0
    of = "samples at rest" if still else "rate − reference"
    caption = f"Correlation factors of the gyros' noise, {of} (Jiang et al. 2012, eq. 22); below, 95 % limits"
    return render_table(columns, rows, caption, compact=True)


def _correlation_cell(row: dict[str, Any] | None, diagonal: bool) -> Cell:
    if row is None or not np.isfinite(row["correlation"]):
        return Cell("—", tone="muted", hint="a gyro whose output does not vary has no correlation")
    value, low, high = float(row["correlation"]), float(row["low"]), float(row["high"])
    if diagonal:
        return Cell("1", tone="muted")
    below = f"{rounded(low, 3)} … {rounded(high, 3)}" if np.isfinite(low) and np.isfinite(high) else ""
    return Cell(rounded(value, 3), below, shade=value)
