"""All figures of a dynamic test: errors of single and virtual gyros against the reference, with limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics.angle import AngleGrid
from vgyro.metrics.dynamic.errors import MOST_DELAY_S, DynamicErrors, errors_of
from vgyro.metrics.dynamic.truth import Truth, known_stretches
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import improvement_factor
from vgyro.metrics.intervals.bootstrap import Resampled, Units, block_sums, joined, resample, unit_grid
from vgyro.metrics.intervals.unit_grid import UnitGrid
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.static.readings import moments

SHIFTED = ("error_sigma_aligned", "error_sigma_scaled", "amplitude", "delay", "phase")
OF_ERROR = "of the error"
NO_SINUSOID = "the reference is no sinusoid"
WIDE = 2.0
"""Standard deviations within which 95.4 % of a Gaussian lie: the share that the note on NEES tells."""


def _no_deviation(series: int) -> None:  # noqa: ARG001
    return None


def dynamic_figures(
    series: Sequence[np.ndarray],
    reference: np.ndarray,
    rate_hz: float,
    segment: np.ndarray,
    singles: int,
    options: MetricsOptions,
    sampling: Sampling | None = None,
    deviation: Callable[[int], np.ndarray | None] = _no_deviation,
    own: Mapping[int, Mapping[str, Reading]] | None = None,
) -> list[dict[str, Reading]]:
    """Errors of series against the true rate, and improvement factors of the virtual gyros.

    series    : S arrays [T], deg/s; the first `singles` are the gyros. Each is taken twice, one at a time
    reference : array [T], deg/s; NaN where it is not known
    segment   : array [T] int, number of the gap-free stretch
    sampling  : of the T samples, for the angle; None: each gap ends a stretch
    deviation : place of a series → its posterior standard deviation, array [T], deg/s; None: it has none, and no NEES
    own       : place of a gyro that lacks values → its figures from those that it has, instead of those of its series
    returns   : S dictionaries, name → Reading; where the reference does not change, delay and what depends on it are
                NaN with a note. Limits by moving-block bootstrap, the improvement factors with common blocks.
    """
    known = np.isfinite(reference)
    for values in series:
        known &= np.isfinite(values)
    cuts, everywhere = known_stretches(known, segment), bool(known.all())
    truth = Truth.of(reference if everywhere else reference[known], rate_hz, cuts, MOST_DELAY_S)
    if truth.reference.size < 2:
        nothing = Reading(math.nan, math.nan, math.nan, truth.note)
        return [
            dict.fromkeys(("error_mean", "error_sigma", *SHIFTED, "angle_drift_60s"), nothing)
            for _ in range(len(series))
        ]
    grid = unit_grid(cuts, rate_hz)
    angle = AngleGrid.of((sampling or Sampling.of(rate_hz, segment)).without(~known))
    raw: list[Units] = []
    readings = []
    for place, values in enumerate(series):
        rate = values if everywhere else values[known]
        error = rate - truth.reference
        units, drift = grid.units_of(error), angle.drift(error, options.confidence)
        of_error = moments(units, 0, options.bootstrap, options.seed, options.confidence)
        row = {"error_mean": of_error["mean"], "error_sigma": of_error["sigma"], "angle_drift_60s": drift}
        sd = deviation(place)
        if sd is not None:
            row["nees"] = nees(error, sd if everywhere else sd[known], grid, options)
        del error, sd
        readings.append(row | _shifted(errors_of(rate, truth), options))
        raw.append(units)
    for place, figures in (own or {}).items():
        readings[place].update(figures)
    drawn = resample(joined(raw), options.bootstrap, options.seed)
    for column in range(singles, len(readings)):
        readings[column].update(_factors(readings, drawn, singles, column, options.confidence))
    return readings


def nees(error: np.ndarray, sd: np.ndarray, grid: UnitGrid, options: MetricsOptions) -> Reading:
    """Normalised error squared: mean of (error/sd)², which is 1 where the standard deviations are honest.

    error, sd : arrays [T], deg/s;  grid : of these samples
    returns   : limits by moving-block bootstrap; NaN with a note if some sd is not a positive number
    Bar-Shalom, Li & Kirubarajan (2001), Estimation with Applications to Tracking and Navigation, section 5.4.
    """
    if not (np.isfinite(sd) & (sd > 0)).all():
        return Reading(math.nan, math.nan, math.nan, "some posterior standard deviations are not positive")
    ratio = np.square(error / sd)
    inside = float(np.mean(ratio <= WIDE**2))
    units = grid.units_of(ratio)
    found = moments(units, 0, options.bootstrap, options.seed, options.confidence)["mean"]
    return replace(found, note=f"{100 * inside:.1f} % of the samples within ±{WIDE:g} s.d.; {found.note}")


def _shifted(error: DynamicErrors, options: MetricsOptions) -> dict[str, Reading]:
    if error.sums is None or error.products is None:
        return dict.fromkeys(SHIFTED, Reading(math.nan, math.nan, math.nan, error.note))
    gain, delay = _resampled_fit(error, error.products, error.sums.block_length(1), options)
    tail = (1 - options.confidence) / 2
    readings = {
        name: moments(error.sums, column, options.bootstrap, options.seed, options.confidence)["sigma"]
        for column, name in enumerate(SHIFTED[:2])
    }
    note = f"gain {error.gain:.6g}"
    if math.isnan(error.frequency):
        note += f"; {NO_SINUSOID}: √2 times the r.m.s. of what the rate has of it"
    for name, value, replicates in (
        ("amplitude", error.amplitude, gain * error.amplitude / error.gain),
        ("delay", error.delay, delay),
    ):
        low, high = np.quantile(replicates, [tail, 1 - tail])
        readings[name] = Reading(value, float(low), float(high), note if name == "amplitude" else "")
    return {**readings, "phase": _phase(error, readings["delay"])}


def _phase(error: DynamicErrors, delay: Reading) -> Reading:
    """Phase of a sinusoid, deg; its limits are those of the delay."""
    if math.isnan(error.frequency):
        return Reading(math.nan, math.nan, math.nan, NO_SINUSOID)
    low, high = (error.phase - 360 * error.frequency * (limit - error.delay) for limit in (delay.high, delay.low))
    return Reading(error.phase, low, high, f"at {error.frequency:.6g} Hz")


def _resampled_fit(
    error: DynamicErrors, products: np.ndarray, block: int, options: MetricsOptions
) -> tuple[np.ndarray, np.ndarray]:
    """Gain and delay [R] of resampled blocks: one Gauss-Newton step from the fit, on the blocks' normal equations."""
    number = -(-len(products) // block)
    starts = np.random.default_rng(options.seed).integers(0, len(products) - block + 1, (options.bootstrap, number))
    total = block_sums(products, starts, block)
    matrix = total[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    step = np.linalg.solve(matrix, total[:, 6:, None])[:, :, 0]
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
        factors[name] = replace(factor, note=note)
    return factors
