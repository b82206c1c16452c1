"""Noise of the gyros of an array that never rests: from their differences, in which the common rate cancels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from vgyro.metrics.allan import allan_deviation
from vgyro.metrics.coefficients import noise_coefficients
from vgyro.metrics.sampling import Sampling

REPLICATES = 50


def noise_from_differences(
    series: Sequence[np.ndarray],
    rate_hz: float,
    segment: np.ndarray | None = None,
    engine: str = "native",
    sampling: Sampling | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """N deg/s/√Hz (two-sided) and K deg/s/√s of each gyro from the fits to all pairwise differences.

    series  : N arrays [T], deg/s, in motion or not, two at a time are held
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
            curve = allan_deviation(rate - series[other], rate_hz, segment=segment, engine=engine, sampling=sampling)
            fit = noise_coefficients(curve, replicates=REPLICATES)
            squares[pairs.index((one, other))] = fit.N.value**2, fit.K.value**2
    if number == 2:
        shares = np.repeat(squares / 2, 2, axis=0)
    else:
        design = np.zeros((len(pairs), number))
        for row, pair in enumerate(pairs):
            design[row, list(pair)] = 1
        shares = np.column_stack([nnls(design, squares[:, term])[0] for term in range(2)])
    return np.sqrt(shares[:, 0]), np.sqrt(shares[:, 1])
