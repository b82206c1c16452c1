"""Degrees of freedom of overlapping, modified and Hadamard variances, and chi² limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

FLATTEST = 2  # white noise of the angle
MOST_TERMS = 100  # J_max of the paper


@dataclass(frozen=True)
class Variance:
    """A variance as the paper sees it: differences of order d; angles averaged first (F = 1) or not (F = m).

    limits : by exponent, a0 and a1 of table 1 (modified) or 2;  level : b0 and b1 of table 3
    """

    d: int
    modified: bool
    steepest: int
    limits: dict[int, tuple[float, float]]
    level: tuple[float, float] = (1.0, 0.0)

    def count(self, samples: np.ndarray, factor: int) -> np.ndarray:
        """M of the paper: differences in stretches of `samples` rates."""
        return samples + 1 - self.d * factor - (factor - 1 if self.modified else 0)


KINDS = {
    "overlapping": Variance(
        2, False, -2, {2: (35 / 18, 1.0), 1: (790.0, 410.0), 0: (2 / 3, 1 / 3), -1: (0.852, 0.375), -2: (1.079, 0.368)},
        (15.23, 12.0),
    ),
    "modified": Variance(
        2, True, -2, {2: (7 / 9, 1 / 2), 1: (0.997, 0.616), 0: (1.033, 0.607), -1: (1.048, 0.534), -2: (1.302, 0.535)},
    ),
    "hadamard": Variance(
        3, False, -4,
        {2: (2.31, 1.5), 1: (9950.0, 6520.0), 0: (7 / 9, 1 / 2), -1: (0.997, 0.617), -2: (1.033, 0.607),
         -3: (1.053, 0.553), -4: (1.302, 0.535)},
        (47.8, 40.0),
    ),
}  # fmt: skip


def degrees_of_freedom(alpha: int, factor: int, samples: np.ndarray | int, kind: str = "overlapping") -> np.ndarray:
    """As vgyro.engine.protocols.noise.AllanEngine.degrees_of_freedom."""
    variance = KINDS[kind]
    alpha = min(max(alpha, variance.steepest), FLATTEST)
    count = variance.count(np.atleast_1d(np.asarray(samples, dtype=float)), factor)
    if variance.modified:
        edf = _by_sums(variance, alpha, factor, count)
    elif alpha == FLATTEST:
        # The formula for white noise of the angle ends where differences overlap for all of the stretch.
        edf = np.empty(count.shape)
        long = np.ceil(count / factor) > variance.d
        a0, a1 = _white_angle(variance.d)
        edf[long] = count[long] / (a0 - a1 * factor / count[long])
        edf[~long] = _by_sums(variance, 1, factor, count[~long])
    else:
        edf = _by_sums(variance, alpha, factor, count)
    return edf.reshape(np.shape(samples))


def _white_angle(d: int) -> tuple[float, float]:
    """a0 and a1 of case 4."""
    return math.comb(4 * d, 2 * d) / math.comb(2 * d, d) ** 2, d / 2


def limits(deviation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.limits."""
    from scipy.special import chdtri

    tail = (1 - confidence) / 2
    return deviation * np.sqrt(edf / chdtri(edf, tail)), deviation * np.sqrt(edf / chdtri(edf, 1 - tail))


def _by_sums(variance: Variance, alpha: int, factor: int, count: np.ndarray) -> np.ndarray:
    """Cases 1 to 3 of the paper: the sum itself, its limit for long series, the sum in between."""
    d = variance.d
    terms, ratio = np.minimum(count, (d + 1) * factor), count / factor
    short, long = terms <= MOST_TERMS, (terms > MOST_TERMS) & (ratio > d + 1)
    edf = np.empty(count.shape)
    own = alpha == 1 and not variance.modified
    filter_factor = 1.0 if variance.modified else factor if own or (d + 1) * factor <= MOST_TERMS else math.inf
    shape = _Shape(d, alpha, filter_factor)
    edf[short] = shape.exact(count[short], terms[short], float(factor))
    flat = (variance.level[0] + variance.level[1] * math.log(factor)) ** 2 if own else 1.0
    a0, a1 = variance.limits[alpha]
    edf[long] = flat * ratio[long] / (a0 - a1 / ratio[long])
    for index in np.flatnonzero(~short & ~long):
        stride = MOST_TERMS / float(ratio[index])
        most = np.array([float(MOST_TERMS)])
        shape = _Shape(d, alpha, stride if own else filter_factor if variance.modified else math.inf)
        edf[index] = shape.exact(most, most, stride, flat if own else None).item()
    return edf


@dataclass(frozen=True)
class _Shape:
    """Autocovariance of the differences: order d, exponent alpha, F."""

    d: int
    alpha: int
    filter_factor: float

    def exact(self, count: Floats, terms: Floats, stride: float, level: float | None = None) -> Floats:
        """M·s(0)² / Σ_j (1 - |j|/M) s(j/S)², |j| <= J: eq. 10 and 13; level: s(0)² where it is known."""
        most = int(terms.max(initial=0))
        lag = np.arange(most + 1)
        squares = self.structure(lag / stride) ** 2
        weight = np.where(lag < terms[:, None], 2.0, np.where(lag == terms[:, None], 1.0, 0.0))
        weight[:, 0] = 1.0
        sums = (weight * (1 - lag / count[:, None])) @ squares
        edf: Floats = (squares[0] if level is None else level) * count / sums
        return edf

    def structure(self, t: np.ndarray) -> np.ndarray:
        """s_z of the paper, eq. 9."""
        total = math.comb(2 * self.d, self.d) * self._filtered(t)
        for step in range(1, self.d + 1):
            weight = (-1) ** step * math.comb(2 * self.d, self.d - step)
            total = total + weight * (self._filtered(t - step) + self._filtered(t + step))
        return total

    def _filtered(self, t: Floats) -> Floats:
        """s_x, eq. 8."""
        if math.isinf(self.filter_factor):
            return _covariance(t, self.alpha + 2)
        step = 1 / self.filter_factor
        near = _covariance(t - step, self.alpha) + _covariance(t + step, self.alpha)
        return self.filter_factor**2 * (2 * _covariance(t, self.alpha) - near)


def _covariance(t: Floats, alpha: int) -> Floats:
    """s_w, eq. 7: -|t|, t² log|t|, |t|³, t⁴ log|t|, |t|⁵, … for alpha = 2, 1, 0, -1, -2, …"""
    size = np.abs(t)
    if alpha == 2:
        return -size
    power = size ** (3 - alpha)
    return power * np.log(size, where=size > 0, out=np.zeros_like(size)) if alpha % 2 else power
