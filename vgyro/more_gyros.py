"""What more gyros of the same kind would bring: N against correlation. Jiang et al. (2012), eq. 21 and fig. 3.

N alike gyros, every pair with the correlation ρ, make a virtual gyro whose white noise is that of one times
√((1 + (N-1)ρ)/N). It tends to √ρ, however many there are. A negative ρ is bounded: 1 + (N-1)ρ > 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.errors import DataError
from vgyro.fusion import design
from vgyro.fusion.types import ArrayNoise, FilterParameters

ASSUMED = (0.0, 0.1, 0.3, 0.5)
"""Correlations of the analysis beside the measured one."""
WANTED = (2.0, 3.0, 5.0, 10.0)
"""Factors for which the number of gyros is told."""
LITTLE = 0.01
"""A gyro that adds less than this share of the factor adds little."""


def factor(gyros: int, correlation: float) -> float:
    """Improvement of N alike gyros over one: √(N/(1 + (N-1)ρ)). Jiang et al. (2012), fig. 3.

    raises : DataError if N gyros cannot have that correlation
    """
    if gyros > most_alike(correlation):
        raise DataError(f"{gyros} gyros cannot all have the correlation {correlation:g}", remedy="ρ > -1/(N - 1)")
    return math.sqrt(gyros / (1.0 + (gyros - 1) * correlation))


def most_alike(correlation: float) -> float:
    """Greatest N of which every pair can have this correlation: 1 + (N-1)ρ > 0; infinite for ρ >= 0."""
    if correlation >= 0:
        return math.inf
    most = math.ceil(1.0 - 1.0 / correlation)
    # At the bound itself the noise would vanish.
    return most if 1.0 + (most - 1) * correlation > 0 else most - 1


def limit(correlation: float) -> float:
    """Factor that no number of gyros passes, 1/√ρ; infinite for ρ <= 0."""
    return 1.0 / math.sqrt(correlation) if correlation > 0 else math.inf


def gyros_for(wanted: float, correlation: float) -> int | None:
    """Least N with a factor of at least `wanted`: N = F²(1 - ρ)/(1 - F²ρ); None if no number is enough."""
    square = wanted**2
    if square * correlation >= 1.0:
        return None
    number = square * (1.0 - correlation) / (1.0 - square * correlation)
    # A whole number that rounding has lifted by a little is that number.
    least = max(1, math.ceil(number * (1.0 - 1e-12)))
    return least if least <= most_alike(correlation) else None


def little_from(correlation: float, share: float = LITTLE) -> int | None:
    """Least N from which each further gyro adds less than `share` to the factor; None for ρ < 0, where each adds more.

    For ρ >= 0 a gyro adds no more than with ρ = 0, √((N + 1)/N) - 1, and less with each.
    """
    if correlation < 0:
        return None
    gyros = 1
    while factor(gyros + 1, correlation) >= (1.0 + share) * factor(gyros, correlation):
        gyros += 1
    return gyros


@dataclass(frozen=True)
class MeanCorrelation:
    """Of all pairs of an array: value, low, high; NaN where it is not known"""

    value: float
    low: float
    high: float

    @property
    def known(self) -> bool:
        return math.isfinite(self.value)

    @classmethod
    def of(cls, value: np.ndarray, low: np.ndarray, high: np.ndarray) -> MeanCorrelation:
        """From the matrices [N, N]; pairs with NaN are left out.

        The half-widths of the pairs are standard errors of estimates that depend on each other: the variance of their
        mean is the mean of their covariances (`dependence`), so that the limits are at the level of the pairs' own.
        """
        pairs = np.triu_indices(len(value), 1)
        known = np.isfinite(value[pairs]) & np.isfinite(low[pairs]) & np.isfinite(high[pairs])
        pairs = pairs[0][known], pairs[1][known]
        if not known.any():
            return cls(math.nan, math.nan, math.nan)
        rho, together = value[pairs], dependence(value, pairs)
        mean, below, above = float(rho.mean()), rho - low[pairs], high[pairs] - rho
        widths = [math.sqrt(max(float(one @ together @ one), 0.0)) / len(rho) for one in (below, above)]
        return cls(mean, mean - widths[0], mean + widths[1])


def dependence(correlation: Floats, pairs: tuple[Ints, Ints]) -> Floats:
    """Correlation [P, P] of the estimated correlations of P pairs: of normal noise, many samples.

    correlation : [N, N];  pairs : the gyros of each pair, ([P], [P])
    cov(r_jk, r_hm) ∝ (ρ_jh - ρ_jk·ρ_kh)(ρ_km - ρ_kh·ρ_hm) + (ρ_jm - ρ_jh·ρ_hm)(ρ_kh - ρ_kj·ρ_jh)
                    + (ρ_jh - ρ_jm·ρ_mh)(ρ_km - ρ_kj·ρ_jm) + (ρ_jm - ρ_jk·ρ_km)(ρ_kh - ρ_km·ρ_mh)
    Pearson & Filon (1898); Steiger (1980), Psychol. Bull. 87, 245-251, eq. 3.
    """
    (j, k), (h, m) = (one[:, None] for one in pairs), (one[None, :] for one in pairs)
    jk, hm = correlation[j, k], correlation[h, m]
    jh, jm, kh, km = correlation[j, h], correlation[j, m], correlation[k, h], correlation[k, m]
    covariance = (jh - jk * kh) * (km - kh * hm) + (jm - jh * hm) * (kh - jk * jh)
    covariance += (jh - jm * hm) * (km - jk * jm) + (jm - jk * km) * (kh - km * hm)
    size = np.sqrt(np.diag(covariance))
    # A pair of copies has no error, and nothing that depends on one.
    scale = np.where(size > 0, size, np.inf)
    correlations: Floats = covariance / np.outer(scale, scale)
    return correlations


@dataclass(frozen=True)
class LargerArrays:
    """columns : of more_gyros.parquet.  summary : what the report says in words, as JSON; null where not known"""

    columns: dict[str, np.ndarray]
    summary: dict[str, object]


def analyse(noise: ArrayNoise, correlation: MeanCorrelation, parameters: FilterParameters, most: int) -> LargerArrays:
    """Virtual gyros of 1 … `most` alike gyros, for the correlation of this array, its limits, and ASSUMED ones.

    noise : of the present array. Its own R stands for the present value, D = 1'R⁻¹1; the analysis is of equal gyros
            with the mean variance, arw² = mean(arw_i²)
    √P∞   : Jiang et al. (2012), eq. 21, at parameters.q, or at the q that gives each array parameters.bandwidth_hz
    Where the limits of the correlation reach beyond what so many gyros can have, there are no rows.
    """
    arw = float(np.sqrt(np.mean(noise.arw**2)))
    present = _present_arw(noise)
    measured = [correlation.value, correlation.low, correlation.high] if correlation.known else []
    rows = []
    for place, rho in enumerate([*measured, *ASSUMED]):
        of_array = correlation.known and place == 0
        for gyros in range(1, int(min(most, most_alike(rho))) + 1):
            gain = factor(gyros, rho)
            over = present * gain / arw if of_array else math.nan
            rows.append((gyros, rho, of_array, arw / gain, _steady_sd(arw, gyros, rho, parameters), gain, over))
    names = ("gyros", "correlation", "measured", "arw", "sd", "factor", "over_present")
    types = (np.int64, float, bool, float, float, float, float)
    columns = {
        name: np.array([row[place] for row in rows], dtype=kind)
        for place, (name, kind) in enumerate(zip(names, types, strict=True))
    }
    return LargerArrays(columns, _summary(len(noise.arw), correlation, arw / present))


def _present_arw(noise: ArrayNoise) -> float:
    """ARW of the present array with the weights of its own R, deg/s/√Hz; NaN where R is not known."""
    try:
        return 1.0 / math.sqrt(design.information(noise.R))
    except DataError:
        return math.nan


def _steady_sd(arw: float, gyros: int, correlation: float, parameters: FilterParameters) -> float:
    if not arw > 0:
        return math.nan
    information = (factor(gyros, correlation) / arw) ** 2
    q = parameters.q
    if q is None:
        q = design.q_for_bandwidth(information, parameters.bandwidth_hz)
    return math.sqrt(design.steady_variance_identical(q, arw, gyros, correlation))


def _summary(gyros: int, correlation: MeanCorrelation, present_factor: float) -> dict[str, object]:
    summary: dict[str, object] = {"gyros": gyros, "present_factor": _known(present_factor), "little": LITTLE}
    if not correlation.known:
        return {**summary, "correlation": None}
    limits = (correlation.value, correlation.low, correlation.high)
    # More correlation is less improvement: the limits change places.
    turned = (correlation.value, correlation.high, correlation.low)
    return {
        **summary,
        "correlation": list(limits),
        "factor": [_factor_or_none(gyros, rho) for rho in turned],
        "twice": [_factor_or_none(2 * gyros, rho) for rho in turned],
        "limit": [_known(limit(rho)) for rho in turned],
        "little_from": little_from(max(correlation.value, 0.0)),
        "most": _known(most_alike(correlation.value)),
        "wanted": [[wanted, *(gyros_for(wanted, rho) for rho in limits)] for wanted in WANTED],
    }


def _factor_or_none(gyros: int, correlation: float) -> float | None:
    return factor(gyros, correlation) if gyros <= most_alike(correlation) else None


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
