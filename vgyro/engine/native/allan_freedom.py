"""Degrees of freedom of an overlapping Allan variance, and chi² limits."""

from __future__ import annotations

import math

import numpy as np

STEEPEST = -2  # random walk of the rate: the steepest noise for which the two-sample variance exists
FLATTEST = 2  # white noise of the angle
MOST_TERMS = 100  # J_max of the paper
TABLE_2 = {1: (790.0, 410.0), 0: (2 / 3, 1 / 3), -1: (0.852, 0.375), -2: (1.079, 0.368)}  # a0, a1 for d = 2
TABLE_3 = (15.23, 12.0)  # b0, b1 for d = 2
WHITE_ANGLE = (35 / 18, 1.0)  # a0 = C(8, 4) / C(4, 2)², a1 = d / 2


def degrees_of_freedom(alpha: int, factor: int, samples: np.ndarray | int) -> np.ndarray:
    """Equivalent degrees of freedom of the overlapping Allan variance of gap-free stretches.

    alpha   : exponent of the rate's power spectrum: 0 white, -1 flicker, -2 random walk, 1 and 2 noise of the angle
    factor  : averaging factor m;  samples : array [S] of the rates in each stretch, at least 2m
    returns : array of the shape of `samples`
    Greenhall & Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003: d = 2, F = S = m.
    """
    alpha = min(max(alpha, STEEPEST), FLATTEST)
    count = np.atleast_1d(np.asarray(samples, dtype=float)) + 1 - 2 * factor  # M of the paper
    ratio = count / factor
    edf = np.empty(count.shape)
    if alpha == FLATTEST:
        # The formula for white noise of the angle ends where two differences overlap for all of the stretch.
        long = ratio > 2
        edf[long] = count[long] / (WHITE_ANGLE[0] - WHITE_ANGLE[1] / ratio[long])
        edf[~long] = _by_sums(1, factor, count[~long])
    else:
        edf = _by_sums(alpha, factor, count)
    return edf.reshape(np.shape(samples))


def limits(deviation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper chi² limits of deviations with `edf` degrees of freedom.  Riley, NIST SP 1065, eq. 45."""
    from scipy.special import chdtri

    tail = (1 - confidence) / 2
    return deviation * np.sqrt(edf / chdtri(edf, tail)), deviation * np.sqrt(edf / chdtri(edf, 1 - tail))


def _by_sums(alpha: int, factor: int, count: np.ndarray) -> np.ndarray:
    """The three cases of the paper for alpha <= 1: the sum itself, its limit for long series, the sum in between."""
    terms, ratio = np.minimum(count, 3 * factor), count / factor
    short, long = terms <= MOST_TERMS, (terms > MOST_TERMS) & (ratio > 3)
    edf = np.empty(count.shape)
    filter_factor = factor if alpha == 1 or 3 * factor <= MOST_TERMS else math.inf
    edf[short] = _exact(alpha, filter_factor, count[short], terms[short], float(factor))
    flat = (TABLE_3[0] + TABLE_3[1] * math.log(factor)) ** 2 if alpha == 1 else 1.0
    a0, a1 = TABLE_2[alpha]
    edf[long] = flat * ratio[long] / (a0 - a1 / ratio[long])
    for index in np.flatnonzero(~short & ~long):
        stride = MOST_TERMS / float(ratio[index])
        most = np.array([float(MOST_TERMS)])
        width, level = (stride, flat) if alpha == 1 else (math.inf, None)
        edf[index] = _exact(alpha, width, most, most, stride, level).item()
    return edf


def _exact(
    alpha: int, filter_factor: float, count: np.ndarray, terms: np.ndarray, stride: float, level: float | None = None
) -> np.ndarray:
    """M·s(0)² / Σ_j (1 - |j|/M) s(j/S)², |j| <= J: eq. 10 and 13; level: s(0)² where it is known."""
    most = int(terms.max(initial=0))
    lag = np.arange(most + 1)
    squares = _structure(lag / stride, filter_factor, alpha) ** 2
    weight = np.where(lag < terms[:, None], 2.0, np.where(lag == terms[:, None], 1.0, 0.0))
    weight[:, 0] = 1.0
    sums = (weight * (1 - lag / count[:, None])) @ squares
    return (squares[0] if level is None else level) * count / sums


def _structure(t: np.ndarray, filter_factor: float, alpha: int) -> np.ndarray:
    """s_z of the paper, eq. 9, for d = 2."""
    outer = _filtered(t - 2, filter_factor, alpha) + _filtered(t + 2, filter_factor, alpha)
    inner = _filtered(t - 1, filter_factor, alpha) + _filtered(t + 1, filter_factor, alpha)
    return 6 * _filtered(t, filter_factor, alpha) - 4 * inner + outer


def _filtered(t: np.ndarray, filter_factor: float, alpha: int) -> np.ndarray:
    """s_x, eq. 8."""
    if math.isinf(filter_factor):
        return _covariance(t, alpha + 2)
    near = _covariance(t - 1 / filter_factor, alpha) + _covariance(t + 1 / filter_factor, alpha)
    return filter_factor**2 * (2 * _covariance(t, alpha) - near)


def _covariance(t: np.ndarray, alpha: int) -> np.ndarray:
    """s_w, eq. 7: -|t|, t² log|t|, |t|³, t⁴ log|t|, |t|⁵ for alpha = 2, 1, 0, -1, -2."""
    size = np.abs(t)
    if alpha == 2:
        return -size
    power = size ** (3 - alpha)
    return power * np.log(size, where=size > 0, out=np.zeros_like(size)) if alpha % 2 else power
