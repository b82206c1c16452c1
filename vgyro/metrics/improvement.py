"""Improvement factors of a virtual gyro over its single gyros, with intervals of both taken together."""

from __future__ import annotations

import math

import numpy as np

from vgyro.metrics.figures import Reading
from vgyro.metrics.intervals.bootstrap import percentile_limits, scale_limits

NOT_SIGNIFICANT = "not significant"
NOT_KNOWN = "the virtual gyro's figure is zero or not known"
ROUNDING = 1e-9


def improvement_factor(
    singles: np.ndarray,
    virtual: float,
    singles_replicates: np.ndarray,
    virtual_replicates: np.ndarray,
    confidence: float = 0.95,
    of_size: bool = True,
) -> Reading:
    """IF = mean of a figure over the single gyros / the figure of the virtual gyro (Liu et al. 2015, eq. 18).

    singles [N], virtual : the figure, its absolute value is taken (a mean may be negative)
    singles_replicates [R, N], virtual_replicates [R] : the same figures of series resampled together, so that what
    the virtual gyro shares with its members does not widen the interval
    of_size : the figure is a size (1σ, ARW), not a mean: limits as in scale_limits
    returns : Reading, limits by percentiles; flagged `not_significant` where they hold 1
    """
    if virtual == 0 or not math.isfinite(virtual):
        return Reading(math.nan, math.nan, math.nan, NOT_KNOWN)
    value = _ratio(singles, virtual)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.mean(np.abs(singles_replicates), axis=1) / np.abs(virtual_replicates)
    ratios = ratios[np.isfinite(ratios)]
    if ratios.size == 0:
        return Reading(value, math.nan, math.nan, "no interval: the resampled figure is zero")
    if of_size:
        low, high = scale_limits(value, ratios, confidence)
    else:
        low, high = (float(limit[0]) for limit in percentile_limits(ratios[:, None], confidence))
    return _factor(value, low, high)


def improvement_by_draws(
    singles: np.ndarray,
    virtual: float,
    singles_drawn: np.ndarray,
    virtual_drawn: np.ndarray,
    expected: np.ndarray,
    confidence: float = 0.95,
) -> Reading:
    """IF with limits from series drawn by a model.

    singles [N], virtual : the figure;  singles_drawn [R, N], virtual_drawn [R] : of the same draws
    expected : true factor of the model, or [R] of the model of each draw
    The share of the true factor that the draws find is taken to be that which the recording has found.
    """
    if virtual == 0 or not math.isfinite(virtual):
        return Reading(math.nan, math.nan, math.nan, NOT_KNOWN)
    value = _ratio(singles, virtual)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.mean(np.abs(singles_drawn), axis=1) / np.abs(virtual_drawn) / expected
    shares = shares[np.isfinite(shares) & (shares > 0)]
    if shares.size == 0:
        return Reading(value, math.nan, math.nan, "no interval: the drawn figure is zero")
    tail = (1 - confidence) / 2
    above, below = np.quantile(shares, [1 - tail, tail])
    low, high = value / float(above), value / float(below)
    return _factor(value, low, high)


def improvement_of_deviation(
    singles: np.ndarray, virtual: float, variance: np.ndarray, correlation: np.ndarray, confidence: float = 0.95
) -> Reading:
    """IF of a size from the standard error of its logarithm: of N, or of an Allan deviation of many edf.

    singles [N], virtual : the figure
    variance [N + 1]     : of the logarithm of each, 1/(2·edf); the virtual gyro is the last
    correlation [N + 1, N + 1] : of the noise that the figures are sizes of. Mean squares of Gaussian noise correlate
    by its square (Isserlis 1918); where one of the two was found from fewer data, these are a part of the other's, and
    the covariance is the variance of the better one.
    """
    if virtual == 0 or not math.isfinite(virtual):
        return Reading(math.nan, math.nan, math.nan, NOT_KNOWN)
    value = _ratio(singles, virtual)
    if not (value > 0 and np.isfinite(variance).all()):
        return Reading(value, math.nan, math.nan, "no interval: a figure or its limits are not known")
    share = np.append(np.abs(singles) / np.sum(np.abs(singles)), -1.0)
    covariance = correlation**2 * np.minimum(variance[:, None], variance)
    covariance[range(len(variance)), range(len(variance))] = variance
    error = math.sqrt(max(float(share @ covariance @ share), 0.0))
    half = math.exp(normal_quantile(confidence) * error)
    return _factor(value, value / half, value * half)


def _factor(value: float, low: float, high: float) -> Reading:
    """A factor, flagged where its limits hold 1."""
    if low <= 1 + ROUNDING and high >= 1 - ROUNDING:
        return Reading(value, low, high, NOT_SIGNIFICANT, frozenset({"not_significant"}))
    return Reading(value, low, high)


def log_variance(reading: Reading, confidence: float = 0.95) -> float:
    """Variance of the logarithm of a size, from its limits; infinite where they hold 0."""
    if not (reading.value > 0 and reading.low > 0 and math.isfinite(reading.high)):
        return math.inf
    return (math.log(reading.high / reading.low) / (2 * normal_quantile(confidence))) ** 2


def _ratio(singles: np.ndarray, virtual: float) -> float:
    return float(np.mean(np.abs(singles)) / abs(virtual))


def normal_quantile(confidence: float) -> float:
    """Half width of a two-sided interval, in standard errors."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + confidence / 2))
