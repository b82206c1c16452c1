"""Allan variance, its degrees of freedom and its limits, by allantools.

allantools works on one gap-free series; pooling over segments is done by the caller (vgyro.metrics.allan).
"""

from __future__ import annotations

import allantools
import numpy as np
from scipy.stats import chi2

STEEPEST = -2  # random walk of the rate: the steepest noise for which the two-sample variance exists
FLATTEST = 2  # white noise of the angle


def second_differences(rate: np.ndarray, rate_hz: float, factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the squared overlapping second differences of the angle, divided by 2τ², and how many there are.

    rate    : array [T], deg/s, one gap-free stretch
    factors : array [M] int, ascending averaging factors m; τ = m / rate_hz
    returns : sums [M] in (deg/s)², counts [M]; sums / counts is the overlapping Allan variance. Zeros where 2m >= T.
    Riley, NIST SP 1065, eq. 11.
    """
    angle = np.concatenate(([0.0], np.cumsum(rate - rate.mean()))) / rate_hz
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    possible = np.flatnonzero(2 * factors < angle.size - 1)  # allantools leaves out a τ with a single difference
    if possible.size:
        _, deviation, _, number = allantools.oadev(angle, rate_hz, "phase", factors[possible] / rate_hz)
        counts[possible] = number
        sums[possible] = deviation**2 * number
    return sums, counts


def degrees_of_freedom(alpha: int, factor: int, samples: int) -> float:
    """Equivalent degrees of freedom of the overlapping Allan variance of one gap-free stretch.

    alpha   : exponent of the rate's power spectrum: 0 white, -1 flicker, -2 random walk, 1 and 2 noise of the angle
    factor  : averaging factor m;  samples : rates in the stretch
    Greenhall & Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003.
    """
    alpha = min(max(alpha, STEEPEST), FLATTEST)
    if alpha == FLATTEST and samples + 1 <= 4 * factor:
        alpha = 1  # the published formula for white noise of the angle ends here
    return float(allantools.edf_greenhall(alpha, 2, factor, samples + 1, overlapping=True))


def limits(deviation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper chi² limits of deviations with `edf` degrees of freedom.  Riley, NIST SP 1065, eq. 45."""
    tail = (1 - confidence) / 2
    return deviation * np.sqrt(edf / chi2.ppf(1 - tail, edf)), deviation * np.sqrt(edf / chi2.ppf(tail, edf))
