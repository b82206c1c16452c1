"""All figures of a dynamic test: errors of single and virtual gyros against the reference, with limits."""

from __future__ import annotations

import math

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics.bootstrap import Resampled, Units, make_units, resample
from vgyro.metrics.dynamic import DynamicErrors, dynamic_errors
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import improvement_factor
from vgyro.metrics.readings import moments

SHIFTED = ("error_sigma_aligned", "error_sigma_scaled", "amplitude", "delay")
OF_ERROR = "of the error"


def dynamic_figures(
    values: np.ndarray,
    reference: np.ndarray,
    rate_hz: float,
    segment: np.ndarray,
    singles: int,
    options: MetricsOptions,
) -> list[dict[str, Reading]]:
    """Errors of series against the true rate, and improvement factors of the virtual gyros.

    values    : array [T, S], deg/s; the first `singles` columns are the gyros
    reference : array [T], deg/s; NaN where it is not known
    segment   : array [T] int, number of the gap-free stretch
    returns   : S dictionaries, name → Reading; where the reference does not change, delay and what depends on it are
                NaN with a note. Limits by moving-block bootstrap, the improvement factors with common blocks.
    """
    known = np.isfinite(reference) & np.isfinite(values).all(axis=1)
    values, reference, segment = values[known], reference[known], segment[known] * 2 + _skips(known)
    if len(values) < 2:
        nothing = Reading(math.nan, math.nan, math.nan, "fewer than 2 samples with a reference")
        return [dict.fromkeys(("error_mean", "error_sigma", *SHIFTED), nothing) for _ in range(values.shape[1])]
    errors = [dynamic_errors(values[:, column], reference, rate_hz, segment) for column in range(values.shape[1])]
    raw = make_units(values - reference[:, None], rate_hz, segment)
    drawn = resample(raw, options.bootstrap, options.seed)
    readings = []
    for column, error in enumerate(errors):
        of_error = moments(raw, column, options.bootstrap, options.seed, options.confidence)
        row = {"error_mean": of_error["mean"], "error_sigma": of_error["sigma"]}
        row.update(_shifted(error, rate_hz, options))
        readings.append(row)
    for column in range(singles, len(errors)):
        readings[column].update(_factors(readings, drawn, singles, column, options.confidence))
    return readings


def _skips(known: np.ndarray) -> np.ndarray:
    """0 or 1 for each known sample, changing where samples between were left out."""
    index = np.flatnonzero(known)
    return np.cumsum(np.diff(index, prepend=index[:1] - 1) > 1) % 2 if index.size else index


def _shifted(error: DynamicErrors, rate_hz: float, options: MetricsOptions) -> dict[str, Reading]:
    if error.note:
        return dict.fromkeys(SHIFTED, Reading(math.nan, math.nan, math.nan, error.note))
    sums = make_units(np.column_stack([error.aligned, error.scaled]), rate_hz, error.inner_segment)
    block = sums.block_length(1)
    gain, delay = _resampled_fit(error, sums, block, options)
    tail = (1 - options.confidence) / 2
    readings = {
        name: moments(sums, column, options.bootstrap, options.seed, options.confidence)["sigma"]
        for column, name in enumerate(SHIFTED[:2])
    }
    note = f"gain {error.gain:.6g}"
    for name, value, replicates in (
        ("amplitude", error.amplitude, gain * error.amplitude / error.gain),
        ("delay", error.delay, delay),
    ):
        low, high = np.quantile(replicates, [tail, 1 - tail])
        readings[name] = Reading(value, float(low), float(high), note if name == "amplitude" else "")
    return readings


def _resampled_fit(
    error: DynamicErrors, sums: Units, block: int, options: MetricsOptions
) -> tuple[np.ndarray, np.ndarray]:
    """Gain and delay [R] of resampled blocks: one Gauss-Newton step from the fit, on the blocks' normal equations."""
    columns = np.column_stack([np.ones_like(error.shifted), error.shifted, -error.gain * error.slope])
    products = [columns[:, i] * columns[:, j] for i in range(3) for j in range(3)]
    products += [columns[:, i] * error.scaled for i in range(3)]
    at = np.append(0, np.cumsum(sums.count[:-1])).astype(np.int64)
    units = np.stack([np.add.reduceat(product, at) for product in products], axis=1)
    running = np.concatenate((np.zeros((1, units.shape[1])), np.cumsum(units, axis=0)))
    blocks = running[block:] - running[:-block]
    number = -(-len(units) // block)
    starts = np.random.default_rng(options.seed).integers(0, len(blocks), (options.bootstrap, number))
    total = np.stack([blocks[row].sum(axis=0) for row in starts])
    step = np.linalg.solve(total[:, :9].reshape(-1, 3, 3), total[:, 9:, None])[:, :, 0]
    return error.gain + step[:, 1], error.delay + step[:, 2]


def _factors(
    readings: list[dict[str, Reading]], drawn: Resampled, singles: int, column: int, confidence: float
) -> dict[str, Reading]:
    factors = {}
    for name, of, replicates in (("if_mean", "error_mean", drawn.mean), ("if_sigma", "error_sigma", drawn.sigma)):
        figures = np.array([row[of].value for row in readings[:singles]])
        factor = improvement_factor(
            figures,
            readings[column][of].value,
            replicates[:, :singles],
            replicates[:, column],
            confidence,
            name != "if_mean",
        )
        note = f"{factor.note}; {OF_ERROR}".removeprefix("; ")
        factors[name] = Reading(factor.value, factor.low, factor.high, note)
    return factors
