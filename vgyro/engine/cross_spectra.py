"""Cross-spectra of several gyros from windows of samples, in groups of windows: plain sums, to be weighed later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SECONDS = 5.0
"""Length of a window, about: its lines are fifths of a Hz apart, and rest of some minutes has dozens of windows."""
SHORTEST, LONGEST = 64, 4096
FEWEST = 16
"""Windows in the longest stretch at least, or they are shorter."""
MOST_SAMPLES = 1 << 19
"""More windows than that are thinned evenly: the error of a correlation is then some thousandths."""
AT_A_TIME = 1 << 17


@dataclass(frozen=True)
class CrossSpectra:
    """Sums over windows of Re X_i·X̄_j, in which white noise of the variance σ² has the mean σ² at each frequency.

    frequency [F] : Hz, above zero and below half the sample rate
    total [G, F, N, N] : (deg/s)², sums over the windows of each group in which both gyros are good
    windows [G, N, N] : how many these are;  length : samples of a window
    """

    frequency: np.ndarray
    total: np.ndarray
    windows: np.ndarray
    length: int


def window_length(rate_hz: float, longest_stretch: int) -> int:
    """Samples of a window: a power of two, about SECONDS; 0: no stretch is long enough for one."""
    usual = 2 ** round(np.log2(max(SECONDS * rate_hz, 1.0)))
    length = int(min(max(usual, SHORTEST), LONGEST))
    while length > SHORTEST and FEWEST * length > 2 * longest_stretch:
        length //= 2
    return length if length <= longest_stretch else 0


def window_starts(stretches: Sequence[slice], length: int) -> np.ndarray:
    """First samples [W] of windows that overlap by half and reach over no end of a stretch; thinned evenly if many."""
    step = max(length // 2, 1)
    found = [np.arange(part.start, part.stop - length + 1, step) for part in stretches]
    starts = np.concatenate([np.empty(0, dtype=int), *found])
    every = -(-len(starts) * step // MOST_SAMPLES)
    return starts[:: max(every, 1)]


def cross_spectra(
    columns: Sequence[np.ndarray], starts: np.ndarray, length: int, good: np.ndarray, group: np.ndarray, rate_hz: float
) -> CrossSpectra:
    """Of N columns [T], deg/s, from windows with Hann's taper, each less its straight line.

    starts [W] : first samples of the windows;  good [W, N] : the gyro can be used there;  group [W] : from 0 on
    Real parts alone: noise of two gyros that is correlated is so at the same time. The two lowest lines and the last
    are left out: they hold what is left of the slow part, or are half a line.
    """
    gyros, number = len(columns), int(group.max(initial=-1)) + 1
    taper = np.hanning(length + 1)[:-1]
    scale = 1.0 / float(np.sum(taper**2))
    ramp = np.arange(length) - (length - 1) / 2.0
    ramp /= np.sqrt(float(ramp @ ramp))
    kept = slice(3, length // 2)
    frequency = np.fft.rfftfreq(length, 1.0 / rate_hz)[kept]
    total = np.zeros((number, len(frequency), gyros, gyros))
    many = max(1, AT_A_TIME // length)
    for begin in range(0, len(starts), many):
        rows = slice(begin, begin + many)
        inside = starts[rows, None] + np.arange(length)
        spectra = np.empty((len(inside), len(frequency), gyros), dtype=complex)
        for gyro, column in enumerate(columns):
            values = np.asarray(column[inside], dtype=float)
            values = np.where(good[rows, gyro][:, None], values, 0.0)
            values -= values.mean(axis=1, keepdims=True)
            values -= (values @ ramp)[:, None] * ramp
            spectra[:, :, gyro] = np.fft.rfft(values * taper, axis=1)[:, kept]
        flat = np.concatenate([spectra.real, spectra.imag], axis=2).reshape(*spectra.shape[:2], 2, gyros)
        for one in np.unique(group[rows]):
            chosen = flat[group[rows] == one]
            total[one] += np.einsum("wfci,wfcj->fij", chosen, chosen, optimize=True) * scale
    used = good.astype(float)
    windows = np.zeros((number, gyros, gyros))
    for one in range(number):
        mine = used[group == one]
        windows[one] = mine.T @ mine
    return CrossSpectra(frequency, total, windows, length)
