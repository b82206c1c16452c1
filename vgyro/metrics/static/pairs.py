"""Noise of the gyros of an array that never rests: from their differences, in which the common rate cancels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from vgyro.errors import TooShort
from vgyro.metrics.allan.coefficients import noise_coefficients
from vgyro.metrics.allan.deviation import AllanCurve, allan_deviation
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.static.lacking import own_samples

REPLICATES = 50


def noise_from_differences(
    series: Sequence[np.ndarray],
    rate_hz: float,
    segment: np.ndarray | None = None,
    engine: str = "native",
    sampling: Sampling | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """N deg/s/√Hz (two-sided) and K deg/s/√s of each gyro from the fits to all pairwise differences.

    series  : N arrays [T], deg/s, in motion or not, two at a time are held; NaN where a gyro has no value, which is
              lost to its differences
    segment : array [T] int;  sampling : instead of it, when the samples were taken: short losses then end no average
    returns : N [N], K [N]; NaN for a single gyro. The squares of a difference are the sum of two gyros' squares (their
              noise taken as independent): non-negative least squares over the pairs. Two gyros share equally.
    The N-cornered hat of Gray & Allan (1974). Gyros of unequal scale leave a part of the motion in K.
    """
    from scipy.optimize import nnls

    number = len(series)
    if number < 2:
        return np.full(number, math.nan), np.full(number, math.nan)
    pairs = list(itertools.combinations(range(number), 2))
    squares = np.zeros((len(pairs), 2))
    for one in range(number - 1):
        rate = series[one]
        for other in range(one + 1, number):
            curve = _curve(rate - series[other], rate_hz, segment, engine, sampling)
            if curve is None:
                squares[pairs.index((one, other))] = math.nan
                continue
            fit = noise_coefficients(curve, replicates=REPLICATES)
            squares[pairs.index((one, other))] = fit.N.value**2, fit.K.value**2
    if number == 2:
        shares = np.repeat(squares / 2, 2, axis=0)
    else:
        design = np.zeros((len(pairs), number))
        for row, pair in enumerate(pairs):
            design[row, list(pair)] = 1
        known = np.isfinite(squares).all(axis=1)
        shares = np.column_stack([nnls(design[known], squares[known, term])[0] for term in range(2)])
        shares[~design[known].any(axis=0)] = math.nan
    return np.sqrt(shares[:, 0]), np.sqrt(shares[:, 1])


def _curve(
    difference: np.ndarray, rate_hz: float, segment: np.ndarray | None, engine: str, sampling: Sampling | None
) -> AllanCurve | None:
    """Allan curve of a difference; None where two gyros that lack values have too few samples in common."""
    if not np.isnan(difference).any():
        return allan_deviation(difference, rate_hz, segment=segment, engine=engine, sampling=sampling)
    if sampling is None:
        sampling = Sampling.of(rate_hz, np.zeros(len(difference), np.int8) if segment is None else segment)
    own, when = own_samples(difference, sampling)
    try:
        return allan_deviation(own, when.rate_hz, engine=engine, sampling=when)
    except TooShort:
        return None
