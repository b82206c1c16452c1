"""Figures of a response to a table: nonlinearity, asymmetry, hysteresis, zero rate (IEEE Std 1431-2004)."""

from __future__ import annotations

import numpy as np

from vgyro import units
from vgyro.calibration.figures import Finding, not_measured, signed, unsigned
from vgyro.calibration.response import SAME_RATE, RateResponse
from vgyro.calibration.sizes import DRAWS, Size, largest, noise_draws, root_mean_square, size_and_limits
from vgyro.calibration.wandering import student

READING_FROM = 0.1  # of full scale: below, an error over the reading says nothing
MEDIAN_OF_NOISE = 0.6745  # of |x|, x standard normal
ROUGH = "no smooth curve: every rate for itself"


def nonlinearity(response: RateResponse, scale: float, full_scale: float, confidence: float) -> dict[str, Finding]:
    """The three nonlinearities, ppm: largest over full scale, largest over reading, r.m.s. over full scale.

    scale : deg/s a count;  full_scale : deg/s
    Value and limits are those of the fitted bend at the rates of the table, floor that of the residuals as seen.
    """
    to_ppm = float(units.parts_per_million(scale))
    rates = np.abs(response.model.rates)
    readable = rates >= READING_FROM * full_scale
    whole = np.full(len(rates), to_ppm / full_scale)
    reading = np.where(readable, to_ppm / np.maximum(rates, READING_FROM * full_scale), 0.0)
    cases: dict[str, tuple[Size, np.ndarray]] = {
        "nonlinearity_full_scale": (largest, whole),
        "nonlinearity_reading": (largest, reading),
        "nonlinearity_rms": (root_mean_square, whole),
    }
    if not response.bends:
        return dict.fromkeys(cases, not_measured("too few rates to tell a bend from noise"))
    note = "" if response.smooth else ROUGH
    findings = {}
    for name, (size, factor) in cases.items():
        bend, seen = factor[:, None] * response.bend, factor[:, None] * response.seen_bend
        findings[name] = _size(response, bend, seen, size, confidence, note)
    return findings


def asymmetry(response: RateResponse, confidence: float) -> Finding:
    """(S⁺ - S⁻) / S, ppm: least-squares slopes of the plateaus from 0 up and from 0 down, over the mean of the two."""
    up, down = response.half_slope(1), response.half_slope(-1)
    if up is None or down is None:
        return not_measured("needs three rates or more on either side, zero included")
    mean = float((up + down) @ response.fit.estimate) / 2
    return combined(response, units.parts_per_million((up - down) / mean), confidence)


def hysteresis(response: RateResponse, scale: float, full_scale: float, confidence: float) -> Finding:
    """Largest |up - down| over full scale, ppm; scale deg/s a count, full_scale deg/s."""
    if not len(response.loop):
        return not_measured("needs three rates or more that are reached both from below and from above")
    factor = float(units.parts_per_million(scale)) / full_scale
    return _size(response, factor * response.loop, factor * response.seen_loop, largest, confidence)


def zero_shift(response: RateResponse, scale: float, confidence: float) -> Finding:
    """Last plateau at zero rate minus the first, deg/h; scale deg/s a count, with the gyro's sign.

    The limits allow for the noise of the two means, slow noise included.
    """
    visits = response.model.visits
    at_zero = np.flatnonzero(np.abs(visits.rate) <= SAME_RATE * visits.largest)
    if at_zero.size < 2 or np.all(np.diff(at_zero) == 1):
        return not_measured("needs a plateau at zero rate before and after the others")
    first, last = at_zero[0], at_zero[-1]
    factor = float(units.deg_h(scale))
    noise = response.fit.noise
    error = abs(factor) * float(np.sqrt(noise[first, first] + noise[last, last] - 2 * noise[first, last]))
    half = student(response.fit.freedom, confidence) * error
    return signed(factor * float(visits.count[last] - visits.count[first]), half, MEDIAN_OF_NOISE * error)


def zero_offset(response: RateResponse, scale: float, confidence: float) -> Finding:
    """Output at zero rate minus that of the straight line, deg/h; scale deg/s a count, with the gyro's sign."""
    at_zero = np.flatnonzero(np.abs(response.model.rates) <= SAME_RATE * response.model.visits.largest)
    if not at_zero.size or not response.bends:
        return not_measured("needs a plateau at zero rate, and rates enough to tell a bend from noise")
    return combined(response, float(units.deg_h(scale)) * response.bend[at_zero[0]], confidence)


def combined(response: RateResponse, combination: np.ndarray, confidence: float, note: str = "") -> Finding:
    """A figure with a sign that is a combination [p] of the coefficients."""
    fit = response.fit
    floor = MEDIAN_OF_NOISE * fit.standard_error(combination)
    return signed(float(combination @ fit.estimate), fit.half_width(combination, confidence), floor, note)


def _size(
    response: RateResponse, combination: np.ndarray, seen: np.ndarray, size: Size, confidence: float, note: str = ""
) -> Finding:
    """A figure that is the size of combinations [J, p]; `seen` [J, P] gives the floor."""
    fit = response.fit
    limits = size_and_limits(combination @ fit.estimate, fit.draws(combination, DRAWS), size, confidence)
    by_noise = size(noise_draws(seen, fit.noise))
    stands_out = float(size(seen @ response.model.visits.count)) > float(np.quantile(by_noise, confidence))
    return unsigned(*limits, float(np.median(by_noise)), stands_out, note)
