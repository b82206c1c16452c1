"""Rates and temperatures over time, and the correlation matrix."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from vgyro.report.envelope import broken, envelope, stretches, thin
from vgyro.report.html import join, paragraph
from vgyro.report.model import ArrayPart, RecordingPart, Table, rows_of
from vgyro.report.numbers import duration, rounded
from vgyro.report.plots import Axis, Curve, curve_plot
from vgyro.report.tables import Cell, Column, render_table

TIME = Axis("time, s")
RATE = Axis("rate, deg/s")
REFERENCE = "reference"
TEMPERATURE = "temp_"


def rates_plots(recording: RecordingPart, array: ArrayPart) -> Markup:
    """Rates of one array over time, with the rest stretches marked; rest alone below it where the board also moves."""
    rates = recording.rates
    if rates is None:
        return Markup("")
    time, at_rest = rates["time"], rates["at_rest"].astype(bool)
    everywhere, nowhere = bool(at_rest.all()), not at_rest.any()
    spans = [] if everywhere or nowhere else stretches(time, at_rest)
    if everywhere:
        words = "at rest throughout"
    elif nowhere:
        words = "never known to be at rest"
    else:
        share = duration(float(sum(stop - start for start, stop in spans)))
        words = f"tinted: {len(spans)} stretches at rest, {share} together"
    summary = f"{words}; each point is the least or greatest value of a short run of samples"
    title = f"Rates, axis {array.axis}"
    whole = curve_plot(
        f"rates-{array.anchor}", title, _rate_curves(rates, array), TIME, RATE, summary=summary, spans=spans
    )
    if not spans:
        return whole
    still = {name: np.where(at_rest, rates[name], np.nan) for name in array.gyros}
    curves = _rate_curves({"time": time, **still}, array)
    return join(whole, curve_plot(f"rest-{array.anchor}", f"{title}, at rest only", curves, TIME, RATE, spans=spans))


def _rate_curves(rates: Table, array: ArrayPart) -> list[Curve]:
    values = np.column_stack([rates[name] for name in array.gyros])
    time, values = broken(*envelope(rates["time"], values))
    curves = [
        Curve(name, name, time, values[:, i], colour=i, width=1, behind=_spread(values[:, i]))
        for i, name in enumerate(array.gyros)
    ]
    reference = rates.get(REFERENCE)
    if reference is not None and np.isfinite(reference).any():
        time, thinned = envelope(rates["time"], reference)
        curves.append(Curve(REFERENCE, REFERENCE, time, thinned, ink=True, width=1))
    return curves


def _spread(values: np.ndarray) -> float:
    """How wide a noisy curve is drawn: its mean step from one point to the next."""
    steps = np.abs(np.diff(values))
    return float(np.nanmean(steps)) if np.isfinite(steps).any() else 0.0


def temperature_plot(recording: RecordingPart) -> Markup:
    """Temperatures of a recording over time; nothing where none is logged."""
    rates = recording.rates or {}
    names = [name for name in rates if name.startswith(TEMPERATURE)]
    if not names:
        return Markup("")
    time, values = thin(rates["time"], np.column_stack([rates[name] for name in names]))
    curves = [
        Curve(name, name.removeprefix(TEMPERATURE), time, values[:, i], colour=i, width=1.2)
        for i, name in enumerate(names)
    ]
    identifier = f"temperature-{recording.name}"
    return curve_plot(identifier, "Temperature", curves, TIME, Axis("temperature, °C"), height=240)


def correlation_table(recording: RecordingPart, array: ArrayPart) -> Markup:
    """Correlation matrix of the gyros' noise as a coloured table, limits below each factor."""
    table = array.tables.get("correlation")
    if table is None or len(array.gyros) < 2:
        return paragraph("One gyro: there is no correlation matrix.", "note")
    found = {(row["gyro"], row["other"]): row for row in rows_of(table)}
    columns = [Column("", numeric=False), *(Column(name) for name in array.gyros)]
    rows = [
        [Cell(name), *(_correlation_cell(found.get((name, other)), name == other) for other in array.gyros)]
        for name in array.gyros
    ]
    still = recording.rates is None or bool(recording.rates["at_rest"].any())
    of = "samples at rest" if still else "rate − reference"
    caption = f"Correlation factors of the gyros' noise, {of} (Jiang et al. 2012, eq. 22); below, 95 % limits"
    return render_table(columns, rows, caption, compact=True)


def _correlation_cell(row: dict | None, diagonal: bool) -> Cell:
    if row is None or not np.isfinite(row["correlation"]):
        return Cell("—", tone="muted", hint="a gyro whose output does not vary has no correlation")
    value, low, high = float(row["correlation"]), float(row["low"]), float(row["high"])
    if diagonal:
        return Cell("1", tone="muted")
    below = f"{rounded(low, 3)} … {rounded(high, 3)}" if np.isfinite(low) and np.isfinite(high) else ""
    return Cell(rounded(value, 3), below, shade=value)
