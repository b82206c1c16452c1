"""The figures that the two papers read off a static test, each with its limits, next to the fitted ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vgyro import units
from vgyro.figure import Flag
from vgyro.metrics.allan.coefficients import Coefficient, NoiseCoefficients, low_pass_factor
from vgyro.metrics.allan.deviation import AllanCurve, read_curve
from vgyro.metrics.equal_bandwidth import OTHER_SHAPE, LowPass
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import log_variance, normal_quantile
from vgyro.metrics.intervals.bootstrap import Units, percentile_limits, resample, scale_limits
from vgyro.metrics.spectra.welch import Spectrum, flat_band, noise_density

K_AT_TAU = 3.0  # s: there the slope +1/2 line equals K
BEYOND_MINIMUM = 2.0
BAND_LIMITED = 0.98
BAND_LIMITED_WORD = "band-limited"
FEWEST_FREEDOM = 1.0
SMOOTHER = f"{BAND_LIMITED_WORD}: a smoother limits the band, N is not that of white noise"
AGREEMENT = 0.01  # noise density and N, which are the same for white noise


def paper_readings(
    curve: AllanCurve,
    spectrum: Spectrum,
    coefficients: NoiseCoefficients,
    rate_hz: float,
    low_pass: LowPass | None = None,
) -> dict[str, Reading]:
    """Noise density, ARW, RRW, bias drift, bias instability, quantisation and ramp of one series in the field's units.

    curve, spectrum, coefficients : of the series, in deg/s
    low_pass : that it went through; None: none
    returns : noise_density deg/s/√Hz (two-sided), arw_1s and arw deg/√h, density_ratio, quantisation deg, rrw_read and
              rrw deg/h/√h, rate_ramp deg/h², bias_drift and bias_instability deg/h, bias_drift_tau s
    Jiang et al. (2012), table 2; Liu et al. (2015), table 3; IEEE Std 952-1997 for the fitted terms.
    """
    low_pass = low_pass or LowPass()
    notes = [SMOOTHER if low_pass.other_shape else "", coefficients.note]
    density = noise_density(spectrum, flat_band(rate_hz, low_pass.bandwidth_hz), curve.confidence)
    drift, drift_tau = bias_drift(curve, low_pass.shortest_tau)
    white = _fitted(coefficients.N, units.arw_deg_rt_h, "; ".join(filter(None, notes)))
    level = Reading(density.value, density.low, density.high, _density_note(density.value, density.band))
    return {
        "noise_density": level,
        "arw_1s": _arw_at_one_second(curve, low_pass),
        "arw": replace(white, flags=white.flags | {"band_limited"}) if low_pass.other_shape else white,
        "density_ratio": density_ratio(level, coefficients.N, curve.confidence, low_pass.dc_gain),
        "quantisation": _fitted(coefficients.Q, float, coefficients.note),
        "rrw_read": rrw_read(curve, low_pass.shortest_tau),
        "rrw": _fitted(coefficients.K, units.rrw_deg_h_rt_h, coefficients.note),
        "rate_ramp": _fitted(coefficients.R, units.ramp_deg_h2, coefficients.note),
        "bias_drift": drift,
        "bias_drift_tau": drift_tau,
        "bias_instability": _fitted(coefficients.B, units.deg_h, coefficients.note),
    }


def moments(
    sums: Units, series: int, replicates: int, seed: int, confidence: float, block: int | None = None
) -> dict[str, Reading]:
    """Mean and 1σ of one series, deg/s, with the limits of the moving-block bootstrap.

    series : column of sums;  block : length of the blocks in units; None: by the rule of block_length for this series
    """
    one = sums.only(series)
    drawn = resample(one, replicates, seed, block)
    count = one.count.sum()
    mean = one.total.sum() / count
    centred = one.squares[:, 0] - 2 * mean * one.total[:, 0] + one.count * mean**2
    sigma = math.sqrt(max(centred.sum(), 0.0) / max(count - 1, 1))
    notes = {name: f"bootstrap of blocks of {drawn.blocks[name]} s" for name in ("mean", "sigma")}
    low, high = percentile_limits(drawn.mean, confidence)
    return {
        "mean": Reading(float(mean), float(low[0]), float(high[0]), notes["mean"]),
        "sigma": Reading(sigma, *scale_limits(sigma, drawn.sigma[:, 0], confidence), notes["sigma"]),
    }


def density_ratio(density: Reading, n: Coefficient, confidence: float, dc_gain: float = 1.0) -> Reading:
    """Noise density over N, both two-sided and at a DC gain of 1; the limits take both as independent.

    For white noise it is 1: √2 between a one-sided density and N. Where it is off by more than 1 % and its limits leave
    1 out, tones, drift or a low-pass share the band of one of the two, and the note says so.
    """
    if not (n.value > 0 and density.value > 0):
        return Reading(math.nan, math.nan, math.nan, "density or N is not known")
    value = density.value / dc_gain / n.value
    variance = log_variance(density, confidence) + log_variance(Reading(n.value, n.low, n.high), confidence)
    if not math.isfinite(variance):
        return Reading(value, math.nan, math.nan, "no interval: N is not shown to exist")
    half = math.exp(normal_quantile(confidence) * math.sqrt(variance))
    low, high = value / half, value * half
    agrees = low <= 1 <= high or abs(value - 1) <= AGREEMENT
    return Reading(value, low, high, "" if agrees else "density and N differ: the noise is not white in both bands")


def counted(number: int) -> Reading:
    """A count of samples."""
    return Reading(float(number), math.nan, math.nan)


def lowest_point(curve: AllanCurve, shortest: float = 0.0) -> int:
    """Index of the lowest point of a curve that has a degree of freedom, from τ = `shortest` s on.

    A smoothed rate hardly changes from sample to sample: below that τ the curve is low whatever the noise is.
    """
    free = curve.edf >= FEWEST_FREEDOM
    usable = free & (curve.tau >= shortest)
    if not usable.any():
        return int(np.flatnonzero(free).max(initial=0))
    return int(np.argmin(np.where(usable, curve.deviation, np.inf)))


def bias_drift(curve: AllanCurve, shortest: float = 0.0) -> tuple[Reading, Reading]:
    """Lowest point of the curve, deg/h, and its τ, s; limits are those of the curve at that τ.

    shortest : τ from which on it is looked for, s: a low-pass lowers the curve below
    """
    usable = curve.edf >= FEWEST_FREEDOM
    index = lowest_point(curve, shortest)
    falls = index == len(curve.tau) - 1 or not usable[index + 1 :].any()
    note = "the curve still falls at its end: an upper limit of the floor" if falls else ""
    low, value, high = (float(units.deg_h(row[index])) for row in (curve.low, curve.deviation, curve.high))
    tau = float(curve.tau[index])
    flags: frozenset[Flag] = frozenset({"upper_limit"}) if falls else frozenset()
    return Reading(value, low, high, note, flags), Reading(tau, math.nan, math.nan, note, flags)


def rrw_read(curve: AllanCurve, shortest: float = 0.0) -> Reading:
    """K read with a slope +1/2 line, deg/h/√h: least squares of log σ = log K + ½ log(τ/3), weight edf.

    The line goes through the points from twice the τ of the minimum to the end. If they span less than an octave the
    curve does not rise: the line then goes through the last octave and K is an upper limit. Limits: chi² with the
    weighted mean of the edf, because neighbouring points are nearly the same data.
    shortest : τ from which on the curve is looked at, s
    """
    usable = (curve.edf >= FEWEST_FREEDOM) & (curve.deviation > 0) & (curve.tau >= shortest)
    if not curve.deviation.any():
        return Reading(0.0, 0.0, 0.0, "the series is constant")
    if not usable.any():
        return Reading(math.nan, math.nan, math.nan, "the curve does not reach beyond the low-pass")
    tau, deviation, edf = curve.tau[usable], curve.deviation[usable], curve.edf[usable]
    start = BEYOND_MINIMUM * tau[int(np.argmin(deviation))]
    rises = bool(tau[-1] >= 2 * start)
    line = tau >= (start if rises else tau[-1] / 2)
    weight = edf[line] / edf[line].sum()
    value = math.exp(float(weight @ (np.log(deviation[line]) - np.log(tau[line] / K_AT_TAU) / 2)))
    value = float(units.rrw_deg_h_rt_h(value))
    low, high = _chi2_limits(value, float(weight @ edf[line]), curve.confidence)
    span = f"line through τ = {tau[line][0]:.3g} to {tau[-1]:.3g} s"
    if rises:
        return Reading(value, low, high, span)
    return Reading(value, 0.0, high, f"no rise, an upper limit; {span}", frozenset({"upper_limit"}))


def _arw_at_one_second(curve: AllanCurve, low_pass: LowPass) -> Reading:
    value, low, high = (float(units.arw_deg_rt_h(read)) for read in read_curve(curve, 1.0))
    note, limited = "" if math.isfinite(value) else "the curve does not reach τ = 1 s", low_pass.other_shape
    if low_pass.other_shape:
        note = f"{BAND_LIMITED_WORD}: {OTHER_SHAPE}, which lowers σ(1 s) by itself"
    elif low_pass.bandwidth_hz:
        kept = math.sqrt(float(low_pass_factor(np.array([1.0]), low_pass.constant, low_pass.passes)[0]))
        if kept < BAND_LIMITED:
            note = f"{BAND_LIMITED_WORD}: the filter by itself lowers σ(1 s) to {kept:.2f} of the white level"
            limited = True
    return Reading(value, low, high, note, frozenset({"band_limited"}) if limited else frozenset())


def _density_note(value: float, band: tuple[float, float]) -> str:
    if not math.isfinite(value):
        return f"no frequency of the spectrum lies in {band[0]:.3g}-{band[1]:.3g} Hz"
    return f"two-sided, {band[0]:.3g}-{band[1]:.3g} Hz; one-sided {units.one_sided(value):.4g}"


def _fitted(coefficient: Coefficient, convert: Callable[[float], float], note: str) -> Reading:
    value, low, high = (float(convert(number)) for number in (coefficient.value, coefficient.low, coefficient.high))
    if low == 0 and math.isfinite(high) and high > 0:
        note = f"not shown to exist: < {high:.4g}" + (f"; {note}" if note else "")
        return Reading(value, low, high, note, frozenset({"not_shown"}))
    return Reading(value, low, high, note)


def _chi2_limits(value: float, freedom: float, confidence: float) -> tuple[float, float]:
    from scipy.special import chdtri

    tail = (1 - confidence) / 2
    low, high = (value * math.sqrt(freedom / chdtri(freedom, share)) for share in (tail, 1 - tail))
    return low, high
