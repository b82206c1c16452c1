"""Allan variance, its degrees of freedom and its limits, by allantools; what tells kinds of noise apart, in NumPy.

allantools works on one gap-free series at a time; the sums of several are added here.
"""

from __future__ import annotations

import itertools

import allantools
import numpy as np
from scipy.stats import chi2

STEEPEST = -2  # random walk of the rate: the steepest noise for which the two-sample variance exists
FLATTEST = 2  # white noise of the angle


def second_differences(
    rate: np.ndarray, rate_hz: float, factors: np.ndarray, edges: np.ndarray | None = None, share: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the squared overlapping second differences of the angle, divided by 2τ², and how many there are.

    rate    : array [T], deg/s
    factors : array [M] int, ascending averaging factors m; τ = m / rate_hz
    edges   : array [S + 1] int, first sample of each gap-free stretch, and T; None: there is no gap
    share   : stretches of less than share·m samples are left out, and those of 2m and less
    returns : sums [M] in (deg/s)², counts [M]; sums / counts is the overlapping Allan variance. Zeros where no stretch
              is long enough.
    Riley, NIST SP 1065, eq. 11.
    """
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    for piece in _stretches(rate, edges):
        # allantools leaves out a τ with a single difference.
        possible = np.flatnonzero((2 * factors < piece.size) & (share * factors <= piece.size))
        if possible.size:
            angle = np.concatenate(([0.0], np.cumsum(piece - piece.mean()))) / rate_hz
            _, deviation, _, number = allantools.oadev(angle, rate_hz, "phase", factors[possible] / rate_hz)
            counts[possible] += number.astype(np.int64)
            sums[possible] += deviation**2 * number
    return sums, counts


def lag_products(
    rate: np.ndarray, factors: np.ndarray, edges: np.ndarray | None = None, fewest: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Σ z² and Σ z z' of the means z of adjacent blocks of m samples, z' the following mean.

    rate    : array [T];  factors : array [M] int, m; an incomplete last block is left out
    edges   : as in second_differences;  fewest : means, at least 4; stretches with fewer are left out
    returns : squares [M, 3], products [M, 3]: of the means about their line, of their differences about the mean
              difference, of the second differences about theirs, each stretch by itself. Zeros without a stretch.
    """
    squares, products = np.zeros((len(factors), 3)), np.zeros((len(factors), 3))
    for piece in _stretches(rate, edges):
        for row, factor in enumerate(factors):
            number = piece.size // factor
            if number < fewest:
                continue
            series = piece[: number * factor].reshape(number, factor).mean(axis=1)
            position = np.arange(number) - (number - 1) / 2
            series = series - series.mean()
            series -= position * float(position @ series) / float(position @ position)
            for order in range(3):
                series = series - series.mean()
                squares[row, order] += series @ series
                products[row, order] += series[1:] @ series[:-1]
                series = np.diff(series)
    return squares, products


def _stretches(rate: np.ndarray, edges: np.ndarray | None) -> list[np.ndarray]:
    rate = np.asarray(rate, dtype=float)
    return [rate] if edges is None else [rate[start:stop] for start, stop in itertools.pairwise(edges.tolist())]


def degrees_of_freedom(alpha: int, factor: int, samples: np.ndarray | int) -> np.ndarray:
    """Equivalent degrees of freedom of the overlapping Allan variance of gap-free stretches.

    alpha   : exponent of the rate's power spectrum: 0 white, -1 flicker, -2 random walk, 1 and 2 noise of the angle
    factor  : averaging factor m;  samples : array [S] of the rates in each stretch
    returns : array of the shape of `samples`
    Greenhall & Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003.
    """
    alpha = min(max(alpha, STEEPEST), FLATTEST)
    edf = []
    for number in np.ravel(samples).tolist():
        # The published formula for white noise of the angle ends at 4m.
        known = 1 if alpha == FLATTEST and number + 1 <= 4 * factor else alpha
        edf.append(float(allantools.edf_greenhall(known, 2, int(factor), number + 1, overlapping=True)))
    return np.array(edf).reshape(np.shape(samples))


def limits(deviation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper chi² limits of deviations with `edf` degrees of freedom.  Riley, NIST SP 1065, eq. 45."""
    tail = (1 - confidence) / 2
    return deviation * np.sqrt(edf / chi2.ppf(1 - tail, edf)), deviation * np.sqrt(edf / chi2.ppf(tail, edf))
