"""Welch's density of a day at 200 Hz, against SciPy."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import rates
from vgyro.metrics import spectral_density

RATE_HZ, SEGMENT_S = 200.0, 100.0
RELATIVE = 1e-9


def contests(quick: bool) -> list[Contest]:
    """Segments of 100 s, Hann window, half overlap, mean removed; no target: both do the same transforms."""
    samples = 200_000 if quick else 17_280_000
    rate = rates(samples, seed=18)
    length = round(SEGMENT_S * RATE_HZ)
    ours = Side("vgyro", lambda: spectral_density(rate, RATE_HZ, SEGMENT_S), samples)
    scipy = Side(f"scipy {version('scipy')}", lambda: by_scipy(rate, length), samples)

    def accuracy() -> list[Accuracy]:
        mine, theirs = spectral_density(rate, RATE_HZ, SEGMENT_S).density[1:], by_scipy(rate, length)[1:]
        return [Accuracy("density, largest relative difference", float(np.max(np.abs(mine / theirs - 1))), RELATIVE)]

    size = f"{samples:,} samples".replace(",", " ")
    # Half overlap: every sample is transformed twice, at 2.5·log2(n) operations for a real transform.
    limit = arithmetic(2 * 2.5 * np.log2(length), 0, 8)
    return [Contest("welch", f"Welch density, {size}", "sample", ours, (Rival(scipy),), limit, accuracy)]


def by_scipy(rate: np.ndarray, length: int) -> np.ndarray:
    """Amplitude density, one-sided."""
    from scipy.signal import welch

    return np.sqrt(welch(rate, RATE_HZ, nperseg=length, noverlap=length // 2)[1])
