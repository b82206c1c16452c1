"""Smoothing by polynomials, without scipy.signal: that takes longer to import than a short recording to fuse."""

from __future__ import annotations

import math

import numpy as np


def savgol_coefficients(window: int, order: int, derivative: int = 0, period: float = 1.0) -> np.ndarray:
    """Taps [window] of a polynomial smoother, as those of a convolution; window odd, greater than order.

    Savitzky & Golay (1964), Anal. Chem. 36, 1627-1639. To the bit those of scipy.signal.savgol_coeffs.
    """
    place = np.flip(np.arange(-(window // 2), window - window // 2, dtype=float))
    powers = place ** np.arange(order + 1, dtype=float)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = math.factorial(derivative) / period**derivative
    return _least_squares(powers, wanted)


def savgol(values: np.ndarray, window: int, order: int, derivative: int = 0, period: float = 1.0) -> np.ndarray:
    """Values [T] or their derivative smoothed by a polynomial of `order` over `window` samples; period: of the samples.

    At both ends the polynomial of the last whole window. To the bit scipy.signal.savgol_filter.
    """
    from scipy.ndimage import convolve1d

    values = np.asarray(values, dtype=float)
    smooth = convolve1d(values, savgol_coefficients(window, order, derivative, period), mode="constant")
    half, samples = window // 2, len(values)
    for start, first, last in ((0, 0, half), (samples - window, samples - half, samples)):
        fitted = _polynomial(values[start : start + window], order)
        for _ in range(derivative):
            fitted = fitted[:-1] * np.arange(len(fitted) - 1, 0, -1, dtype=float)
        at = np.arange(first - start, last - start, dtype=float)
        smooth[first:last] = np.polyval(fitted, at) / period**derivative
    return smooth


def _polynomial(values: np.ndarray, order: int) -> np.ndarray:
    """Coefficients of the polynomial over 0, 1, …, the highest power first."""
    powers = np.arange(len(values), dtype=float)[:, None] ** np.arange(order, -1, -1, dtype=float)
    scale = np.sqrt(np.sum(powers * powers, axis=0))
    return _least_squares(powers / scale, values, len(values) * float(np.finfo(float).eps)) / scale


def _least_squares(matrix: np.ndarray, values: np.ndarray, least: float | None = None) -> np.ndarray:
    from scipy.linalg import lstsq

    given = max(matrix.shape) * float(np.finfo(float).eps) if least is None else least
    return np.asarray(lstsq(matrix, values, cond=given)[0])
