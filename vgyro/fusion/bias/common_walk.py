"""How the gyros drift together: no difference between them shows what all share, but a record at rest does.

A supply, a temperature or a tilt may move all biases alike. In the Allan covariances of a record at rest that is what
the mean of the gyros has beyond white noise, and beyond what the differences between the gyros allow for gyros that
drift each by itself. It is taken for a random walk that all share. The random walks of the gyros themselves are
correlated as their white noise is (Bayard & Ploen, US 2003/0187623), or not at all, whichever these covariances prefer.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion.types import AllanScales, ArrayNoise
from vgyro.units import rrw_deg_h_rt_h

SIGNIFICANCE = 1e-3
"""Of the F test by which the mean's Allan variance is above that of gyros that drift each by itself."""
LONGEST = 0.25
"""The walk is read off at this part of the record: vgyro.metrics.allan.scales goes no farther."""
FACTORS = np.geomspace(1e-2, 1e2, 33)
"""Of the variances of the random walks over those that were measured, tried beside either correlation of them."""
SLOPES = (0.0, 2.0)
"""Of an Allan variance over τ in logarithms, at the end of the curve: from flicker to a ramp."""


def common_walk(scales: AllanScales | None) -> float:
    """Variance K² of the common random walk, (deg/s)²/s; 0: none is seen, or there is no record at rest.

    A random walk has the Allan variance K²τ/3 (IEEE Std 952, annex C), read off at a quarter of the record, to which
    the curve is continued by its last slope; white noise falls with 1/τ from the shortest τ on. If nothing drifts
    together the mean of the gyros has 1/N of the variance of one, which N - 1 times as many differences show: F of
    (pairs, (N - 1)·pairs) degrees of freedom.
    """
    from scipy.special import fdtri

    if scales is None or len(scales.tau) < 3:
        return 0.0
    known = np.flatnonzero(np.isfinite(scales.covariance[[0, -2, -1]]).all(axis=0).diagonal())
    gyros = len(known)
    if gyros < 2:
        return 0.0
    inside = np.ix_(known, known)
    white, *last = (_mean_and_own(scales.covariance[row][inside]) for row in (0, -2, -1))
    fallen = scales.tau[0] / scales.tau[-2:]
    drifts = [mean - share * max(white[0] - white[1], 0.0) for share, (mean, _) in zip(fallen, last, strict=True)]
    own, pairs = last[1][1], max(float(scales.pairs[-1]), 1.0)
    if not (own > 0.0 and drifts[1] > own * fdtri(pairs, (gyros - 1) * pairs, 1.0 - SIGNIFICANCE)):
        return 0.0
    longest = float(scales.tau[-1])
    before, after = (drift - one for drift, (_, one) in zip(drifts, last, strict=True))
    slope = math.log(after / before) / math.log(longest / float(scales.tau[-2])) if before > 0.0 else SLOPES[1]
    further = max(LONGEST * (pairs + 1.0), 1.0)
    walk: float = 3.0 * after / longest * further ** (min(max(slope, SLOPES[0]), SLOPES[1]) - 1.0)
    return walk


def walk_correlation(noise: ArrayNoise) -> np.ndarray:
    """Correlation [N, N] of the gyros' random walks: that of their white noise, or none.

    By the likelihood of the Allan covariance S at the longest τ, of about `pairs` degrees of freedom, whose mean is
    R/τ + g·K_i·K_j·corr_ij·τ/3, g free (Wishart); that of the white noise without a record at rest.
    """
    scales, gyros = noise.scales, len(noise.arw)
    if scales is None:
        return noise.correlation
    tau, seen = float(scales.tau[-1]), scales.covariance[-1]
    known = np.flatnonzero(np.isfinite(noise.arw) & np.isfinite(noise.rrw) & np.isfinite(np.diagonal(seen)))
    inside = np.ix_(known, known)
    walks = np.outer(noise.rrw, noise.rrw)[inside] * tau / 3.0

    def likelihood(correlation: np.ndarray) -> float:
        """Highest over g, over the degrees of freedom, less a constant."""
        sums = noise.R[inside] / tau + FACTORS[:, None, None] * walks * correlation[inside]
        usable = np.linalg.matrix_rank(sums, hermitian=True) == len(known)
        if not usable.any():
            return -math.inf
        traces = np.trace(np.linalg.solve(sums[usable], np.broadcast_to(seen[inside], sums[usable].shape)), 0, 1, 2)
        return float((-np.linalg.slogdet(sums[usable])[1] - traces).max())

    alone = np.eye(gyros)
    return noise.correlation if len(known) < 2 or likelihood(alone) <= likelihood(noise.correlation) else alone


def common_note(variance: float) -> str:
    """In words, for people."""
    size = rrw_deg_h_rt_h(math.sqrt(variance))
    drift = f"at rest all gyros drift together, about as by a random walk of {size:.3g} deg/h/√h"
    return f"{drift}: no difference shows it, and the deviation holds it" if variance else ""


def _mean_and_own(covariance: np.ndarray) -> tuple[float, float]:
    """Variance of the mean of N gyros, and what it would be if each had only what their differences show."""
    gyros = len(covariance)
    mean = float(covariance.mean())
    return mean, (float(np.trace(covariance)) - gyros * mean) / (gyros - 1) / gyros
