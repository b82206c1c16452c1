"""Correlation matrix of the gyros' noise, with limits that allow for noise correlated in time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.metrics.allan.deviation import edges_of

LARGEST_LAG_SHARE = 4
WINDOW_FACTOR = 5
FIRST_LAGS, MORE_LAGS = 1 << 10, 16
PARTS = 4  # an FFT is so many times as long as the lags
HELD = 3  # series that are held while the others pass
BATCH = 1 << 18  # samples that are transformed together


@dataclass(frozen=True)
class Correlation:
    """value, low, high [N, N]; effective [N, N] : number of independent samples behind each; NaN for a constant gyro"""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    effective: np.ndarray


def correlation_matrix(
    series: Sequence[np.ndarray],
    rate_hz: float,
    segment: np.ndarray | None = None,
    confidence: float = 0.95,
    truth: np.ndarray | None = None,
) -> Correlation:
    """Correlation factors c_ij = cov(g_i, g_j) / √(cov(g_i, g_i) cov(g_j, g_j)) of the sampled noise.

    series  : N arrays [T], deg/s, at rest; four of them at a time are held;  rate_hz : as in the other figures
    segment : array [T] int; each stretch's mean is removed (a rest pose's own bias is not noise)
    truth   : array [T], deg/s, taken off every gyro where the board moves; None: nothing
    returns : Correlation; limits by Fisher's z with n independent samples, n = T / (1 + 2 Σ_k ρ_i(k) ρ_j(k)): drift
              common in time makes few samples of many (Bartlett 1935). The diagonal is 1 without limits' width.
    Jiang et al. (2012), eq. 22 and table 1; Fisher (1921).
    """
    from scipy.special import ndtri

    del rate_hz
    noise = _PairNoise(series, segment, truth)
    covariance, functions, samples = _second_moments(noise)
    scale = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.clip(covariance / np.outer(scale, scale), -1, 1)
    value[scale == 0] = value[:, scale == 0] = np.nan
    effective = _effective_samples(noise, functions, samples)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.arctanh(value)
        half = ndtri(0.5 + confidence / 2) / np.sqrt(np.maximum(effective - 3, 0))
        low, high = np.tanh(z - half), np.tanh(z + half)
    low[np.isnan(low) & ~np.isnan(value)] = -1
    high[np.isnan(high) & ~np.isnan(value)] = 1
    known = np.flatnonzero(scale > 0)
    for matrix in (value, low, high):
        matrix[known, known] = 1.0
    return Correlation(value, low, high, effective)


@dataclass(frozen=True)
class _PairNoise:
    """What of N series [T] is noise: without the truth [T] and the mean of each stretch. Made when it is asked for."""

    series: Sequence[np.ndarray]
    segment: np.ndarray | None
    truth: np.ndarray | None

    def column(self, gyro: int) -> np.ndarray:
        """One gyro [T]."""
        rate = np.asarray(self.series[gyro], dtype=float)
        if self.truth is not None:
            rate = rate - self.truth
        column = np.empty(len(rate))
        for start, stop in itertools.pairwise(edges_of(len(rate), self.segment).tolist()):
            np.subtract(rate[start:stop], rate[start:stop].mean(), out=column[start:stop])
        return column


def _second_moments(noise: _PairNoise) -> tuple[np.ndarray, list[np.ndarray], int]:
    """Σ g_i g_j [N, N], the autocorrelation of each at the first lags, and the number of samples."""
    number, samples = len(noise.series), 0
    covariance = np.zeros((number, number))
    functions: list[np.ndarray] = []
    held: list[np.ndarray] = []
    for first in range(0, number, HELD):
        held.clear()
        for gyro in range(first, min(first + HELD, number)):
            held.append(noise.column(gyro))
            samples = len(held[-1])
            functions.append(autocorrelation(held[-1], min(FIRST_LAGS, samples // LARGEST_LAG_SHARE)))
        for other in range(first, number):
            column = held[other - first] if other < first + HELD else noise.column(other)
            for row, values in enumerate(held, first):
                covariance[row, other] = covariance[other, row] = float(values @ column)
            del column
    return covariance, functions, samples


def _effective_samples(noise: _PairNoise, functions: list[np.ndarray], samples: int) -> np.ndarray:
    """T / (1 + 2 Σ ρ_i(k) ρ_j(k)) [N, N], by as many lags as every sum needs to end, at most T/4."""
    number = len(functions)
    effective = np.full((number, number), float(samples))
    if samples < WINDOW_FACTOR * LARGEST_LAG_SHARE:
        return effective
    lags, most = len(functions[0]), samples // LARGEST_LAG_SHARE
    while True:
        sums = [_sum_to_window(functions[i] * functions[j]) for i in range(number) for j in range(i, number)]
        if lags == most or all(ended for _, ended in sums):
            break
        lags = min(lags * MORE_LAGS, most)
        functions = [autocorrelation(noise.column(gyro), lags) for gyro in range(number)]
    lengths = iter(sums)
    for row in range(number):
        for column in range(row, number):
            effective[row, column] = effective[column, row] = min(samples / next(lengths)[0], samples)
    return effective


def autocorrelation(centred: np.ndarray, lags: int) -> np.ndarray:
    """Autocorrelation at lags 0 … lags - 1 of a series without mean (divided by T); zeros if it is constant."""
    function = lagged_products(centred, centred, lags) if lags else np.empty(0)
    return function / function[0] if lags and function[0] > 0 else np.zeros(lags)


def lagged_products(first: Floats, second: Floats, lags: int) -> Floats:
    """Σ_t first[t] second[t + k] for k = 0 … lags - 1, as far as there is a second[t + k].

    By FFT; series much longer than the lags are cut into parts of `first`, each with what it meets of `second`.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    number = len(first)
    part = number if number <= PARTS * lags else (PARTS - 1) * lags
    size = next_fast_len(part + lags, real=True)
    spectrum = np.zeros(size // 2 + 1, complex)
    whole = min(number, len(second) - lags) // part if part < number else 0
    batch = max(BATCH // size, 1)
    for start in range(0, whole, batch):
        chosen = slice(start * part, (min(start + batch, whole) - 1) * part + 1, part)
        transform = rfft(np.lib.stride_tricks.sliding_window_view(second, part + lags)[chosen], size)
        transform *= rfft(np.lib.stride_tricks.sliding_window_view(first, part)[chosen], size).conj()
        spectrum += transform.sum(axis=0)
    for start in range(whole * part, number, part):
        spectrum += rfft(first[start : start + part], size).conj() * rfft(second[start : start + part + lags], size)
    products: Floats = irfft(spectrum, size)[:lags]
    return products


def correlation_length(function: np.ndarray) -> float:
    """1 + 2 Σ function(k), summed to the first lag beyond five times the sum so far (Sokal's window); at least 1."""
    return _sum_to_window(function)[0]


def _sum_to_window(function: np.ndarray) -> tuple[float, bool]:
    """correlation_length, and whether its window ends within the function."""
    sums = 2 * np.cumsum(function) - 1
    beyond = np.flatnonzero(np.arange(len(function)) >= WINDOW_FACTOR * sums)
    return float(max(sums[beyond[0]] if beyond.size else sums[-1], 1.0)), bool(beyond.size)
