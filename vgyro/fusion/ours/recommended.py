"""The recommended virtual gyroscope: every part of the offline case put together, each chosen from the data.

1. Faults (vgyro.fusion.faults) are left out while they last.
2. R_t and slow errors b from the differences between the gyros (vgyro.fusion.ours.array_estimate).
3. u = minimum-variance weights of R_t;  z = u'(y - b).
4. The motion: the model of the least estimated error, two-sided smoother of z with u'R_t·u
   (vgyro.fusion.motion.smoother).
   Where the colours of the gyros' noise differ, R_t is scaled to the band that it passes (vgyro.fusion.noise.band).
5. The array's delay by its sensors' low-pass, where it is declared or the motion shows it, is undone
   (vgyro.fusion.motion.lowpass).

The posterior variance of a sample is that of 4 plus that of u'(b - its estimate) of 2.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vgyro.errors import DataError
from vgyro.fusion.bias.estimate import combined_without, slow_variance
from vgyro.fusion.motion.models import UNLIMITED, SteadyGain, fixed_bandwidth
from vgyro.fusion.motion.smoother import mean_variance
from vgyro.fusion.noise.band import in_band
from vgyro.fusion.ours.array_estimate import Analysed, analysed, shared_motion
from vgyro.fusion.ours.smoothed import Signal, smoothed
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused
from vgyro.fusion.weights import min_variance_weights


def recommended(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """All of it, smoothed, with the posterior standard deviation of each sample."""
    known = analysed(array, parameters)
    variances, note = known.variances, ""
    if parameters.has("band"):
        variances, note = in_band(known.array, variances, passed_hz(array, parameters, known))
    weights = known.weights if not note else variances.sample_weights(parameters.engine)
    shares = variances.weights(parameters.engine)
    signal = Signal(
        *known.bridged(
            combined_without(known.array, weights, known.slow),
            known.at_samples(known.variances.combined_variance(shares)),
        ),
        known.variances.colour(shares),
        weights,
        "; ".join(filter(None, [known.note, note])),
        known.at_least(known.slow.at_samples(slow_variance(weights, known.slow)), shares, parameters)
        + known.answer_variance(shares),
        late_s=known.late_s,
    )
    fused = smoothed(array, parameters, signal)
    return fused if known.guess is None else known.guess.beyond(fused)


def passed_hz(array: ArrayRates, parameters: FilterParameters, known: Analysed) -> float:
    """Noise-equivalent bandwidth, one-sided, Hz, of the smoother; NaN: it is not limited, or not known."""
    mean, colour = mean_variance(known.variance()), known.variances.colour()
    try:
        if parameters.in_motion:
            motion = shared_motion(array, parameters)
        else:
            motion, colour = fixed_bandwidth(parameters.bandwidth_hz, mean, array.rate_hz), 0.0
        return SteadyGain(motion, mean, colour).noise_bandwidth_hz() if motion.model != UNLIMITED else math.nan
    except DataError:
        # The smoother will say so.
        return math.nan


def recommended_unsmoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The same without a model of the motion: u(t)'(y - b), full bandwidth, no delay."""
    known = analysed(array, parameters)
    return replace(Fused.undelayed(known.in_time(known.rate()), known.weights, known.note), delay_s=-known.undone_s)


def static_weights(array: ArrayRates, parameters: FilterParameters) -> np.ndarray:
    """One weight a gyro [N]: minimum-variance weights of the mean covariance of the recording's white noise."""
    variances = analysed(array, parameters).variances
    used = variances.shares[:, None] * ~variances.excluded
    deviation = np.sqrt((variances.variance * used).sum(axis=0) / np.maximum(used.sum(axis=0), 1))
    return min_variance_weights(np.outer(deviation, deviation) * variances.correlation, parameters.engine)
