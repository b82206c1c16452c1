"""The tables that measure writes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgyro.metrics import (
    FIGURES,
    Correlation,
    CrossAllan,
    LowPass,
    Reading,
    StaticFigures,
    find_tones,
    share_tones,
    thinned,
)
from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task

SPECTRUM_POINTS = 600
CURVE = ("tau", "deviation", "low", "high", "edf")
NUMBERS = ("true_rate", "value", "low", "high")


@dataclass(frozen=True)
class MeasuredSeries:
    """One column to measure: its file and name there, what metrics.parquet calls it, and what it went through."""

    path: Path
    column: str
    method: str
    definition: str
    low_pass: LowPass


@dataclass(frozen=True)
class FigureRows:
    """Figures by name of each series, at one true rate, deg/s."""

    series: list[MeasuredSeries]
    readings: list[dict[str, Reading]]
    true_rate: float


@dataclass(frozen=True)
class Results:
    """All that `measure` writes of one array.

    series      : what was measured;  singles : how many of them are gyros; these come first
    rows        : figures of metrics.parquet, for each true rate
    static      : curves and spectra at rest; None: nothing rests
    correlation : of the noise of the gyros;  of : which samples or errors that correlation is of, in words
    rate_hz     : sample rate, Hz
    """

    series: list[MeasuredSeries]
    singles: int
    rows: list[FigureRows]
    static: StaticFigures | None
    correlation: Correlation
    of: str
    rate_hz: float


def write_results(task: Task, found: Results, confidence: float) -> None:
    """Write allan, spectrum, metrics, correlation, cross_allan and tones; what is not known has no rows."""
    made = task.provenance()
    names = [one.column for one in found.series]
    gyros = names[: found.singles]
    static = found.static
    curves = {} if static is None else dict(zip(names, static.curves, strict=True))
    spectra = {} if static is None else dict(zip(names, static.spectra, strict=True))
    of_gyros = {name: spectra[name] for name in gyros if name in spectra}
    tones = share_tones({name: find_tones(spectrum, confidence) for name, spectrum in of_gyros.items()})
    every = [(name, curve) for name, kinds in curves.items() for curve in kinds.values()]
    columns = {
        "series": _repeated([(name, len(curve.tau)) for name, curve in every]),
        "kind": _repeated([(curve.kind, len(curve.tau)) for _, curve in every]),
        **{name: np.concatenate([np.empty(0), *(getattr(curve, name) for _, curve in every)]) for name in CURVE},
    }
    write_table(task.output("allan"), columns, "allan", made)
    thin = {name: thinned(spectrum, SPECTRUM_POINTS) for name, spectrum in spectra.items()}
    columns = {"series": _repeated([(name, len(spectrum.frequency)) for name, spectrum in thin.items()])}
    for name in ("frequency", "density"):
        columns[name] = np.concatenate([np.empty(0), *(getattr(spectrum, name) for spectrum in thin.values())])
    write_table(task.output("spectrum"), columns, "spectrum", made)
    write_table(task.output("metrics"), metric_columns(task, found.rows), "metrics", made)
    write_table(task.output("tones"), tones, "tones", made, {"rate_hz": found.rate_hz})
    write_table(
        task.output("cross_allan"), cross_columns(gyros, None if static is None else static.cross), "cross_allan", made
    )
    write_table(
        task.output("correlation"), correlation_columns(gyros, found.correlation), "correlation", made, {"of": found.of}
    )


def metric_columns(task: Task, found: list[FigureRows]) -> dict[str, np.ndarray]:
    """metrics.parquet, long: one row a true rate, series and figure, in the order of FIGURES."""
    rows = [
        (
            task.option("recording"), task.option("axis"), one.method, one.definition, part.true_rate, name,
            row[name].value, row[name].low, row[name].high, figure.unit, row[name].note,
            " ".join(sorted(row[name].flags)),
        )
        for part in found
        for one, row in zip(part.series, part.readings, strict=True)
        for name, figure in FIGURES.items()
        if name in row
    ]  # fmt: skip
    names = (
        "recording", "axis", "method", "definition", "true_rate", "metric", "value", "low", "high", "unit", "note",
        "flags",
    )  # fmt: skip
    columns = {name: [row[index] for row in rows] for index, name in enumerate(names)}
    return {name: np.array(column, dtype=float if name in NUMBERS else str) for name, column in columns.items()}


def correlation_columns(gyros: list[str], correlation: Correlation) -> dict[str, list[str] | list[float]]:
    """correlation.parquet: one row a pair, both ways, and the diagonal."""
    places = [(row, column) for row in range(len(gyros)) for column in range(len(gyros))]
    return {
        "gyro": [gyros[row] for row, _ in places],
        "other": [gyros[column] for _, column in places],
        "correlation": [float(correlation.value[place]) for place in places],
        "low": [float(correlation.low[place]) for place in places],
        "high": [float(correlation.high[place]) for place in places],
    }


def cross_columns(gyros: list[str], cross: CrossAllan | None) -> dict[str, np.ndarray]:
    """cross_allan.parquet: one row a τ and pair, each pair once, and each gyro with itself."""
    number = 0 if cross is None else len(cross.tau)
    pairs = [(row, column) for row in range(len(gyros)) for column in range(row, len(gyros))] if number else []
    columns = {
        "gyro": _repeated([(gyros[row], number) for row, _ in pairs]),
        "other": _repeated([(gyros[column], number) for _, column in pairs]),
        "tau": np.concatenate([np.empty(0), *(cross.tau for _ in pairs if cross is not None)]),
    }
    for name in ("covariance", "correlation", "low", "high"):
        columns[name] = np.concatenate([np.empty(0), *(getattr(cross, name)[:, *pair] for pair in pairs)])
    return columns


def _repeated(lengths: list[tuple[str, int]]) -> np.ndarray:
    return np.array([name for name, length in lengths for _ in range(length)], dtype=str)
