"""What all gyros drift together: no difference between them shows it, but a record at rest does.

A supply, a temperature or a tilt may move all biases alike. In the Allan covariances of a record at rest that is what
the mean of the gyros has beyond white noise, and beyond what the differences between the gyros allow for gyros that
drift each by itself. It is taken for a random walk that all share.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion.array import AllanScales
from vgyro.units import rrw_deg_h_rt_h

SIGNIFICANCE = 1e-3
"""Of the F test by which the mean's Allan variance is above that of gyros that drift each by itself."""
LONGEST = 0.25
"""The walk is read off at this part of the record: vgyro.metrics.scales goes no farther."""
SLOPES = (0.0, 2.0)
"""Of an Allan variance over τ in logarithms, at the end of the curve: from flicker to a ramp."""


def common_walk(scales: AllanScales | None) -> float:
    """Variance K² of the common random walk, (deg/s)²/s; 0: none is seen, or there is no record at rest.

    A random walk has the Allan variance K²τ/3 (IEEE Std 952, annex C), read off at a quarter of the record, to which
    the curve is continued by its last slope; white noise falls with 1/τ from the shortest τ on. If nothing drifts
    together the mean of the gyros has 1/N of the variance of one, which N - 1 times as many differences show: F of
    (pairs, (N - 1)·pairs) degrees of freedom.
    """
    from scipy.stats import f as fisher

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
    if not (own > 0.0 and drifts[1] > own * fisher.isf(SIGNIFICANCE, pairs, (gyros - 1) * pairs)):
        return 0.0
    longest = float(scales.tau[-1])
    before, after = (drift - one for drift, (_, one) in zip(drifts, last, strict=True))
    slope = math.log(after / before) / math.log(longest / float(scales.tau[-2])) if before > 0.0 else SLOPES[1]
    further = max(LONGEST * (pairs + 1.0), 1.0)
    return 3.0 * after / longest * further ** (min(max(slope, SLOPES[0]), SLOPES[1]) - 1.0)


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
