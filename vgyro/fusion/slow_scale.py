"""Do scale errors that a calibration left show in the differences between gyros?

s_i·w̄(t) is in the mean of a block what a bias is not: it follows the rate. Where it shows, the rate is a regressor, or
the biases would be taken for fast ones that follow it.
"""

from __future__ import annotations

import math

import numpy as np

CLEAR = 100.0
"""The rate's changes from block to block are above this multiple of their noise's variance, or none is looked for."""


def scale_variance(
    means: np.ndarray, weight: np.ndarray, total: np.ndarray, pairs: np.ndarray, rate: np.ndarray
) -> float:
    """Variance of the scale errors between N gyros; 0 where they do not show.

    means [B, N], deg/s;  weight [B, N, N], of the parity;  total [B, N], R⁻¹1;  rate [B], deg/s, of the array
    pairs : numbers of the blocks that may be compared with the one before
    By least squares on the changes from one block to the next, in which slow errors hardly are, of blocks in which the
    same gyros are used. Believed if χ², over that of the residuals by degree of freedom, exceeds (N - 1)·log(changes)
    (BIC; Schwarz 1978).
    """
    used = np.diagonal(weight, axis1=1, axis2=2) > 0
    pairs = pairs[(used[pairs] == used[pairs - 1]).all(axis=1) & used[pairs].any(axis=1)]
    change, turned = means[pairs] - means[pairs - 1], rate[pairs] - rate[pairs - 1]
    noise = 1.0 / total[pairs].sum(axis=1) + 1.0 / total[pairs - 1].sum(axis=1)
    gyros = means.shape[1]
    if len(pairs) <= 2 * gyros or np.square(turned).sum() <= CLEAR * noise.sum():
        return 0.0
    # The weights of a difference of two measurements of the same weights; close to it where they differ.
    both = (weight[pairs] + weight[pairs - 1]) / 4.0
    vector = (both @ change[..., None])[..., 0]
    seen, score = np.tensordot(turned**2, both, axes=1), turned @ vector
    found = np.linalg.pinv(seen, rcond=1e-9, hermitian=True) @ score
    gain = float(found @ score)
    freedom = int((used[pairs].sum(axis=1) - 1).sum()) - (gyros - 1)
    dispersion = (float(np.sum(change * vector)) - gain) / max(freedom, 1)
    if gain <= (gyros - 1) * math.log(len(pairs)) * max(dispersion, 1.0):
        return 0.0
    return float(np.sum(found**2) / (gyros - 1))
