"""A robust Allan variance: the median of the squared differences, of a series without its outliers."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Ints
from vgyro.metrics.allan.slots import SINGLE, SlotSums, variance_of_samples
from vgyro.metrics.outliers import find_outliers
from vgyro.metrics.sampling import Sampling

THRESHOLD = 6.0  # scales from the level: one in 5e8 samples of Gaussian noise
MEDIAN_OF_SQUARE = 0.454936423119573  # median of chi² with one degree of freedom
MOST_DIFFERENCES = 1 << 18
DENSE = 64
EFFICIENCY = {1: 0.39, 2: 0.49}
"""By m (the last also for more): variance of the mean of the squared overlapping differences over that of their
median, least of the exponents 2 … -2. Of independent differences it is 0.37; the median gains more by overlap.
"""


def without_far_off(
    rate: np.ndarray, rate_hz: float, sampling: Sampling | None = None, segment: np.ndarray | None = None
) -> tuple[np.ndarray, Sampling]:
    """The samples but for the outliers, and when they were taken.

    A single outlier is in 2m differences; at long τ some outlier is in each, and no median of them can do without it.
    """
    if sampling is None:
        sampling = Sampling.of(rate_hz, np.zeros(len(rate), np.int8) if segment is None else segment)
    outlier = find_outliers(rate, rate_hz, sampling.stretch, THRESHOLD)
    return (rate[~outlier], sampling.without(outlier)) if outlier.any() else (rate, sampling)


def robust_differences(sums: SlotSums, factors: np.ndarray, share: int) -> tuple[np.ndarray, np.ndarray]:
    """Median of the squared differences of adjacent means over twice that of chi², and the share of them there are.

    factors : array [M] int;  share : stretches of less than share·m slots are left out
    returns : variance [M] (deg/s)², share [M]
    Heavy stretches that a twentieth of the differences touch raise it by no more than an eighth. Losses as in
    allan_deviation.
    """
    singles = np.array([_median(sums, m, 2)[0] for m in SINGLE.tolist()])
    single = variance_of_samples(singles, np.isfinite(singles))
    found = np.array([_median(sums, m, share) for m in factors.tolist()]).reshape(-1, 3)
    return np.maximum(np.nan_to_num(found[:, 0] - single * found[:, 1]), 0.0), found[:, 2]


def robust_edf(variance: np.ndarray, edf: np.ndarray, factors: np.ndarray, slots: int) -> tuple[np.ndarray, np.ndarray]:
    """Variance [M] without the bias of a median of few, and degrees of freedom [M] of it, from those of the mean.

    slots : of all stretches
    A median of n independent chi² is too large by 1.98/(n + 2) of it (second order in 1/n); n is edf over 0.37.
    """
    efficiency = np.where(factors == 1, EFFICIENCY[1], EFFICIENCY[2])
    few = np.minimum(edf * efficiency, 0.37 * slots / _stride(factors, slots))
    return variance / (1 + 1.98 / (few / 0.37 + 2)), few


def _median(sums: SlotSums, factor: int, share: int) -> tuple[float, float, float]:
    """Variance by the median, mean excess, share of the differences there are."""
    stride = int(_stride(np.array(factor), int(sums.edges[-1])))
    d, excess, possible = sums.differences(factor, stride, share)
    if not len(d):
        return float("nan"), 0.0, 0.0
    return float(np.median(d * d)) / (2 * MEDIAN_OF_SQUARE), float(excess.mean()), len(d) / possible


def _stride(factors: Ints, slots: int) -> Ints:
    return np.maximum(np.maximum(factors // DENSE, -(-slots // MOST_DIFFERENCES)), 1)
