"""Improvement factors of a virtual gyro over its single gyros, with intervals."""

from __future__ import annotations

import math

import numpy as np

from vgyro.metrics.bootstrap import percentile_limits, scale_limits
from vgyro.metrics.figures import Reading

NOT_SIGNIFICANT = "not significant"
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
    returns : Reading, limits by percentiles; note "not significant" where they hold 1
    """
    if virtual == 0 or not math.isfinite(virtual):
        return Reading(math.nan, math.nan, math.nan, "the virtual gyro's figure is zero or not known")
    value = float(np.mean(np.abs(singles)) / abs(virtual))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.mean(np.abs(singles_replicates), axis=1) / np.abs(virtual_replicates)
    ratios = ratios[np.isfinite(ratios)]
    if ratios.size == 0:
        return Reading(value, math.nan, math.nan, "no interval: the resampled figure is zero")
    if of_size:
        low, high = scale_limits(value, ratios, confidence)
    else:
        low, high = (float(limit[0]) for limit in percentile_limits(ratios[:, None], confidence))
    return Reading(value, low, high, _note(low, high))


def improvement_of_deviation(
    singles: np.ndarray, virtual: float, singles_edf: np.ndarray, virtual_edf: float, confidence: float = 0.95
) -> Reading:
    """IF of an Allan deviation with limits from the chi² of both curves (an F distribution of the ratio squared).

    singles [N], singles_edf [N] : deviations of the single gyros and their degrees of freedom;  virtual, virtual_edf :
    of the virtual gyro. The two sides are taken as independent, which they are not: the interval is too wide.
    """
    from scipy.special import fdtri

    if virtual == 0 or not math.isfinite(virtual):
        return Reading(math.nan, math.nan, math.nan, "the virtual gyro's figure is zero or not known")
    value = float(np.mean(singles) / virtual)
    # The mean of N deviations varies like one with the degrees of freedom of this weighted sum (Satterthwaite).
    freedom = float(np.sum(singles) ** 2 / np.sum(singles**2 / singles_edf)) if np.any(singles) else 1.0
    tail = (1 - confidence) / 2
    low = value / math.sqrt(fdtri(freedom, virtual_edf, 1 - tail))
    high = value / math.sqrt(fdtri(freedom, virtual_edf, tail))
    note = "limits from the chi² of both curves, taken as independent"
    return Reading(value, low, high, f"{_note(low, high)}; {note}".removeprefix("; "))


def _note(low: float, high: float) -> str:
    return NOT_SIGNIFICANT if low <= 1 + ROUNDING and high >= 1 - ROUNDING else ""
