"""The recommended virtual gyroscope: every part of the offline case put together, each chosen from the data.

1. Faults (vgyro.fusion.faults) are left out while they last.
2. R_t and slow errors b from the differences between the gyros (vgyro.fusion.analysed).
3. u = minimum-variance weights of R_t;  z = u'(y - b).
4. The motion: model and parameters by likelihood, two-sided smoother of z with u'R_t·u (vgyro.fusion.smoother).
5. The sensor's low-pass, where parity shows its colour in the noise, is undone on the smoothed rate.

The posterior variance of a sample is that of 4 plus that of u'(b - its estimate) of 2.
"""

from __future__ import annotations

import numpy as np

from vgyro.fusion.analysed import analysed
from vgyro.fusion.array import ArrayRates, FilterParameters, Fused
from vgyro.fusion.slow import slow_variance
from vgyro.fusion.smoothed import Signal, smoothed
from vgyro.fusion.weights import min_variance_weights


def recommended(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """All of it, smoothed, with the posterior standard deviation of each sample."""
    known = analysed(array, parameters)
    signal = Signal(
        known.rate(array),
        known.variance(),
        known.variances.colour(),
        known.weights,
        known.note,
        known.slow.at_samples(slow_variance(known.weights, known.slow)),
        undo_pole=True,
    )
    return smoothed(array, parameters, signal)


def recommended_unsmoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The same without a model of the motion: u(t)'(y - b), full bandwidth, no delay."""
    known = analysed(array, parameters)
    return Fused.undelayed(known.rate(array), known.weights, known.note)


def static_weights(array: ArrayRates, parameters: FilterParameters) -> np.ndarray:
    """One weight a gyro [N]: minimum-variance weights of the mean covariance of the recording's white noise."""
    variances = analysed(array, parameters).variances
    used = variances.shares[:, None] * ~variances.excluded
    deviation = np.sqrt((variances.variance * used).sum(axis=0) / np.maximum(used.sum(axis=0), 1))
    return min_variance_weights(np.outer(deviation, deviation) * variances.correlation, parameters.engine)
