"""Measure: Allan deviations, densities, correlation and every figure of one array, with intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

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
    thinned,
)
from vgyro.storage.tables import read_columns, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.rates_file import ArrayFile, read_array

SPECTRUM_POINTS = 600


@dataclass(frozen=True)
class Series:
    """One column to measure: what metrics.parquet calls it, and what it went through."""

    column: str
    method: str
    definition: str
    low_pass: LowPass


def main(task: Task) -> None:
    """inputs : rates, fused, methods;  outputs : allan, spectrum, metrics, correlation

    options : board, axis, recording, kind, analysis.metrics, analysis.engine
    """
    options = MetricsOptions.model_validate(task.options["analysis"].get("metrics", {}))
    engine = task.options["analysis"].get("engine", "reference")
    axis = task.options["axis"]
    gyros = [gyro.name for gyro in Board.model_validate(task.options["board"]).array(axis)]
    array = read_array(task.input("rates"), gyros, axis)
    series = [Series(gyro, gyro, "", LowPass()) for gyro in gyros] + fused_series(read_columns(task.input("methods")))
    fused = read_columns(task.input("fused"), [one.column for one in series[len(gyros) :]])
    values = np.column_stack([array.rate, *(fused[one.column] for one in series[len(gyros) :])])
    curves: dict[str, AllanCurve] = {}
    spectra: dict[str, Spectrum] = {}
    readings: list[dict[str, Reading]] = [{} for _ in series]
    rest_segment = array.rest_segment()
    resting = array.at_rest
    if longest_run(rest_segment) >= 3:
        poses = task.options["kind"] == "free" and len(np.unique(rest_segment)) > 1
        found = static_figures(
            values[resting], array.rate_hz, rest_segment, len(gyros), [one.low_pass for one in series], options, engine,
            poses,
        )  # fmt: skip
        names = [one.column for one in series]
        curves, spectra = dict(zip(names, found.curves, strict=True)), dict(zip(names, found.spectra, strict=True))
        readings = found.readings
    if array.reference is not None:
        moving = dynamic_figures(values, array.reference, array.rate_hz, array.segment, len(gyros), options)
        readings = [{**still, **row} for still, row in zip(readings, moving, strict=True)]
    write_tables(task, series, curves, spectra, readings)
    correlation = noise_correlation(array, rest_segment, options)
    write_table(
        task.output("correlation"), correlation_columns(gyros, correlation), "correlation", task.provenance(),
        {"of": "samples at rest" if resting.any() else "rate - reference"},
    )  # fmt: skip


def fused_series(methods: Mapping[str, np.ndarray]) -> list[Series]:
    """The columns of fused.parquet, by methods.parquet; a method that could not run has none."""
    found = []
    for row, column in enumerate(methods["column"]):
        if column:
            bandwidth, gain = float(methods["bandwidth_hz"][row]), float(methods["dc_gain"][row])
            low_pass = LowPass(
                bandwidth if math.isfinite(bandwidth) else None, gain if math.isfinite(gain) and gain > 0 else 1.0
            )
            found.append(
                Series(str(column), str(methods["method"][row]), str(methods["definition"][row] or ""), low_pass)
            )
    return found


def longest_run(segment: np.ndarray) -> int:
    """Samples in the longest stretch."""
    return int(np.max(np.unique(segment, return_counts=True)[1])) if segment.size else 0


def noise_correlation(array: ArrayFile, rest_segment: np.ndarray, options: MetricsOptions) -> Correlation:
    """Correlation of the noise at rest; of the errors where the board moves and the true rate is known; else NaN."""
    number = array.rate.shape[1]
    if array.at_rest.any():
        return correlation_matrix(array.rate[array.at_rest], array.rate_hz, rest_segment, options.confidence)
    if array.reference is not None and np.isfinite(array.reference).sum() > number:
        known = np.isfinite(array.reference)
        error = array.rate[known] - array.reference[known, None]
        return correlation_matrix(error, array.rate_hz, array.segment[known], options.confidence)
    unknown = np.full((number, number), math.nan)
    return Correlation(unknown, unknown, unknown, unknown)


def write_tables(
    task: Task,
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
    write_table(task.output("allan"), columns, "allan", task.provenance())
    thin = {name: thinned(spectrum, SPECTRUM_POINTS) for name, spectrum in spectra.items()}
    columns = {"series": _repeated({name: len(spectrum.frequency) for name, spectrum in thin.items()})}
    columns["frequency"] = np.concatenate([np.empty(0), *(spectrum.frequency for spectrum in thin.values())])
    columns["density"] = np.concatenate([np.empty(0), *(spectrum.density for spectrum in thin.values())])
    write_table(task.output("spectrum"), columns, "spectrum", task.provenance())
    write_table(task.output("metrics"), metric_columns(task, series, readings), "metrics", task.provenance())


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
