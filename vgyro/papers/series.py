"""The figures of Liu et al. (2015), Table 3: those of the slow series that the volatility models see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics import FIGURES, LowPass, Reading, static_figures
from vgyro.papers.evidence import magnitude

Name = tuple[str, str]
Rows = list[dict[str, Any]]
LIMITS = ("value", "low", "high")
METRICS = ("mean", "sigma", "arw_1s", "bias_drift")


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
    engine: str = "reference",
) -> SeriesFigures:
    """Figures of block means, with limits, and improvement factors over the single gyros (L, eq. 18).

    place  : columns that every row gets;  names : (method, definition) of each series, (gyro, "") for a single gyro;
             the first `gyros` of them are the single gyros
    values : [M, S] deg/s at rate_hz;  stretch : [M] number of the run without a gap
    """
    found = static_figures(values, rate_hz, stretch, gyros, [LowPass()] * len(names), options, engine)
    metrics = [
        _row(place, name, metric, metric, readings[metric])
        for name, readings in zip(names, found.readings, strict=True)
        for metric in METRICS
    ]
    factors = [
        _row(place, name, metric, f"if_{metric}", readings[f"if_{metric}"])
        for name, readings in zip(names[gyros:], found.readings[gyros:], strict=True)
        for metric in METRICS
    ]
    return SeriesFigures(metrics, factors)


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


def _row(place: Mapping[str, str], name: Name, metric: str, figure: str, reading: Reading) -> dict[str, Any]:
    method, definition = name
    return {
        **place, "method": method, "definition": definition, "metric": metric, "value": reading.value,
        "low": reading.low, "high": reading.high, "unit": FIGURES[figure].unit, "note": reading.note,
    }  # fmt: skip
