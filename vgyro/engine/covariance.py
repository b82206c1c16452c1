"""The conditional covariance H_t = D_t R_t D_t in NumPy, and which covariance matrices can be used."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.engine.models import DccModel
from vgyro.engine.recursions import dcc_correlation, garch_variance

SINGULAR = 1e-12
"""Smallest eigenvalue of the correlation below which the minimum of w'Hw is not one point any more."""
ASYMMETRY = 1e-9
"""Largest difference of a correlation from its transpose that is still rounding."""


def conditional_covariance(r: np.ndarray, inside: int, model: DccModel) -> np.ndarray:
    """H_t over a window and beyond it.

    r       : [L, N] deg/s, the window's `inside` samples and those after it; leading rows with a value that is not
              finite take the first H
    model   : of the window; a = 0 is a constant correlation
    returns : [L, N, N] (deg/s)²
    The start (mean(e²), Q_1 = S) is the window's own: H_t beyond it uses r up to t - 1, nothing later.
    Liu et al. (2015), eq. 1-6.
    """
    first = int(np.argmax(np.all(np.isfinite(r), axis=1)))
    e = r[first:]
    omega, alpha, beta, a, b, target = model
    start = omega + (alpha + beta) * np.mean(np.square(e[: inside - first]), axis=0)
    deviation = np.sqrt(garch_variance(e, omega, alpha, beta, start))
    correlation = target if a == 0 else dcc_correlation(e / deviation, a, b, target)
    covariance = deviation[:, :, None] * correlation * deviation[:, None, :]
    return np.concatenate([np.repeat(covariance[:1], first, axis=0), covariance])


def usable(H: Floats) -> Bools:
    """Which matrices H [..., N, N] are finite, symmetric and positive definite: array [...] of bool."""
    finite = np.asarray(np.isfinite(H).all(axis=(-1, -2)))
    safe = np.where(finite[..., None, None], H, 0.0)
    variance = np.diagonal(safe, axis1=-2, axis2=-1)
    positive = finite & (variance > 0).all(axis=-1)
    scale = np.sqrt(np.where(positive[..., None], variance, 1.0))
    correlation = np.where(positive[..., None, None], safe, 0.0) / (scale[..., :, None] * scale[..., None, :])
    symmetric = (np.abs(correlation - np.swapaxes(correlation, -1, -2)) <= ASYMMETRY).all(axis=(-1, -2))
    found: Bools = positive & symmetric & (np.linalg.eigvalsh(correlation)[..., 0] > SINGULAR)
    return found
