"""Measure: Allan deviations, densities, correlation, tones and every figure of one array, with intervals."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.config import MetricsOptions
from vgyro.errors import TooShort
from vgyro.metrics import (
    Correlation,
    LowPass,
    Measured,
    Reading,
    RestRecording,
    StaticFigures,
    array_figures,
    cleaned_of,
    common_bandwidth,
    correlation_of,
    counted,
    run_back,
)
from vgyro.metrics.dynamic.figures import dynamic_figures
from vgyro.metrics.figures import without_interpolation
from vgyro.storage.tables import read_column, read_columns, read_metadata
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.figures.missing import Lacking, own_moving, own_still, with_own
from vgyro.tasks.figures.tables import FigureRows, MeasuredSeries, Results, write_results
from vgyro.tasks.rates.rates_file import DEVIATION, ArrayFile, FileColumns, read_frame

SECTIONS = ("board", "engine", "metrics")

FEWEST_SAMPLES = 3  # in the longest stretch, for an Allan deviation
HEAD = ("time", "segment")


@dataclass(frozen=True)
class Still:
    """Static figures of all series of a recording, and what they were made from.

    true_rate : deg/s, the constant rate that the figures are about, 0 at rest
    where     : [T] of bool, samples that were taken; None: all
    shared    : what all series share, such as the sampling;  measured : what was found of each series alone
    own       : place of a gyro that lacks values → its figures from the values that it has
    figures   : all figures of all series
    """

    true_rate: float
    where: np.ndarray | None
    shared: RestRecording
    measured: list[Measured]
    own: dict[int, dict[str, Reading]]
    figures: StaticFigures


def main(task: Task) -> None:
    """inputs : rates, fused, methods, moved;  outputs : allan, spectrum, metrics, correlation, cross_allan, tones

    options : board, axis, recording, kind, analysis.metrics, analysis.engine
    """
    options = task.section("metrics", MetricsOptions)
    axis, rates = task.option("axis"), task.input("rates")
    gyros = [gyro.name for gyro in task.section("board", Board).array(axis)]
    frame = read_frame(rates, gyros, axis)
    lacking = Lacking.of(rates, gyros, frame, options.most_lost_s)
    gyros = lacking.gyros
    series = [MeasuredSeries(rates, gyro, gyro, "", LowPass()) for gyro in gyros]
    series += fused_series(task.input("fused"), read_columns(task.input("methods")))
    reference = frame.reference
    still = still_figures(task, frame, reference, series, lacking, options)
    rows = [] if still is None else [FigureRows(series, still.figures.readings, still.true_rate)]
    if reference is not None:
        columns, sampling = columns_of(series, held=lacking.filled), frame.sampling(options.most_lost_s)
        own = {place: own_moving(lacking.own(rates, place), reference, sampling, options) for place in lacking.places}
        moving = dynamic_figures(
            columns, reference, frame.rate_hz, frame.segment, len(gyros), options, sampling, deviations_of(series), own
        )
        rows = with_dynamic(rows, FigureRows(series, moving, 0.0))
    if still is not None and still.true_rate == 0:
        rows += moved_figures(task.input("moved"), series, len(gyros), still)
    figures = None if still is None else still.figures
    # Its sums and sampling are not wanted while the correlation holds several columns.
    del still
    correlation = noise_correlation(columns_of(series[: len(gyros)]), frame, reference, options, lacking.places)
    of = "samples at rest" if frame.at_rest.any() else "rate - reference"
    write_results(task, Results(series, len(gyros), rows, figures, correlation, of, frame.rate_hz), options.confidence)


def columns_of(
    series: Sequence[MeasuredSeries],
    where: np.ndarray | None = None,
    less: float | np.ndarray = 0.0,
    held: Mapping[tuple[Path, str], np.ndarray] | None = None,
) -> FileColumns:
    """The rates of several series, one array [T] after the other; each is read when it is asked for.

    where : [T] of bool, samples that are taken; None: all;  less : deg/s, a number or [T], taken off every series
    held  : (file, column) → rates that are in memory already
    """
    return FileColumns([(one.path, one.column) for one in series], where, less, held=held or {})


def deviations_of(series: Sequence[MeasuredSeries]) -> Callable[[int], np.ndarray | None]:
    """Place of a series → its posterior standard deviation [T], deg/s, read when it is asked for; None: it has none."""
    names = {path: set(pq.read_schema(path).names) for path in {one.path for one in series}}

    def of(place: int) -> np.ndarray | None:
        one = series[place]
        column = DEVIATION.format(one.column)
        return read_column(one.path, column, float) if column in names[one.path] else None

    return of


def fused_series(fused: Path, methods: Mapping[str, np.ndarray]) -> list[MeasuredSeries]:
    """The columns of fused.parquet, by methods.parquet; a method that could not run has none."""
    found = []
    for row, column in enumerate(methods["column"]):
        if column:
            bandwidth, gain = float(methods["bandwidth_hz"][row]), float(methods["dc_gain"][row])
            low_pass = LowPass(
                bandwidth if math.isfinite(bandwidth) else None,
                gain if math.isfinite(gain) and gain > 0 else 1.0,
                int(methods["passes"][row]),
            )
            method, definition = str(methods["method"][row]), str(methods["definition"][row] or "")
            found.append(MeasuredSeries(fused, str(column), method, definition, low_pass))
    return found


def still_figures(
    task: Task,
    frame: ArrayFile,
    reference: np.ndarray | None,
    series: list[MeasuredSeries],
    lacking: Lacking,
    options: MetricsOptions,
) -> Still | None:
    """Figures of the samples at rest; of a recording at a constant, known rate: those of rate - reference."""
    where, less, true_rate = frame.at_rest, 0.0, 0.0
    if task.option("kind") == "constant" and reference is not None and not where.any():
        where = np.isfinite(reference)
        less = reference[where]
        true_rate = float(np.mean(less)) if where.any() else 0.0
    sampling = frame.sampling(options.most_lost_s)
    if not where.all():
        sampling = sampling.without(~where)
    longest = np.bincount(sampling.stretch).max(initial=0)
    if longest < FEWEST_SAMPLES:
        return None
    # Between two rests the board may have been turned over.
    poses = (task.option("kind") == "free" or frame.moved) and bool(sampling.stretch[-1] > 0)
    filters = [one.low_pass for one in series]
    bandwidth_hz = common_bandwidth(filters, options.equal_bandwidth_hz)
    engine = task.engine
    shared = RestRecording.of(sampling, options, bandwidth_hz, engine, poses, run_back(filters))
    columns, back = columns_of(series, where, less, lacking.filled), run_back(filters)
    try:
        measured = [shared.measure(values, one.low_pass) for values, one in zip(columns, series, strict=True)]
        alone = {
            place: own_still(lacking.own(frame.path, place)[where] - less, shared, bandwidth_hz, back)
            for place in lacking.places
        }
    except TooShort as reason:
        logging.warning("no static figures: %s", reason)
        return None
    measured = with_own(measured, {place: one for place, (one, _) in alone.items()})
    own, singles = {place: row for place, (_, row) in alone.items()}, len(lacking.gyros)
    figures = array_figures(shared, measured, singles, own)
    metadata = read_metadata(frame.path)
    clipped, gains = metadata.get("clipped", {}), metadata.get("noise_gain", {})
    for one, row in zip(series[:singles], figures.readings, strict=False):
        if one.column in gains and "sigma" in row:
            row["sigma"] = without_interpolation(row["sigma"], gains[one.column])
        if one.column in clipped:
            row["clipped"] = counted(int(clipped[one.column]))
    return Still(true_rate, where, shared, measured, own, figures)


def with_dynamic(still: list[FigureRows], moving: FigureRows) -> list[FigureRows]:
    """Dynamic figures beside static ones; those of the same true rate go into the same rows."""
    if still and still[0].true_rate == moving.true_rate:
        readings = [{**rest, **row} for rest, row in zip(still[0].readings, moving.readings, strict=True)]
        return [replace(moving, readings=readings)]
    return [*still, moving]


def moved_figures(path: Path, series: list[MeasuredSeries], singles: int, still: Still) -> list[FigureRows]:
    """Static figures of the methods that a constant rate changes; the errors of the gyros are the same with it."""
    rate = read_metadata(path).get("injected_rate")
    names = [name for name in pq.read_schema(path).names if name not in HEAD]
    if rate is None or not names:
        return []
    moved = [replace(one, path=path) for one in series[singles:] if one.column in names]
    columns = columns_of(moved, still.where)
    own = [still.shared.measure(values, one.low_pass) for values, one in zip(columns, moved, strict=True)]
    found = array_figures(still.shared, [*still.measured[:singles], *own], singles, still.own)
    return [FigureRows(moved, found.readings[singles:], float(rate))]


def noise_correlation(
    gyros: FileColumns,
    frame: ArrayFile,
    reference: np.ndarray | None,
    options: MetricsOptions,
    lacking: Sequence[int],
) -> Correlation:
    """Correlation of the noise at rest; of the errors where the board moves and the true rate is known; else NaN.

    lacking : places of the gyros that lack values
    """
    if frame.at_rest.any():
        rest = frame.rest_sampling(options.most_lost_s)
        segment, stretch = rest.segment, rest.stretch
        del rest

        def cleaned(rate: np.ndarray) -> np.ndarray:
            return cleaned_of(rate, frame.rate_hz, segment, options.outlier_threshold)

        columns = replace(gyros, where=frame.at_rest, cleaned=cleaned)
        return correlation_of(columns, lacking, frame.rate_hz, stretch, options.confidence)
    if reference is not None and np.isfinite(reference).sum() > len(gyros):
        known = np.isfinite(reference)
        moving = replace(gyros, where=known)
        segment, truth = frame.segment[known], reference[known]
        return correlation_of(moving, lacking, frame.rate_hz, segment, options.confidence, truth)
    unknown = np.full((len(gyros), len(gyros)), math.nan)
    return Correlation(unknown, unknown, unknown, unknown)


if __name__ == "__main__":
    run_task(main)
