"""Welch amplitude density, one-sided, and the noise density read from it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from vgyro import units
from vgyro.metrics.allan.deviation import edges_of

FEWEST_SAMPLES = 8
HANN_BINS = 1.5  # equivalent noise bandwidth of the Hann window, in bins
HANN_OVERLAP = 0.95  # independent averages per half-overlapping Hann segment (Welch 1967: 1.89 K / (2K - 1))
LOWEST_HZ = 0.1
HIGHEST_HZ = 10.0
BATCH = 1 << 20  # samples of Welch segments that are transformed together


@dataclass(frozen=True)
class Spectrum:
    """frequency [F] Hz; density [F], unit of the rate per √Hz, ONE-sided; averages : Welch segments in the mean"""

    frequency: np.ndarray
    density: np.ndarray
    averages: int


@dataclass(frozen=True)
class Density:
    """A level of the spectrum, two-sided, with its limits and the band that it was read in, Hz."""

    value: float
    low: float
    high: float
    band: tuple[float, float]


def spectral_density(
    rate: np.ndarray, rate_hz: float, welch_s: float = 100.0, segment: np.ndarray | None = None
) -> Spectrum:
    """Amplitude density of a series by Welch's method, ONE-sided (√2 times the two-sided one).

    rate    : array [T], deg/s;  welch_s : length of a Welch segment, s; shorter where less than half of the
              samples lie in gap-free stretches so long
    segment : array [T] int, number of the gap-free stretch; power is averaged over the stretches that are long enough
    returns : Spectrum; empty if no stretch has 8 samples
    Hann window, half overlap, each Welch segment's mean removed.  Welch (1967), IEEE Trans. Audio Electroacoust. 15(2).
    """
    rate = np.asarray(rate, dtype=float)
    edges = edges_of(len(rate), segment)
    lengths = np.sort(np.diff(edges))
    if lengths.max(initial=0) < FEWEST_SAMPLES:
        return Spectrum(np.empty(0), np.empty(0), 0)
    common = int(lengths[np.searchsorted(np.cumsum(lengths), lengths.sum() / 2)])
    length = max(min(round(welch_s * rate_hz), common), FEWEST_SAMPLES)
    step = length - length // 2
    cuts = [(start, stop) for start, stop in itertools.pairwise(edges.tolist()) if stop - start >= length]
    starts = np.concatenate([np.arange(start, stop - length + 1, step) for start, stop in cuts])
    # The periodic Hann window; its power and the bins that stand for two make the density one-sided.
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    power = _summed_power(rate, starts, window)
    power[1 : (length + 1) // 2] *= 2
    density = np.sqrt(power / (len(starts) * rate_hz * np.sum(window**2)))
    return Spectrum(np.fft.rfftfreq(length, 1 / rate_hz), density, len(starts))


def _summed_power(rate: np.ndarray, starts: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Σ |rfft(window · (part - its mean))|² over the parts of `rate` from starts [P] on, a few at a time."""
    from scipy.fft import rfft

    power = np.zeros(len(window) // 2 + 1)
    parts = np.lib.stride_tricks.sliding_window_view(rate, len(window))
    batch = max(BATCH // len(window), 1)
    for first in range(0, len(starts), batch):
        some = parts[starts[first : first + batch]]
        some -= some.mean(axis=1, keepdims=True)
        some *= window
        transform = rfft(some, overwrite_x=True).view(float)
        transform *= transform
        power += transform.sum(axis=0).reshape(-1, 2).sum(axis=1)
    return power


def flat_band(rate_hz: float, bandwidth_hz: float | None = None) -> tuple[float, float]:
    """Band in which the floor is read: above drift, below the roll-off of gyro and filter.

    0.1 Hz to the lowest of 10 Hz, rate/10, and a quarter of the bandwidth of a filter that limits the series
    (where a first-order low-pass has lost 3 % of the amplitude).
    """
    top = min(HIGHEST_HZ, rate_hz / 10, math.inf if bandwidth_hz is None else bandwidth_hz / 4)
    return min(LOWEST_HZ, top / 3), top


def noise_density(spectrum: Spectrum, band: tuple[float, float], confidence: float = 0.95) -> Density:
    """Floor of the spectrum in a band, two-sided: median of the power in it, put right for the skew of chi².

    Two-sided because the figure read off a plot by Jiang et al. (2012, table 2: 0.11 deg/s/√Hz beside 6.17 deg/√h) fits
    that reading: it is then N itself. Multiply by √2 for the one-sided density. NaN where no bin is in the band.
    """
    inside = (spectrum.frequency >= band[0]) & (spectrum.frequency <= band[1]) & (spectrum.frequency > 0)
    if not inside.any():
        return Density(math.nan, math.nan, math.nan, band)
    averages = max(spectrum.averages * HANN_OVERLAP, 1.0) if spectrum.averages > 1 else 1.0
    freedom = 2 * averages
    median = float(np.median(spectrum.density[inside] ** 2)) / (1 - 2 / (9 * freedom)) ** 3
    independent = max(inside.sum() / HANN_BINS, 1.0) * averages
    # Half the relative error of a power is that of an amplitude; a median has √(π/2) times the error of a mean.
    error = _normal_quantile(confidence) * math.sqrt(math.pi / 2 / independent) / 2
    value = units.two_sided(math.sqrt(median))
    return Density(value, value * math.exp(-error), value * math.exp(error), band)


def thinned(spectrum: Spectrum, points: int = 600) -> Spectrum:
    """The spectrum with at most `points` frequencies: power averaged in bands of equal width on a log scale."""
    keep = spectrum.frequency > 0
    frequency, power = spectrum.frequency[keep], spectrum.density[keep] ** 2
    if frequency.size <= points:
        return Spectrum(frequency, np.sqrt(power), spectrum.averages)
    edges = np.geomspace(frequency[0], frequency[-1] * (1 + 1e-9), points + 1)
    band = np.searchsorted(edges, frequency, side="right")
    starts = np.flatnonzero(np.diff(band, prepend=-1))
    counts = np.diff(np.append(starts, frequency.size))
    mean_power = np.add.reduceat(power, starts) / counts
    centre = np.exp(np.add.reduceat(np.log(frequency), starts) / counts)
    return Spectrum(centre, np.sqrt(mean_power), spectrum.averages)


def _normal_quantile(confidence: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + confidence / 2))
