"""A series without its drift, its tones and its correlation: what is left is white, of constant variance or not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.volatility.arch_lm import FLAT

FEWEST_SAMPLES = 50
MOST_LINES = 10
LINE_LEVEL = 0.01
"""Probability that white noise shows a line anywhere in its periodogram."""
SIDE, GUARD, FEWEST = 50, 2, 5  # bins of the floor on each side of a line, between it and them, and at least
HIGHEST_ORDER, SAMPLES_AN_ORDER = 20, 20
DISTURBED_LEVEL = 1e-3
"""Probability that Gaussian noise has one sample or more that counts as disturbed."""


@dataclass(frozen=True)
class SeriesLine:
    """A sinusoid in a series: frequency [Hz], amplitude, probability of so high a line anywhere in white noise."""

    frequency: float
    amplitude: float
    probability: float


@dataclass(frozen=True)
class Whitened:
    """One series, taken apart: series = drift + tones + what an autoregression makes of `residual`.

    residual, drift, tones [T]; lines; autoregression [p]; disturbed [T]: true for the samples that the fits left out
    quiet [T] : the residual if those samples had been zero, so that a knock does not ring on
    """

    residual: np.ndarray
    quiet: np.ndarray
    drift: np.ndarray
    tones: np.ndarray
    lines: tuple[SeriesLine, ...]
    autoregression: np.ndarray
    disturbed: np.ndarray


def whiten(series: np.ndarray, rate_hz: float, span: int) -> Whitened:
    """Take drift, tones and correlation out of a series, so that what ARCH-LM finds in the rest is changing variance.

    series  : [T], evenly spaced, one stretch;  rate_hz : its rate;  span : samples of the running median
    returns : Whitened; the residual is NaN for a series that does not vary, holds NaN, or has less than 50 samples

    1. Tones: sinusoids at the lines of the periodogram, the strongest first, at most 10. Fisher's (1929) test, at 1 %
       for the whole periodogram, but against the floor on both sides of the line, the greater of two medians: the
       series need not be white yet. Frequency, amplitude and phase by least squares. The running mean is taken out
       before, and its effect on a sinusoid put right; slower than half a turn in `span` samples, a tone is drift.
    2. Drift: the running median over `span` samples, which a knock does not bend and which follows a jump; at both
       ends, the line through the first or last `span` samples with the median of their slopes (Theil 1950).
    3. Disturbed: samples further off than noise is (in 1 of 1000 such series), by the median of the magnitudes.
       The fits do without them; the residual holds them as they are.
    4. Correlation: an autoregression (Burg 1975) of the order, up to 20, of the lowest AICc (Hurvich & Tsai 1989).
    """
    series = np.asarray(series, dtype=float)
    missing = np.full(len(series), np.nan)
    flat = np.ptp(series) <= FLAT * np.max(np.abs(series), initial=0.0) if len(series) else True
    if len(series) < FEWEST_SAMPLES or flat or not np.isfinite(series).all():
        none = np.zeros(len(series), dtype=bool)
        return Whitened(missing, missing, missing, missing, (), np.empty(0), none)
    drift = running_median(series, span)
    disturbed = far_off(series - drift)
    lines, tones = find_lines(np.where(disturbed, drift, series), rate_hz, span)
    if lines:
        drift = running_median(series - tones, span)
        disturbed = far_off(series - tones - drift)
    rest = series - tones - drift
    calm = np.where(disturbed, 0.0, rest)
    autoregression = fit_autoregression(calm)
    residual, quiet = _innovations(rest, autoregression), _innovations(calm, autoregression)
    return Whitened(residual, quiet, drift, tones, lines, autoregression, disturbed)


def running_median(series: Floats, span: int) -> Floats:
    """Median over `span` samples about each sample, made odd and no more than there are; straight at both ends."""
    from scipy.ndimage import median_filter

    samples = len(series)
    half = min(span // 2, (samples - 1) // 2)
    median: Floats = median_filter(series, 2 * half + 1, mode="nearest")
    place = np.arange(half + 1)
    median[: half + 1] = median[half] - _slope(series[: 2 * half + 1]) * place[::-1]
    median[samples - half - 1 :] = median[samples - half - 1] + _slope(series[samples - 2 * half - 1 :]) * place
    return median


def far_off(rest: Floats) -> Bools:
    """True for the samples of a series about zero [T] that are too far off for Gaussian noise of its usual size."""
    from scipy.special import ndtri

    limit = float(ndtri(1 - DISTURBED_LEVEL / 2 / len(rest)))
    return np.abs(rest) > limit * usual_size(rest)


def usual_size(rest: np.ndarray) -> float:
    """Standard deviation of the bulk of a series about zero: from the median magnitude; of all if that is zero."""
    size = 1.4826 * float(np.median(np.abs(rest)))
    return size if size > 0 else float(np.sqrt(np.mean(np.square(rest))))


def find_lines(series: np.ndarray, rate_hz: float, span: int) -> tuple[tuple[SeriesLine, ...], np.ndarray]:
    """The sinusoids in a series [T] with drift: the lines, strongest first, and the sum of the sinusoids [T]."""
    half = min(span // 2, len(series) // 4)
    length = 2 * half + 1
    total = np.cumsum(np.concatenate([[0.0], series]))
    rest = series[half : len(series) - half] - (total[length:] - total[:-length]) / length
    time = np.arange(len(series)) - (len(series) - 1) / 2
    found: list[SeriesLine] = []
    tones = np.zeros(len(series))
    for _ in range(MOST_LINES):
        place, chance = _highest_line(rest, 0.5 / length)
        if not chance < LINE_LEVEL:
            break
        frequency, weights = _fit_sinusoid(rest, place)
        angle = 2 * np.pi * frequency * time
        sinusoid = weights[0] * np.cos(angle) + weights[1] * np.sin(angle)
        rest = rest - sinusoid[half : len(series) - half]
        sinusoid /= 1 - block_gain(frequency, length)
        tones += sinusoid
        found.append(SeriesLine(frequency * rate_hz, math.sqrt(2 * float(np.mean(np.square(sinusoid)))), chance))
    return tuple(found), tones


def block_gain(frequency: float, length: int) -> float:
    """Gain of the mean of `length` samples for a sinusoid, signed; frequency in cycles a sample."""
    angle = math.pi * frequency
    return math.sin(length * angle) / (length * math.sin(angle)) if abs(math.sin(angle)) > 1e-12 else 1.0


def fit_autoregression(series: np.ndarray) -> np.ndarray:
    """Coefficients [p] of y_t = Σ φ_i y_{t-i} + e_t by Burg's method; p of the lowest AICc; none for a flat series."""
    samples = len(series)
    forward, backward = series[1:].copy(), series[:-1].copy()
    size = float(series @ series) / samples
    if size == 0:
        return np.empty(0)
    known, best = np.empty(0), np.empty(0)
    lowest = samples * math.log(size)
    for order in range(1, min(HIGHEST_ORDER, samples // SAMPLES_AN_ORDER) + 1):
        total = float(forward @ forward + backward @ backward)
        if total <= FLAT * samples * size:
            break
        reflection = 2 * float(forward @ backward) / total
        known = np.append(known - reflection * known[::-1], reflection)
        size *= 1 - reflection**2
        forward, backward = (forward - reflection * backward)[1:], (backward - reflection * forward)[:-1]
        criterion = samples * math.log(size) + 2 * order * samples / (samples - order - 1)
        if criterion < lowest:
            lowest, best = criterion, known
    return best


def _highest_line(series: np.ndarray, lowest: float) -> tuple[float, float]:
    """Frequency of the highest line over its floor, and the probability that noise has one.

    lowest : frequency from which on lines are sought; both in cycles a sample
    """
    from scipy.fft import rfft
    from scipy.special import fdtrc

    samples = len(series)
    power = np.square(np.abs(rfft(series)))
    if samples % 2 == 0:
        power[-1] /= 2  # one degree of freedom in place of two
    known = np.concatenate([np.full(SIDE + GUARD + 1, np.nan), power[1:], power[-2 : -SIDE - GUARD - 2 : -1]])
    if power.size < SIDE + 2 * GUARD:
        return math.nan, 1.0
    views = np.lib.stride_tricks.sliding_window_view(known, SIDE)
    above = np.median(views[SIDE + 2 * GUARD + 1 :], axis=1)
    below = np.full(above.size, -np.inf)
    full = SIDE + GUARD + 1
    below[full:] = np.median(views[full : above.size], axis=1)
    counts = np.full(above.size, SIDE)
    for place in range(1 + GUARD + FEWEST, min(full, above.size)):
        below[place] = np.median(power[1 : place - GUARD])
        counts[place] = place - GUARD - 1
    below[: 1 + GUARD + FEWEST] = np.inf
    floor = np.maximum(below, above) / math.log(2)
    ratio = np.divide(power[: floor.size], floor, out=np.zeros(floor.size), where=floor > 0)
    # Variance of the median of exponential powers: that of a mean of count·(ln 2)² of them.
    chance = fdtrc(2, 2 * counts * math.log(2) ** 2, ratio) * floor.size
    chance[: math.ceil(lowest * samples)] = 1.0
    place = int(np.argmin(chance))
    return place / samples, float(chance[place])


def _fit_sinusoid(series: np.ndarray, start: float) -> tuple[float, np.ndarray]:
    """Frequency [cycles a sample] of the sinusoid near `start`, and its cosine and sine about the series' middle."""
    samples = len(series)
    time = np.arange(samples) - (samples - 1) / 2
    frequency = start
    for _ in range(4):
        cosine, sine = _base(frequency, time).T
        weights = _least_squares(np.column_stack([cosine, sine]), series)
        slope = 2 * np.pi * time * (weights[1] * cosine - weights[0] * sine)
        change = _least_squares(np.column_stack([cosine, sine, slope]), series)[2]
        frequency = float(np.clip(frequency + change, start - 1 / samples, min(start + 1 / samples, 0.5)))
    return frequency, _least_squares(_base(frequency, time), series)


def _base(frequency: float, time: np.ndarray) -> np.ndarray:
    angle = 2 * np.pi * frequency * time
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _least_squares(base: Floats, series: Floats) -> Floats:
    """At half the sample rate one column of the base is zero: its weight, too."""
    return np.linalg.lstsq(base, series, rcond=1e-6)[0]


def _innovations(series: Floats, autoregression: Floats) -> Floats:
    """What an autoregression leaves of a series; what lies before its first sample counts as zero."""
    innovations: Floats = np.convolve(np.concatenate([[1.0], -autoregression]), series)[: len(series)]
    return innovations


def _slope(series: np.ndarray) -> float:
    """Median slope of all pairs of samples (Theil 1950), a sample."""
    first, second = np.triu_indices(len(series), 1)
    return float(np.median((series[second] - series[first]) / (second - first))) if len(series) > 1 else 0.0
