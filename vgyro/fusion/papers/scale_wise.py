"""Zhang et al.'s scale-wise variance optimisation: fixed weights from the wavelet covariances of a record at rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.blocks import combined
from vgyro.fusion.design import SINGULAR, flaw
from vgyro.fusion.papers.vaccaro_zaki import known_gyros, not_known
from vgyro.fusion.rest_scales import LONGEST_TAU, angle_of, rest_scales, second_differences
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused

SOURCE = "Zhang, Cucci, Molinari & Guerrier (2022), arXiv 2106.15997"
FIRST_LARGE = 0.75
"""The scale in the middle of the logistic weights, as a share of their number. The authors' package synimu has 15 in
its example; as a share it means the same in records of other lengths."""
INFERRED_ALL = (
    "weights on scales are the user's choice: here each scale counts by the mean wavelet variance of the gyros at it, "
    "ω_j ∝ N/tr W_j"
)
INFERRED_LARGE = (
    "weights on scales are the user's choice: here ω_j ∝ 1/(1 + e^(j₀ - j)), the form of their example, with "
    f"j₀ = {FIRST_LARGE:.0%} of the number of scales"
)
WHITE_FREEDOM = 1.5
"""Degrees of freedom that white noise has for each pair of adjacent means at long times; no slower noise has more."""
LAGS = 32
"""The autocorrelation of wavelet coefficients is summed at so many lags at most; those of white noise and of random
walks end at 2m samples, m the averaging factor."""


def scale_wise_all(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """All scales alike: A = Σ_j ω_j·W_j with ω_j ∝ N/tr W_j, c = A⁻¹1/(1'A⁻¹1). raises : as scale_wise"""
    return scale_wise(array, parameters, alike)


def scale_wise_large(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Large scales: the same with ω_j ∝ 1/(1 + e^(j₀ - j)), which leaves out small ones. raises : as scale_wise"""
    return scale_wise(array, parameters, large)


def alike(wavelet: np.ndarray) -> np.ndarray:
    """ω [J], Σω = 1, of wavelet covariances [J, N, N]: inverse to the gyros' mean variance at the scale."""
    return _shares(1.0 / np.trace(wavelet, axis1=1, axis2=2))


def large(wavelet: np.ndarray) -> np.ndarray:
    """ω [J], Σω = 1, of wavelet covariances [J, N, N]: the logistic curve about j₀ = 3J/4, j from 1."""
    level = np.arange(1, len(wavelet) + 1)
    return _shares(1.0 / (1.0 + np.exp(FIRST_LARGE * len(wavelet) - level)))


def scale_wise(
    array: ArrayRates, parameters: FilterParameters, weights_of: Callable[[np.ndarray], np.ndarray]
) -> Fused:
    """The combination whose wavelet variance, summed over the scales with weights ω, is least; fixed.

    weights_of : wavelet covariances [J, N, N] → ω [J] >= 0, Σω = 1. Scale j of the Haar MODWT is an averaging time of
                 2^(j-1) samples of the record at rest; W_j is half the Allan covariance there
    raises     : CannotRun if no record at rest is known, or fewer than two gyros are known in it
    c = A⁻¹1/(1'A⁻¹1), A = Σ_j ω_j·W_j, without a bound on signs. A gyro whose covariances are not known, or zero, has
    the weight 0.
    Zhang et al. (2022), arXiv 2106.15997.
    """
    scales, origin = rest_scales(array, parameters)
    used = np.flatnonzero(known_gyros(scales))
    if len(used) < 2:
        raise CannotRun("the Allan covariances of fewer than two gyros are known")
    wavelet = scales.covariance[:, used[:, None], used] / 2.0
    shares = weights_of(wavelet)
    A = np.tensordot(shares, wavelet, axes=1)
    weights = np.zeros(array.rate.shape[1])
    weights[used] = least_variance(A)
    parts = np.cumsum(_shares(shares * np.trace(wavelet, axis1=1, axis2=2)))
    half = scales.tau[int(np.searchsorted(parts, 0.5))]
    singular = flaw(A)
    notes = [
        f"half of the sum is of averaging times of {half:.3g} s or more",
        f"pseudo-inverse: {singular}" if singular else "",
        not_known(weights, used),
        origin,
    ]
    return Fused.undelayed(combined(array.rate, weights), weights, "; ".join(one for one in notes if one))


def least_variance(A: Floats) -> Floats:
    """c [N] = A⁻¹1/(1'A⁻¹1); by the pseudo-inverse of its correlation matrix where A is singular.

    Copies of one gyro then share its weight.
    """
    scale = np.sqrt(np.diag(A))
    inverse = np.linalg.pinv(A / np.outer(scale, scale), rcond=SINGULAR, hermitian=True)
    solved = inverse @ (1.0 / scale) / scale
    weights: Floats = solved / solved.sum()
    return weights


@dataclass(frozen=True)
class WaveletVariance:
    """Of one signal: tau [J] s; value, low, high [J], (deg/s)²; freedom [J], equivalent degrees of freedom."""

    tau: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    freedom: np.ndarray


def wavelet_variance(array: ArrayRates, weights: np.ndarray, confidence: float = 0.95) -> WaveletVariance:
    """c'W_jc of a recording at rest at every scale, with its asymptotic interval.

    array   : at rest;  weights : c [N], which should come from another record: the interval takes them as given
    returns : WaveletVariance. The variance of c'W_jc is (2/M)·Σ_h s_h², s_h the autocovariance at lag h of the M
              wavelet coefficients of c'y (Gaussian noise; what errors of s_h add to the squares is taken off). The
              interval is that of chi² with ν = 2(c'W_jc)²/variance degrees of freedom, at most those of white noise;
              for large ν it is the normal one.
    raises  : CannotRun if no gap-free stretch has four samples
    Percival (1995), Biometrika 82, 619-631, eq. 7; Zhang et al. (2022) for any c.
    """
    from scipy.special import chdtri

    parts = [angle_of(combined(array.rate[part], weights)) for part in array.stretches()]
    longest = max(len(angle) - 1 for angle in parts)
    factors = 2 ** np.arange((longest // LONGEST_TAU).bit_length())
    if len(factors) == 0:
        raise CannotRun(f"the longest stretch has {longest} samples, fewer than 4")
    value, freedom = np.array([_variance_and_freedom(parts, m) for m in factors.tolist()]).T
    tail = (1.0 - confidence) / 2.0
    low, high = (freedom * value / chdtri(freedom, probability) for probability in (tail, 1.0 - tail))
    return WaveletVariance(factors / array.rate_hz, value, low, high, freedom)


def _variance_and_freedom(angles: Sequence[np.ndarray], factor: int) -> tuple[float, float]:
    """Wavelet variance at one scale, and its degrees of freedom.  angles : of the stretches, as of angle_of"""
    stride = max(1, 2 * factor // LAGS)
    coefficients = [second_differences(one, factor, stride) / 2.0 for one in angles]
    coefficients = [one for one in coefficients if len(one)]
    number = sum(map(len, coefficients))
    value = sum(float(one @ one) for one in coefficients) / number
    lags = range(1, min(-(-2 * factor // stride), max(map(len, coefficients))))
    autocovariance = np.array(
        [value, *(sum(float(one[lag:] @ one[: len(one) - lag]) for one in coefficients) / number for lag in lags)]
    )
    square = float(autocovariance[0] ** 2 + 2.0 * (autocovariance[1:] ** 2).sum())
    square /= 1.0 + (2.0 * len(autocovariance) - 1.0) / number
    pairs = sum(max((len(one) - 1) / factor - 1.0, 0.0) for one in angles)
    return value, min(number * value**2 / square if square > 0 else math.inf, max(WHITE_FREEDOM * pairs, 1.0))


def _shares(weights: Floats) -> Floats:
    shares: Floats = weights / weights.sum()
    return shares
