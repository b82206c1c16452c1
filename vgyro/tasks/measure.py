"""Measure: Allan deviations, densities, correlation and every figure of one array, with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgyro.board import Board
from vgyro.config import MetricsOptions
from vgyro.metrics import (
    FIGURES,
    AllanCurve,
    Correlation,
    LowPass,
    Reading,
    Spectrum,
    correlation_matrix,
    dynamic_figures,
    static_figures,
    stretches,
    thinned,
)
from vgyro.storage.tables import Provenance, read_columns, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates_file import ArrayFile, FileColumns, read_array

SPECTRUM_POINTS = 600
FEWEST_SAMPLES = 3  # in the longest stretch, for an Allan deviation


@dataclass(frozen=True)
class Series:
    """One column to measure: its file and name there, what metrics.parquet calls it, and what it went through."""

    path: Path
    column: str
    method: str
    definition: str
    low_pass: LowPass


def main(task: Task) -> None:
    """inputs : rates, fused, methods;  outputs : allan, spectrum, metrics, correlation

    options : board, axis, recording, kind, analysis.metrics, analysis.engine
    """
    options = MetricsOptions.model_validate(task.options["analysis"].get("metrics", {}))
    engine = task.options["analysis"].get("engine", "native")
    axis, rates = task.options["axis"], task.input("rates")
    gyros = [gyro.name for gyro in Board.model_validate(task.options["board"]).array(axis)]
    series = [Series(rates, gyro, gyro, "", LowPass()) for gyro in gyros]
    series += fused_series(task.input("fused"), read_columns(task.input("methods")))
    places = [(one.path, one.column) for one in series]
    frame = read_array(rates, [], axis)
    curves: dict[str, AllanCurve] = {}
    spectra: dict[str, Spectrum] = {}
    readings: list[dict[str, Reading]] = [{} for _ in series]
    resting = frame.at_rest.any()
    rest = frame.rest_segment()
    poses = stretches(rest)
    if max((stop - start for start, stop in poses), default=0) >= FEWEST_SAMPLES:
        found = static_figures(
            FileColumns(places, frame.at_rest), frame.rate_hz, rest, len(gyros), [one.low_pass for one in series],
            options, engine, task.options["kind"] == "free" and len(poses) > 1,
        )  # fmt: skip
        names = [one.column for one in series]
        curves, spectra = dict(zip(names, found.curves, strict=True)), dict(zip(names, found.spectra, strict=True))
        readings = found.readings
    reference = frame.reference
    if reference is not None:
        moving = dynamic_figures(FileColumns(places), reference, frame.rate_hz, frame.segment, len(gyros), options)
        readings = [{**still, **row} for still, row in zip(readings, moving, strict=True)]
    made = task.provenance()
    write_tables(task, made, series, curves, spectra, readings)
    correlation = noise_correlation(places[: len(gyros)], frame, rest, reference, options)
    write_table(
        task.output("correlation"), correlation_columns(gyros, correlation), "correlation", made,
        {"of": "samples at rest" if resting else "rate - reference"},
    )  # fmt: skip


def fused_series(fused: Path, methods: Mapping[str, np.ndarray]) -> list[Series]:
    """The columns of fused.parquet, by methods.parquet; a method that could not run has none."""
    found = []
    for row, column in enumerate(methods["column"]):
        if column:
            bandwidth, gain = float(methods["bandwidth_hz"][row]), float(methods["dc_gain"][row])
            low_pass = LowPass(
                bandwidth if math.isfinite(bandwidth) else None, gain if math.isfinite(gain) and gain > 0 else 1.0
            )
            method, definition = str(methods["method"][row]), str(methods["definition"][row] or "")
            found.append(Series(fused, str(column), method, definition, low_pass))
    return found


def noise_correlation(
    gyros: list[tuple[Path, str]],
    frame: ArrayFile,
    rest: np.ndarray,
    reference: np.ndarray | None,
    options: MetricsOptions,
) -> Correlation:
    """Correlation of the noise at rest; of the errors where the board moves and the true rate is known; else NaN."""
    if rest.size:
        return correlation_matrix(FileColumns(gyros, frame.at_rest), frame.rate_hz, rest, options.confidence)
    if reference is not None and np.isfinite(reference).sum() > len(gyros):
        known = np.isfinite(reference)
        moving, segment = FileColumns(gyros, known), frame.segment[known]
        return correlation_matrix(moving, frame.rate_hz, segment, options.confidence, reference[known])
    unknown = np.full((len(gyros), len(gyros)), math.nan)
    return Correlation(unknown, unknown, unknown, unknown)


def write_tables(
    task: Task,
    made: Provenance,
    series: list[Series],
    curves: dict[str, AllanCurve],
    spectra: dict[str, Spectrum],
    readings: list[dict[str, Reading]],
) -> None:
    """Write allan, spectrum and metrics; without a curve the tables have no rows."""
    allan = {
        name: [getattr(curve, name) for curve in curves.values()] for name in ("tau", "deviation", "low", "high", "edf")
    }
    columns = {"series": _repeated({name: len(curve.tau) for name, curve in curves.items()})}
    columns |= {name: np.concatenate([np.empty(0), *parts]) for name, parts in allan.items()}
    write_table(task.output("allan"), columns, "allan", made)
    thin = {name: thinned(spectrum, SPECTRUM_POINTS) for name, spectrum in spectra.items()}
    columns = {"series": _repeated({name: len(spectrum.frequency) for name, spectrum in thin.items()})}
    columns["frequency"] = np.concatenate([np.empty(0), *(spectrum.frequency for spectrum in thin.values())])
    columns["density"] = np.concatenate([np.empty(0), *(spectrum.density for spectrum in thin.values())])
    write_table(task.output("spectrum"), columns, "spectrum", made)
    write_table(task.output("metrics"), metric_columns(task, series, readings), "metrics", made)


def metric_columns(task: Task, series: list[Series], readings: list[dict[str, Reading]]) -> dict[str, np.ndarray]:
    """metrics.parquet, long: one row a series and figure, in the order of FIGURES."""
    rows = [
        (
            task.options["recording"], task.options["axis"], one.method, one.definition, name,
            row[name].value, row[name].low, row[name].high, figure.unit, row[name].note,
        )
        for one, row in zip(series, readings, strict=True)
        for name, figure in FIGURES.items()
        if name in row
    ]  # fmt: skip
    names = ("recording", "axis", "method", "definition", "metric", "value", "low", "high", "unit", "note")
    columns = {name: [row[index] for row in rows] for index, name in enumerate(names)}
    return {name: _typed(name, column) for name, column in columns.items()}


def correlation_columns(gyros: list[str], correlation: Correlation) -> dict[str, list]:
    """correlation.parquet: one row a pair, both ways, and the diagonal."""
    places = [(row, column) for row in range(len(gyros)) for column in range(len(gyros))]
    return {
        "gyro": [gyros[row] for row, _ in places],
        "other": [gyros[column] for _, column in places],
        "correlation": [float(correlation.value[place]) for place in places],
        "low": [float(correlation.low[place]) for place in places],
        "high": [float(correlation.high[place]) for place in places],
    }


def _repeated(lengths: Mapping[str, int]) -> np.ndarray:
    return np.array([name for name, length in lengths.items() for _ in range(length)], dtype=str)


def _typed(name: str, column: list) -> np.ndarray:
    return np.array(column, dtype=float) if name in {"value", "low", "high"} else np.array(column, dtype=str)


if __name__ == "__main__":
    run_task(main)
