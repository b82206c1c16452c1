"""The rate that all gyros share, as a mean of least variance: the reference for what comes with the motion."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.fusion.events import excluded
from vgyro.fusion.noise.quiet_frequencies import quiet_noise
from vgyro.fusion.types import ArrayRates
from vgyro.fusion.weights import min_variance_weights, usable

LONGEST_S = 1.0
"""Half the smoothing window at most."""
LOST = 1.5
"""The window is the longest that takes no more from the mean than this, over what it takes from its noise."""
ORDER = 3
"""Degree of the polynomials of the smoother (Savitzky & Golay 1964)."""
CLEAR = 10.0
"""Mean square of the smoothed motion over that of its noise, or nothing is looked for."""
LEAST = 0.05
"""Least variance of a gyro's noise, of the median: a gyro that does not measure is no perfect one."""


def used(array: ArrayRates) -> np.ndarray:
    """Samples [T, N] of bool at which a gyro is neither at fault nor missing."""
    samples, gyros = array.rate.shape
    good = np.ones((samples, gyros), dtype=bool, order="F")
    for gyro, spans in enumerate(excluded(array.faults, samples, gyros)):
        for start, stop in spans:
            good[start:stop, gyro] = False
    if array.missing is not None:
        good &= ~array.missing
    return good


def reference(array: ArrayRates, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Mean of the good gyros of least variance [T], deg/s, and the variance of its white noise, (deg/s)² a sample.

    So weighed its noise is in no difference, and no noise is taken for an answer to the motion. Where no gyro is good
    all of them count.
    """
    shares, noise = array.once("reference", lambda: _shares(array, good))
    total, number = np.zeros(len(array.rate)), np.zeros(len(array.rate))
    none = ~good.any(axis=1)
    for gyro, share in enumerate(shares.tolist()):
        counts = good[:, gyro] | none
        total += share * np.where(counts, array.rate[:, gyro], 0.0)
        number += share * counts
    return total / np.where(number > 0, number, 1.0), noise


def _shares(array: ArrayRates, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights of least variance [N], Σ = 1, and that variance: of the noise at the frequencies with little motion.

    Where these say nothing, of the steps between neighbouring samples, as if no gyro's noise were another's.
    """
    shares: Floats = 1.0 / _white(array, good)
    noise, shares = 1.0 / float(shares.sum()), shares / shares.sum()
    lost = np.concatenate([np.zeros((1, good.shape[1]), dtype=np.int64), np.cumsum(~good, axis=0)])
    quiet = quiet_noise(array, shares, lambda starts, length: np.equal(lost[starts + length], lost[starts]))
    if quiet is None:
        return shares, noise
    covariance = quiet.variance * quiet.noise(np.eye(len(shares)))
    if not usable(covariance[None])[0]:
        return shares, noise
    shares = min_variance_weights(covariance)
    return shares, float(shares @ covariance @ shares)


def _white(array: ArrayRates, good: Bools) -> Floats:
    """Variances of the gyros' white noise [N], from the steps of neighbouring samples about the mean of all.

    a_i = σ_i²·(1 - 2/N) + Σσ²/N². None below LEAST of the median; two gyros have the same.
    """
    gyros = array.rate.shape[1]
    mean = np.zeros(len(array.rate))
    for column in array.rate.T:
        mean += column / gyros
    seen = np.full(gyros, np.nan)
    for gyro in range(gyros):
        steps = np.diff(np.subtract(array.rate[:, gyro], mean, dtype=float))[good[1:, gyro] & good[:-1, gyro]]
        if steps.size:
            seen[gyro] = float(np.mean(steps**2)) / 2.0
    usual = float(np.nanmedian(seen)) if np.isfinite(seen).any() else 1.0
    seen = np.where(np.isfinite(seen), seen, usual)
    total = float(seen.sum()) / (1.0 - 1.0 / gyros)
    if gyros == 2 or total == 0.0:
        return np.full(gyros, total / gyros or 1.0)
    found = (seen - total / gyros**2) / (1.0 - 2.0 / gyros)
    white: Floats = np.maximum(found, LEAST * max(float(np.median(found)), total * 1e-6))
    return white


def smoothing_window(array: ArrayRates, mean: np.ndarray, noise: float) -> int | None:
    """Samples of the smoother's window, odd; 1: none; None: the motion is not clear of the mean's noise a sample."""
    best = None
    half = 0
    while half <= max(LONGEST_S * array.rate_hz, 1.0):
        window = 2 * half + 1
        kernel = _kernel(window)
        smooth = smoothed(array, mean, window)
        lost = float(np.mean(np.square(mean - smooth)))
        taken = noise * (1.0 - 2.0 * kernel[half] + float(kernel @ kernel))
        if half and lost > LOST * taken:
            break
        left = noise * float(kernel @ kernel)
        best = window if float(np.var(smooth)) > CLEAR * left else None
        half = 2 if half == 0 else 2 * half
    return best


def _kernel(window: int) -> np.ndarray:
    from scipy.signal import savgol_coeffs

    return savgol_coeffs(window, ORDER) if window > 1 else np.ones(1)


def smoothed(array: ArrayRates, values: np.ndarray, window: int, derivative: int = 0) -> np.ndarray:
    """Values [T] or their derivative by s^derivative, smoothed in each gap-free stretch."""
    from scipy.signal import savgol_filter

    found = np.empty(len(values))
    for part in array.stretches():
        length = part.stop - part.start
        own = min(window, length - 1 + length % 2)
        if own > ORDER:
            found[part] = savgol_filter(values[part], own, ORDER, deriv=derivative, delta=array.period)
            continue
        piece = values[part].astype(float)
        for _ in range(derivative):
            piece = np.gradient(piece, array.period) if length > 1 else np.zeros(1)
        found[part] = piece
    return found
