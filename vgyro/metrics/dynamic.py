"""Errors of a rate against a known reference: raw, with the delay removed, with delay and gain removed."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np

MOST_DELAY_S = 1.0
NEWTON_STEPS = 8
STILL = 1e-9
SMALL_STEP_S = 1e-9


@dataclass(frozen=True)
class DynamicErrors:
    """Errors of one series; all but the first two are NaN where the reference does not change, and `note` says so.

    error_mean, error_sigma : mean and standard deviation of rate - reference, deg/s
    error_sigma_aligned     : the same after shifting the reference by the delay
    error_sigma_scaled      : about offset + gain · shifted reference
    amplitude deg/s, delay s, gain : of the fit
    aligned, scaled, shifted, slope, inner_segment [I] : errors after alignment, the shifted reference (deg/s) and its
        derivative (deg/s²), number of the stretch; the ends of the stretches are left out
    """

    error_mean: float
    error_sigma: float
    error_sigma_aligned: float = math.nan
    error_sigma_scaled: float = math.nan
    amplitude: float = math.nan
    delay: float = math.nan
    gain: float = math.nan
    aligned: np.ndarray = field(default_factory=lambda: np.empty(0))
    scaled: np.ndarray = field(default_factory=lambda: np.empty(0))
    shifted: np.ndarray = field(default_factory=lambda: np.empty(0))
    slope: np.ndarray = field(default_factory=lambda: np.empty(0))
    inner_segment: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    note: str = ""


@dataclass(frozen=True)
class _Alignment:
    delay: float
    offset: float
    gain: float
    shifted: np.ndarray
    slope: np.ndarray


def dynamic_errors(
    rate: np.ndarray,
    reference: np.ndarray,
    rate_hz: float,
    segment: np.ndarray | None = None,
    most_delay_s: float = MOST_DELAY_S,
) -> DynamicErrors:
    """Compare a rate with the true one.

    rate, reference : arrays [T], deg/s; samples where either is NaN are left out
    segment         : array [T] int, number of the gap-free stretch
    most_delay_s    : largest delay that is searched, either way, s; the ends of each stretch are left out by as much
                      when the delay is fitted
    returns         : DynamicErrors. Delay: the lag of the highest correlation between rate and reference, refined below
                      a sample by Gauss-Newton steps on rate = offset + gain · reference(t - delay), the reference
                      between samples by a cubic spline. Amplitude: gain · √2 · r.m.s. of the reference about its mean,
                      which for a sinusoid is the amplitude of the fitted sinusoid.
    Jiang et al. (2012), table 3 gives mean, 1σ (raw) and amplitude.
    """
    rate, reference = np.asarray(rate, dtype=float), np.asarray(reference, dtype=float)
    used = np.isfinite(rate) & np.isfinite(reference)
    error = (rate - reference)[used]
    mean = float(error.mean()) if error.size else math.nan
    sigma = float(error.std(ddof=1)) if error.size > 1 else math.nan
    if error.size < 2:
        return DynamicErrors(mean, sigma, note="fewer than 2 samples with a reference")
    swing = float(np.std(reference[used]))
    if swing <= STILL * max(float(np.max(np.abs(reference[used]))), 1.0):
        return DynamicErrors(mean, sigma, note="the reference does not change: no delay, gain or amplitude")
    margin = max(round(most_delay_s * rate_hz), 1)
    runs = [run for run in _runs(used, segment) if run.stop - run.start > 4 * margin]
    if not runs:
        return DynamicErrors(mean, sigma, note=f"no gap-free stretch is longer than {4 * most_delay_s:g} s")
    lag = _coarse_lag(rate, reference, runs, margin)
    inner = np.concatenate([np.arange(run.start + margin, run.stop - margin) for run in runs])
    number = np.concatenate([np.full(run.stop - run.start - 2 * margin, index) for index, run in enumerate(runs)])
    fit = _align(rate[inner], reference, runs, margin, lag / rate_hz, rate_hz)
    aligned, scaled = rate[inner] - fit.shifted, rate[inner] - fit.offset - fit.gain * fit.shifted
    return DynamicErrors(
        mean, sigma, float(aligned.std(ddof=1)), float(scaled.std(ddof=1)), float(fit.gain * math.sqrt(2) * swing),
        fit.delay, fit.gain, aligned, scaled, fit.shifted, fit.slope, number,
    )  # fmt: skip


def _runs(used: np.ndarray, segment: np.ndarray | None) -> list[slice]:
    """Stretches of used samples that no gap breaks."""
    change = np.diff(used.astype(np.int8)) != 0
    if segment is not None:
        change |= np.diff(segment) != 0
    borders = [0, *(np.flatnonzero(change) + 1).tolist(), len(used)]
    return [slice(a, b) for a, b in itertools.pairwise(borders) if used[a]]


def _coarse_lag(rate: np.ndarray, reference: np.ndarray, runs: list[slice], margin: int) -> int:
    """Whole-sample lag of the highest correlation: inner part of the rate against the reference moved past it."""
    from scipy.signal import correlate

    products, squares, sums, count = np.zeros(2 * margin + 1), np.zeros(2 * margin + 1), np.zeros(2 * margin + 1), 0
    centre = float(np.mean(reference[runs[0]]))
    mean = sum(float(rate[run].sum()) for run in runs) / sum(run.stop - run.start for run in runs)
    for run in runs:
        inner = rate[run.start + margin : run.stop - margin] - mean
        moving = reference[run] - centre
        products += correlate(moving, inner, mode="valid", method="fft")
        running, running_squares = (np.concatenate(([0.0], np.cumsum(x))) for x in (moving, moving**2))
        sums += running[inner.size :] - running[: -inner.size]
        squares += running_squares[inner.size :] - running_squares[: -inner.size]
        count += inner.size
    spread = np.maximum(squares - sums**2 / count, np.finfo(float).tiny)
    # Position k of the moving reference stands for a delay of margin - k samples.
    return margin - int(np.argmax(products / np.sqrt(spread)))


def _align(
    measured: np.ndarray, reference: np.ndarray, runs: list[slice], margin: int, delay: float, rate_hz: float
) -> _Alignment:
    """Least squares of measured [I] = offset + gain · reference(t - delay), by Gauss-Newton from a delay, s."""
    from scipy.interpolate import CubicSpline

    splines = [CubicSpline(np.arange(run.stop - run.start), reference[run]) for run in runs]
    positions = [np.arange(margin, run.stop - run.start - margin, dtype=float) for run in runs]
    limit = margin / rate_hz

    def moved(delay_s: float, derivative: int) -> np.ndarray:
        parts = [spline(at - delay_s * rate_hz, derivative) for spline, at in zip(splines, positions, strict=True)]
        return np.concatenate(parts) * rate_hz**derivative

    best = (math.inf, delay, 0.0, 1.0)
    for _ in range(NEWTON_STEPS):
        shifted = moved(delay, 0)
        design = np.column_stack([np.ones_like(shifted), shifted])
        (offset, gain), *_ = np.linalg.lstsq(design, measured, rcond=None)
        left = measured - design @ (offset, gain)
        cost = float(left @ left)
        if cost < best[0]:
            best = (cost, delay, float(offset), float(gain))
        slope = -gain * moved(delay, 1)
        slope -= design @ np.linalg.lstsq(design, slope, rcond=None)[0]
        if not slope.any():
            break
        step = float(slope @ left / (slope @ slope))
        delay = float(np.clip(delay + step, -limit, limit))
        if abs(step) < SMALL_STEP_S:
            break
    _, delay, offset, gain = best
    return _Alignment(delay, offset, gain, moved(delay, 0), moved(delay, 1))
