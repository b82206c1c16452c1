"""Allan covariance between series: at which averaging times do gyros err together?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.errors import TooShort
from vgyro.metrics.allan.deviation import LEAST_USED, LONGEST_TAU, averaging_factors
from vgyro.metrics.allan.noise_type import noise_exponents
from vgyro.metrics.allan.slots import SlotSums
from vgyro.metrics.sampling import Sampling

DENSE = 64


@dataclass(frozen=True)
class CrossAllan:
    """Of N series at M averaging times tau, s; the diagonal of covariance [M, N, N] holds the Allan variances.

    covariance       : [M, N, N], (deg/s)²
    correlation      : [M, N, N], NaN where a series has no variance;  low, high [M, N, N] : its limits
    edf              : [M, N, N], equivalent degrees of freedom
    """

    tau: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    edf: np.ndarray


def cross_allan(
    rate: np.ndarray,
    rate_hz: float,
    sampling: Sampling | None = None,
    taus: np.ndarray | None = None,
    confidence: float = 0.95,
    engine: str = "native",
) -> CrossAllan:
    """Overlapping Allan covariance and correlation of series that were sampled together.

    rate       : array [T, N], deg/s;  rate_hz : Hz
    sampling   : when the samples were taken; None: there is no gap
    taus       : array, s; None: three an octave, up to a third of the longest stretch
    confidence : of the limits;  engine : whose degrees of freedom
    returns    : CrossAllan. C_ij(τ) = ⟨d_i d_j⟩/2, d the differences of adjacent means over τ, over all that begin in a
                 stretch of at least 3τ (from m = 128 samples on, m // 64 samples apart); losses as in allan_deviation,
                 but for the noise they add, of which little is common. A τ at which losses leave less than a tenth of
                 the differences is left out.
    raises     : TooShort if no stretch has three samples, or losses leave too few differences
    So σ²(i + j) = C_ii + 2C_ij + C_jj, and C_ij = (σ²(i + j) - σ²(i - j))/4.
    Limits by Fisher's z: atanh(correlation) has the variance 1/(ν - 2), ν the geometric mean of the degrees of freedom
    of both Allan variances (Greenhall & Riley), as independent pairs without a mean to estimate have; -1 and 1 for
    ν <= 2. Groslambert et al. (1981), 35th Frequency Control Symposium; Fisher (1921), Metron 1.
    """
    rate = np.asarray(rate, dtype=float)
    if sampling is None:
        sampling = Sampling.of(rate_hz, np.zeros(len(rate), np.int8))
    slot, edges = sampling.slots()
    lengths, alike = np.unique(np.diff(edges), return_counts=True)
    factors = averaging_factors(rate_hz, int(lengths.max(initial=0)), taus)
    if factors.size == 0:
        raise TooShort(f"the longest stretch has {lengths.max(initial=0)} samples", remedy="3 in a row are needed")
    allan = engines.get(engine).allan
    sums = SlotSums.of(rate, slot, edges, allan)
    found = [_covariance(sums, m) for m in factors.tolist()]
    share = np.array([part for _, part in found])
    kept = share >= LEAST_USED
    if not kept.any():
        raise TooShort("lost samples leave too few differences at every τ", remedy="Look for a less damaged recording")
    factors, share = factors[kept], share[kept]
    covariance = np.stack([matrix for (matrix, _), good in zip(found, kept, strict=True) if good])
    single = [replace(sums, total=np.ascontiguousarray(column)) for column in sums.total.T]
    exponents = [noise_exponents(rate, edges, factors, allan, one) for one in single]
    freedom = np.empty((len(factors), rate.shape[1]))
    for row, m in enumerate(factors.tolist()):
        used = lengths >= LONGEST_TAU * m
        for alpha in {int(one[row]) for one in exponents}:
            edf = np.sum(alike[used] * allan.degrees_of_freedom(alpha, m, lengths[used])) * share[row]
            freedom[row, [one[row] == alpha for one in exponents]] = edf
    edf = np.sqrt(freedom[:, :, None] * freedom[:, None, :])
    correlation = _correlation(covariance)
    low, high = correlation_limits(correlation, edf, confidence)
    return CrossAllan(factors / rate_hz, covariance, correlation, low, high, edf)


def correlation_limits(correlation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Limits of correlations of `edf` independent pairs without mean, by Fisher's z; 1 has the limits 1 and 1."""
    from scipy.special import ndtri

    spare = np.maximum(edf - 2, 0)
    with np.errstate(divide="ignore"):
        z = np.arctanh(np.clip(correlation, -1, 1))
        reach = float(ndtri((1 + confidence) / 2)) / np.sqrt(spare)
    whole = np.isinf(z)
    low = np.where(whole, correlation, np.tanh(np.where(whole, 0, z) - reach))
    high = np.where(whole, correlation, np.tanh(np.where(whole, 0, z) + reach))
    return low, high


def _covariance(sums: SlotSums, factor: int) -> tuple[np.ndarray, float]:
    """⟨d_i d_j⟩/2 [N, N], and the share of the differences there are."""
    d, _, possible = sums.differences(factor, max(factor // DENSE, 1), LONGEST_TAU)
    number = len(d)
    return d.T @ d / (2 * max(number, 1)), number / max(possible, 1)


def _correlation(covariance: Floats) -> Floats:
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    scale = deviation[:, :, None] * deviation[:, None, :]
    correlation: Floats = np.clip(
        np.divide(covariance, scale, where=scale > 0, out=np.full(scale.shape, math.nan)), -1, 1
    )
    places = np.arange(covariance.shape[1])
    correlation[:, places, places] = np.where(deviation > 0, 1.0, math.nan)
    return correlation
