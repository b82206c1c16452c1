"""The figures of Liu et al. (2015), Table 3: those of the slow series that the volatility models see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics import (
    AllanCurve,
    Reading,
    allan_deviation,
    improvement_factor,
    improvement_of_deviation,
    make_units,
    moments,
    read_curve,
    resample,
)
from vgyro.metrics.readings import bias_drift
from vgyro.papers.evidence import magnitude
from vgyro.units import arw_deg_rt_h

Name = tuple[str, str]
Rows = list[dict[str, Any]]
LIMITS = ("value", "low", "high")
UNITS = {"mean": "deg/s", "sigma": "deg/s", "arw_1s": "deg/√h", "bias_drift": "deg/h"}


@dataclass(frozen=True)
class SeriesFigures:
    """metrics : mean, sigma, arw_1s and bias_drift of every series;  factors : improvement factors of every method"""

    metrics: Rows
    factors: Rows


def series_figures(
    place: Mapping[str, str],
    names: Sequence[Name],
    gyros: int,
    values: np.ndarray,
    stretch: np.ndarray,
    rate_hz: float,
    options: MetricsOptions,
) -> SeriesFigures:
    """Figures of block means, with limits, and improvement factors over the single gyros (L, eq. 18).

    place  : columns that every row gets;  names : (method, definition) of each series, (gyro, "") for a single gyro;
             the first `gyros` of them are the single gyros
    values : [M, S] deg/s at rate_hz;  stretch : [M] number of the run without a gap
    """
    curves = [
        allan_deviation(values[:, i], rate_hz, segment=stretch, confidence=options.confidence)
        for i in range(len(names))
    ]
    sums = make_units(values, rate_hz, stretch)
    drawn = resample(sums, options.bootstrap, options.seed)
    figures: list[dict[str, Reading]] = []
    for index, curve in enumerate(curves):
        value, low, high = (float(arw_deg_rt_h(read)) for read in read_curve(curve, 1.0))
        moment = moments(sums, drawn, index, options.confidence)
        figures.append({**moment, "arw_1s": Reading(value, low, high), "bias_drift": bias_drift(curve)[0]})
    metrics = [
        _row(place, name, metric, found[metric], UNITS[metric])
        for name, found in zip(names, figures, strict=True)
        for metric in UNITS
    ]
    replicates = {"mean": drawn.mean, "sigma": drawn.sigma, "arw_1s": drawn.adev_1s}
    factors = [
        _row(place, names[index], metric, _factor(metric, index, gyros, figures, replicates, curves), "1")
        for index in range(gyros, len(names))
        for metric in UNITS
    ]
    return SeriesFigures(metrics, factors)


def _factor(
    metric: str,
    index: int,
    gyros: int,
    figures: Sequence[Mapping[str, Reading]],
    replicates: Mapping[str, np.ndarray],
    curves: Sequence[AllanCurve],
) -> Reading:
    """Improvement factor of series `index` over the first `gyros` series."""
    singles, virtual = np.array([found[metric].value for found in figures[:gyros]]), figures[index][metric].value
    if metric in replicates:
        drawn = replicates[metric]
        return improvement_factor(singles, virtual, drawn[:, :gyros], drawn[:, index])
    freedom = np.array([curve.edf[int(np.argmin(curve.deviation))] for curve in curves])
    return improvement_of_deviation(singles, virtual, freedom[:gyros], float(freedom[index]))


def with_extremes(rows: Rows, gyros: Sequence[str], faulty: str) -> Rows:
    """Add the smallest mean of a single gyro (`best_single`) and the largest of one without fault (`worst_healthy`)."""
    means = [row for row in rows if row["metric"] == "mean" and row["method"] in gyros]
    means = [
        {**row, **dict(zip(LIMITS, magnitude(row["value"], row["low"], row["high"]), strict=True))} for row in means
    ]
    healthy = [row for row in means if row["method"] != faulty]
    best, worst = min(means, key=lambda row: row["value"]), max(healthy, key=lambda row: row["value"])
    named = (("best_single", best), ("worst_healthy", worst))
    return [*rows, *({**row, "method": name, "note": f"that of {row['method']}"} for name, row in named)]


def _row(place: Mapping[str, str], name: Name, metric: str, reading: Reading, unit: str) -> dict[str, Any]:
    method, definition = name
    return {
        **place, "method": method, "definition": definition, "metric": metric, "value": reading.value,
        "low": reading.low, "high": reading.high, "unit": unit, "note": reading.note,
    }  # fmt: skip
