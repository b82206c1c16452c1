"""How much of each gyro's noise lies in the band that is passed, where the gyros differ in that.

Weights by the variance of the samples are best at the sample rate. A smoother passes less, and there a gyro whose noise
is mostly fast is better than its samples say. Noise of the means of n samples, times n, has the density of the band
below rate/(2n): so R_i is scaled by the ratio f_i of that to the variance of the samples.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vgyro.fusion.noise.cornered_hat import most_likely, second_moments
from vgyro.fusion.noise.difference_blocks import BlockMoments, block_moments
from vgyro.fusion.noise.parity import Variances
from vgyro.fusion.types import ArrayRates

PARTS = 16
FEWEST_MEANS = 16
"""Means in a part of the recording, at least."""
LONGEST_S = 1.0
"""No longer means: what is slower is the slow errors' (vgyro.fusion.bias.estimate), which are taken out beforehand."""
SIGNIFICANCE = 1e-3


def in_band(array: ArrayRates, variances: Variances, bandwidth_hz: float) -> tuple[Variances, str]:
    """The variances with each gyro's scaled by its level in the band, relative to the mean of all; and a note.

    bandwidth_hz : noise-equivalent bandwidth of what passes, one-sided; means of 1/(2·bandwidth), 1 s at most, have it
    Where the levels of the gyros do not differ, by an F test of their logarithms at 0.001 (standard errors by the
    jackknife over 16 parts of the recording), nothing changes. Otherwise log f_i is drawn toward the mean of all by
    1 - 1/F (James & Stein 1961, Proc. 4th Berkeley Symp. 1, 361-379).
    """
    from scipy.special import fdtri

    length = _samples(bandwidth_hz, array.rate_hz)
    gyros = variances.gyros
    if length < 2 or gyros < 3:
        return variances, ""
    found = _log_levels(array, variances, length)
    if found is None:
        return variances, ""
    level, error = found
    known = np.isfinite(level)
    several = int(known.sum()) - 1
    if several < 1:
        return variances, ""
    weight = np.where(known, 1.0 / np.where(known, error, 1.0) ** 2, 0.0)
    off = np.where(known, level, 0.0) - float(weight @ np.where(known, level, 0.0) / weight.sum())
    ratio = float(weight @ off**2) / several
    if not ratio > fdtri(several, PARTS - 1, 1.0 - SIGNIFICANCE):
        return variances, ""
    factor = np.where(known, np.exp(off * (1.0 - 1.0 / ratio)), 1.0)
    text = ", ".join(f"{one:.2g}" for one in factor)
    note = f"variances for means of {length} samples, which pass: times {text}"
    return variances.scaled(factor), note


def _samples(bandwidth_hz: float, rate_hz: float) -> int:
    """Samples of a mean of this noise bandwidth."""
    if not bandwidth_hz >= 0:
        return 1
    seconds = LONGEST_S if bandwidth_hz == 0 else min(LONGEST_S, 0.5 / bandwidth_hz)
    return round(seconds * rate_hz)


def _log_levels(array: ArrayRates, variances: Variances, length: int) -> tuple[np.ndarray, np.ndarray] | None:
    """log f_i [N] and their standard errors; NaN: of a gyro that is excluded throughout.  None: too little is known."""
    sides = []
    for moments, size in ((block_moments(array), 1.0), (_of_means(block_moments(array, length)), float(length))):
        sides.append((second_moments(moments) * size, moments))
    levels = []
    for left_out in (None, *range(PARTS)):
        both = []
        for square, moments in sides:
            part = np.arange(len(square)) * PARTS // len(square)
            used = np.ones(len(square), dtype=bool) if left_out is None else part != left_out
            if len(square) < PARTS * FEWEST_MEANS or not _enough(moments, used):
                return None
            both.append(most_likely(square, moments, used, variances.correlation))
        levels.append(np.log(both[1]) - np.log(both[0]))
    seen = np.logical_not(sides[1][1].excluded.all(axis=0))
    error = math.sqrt(PARTS - 1) * np.std(levels[1:], axis=0)
    return np.where(seen, levels[0], np.nan), np.maximum(error, 1e-6)


def _enough(moments: BlockMoments, used: np.ndarray) -> bool:
    return bool(((~moments.excluded[used]).sum(axis=1) > 2).sum() >= FEWEST_MEANS)


def _of_means(moments: BlockMoments) -> BlockMoments:
    """The means of blocks as samples: each one a block of its own."""
    every = np.arange(len(moments.start), dtype=np.int64)
    square = moments.mean[:, :, None] * moments.mean[:, None, :]
    return replace(moments, start=every, stop=every + 1, square=square)
