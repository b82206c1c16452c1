"""The figures of Liu et al. (2015), Table 3: those of the slow series that the volatility models see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics import FIGURES, LowPass, Reading, Sampling, make_units, resample
from vgyro.metrics.static.figures import static_figures

Name = tuple[str, str]
Rows = list[dict[str, Any]]
METRICS = ("mean", "sigma", "arw_1s", "bias_drift")
PAIRED = ("mean", "sigma", "arw_1s")


@dataclass(frozen=True)
class SeriesFigures:
    """metrics : mean, sigma, arw_1s and bias_drift of every series;  factors : improvement factors of every method"""

    metrics: Rows
    factors: Rows


class SlowSeries(NamedTuple):
    """Block means of single gyros and of methods, which come after them.

    names  : (method, definition) of each series, (gyro, "") for a single gyro
    values : [M, S] deg/s at rate_hz;  stretch : [M] number of the run without a gap
    """

    names: Sequence[Name]
    values: np.ndarray
    stretch: np.ndarray
    rate_hz: float


def series_figures(
    place: Mapping[str, str], series: SlowSeries, gyros: int, options: MetricsOptions, engine: str = "native"
) -> SeriesFigures:
    """Figures of block means, with limits, and improvement factors over the single gyros (L, eq. 18).

    place : columns that every row gets;  gyros : how many of the series are single gyros
    """
    names, values, stretch, rate_hz = series
    sampling = Sampling.of(rate_hz, stretch)
    found = static_figures(values.T, sampling, gyros, [LowPass()] * len(names), options, engine)
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


def extremes(rows: Rows, gyros: Sequence[str], faulty: str) -> dict[str, Name]:
    """The single gyro of the smallest mean (`best_single`) and that of the largest without fault (`worst_healthy`).

    rows : SeriesFigures.metrics
    """
    size = {row["method"]: abs(row["value"]) for row in rows if row["metric"] == "mean" and row["method"] in gyros}
    healthy = [gyro for gyro in gyros if gyro != faulty]
    return {
        "best_single": (min(gyros, key=size.__getitem__), ""),
        "worst_healthy": (max(healthy, key=size.__getitem__), ""),
    }


def paired_ratios(
    place: Mapping[str, str], series: SlowSeries, over: Mapping[str, Name], options: MetricsOptions
) -> Rows:
    """Mean (as a magnitude), 1σ and ARW at 1 s of every series over those of a few, with limits.

    over : label → series to divide by;  the other arguments as in `series_figures`
    Both series are resampled with the same blocks, so that the noise they share does not widen the limits. The limits
    are percentiles moved by a factor to have the ratio itself as their median: blocks are shorter than the drift and
    lose a part of it. Bias drift is not there: the minimum of a curve cannot be resampled by blocks.
    """
    names = list(series.names)
    sums = make_units(series.values, series.rate_hz, series.stretch)
    drawn = resample(sums, options.bootstrap, options.seed)
    replicates = dict(zip(PAIRED, (np.abs(drawn.mean), drawn.sigma, drawn.adev_1s), strict=True))
    tails = [(1 - options.confidence) / 2, (1 + options.confidence) / 2]
    # One block as long as the record is the record itself.
    whole = resample(sums, 1, options.seed, len(sums.count))
    figures = dict(zip(PAIRED, (np.abs(whole.mean[0]), whole.sigma[0], whole.adev_1s[0]), strict=True))
    rows: Rows = []
    for label, name in over.items():
        to = names.index(name)
        for index, (method, definition) in enumerate(names):
            for metric in PAIRED:
                drawn_ratio = replicates[metric][:, index] / replicates[metric][:, to]
                value = float(figures[metric][index] / figures[metric][to])
                low, high = (float(limit) for limit in value * np.quantile(drawn_ratio, tails) / np.median(drawn_ratio))
                about = {"method": method, "definition": definition, "over": label, "metric": metric}
                about |= {"over_method": name[0], "over_definition": name[1]}
                rows.append({**place, **about, "value": value, "low": low, "high": high, "unit": "1", "note": ""})
    return rows


def _row(place: Mapping[str, str], name: Name, metric: str, figure: str, reading: Reading) -> dict[str, Any]:
    method, definition = name
    return {
        **place, "method": method, "definition": definition, "metric": metric, "value": reading.value,
        "low": reading.low, "high": reading.high, "unit": FIGURES[figure].unit, "note": reading.note,
    }  # fmt: skip
