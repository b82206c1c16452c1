"""Errors of a rate against a known reference: raw, with the delay removed, with delay and gain removed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.metrics.correlation import lagged_products
from vgyro.metrics.dynamic.truth import Truth, known_stretches
from vgyro.metrics.intervals.bootstrap import UNITS_AT_ONCE, UnitGrid, Units, joined, unit_grid

MOST_DELAY_S = 1.0
NEWTON_STEPS = 8
SMALL_STEP_S = 1e-9
ROUNDING = 1e-9


@dataclass(frozen=True)
class DynamicErrors:
    """Errors of one series; all but the first two are NaN where the reference does not change, and `note` says so.

    error_mean, error_sigma : mean and standard deviation of rate - reference, deg/s
    error_sigma_aligned     : the same after shifting the reference by the delay
    error_sigma_scaled      : about offset + gain · shifted reference
    amplitude deg/s, delay s, gain : of the fit;  frequency : of a reference that is a sinusoid, Hz, else NaN
    sums     : of the errors after alignment, in units of 1 s: aligned, scaled; the ends of the stretches are left out
    products : [U, 9] of the fit's derivatives by offset, gain and delay (1, x, d): 11 1x 1d xx xd dd, then 1, x and d
               times the error about the fit, summed over the same units
    """

    error_mean: float
    error_sigma: float
    error_sigma_aligned: float = math.nan
    error_sigma_scaled: float = math.nan
    amplitude: float = math.nan
    delay: float = math.nan
    gain: float = math.nan
    sums: Units | None = None
    products: np.ndarray | None = None
    frequency: float = math.nan
    note: str = ""

    @property
    def phase(self) -> float:
        """Phase against a sinusoidal reference, -360·frequency·delay in -180 to 180, deg; negative: the rate lags."""
        return -math.remainder(360 * self.frequency * self.delay, 360)


@dataclass(frozen=True)
class _Fit:
    """rate = offset + gain · reference(t - delay)"""

    offset: float
    gain: float
    delay: float


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
    returns         : DynamicErrors. Delay: the lag of the highest correlation between rate and reference, of a sinusoid
                      at most half a period, refined below a sample by Gauss-Newton steps on
                      rate = offset + gain · reference(t - delay), the reference between samples by a cubic spline.
                      Amplitude: gain · √2 · r.m.s. of the reference about its mean, which for a sinusoid is the
                      amplitude of the fitted sinusoid.
    Jiang et al. (2012), table 3 gives mean, 1σ (raw) and amplitude.
    """
    rate, reference = np.asarray(rate, dtype=float), np.asarray(reference, dtype=float)
    known = np.isfinite(rate) & np.isfinite(reference)
    cuts = known_stretches(known, segment)
    return errors_of(rate[known], Truth.of(reference[known], rate_hz, cuts, most_delay_s))


def errors_of(rate: np.ndarray, truth: Truth) -> DynamicErrors:
    """dynamic_errors of a rate [T] without NaN against a truth that serves several series."""
    error = rate - truth.reference
    mean = float(error.mean()) if error.size else math.nan
    sigma = float(error.std(ddof=1)) if error.size > 1 else math.nan
    if truth.note:
        return DynamicErrors(mean, sigma, note=truth.note)
    del error
    fit = _align(rate, truth, _coarse_lag(rate, truth) / truth.rate_hz)
    grid = unit_grid(truth.inner(), truth.rate_hz)
    aligned, scaled, products = _errors_about(rate, truth, fit, grid)
    return DynamicErrors(
        mean, sigma, float(aligned.std(ddof=1)), float(scaled.std(ddof=1)), fit.gain * math.sqrt(2) * truth.swing,
        fit.delay, fit.gain, joined([grid.units_of(aligned), grid.units_of(scaled)]), products, truth.frequency,
    )  # fmt: skip


def _coarse_lag(rate: np.ndarray, truth: Truth) -> int:
    """Whole-sample lag of the highest correlation: inner part of the rate against the reference moved past it."""
    margin = truth.margin
    products = np.zeros(2 * margin + 1)
    mean = sum(float(rate[run].sum()) for run in truth.runs) / sum(run.stop - run.start for run in truth.runs)
    for run in truth.runs:
        inner = rate[run.start + margin : run.stop - margin] - mean
        products += lagged_products(inner, truth.reference[run] - truth.centre, 2 * margin + 1)
    # Position k of the moving reference stands for a delay of margin - k samples.
    reach = slice(margin - truth.most_lag, margin + truth.most_lag + 1)
    return truth.most_lag - int(np.argmax((products / np.sqrt(truth.spread))[reach]))


def _align(rate: np.ndarray, truth: Truth, delay: float) -> _Fit:
    """Least squares of the inner rate = offset + gain · reference(t - delay), by Gauss-Newton from a delay, s."""
    limit = truth.margin / truth.rate_hz
    best, cost = _Fit(0.0, 1.0, delay), math.inf
    for _ in range(NEWTON_STEPS):
        gram = np.zeros((4, 4))
        for run, first, last in truth.parts():
            at = slice(run.start + first, run.start + last)
            value, slope = truth.moved(run, first, last, delay)
            rows = np.stack([np.ones(last - first), value - truth.centre, slope, rate[at] - truth.centre])
            gram += rows @ rows.T
        # Rows and columns: 1, x, dx/dt, y; x and y counted from the centre.
        offset, gain = np.linalg.solve(gram[:2, :2], gram[:2, 3]).tolist()
        left = np.array([-offset, -gain, 0.0, 1.0])
        squares = float(left @ gram @ left)
        if squares <= cost * (1 + ROUNDING):
            cost, best = squares, _Fit(offset + truth.centre * (1 - gain), gain, delay)
        steepness = gram[2, 2] - gram[2, :2] @ np.linalg.solve(gram[:2, :2], gram[:2, 2])
        if gain == 0 or steepness <= 0:
            break
        step = -float(gram[2] @ left) / (gain * float(steepness))
        delay = float(np.clip(delay + step, -limit, limit))
        if abs(step) < SMALL_STEP_S:
            break
    return best


def _errors_about(
    rate: np.ndarray, truth: Truth, fit: _Fit, grid: UnitGrid
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors after alignment, and about the fit, of the inner samples [I]; the products of DynamicErrors."""
    aligned, scaled = np.empty(grid.samples), np.empty(grid.samples)
    products = np.empty((len(grid.at), 9))
    for run, (start, stop) in zip(truth.runs, truth.inner(), strict=True):
        first_unit, end_unit = np.searchsorted(grid.at, (start, stop)).tolist()
        for unit in range(first_unit, end_unit, UNITS_AT_ONCE):
            units = slice(unit, min(unit + UNITS_AT_ONCE, end_unit))
            here = slice(int(grid.at[unit]), int(grid.at[units.stop]) if units.stop < end_unit else stop)
            first, last = (place - start + truth.margin for place in (here.start, here.stop))
            value, slope = truth.moved(run, first, last, fit.delay)
            measured = rate[run.start + first : run.start + last]
            aligned[here] = measured - value
            scaled[here] = left = measured - fit.offset - fit.gain * value
            slope *= -fit.gain
            rows = (
                np.ones(len(value)), value, slope, value * value, value * slope, slope * slope,
                left, value * left, slope * left,
            )  # fmt: skip
            at = grid.at[units] - here.start
            products[units] = np.stack([np.add.reduceat(row, at) for row in rows], axis=1)
    return aligned, scaled, products
