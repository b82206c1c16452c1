"""Do all gyros see a line, as they see a motion, or is it the noise of one of them?"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from vgyro.fusion.motion.evidence import taper_of
from vgyro.runs import runs

LONGEST = 1 << 17
"""Samples that are looked at."""
ALIKE = 0.1
"""Scale factors and delays make the amplitudes of a motion differ by this share, at most."""
BESIDE = (6, 7, 8, 9, 10, 11)
"""Lines of the periodogram on either side that show the noise."""


def shared_lines(rate: np.ndarray, segment: np.ndarray, rate_hz: float) -> Callable[[float], bool]:
    """Whether the gyros share a line at a frequency, Hz.

    rate : [T, N], deg/s;  segment : as in vgyro.fusion.motion.noisy_rate.NoisyRate
    With amplitudes A_i ± σ_i in the longest stretch: a motion leaves Σ |A_i - A|²/(σ_i² + (ALIKE·A)²), noise of gyro j
    the sum of |A_i|²/σ_i² over the others. The smaller one decides, and a single gyro tells nothing: yes.
    """
    tapered = cache(lambda: _tapered(rate, segment))

    def amplitudes(frequency: float) -> np.ndarray:
        part = tapered()
        found: np.ndarray = np.exp(-2j * math.pi * frequency / rate_hz * np.arange(len(part))) @ part
        return found

    def shared(frequency: float) -> bool:
        own, step = amplitudes(frequency), rate_hz / len(tapered())
        beside = [amplitudes(frequency + sign * k * step) for k in BESIDE for sign in (-1, 1)]
        noise = np.maximum(np.mean(np.abs(beside) ** 2, axis=0), 1e-300)
        if len(own) < 2:
            return True
        mean = np.sum(own / noise) / np.sum(1.0 / noise)
        together = float(np.sum(np.abs(own - mean) ** 2 / (noise + (ALIKE * abs(mean)) ** 2)))
        each = np.abs(own) ** 2 / noise
        return together <= float(each.sum() - each.max())

    return shared


def _tapered(rate: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """The longest stretch, without its mean."""
    start, stop = max(runs(segment).tolist(), key=lambda part: part[1] - part[0])
    part = rate[start : min(stop, start + LONGEST)].astype(float)
    taper = taper_of(len(part))
    tapered: np.ndarray = (part - taper @ part / taper.sum()) * taper[:, None]
    return tapered
