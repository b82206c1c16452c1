"""All figures of a static test: single gyros and virtual gyros, side by side, with improvement factors."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics.allan import AllanCurve, allan_deviation, split_segments, stretches
from vgyro.metrics.bootstrap import Resampled, Units, joined, resample, unit_grid
from vgyro.metrics.coefficients import noise_coefficients
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import improvement_factor, improvement_of_deviation
from vgyro.metrics.readings import moments, paper_readings
from vgyro.metrics.spectrum import Spectrum, spectral_density

POSE_NOTE = "each pose's own mean is removed"


@dataclass(frozen=True)
class LowPass:
    """What a method does to a series: -3 dB bandwidth, Hz (None: not limited), and gain for a constant rate."""

    bandwidth_hz: float | None = None
    dc_gain: float = 1.0


@dataclass(frozen=True)
class StaticFigures:
    """Of each of S series: Allan curve, spectrum, figures by name (vgyro.metrics.FIGURES)."""

    curves: list[AllanCurve]
    spectra: list[Spectrum]
    readings: list[dict[str, Reading]]


def static_figures(
    series: Iterable[np.ndarray],
    rate_hz: float,
    segment: np.ndarray,
    singles: int,
    filters: list[LowPass],
    options: MetricsOptions,
    engine: str = "native",
    poses: bool = False,
) -> StaticFigures:
    """Figures of series at rest, which are taken one by one: only one of them needs to be in memory.

    series  : S arrays [T], deg/s; the first `singles` are the gyros, the others virtual gyros
    segment : array [T] int, number of the stretch at rest and without a gap
    filters : S, what each series went through
    poses   : the stretches are different poses: 1σ is then taken about each pose's own mean, because gravity and
              switch-on change the bias from pose to pose
    returns : StaticFigures; virtual gyros also get improvement factors
    raises  : TooShort if no stretch has three samples
    """
    curves, spectra, readings = [], [], []
    sums: list[Units] = []
    inside: list[Units] = []
    grid = unit_grid(stretches(segment), rate_hz)
    for values, low_pass in zip(series, filters, strict=True):
        curve = allan_deviation(
            values, rate_hz, None, segment, options.confidence, engine, per_octave=options.taus_per_octave
        )
        spectrum = spectral_density(values, rate_hz, options.welch_s, segment)
        fitted = noise_coefficients(curve, low_pass.bandwidth_hz, low_pass.dc_gain, options.bootstrap, options.seed)
        curves.append(curve)
        spectra.append(spectrum)
        readings.append(paper_readings(curve, spectrum, fitted, rate_hz, low_pass.bandwidth_hz))
        sums.append(grid.units_of(values))
        if poses:
            inside.append(grid.units_of(without_means(values, segment)))
    drawn = _add_moments(readings, joined(sums), joined(inside) if poses else None, options)
    for column in range(singles, len(filters)):
        readings[column].update(_factors(readings, curves, drawn, singles, column, options.confidence))
    return StaticFigures(curves, spectra, readings)


def _add_moments(
    readings: list[dict[str, Reading]], sums: Units, inside: Units | None, options: MetricsOptions
) -> Resampled:
    """Mean and 1σ, into readings; inside : units of the series without the means of their poses, for 1σ."""
    drawn = resample(sums, options.bootstrap, options.seed)
    for column, row in enumerate(readings):
        row.update(moments(sums, column, options.bootstrap, options.seed, options.confidence))
    if inside is not None:
        for column, row in enumerate(readings):
            sigma = moments(inside, column, options.bootstrap, options.seed, options.confidence)["sigma"]
            row["sigma"] = replace(sigma, note=f"{POSE_NOTE}; {sigma.note}")
        drawn = replace(drawn, sigma=resample(inside, options.bootstrap, options.seed, drawn.block).sigma)
    return drawn


def without_means(values: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """values [T] with the mean of each stretch taken off."""
    return np.concatenate([piece - piece.mean() for piece in split_segments(values, segment)])


def _factors(
    readings: list[dict[str, Reading]],
    curves: list[AllanCurve],
    drawn: Resampled,
    singles: int,
    column: int,
    confidence: float,
) -> dict[str, Reading]:
    factors = {}
    for name, replicates in (("mean", drawn.mean), ("sigma", drawn.sigma), ("arw_1s", drawn.adev_1s)):
        figures = np.array([row[name].value for row in readings[:singles]])
        factors[f"if_{name}"] = improvement_factor(
            figures,
            readings[column][name].value,
            replicates[:, :singles],
            replicates[:, column],
            confidence,
            name != "mean",
        )
    if "band-limited" in readings[column]["arw_1s"].note:
        limited = factors["if_arw_1s"]
        note = f"{limited.note}; the low-pass takes part in it".removeprefix("; ")
        factors["if_arw_1s"] = replace(limited, note=note)
    drift = [row["bias_drift"].value for row in readings]
    freedom = np.array([_freedom(curve) for curve in curves])
    factors["if_bias_drift"] = improvement_of_deviation(
        np.array(drift[:singles]), drift[column], freedom[:singles], float(freedom[column]), confidence
    )
    return factors


def _freedom(curve: AllanCurve) -> float:
    lowest = np.where(curve.edf >= 1, curve.deviation, math.inf)
    return float(curve.edf[int(np.argmin(lowest))])
