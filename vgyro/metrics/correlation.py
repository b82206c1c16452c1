"""Correlation matrix of the gyros' noise, with limits that allow for noise correlated in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.metrics.allan import split_segments

LARGEST_LAG_SHARE = 4
WINDOW_FACTOR = 5


@dataclass(frozen=True)
class Correlation:
    """value, low, high [N, N]; effective [N, N] : number of independent samples behind each; NaN for a constant gyro"""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    effective: np.ndarray


def correlation_matrix(
    rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None, confidence: float = 0.95
) -> Correlation:
    """Correlation factors c_ij = cov(g_i, g_j) / √(cov(g_i, g_i) cov(g_j, g_j)) of the sampled noise.

    rate    : array [T, N], deg/s, at rest;  rate_hz : kept for symmetry with the other figures
    segment : array [T] int; each stretch's mean is removed (a rest pose's own bias is not noise)
    returns : Correlation; limits by Fisher's z with n independent samples, n = T / (1 + 2 Σ_k ρ_i(k) ρ_j(k)): drift
              common in time makes few samples of many (Bartlett 1935). The diagonal is 1 without limits' width.
    Jiang et al. (2012), eq. 22 and table 1; Fisher (1921).
    """
    from scipy.special import ndtri

    del rate_hz
    rate = np.asarray(rate, dtype=float)
    pieces = [piece - piece.mean(axis=0) for piece in split_segments(rate, segment)]
    number = rate.shape[1]
    samples = sum(len(piece) for piece in pieces)
    covariance = sum((piece.T @ piece for piece in pieces), np.zeros((number, number)))
    scale = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.clip(covariance / np.outer(scale, scale), -1, 1)
    value[scale == 0] = value[:, scale == 0] = np.nan
    effective = _effective_samples(np.concatenate(pieces) if pieces else rate, samples)
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


def _effective_samples(centred: np.ndarray, samples: int) -> np.ndarray:
    number = centred.shape[1]
    if samples < WINDOW_FACTOR * LARGEST_LAG_SHARE:
        return np.full((number, number), float(samples))
    functions = np.array([autocorrelation(centred[:, gyro], samples // LARGEST_LAG_SHARE) for gyro in range(number)])
    effective = np.empty((number, number))
    for row in range(number):
        for column in range(row, number):
            length = correlation_length(functions[row] * functions[column])
            effective[row, column] = effective[column, row] = min(samples / length, samples)
    return effective


def autocorrelation(centred: np.ndarray, lags: int) -> np.ndarray:
    """Autocorrelation at lags 0 … lags - 1 of a series without mean (by FFT, divided by T); zeros if it is constant."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(centred) + lags, real=True)
    transform = rfft(centred, size)
    function = irfft(transform.real**2 + transform.imag**2, size)[:lags]
    return function / function[0] if function[0] > 0 else np.zeros(lags)


def correlation_length(function: np.ndarray) -> float:
    """1 + 2 Σ function(k), summed to the first lag beyond five times the sum so far (Sokal's window); at least 1."""
    sums = 2 * np.cumsum(function) - 1
    beyond = np.flatnonzero(np.arange(len(function)) >= WINDOW_FACTOR * sums)
    return float(max(sums[beyond[0]] if beyond.size else sums[-1], 1.0))
