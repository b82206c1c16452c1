"""Is the variance of the smoothed rate right? The spectrum of what the smoother left says so, for any rate."""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion.motion_evidence import Spectrum

PASSED = 0.05
"""Where the smoother passes less, its model of the rate is taken as right."""
BELIEF = 0.25
"""Standard deviation of the calibration before the residual is looked at: how wrong a model of least risk is."""
LEAST, MOST = 0.25, 4.0
SURE = 4.0
"""Standard errors above which there is motion that is not passed."""


def calibration(spectrum: Spectrum, signal: np.ndarray) -> float:
    """Mean square error of the smoothed rate over the variance that its model claims.

    signal : S [F], of the model
    The smoother H = S/(S + S_v) leaves (1 - H)·z, and its error has the density (1 - H)²·S_z + (2H - 1)·S_v, whatever
    the rate is, where the model claims H·S_v: the ratio is 1 + ∫ ((1 - H)²·S_z - (1 - H)·S_v) / ∫ H·S_v. The first
    integral is taken over the frequencies that the smoother passes. The ratio is drawn toward 1 by what is known before
    (1 ± BELIEF) and by its own standard error.
    """
    H = signal / (signal + spectrum.noise)
    claimed = float(spectrum.weight @ (H * spectrum.noise))
    passed = H >= PASSED
    if not passed.any() or claimed <= 0.0:
        return 1.0
    expected = (1.0 - H) * spectrum.noise
    excess = (1.0 - H) ** 2 * spectrum.power - expected
    mean = float(spectrum.weight[passed] @ excess[passed]) / claimed
    # A line of the periodogram has two degrees of freedom, and a weight of two of them.
    variance = 2.0 * float(spectrum.weight[passed] @ expected[passed] ** 2) / claimed**2
    return min(max(1.0 + mean * BELIEF**2 / (BELIEF**2 + variance), LEAST), MOST)


def lost(spectrum: Spectrum, signal: np.ndarray) -> float:
    """Variance of the motion that the smoother takes away, (deg/s)²: ∫ (1 - H)²·(S_z - S_v), as far as it is certain.

    signal : S [F], which makes the smoother and need not be the density of the motion
    Zero within SURE standard errors.
    """
    H = signal / (signal + spectrum.noise)
    share = (1.0 - H) ** 2 * spectrum.weight / float(spectrum.weight.sum()) * spectrum.rate_hz
    mean = float(share @ (spectrum.power - spectrum.noise))
    error = math.sqrt(2.0 * float((share * spectrum.noise) ** 2 @ (1.0 / spectrum.weight)))
    return mean if mean > SURE * error else 0.0
