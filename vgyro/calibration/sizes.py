"""The largest, or the r.m.s., of noisy numbers: what noise adds to it, and what is left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vgyro.arrays import Floats

DRAWS = 2000
SEED = 1431
BISECTIONS = 16  # to 1e-5 of the range, far below what 2000 draws resolve

Size = Callable[[np.ndarray], np.ndarray]  # [J, ...] → [...]: a norm


def largest(values: Floats) -> Floats:
    """Largest |value| along the first axis."""
    sizes: Floats = np.abs(values).max(axis=0)
    return sizes


def root_mean_square(values: Floats) -> Floats:
    """Root of the mean square along the first axis."""
    sizes: Floats = np.sqrt(np.mean(values**2, axis=0))
    return sizes


def noise_draws(combinations: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Draws [J, 2000] of combinations [J, P] · normal noise of the covariance [P, P]."""
    unit = np.random.default_rng(SEED).standard_normal((len(covariance), DRAWS))
    return combinations @ np.linalg.cholesky(covariance) @ unit


def size_and_limits(
    estimate: np.ndarray, noise: np.ndarray, size: Size, confidence: float
) -> tuple[float, float, float]:
    """Size of a vector that is known with errors: median-unbiased value, lower and upper limit.

    estimate : [J];  noise : draws [J, n] of its errors
    size(estimate) is biased upward by the errors. So the test is inverted: for a true vector a·u, u of size 1 along the
    estimate, size(a·u + noise) is below the size seen with a probability that falls with a; the value is the a of
    probability one half, the limits those of (1 ± confidence) / 2. Where noise alone (a = 0) shows that size often
    enough the limit, or the value, is 0; that is exact, whatever u is. For the upper limit the probability is that over
    the one at a = 0 (CLs; Read 2002, J. Phys. G 28, 2693): a size that is small by chance proves no more than the test
    can see. The upper limit of the largest one is the largest upper limit of all: it holds for every shape, while the
    shape of a noisy estimate has more large numbers than the true one.
    """
    seen = float(size(estimate))
    if seen <= 0:
        return 0.0, 0.0, float(np.quantile(size(noise), confidence))
    unit = (estimate / seen)[:, None]
    top = seen + float(size(noise).max())
    by_noise = float(np.mean(size(noise) <= seen))

    def true_size(below: float) -> float:
        low, high = 0.0, top
        if by_noise <= below:
            return 0.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if np.mean(size(middle * unit + noise) <= seen) > below else (low, middle)
        return (low + high) / 2

    if size is largest:
        high = float(np.max(np.abs(estimate) + np.quantile(np.abs(noise), confidence, axis=1)))
    else:
        high = true_size((1 - confidence) / 2 * by_noise)
    return true_size(0.5), true_size((1 + confidence) / 2), high
