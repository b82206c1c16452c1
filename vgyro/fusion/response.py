"""What a method does to a motion: its gain and delay, measured by adding a known motion to all gyros."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.types import ArrayRates, FilterParameters, Fused

Fuse = Callable[[ArrayRates, FilterParameters], Fused]

ANALYSED = 1 << 16
"""Samples in the middle of which the response is analysed; as many again lie about them."""
FEWEST = 1 << 12
"""Of a shorter stretch no response is taken: simulated noise stands in."""
TONES, NEIGHBOURS = 144, 5
LOWEST, HIGHEST = 2, 0.49
"""Lowest frequency in cycles of the analysed samples, highest in cycles a sample."""
SMALL = 0.1
"""R.m.s. of the sinusoids, and the constant, over that of the gyros' white noise: small, so that a method that is not
linear stays where it works."""
SLOW, FEWEST_SLOW = 0.1, 3
"""The delay is taken below this share of the bandwidth, or at the lowest so many frequencies."""
SEED = 20120207
TINY = 1e-30


@dataclass(frozen=True)
class Response:
    """frequency [F] Hz; gain [F] complex; dc_gain, bandwidth_hz, noise_bandwidth_hz and delay_s as in Fused"""

    frequency: np.ndarray
    gain: np.ndarray
    dc_gain: float
    bandwidth_hz: float
    noise_bandwidth_hz: float
    delay_s: float


def measured_response(
    fuse: Fuse, array: ArrayRates, parameters: FilterParameters, analysed: int = ANALYSED
) -> Response:
    """Gain and delay of a method: it runs on a stretch of the recording with and without an added motion.

    fuse     : the method;  parameters : for it, with the definition of r_t where it has one
    array    : the recording. Its longest gap-free stretch, cut to 2·`analysed` samples, is used; if that is shorter
               than FEWEST, simulated white noise of the array's own N and correlation
    analysed : samples, at most
    returns  : Response. The motion is a constant and TONES sinusoids of equal amplitude, whole cycles of the analysed
               samples each and evenly spaced by the logarithm of their frequency. gain = ratio of the Fourier
               coefficients of (fused with - fused without) and of the motion;  dc_gain, of the means;
               bandwidth_hz, where |gain/dc_gain|² first falls to 1/2, NaN if it does not;
               noise_bandwidth_hz = ∫ |gain/dc_gain|² df from 0 to half the sample rate, NaN without a bandwidth;
               delay_s, d of the phase -d·ω + e·ω³ well below the bandwidth
    raises   : CannotRun, as the method does
    A quarter of the stretch at either end is left out: filters settle there, smoothers at both ends.
    """
    part = _stretch(array, 2 * analysed)
    length = len(part.rate) // 2
    cycles = np.unique(np.rint(np.geomspace(LOWEST, HIGHEST * length, TONES)).astype(int))
    motion, constant = _motion(part.rate, cycles, length)
    still, moved = (fuse(one, parameters).rate for one in (part, _with(part, motion + constant)))
    inside = slice(length // 2, length // 2 + length)
    answer = moved[inside] - still[inside]
    gain = np.fft.rfft(answer)[cycles] / np.fft.rfft(motion[inside])[cycles]
    frequency = cycles * (array.rate_hz / length)
    dc_gain = float(answer.mean() / constant)
    bandwidth, noise_bandwidth = _bandwidths(frequency, np.abs(gain / dc_gain) ** 2, array.rate_hz / 2)
    delay = _delay(frequency, gain / dc_gain, SLOW * bandwidth)
    return Response(frequency, gain, dc_gain, bandwidth, noise_bandwidth, delay)


def _stretch(array: ArrayRates, most: int) -> ArrayRates:
    """The longest gap-free stretch, an even number of samples of it in double precision; or simulated noise."""
    longest = max(array.stretches(), key=lambda part: part.stop - part.start)
    length = min(longest.stop - longest.start, most) // 2 * 2
    if length >= FEWEST:
        part = array.part(slice(longest.start, longest.start + length))
        return replace(part, rate=np.asarray(part.rate, dtype=float, order="F"))
    white = np.random.default_rng(SEED).standard_normal((most, array.rate.shape[1]))
    arw = np.where(np.isfinite(array.noise.arw), array.noise.arw, np.nanmean(np.append(array.noise.arw, 1.0)))
    values, vectors = np.linalg.eigh(array.noise.correlation)
    rate = white @ (vectors * np.sqrt(np.maximum(values, 0))).T * arw * math.sqrt(array.rate_hz)
    segment, at_rest = np.zeros(most, dtype=np.int32), np.ones(most, dtype=bool)
    return replace(array, rate=rate, segment=segment, at_rest=at_rest, weights={})


def _motion(rate: np.ndarray, cycles: np.ndarray, length: int) -> tuple[np.ndarray, float]:
    """The sinusoids [T], `cycles` of them in `length` samples each, at random phases, and the constant; deg/s."""
    size = SMALL * float(np.mean(np.diff(rate, axis=0).std(axis=0))) / math.sqrt(2) or 1.0
    spectrum = np.zeros(length // 2 + 1, dtype=complex)
    spectrum[cycles] = np.exp(2j * math.pi * np.random.default_rng(SEED).random(len(cycles)))
    period = np.fft.irfft(spectrum, length)
    return np.tile(period * (size / period.std()), 2)[: len(rate)], size


def _with(array: ArrayRates, motion: np.ndarray) -> ArrayRates:
    return replace(array, rate=array.rate + motion[:, None])


def _delay(frequency: np.ndarray, gain: np.ndarray, highest: float) -> float:
    """Delay at low frequency, s, of a gain [F] that is 1 at frequency 0, from frequencies up to `highest`, Hz."""
    slow = slice(max(int(np.searchsorted(frequency, highest if math.isfinite(highest) else 0.0)), FEWEST_SLOW))
    angular = 2 * math.pi * frequency[slow]
    powers = np.stack([angular, angular**3], axis=1) / angular[-1]
    return -float(np.linalg.lstsq(powers, np.unwrap(np.angle(gain[slow])), rcond=None)[0][0]) / float(angular[-1])


def _bandwidths(frequency: np.ndarray, power: np.ndarray, highest: float) -> tuple[float, float]:
    """-3 dB bandwidth and noise-equivalent bandwidth, Hz, of a power gain that is 1 at frequency 0; NaN without one.

    Medians of NEIGHBOURS gains are used: of a smooth fall they are the gains; a method that adapts itself adds noise.
    Between the frequencies a cubic spline of the logarithms, below the lowest a parabola, above the highest a constant.
    """
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import median_filter

    power = median_filter(power, NEIGHBOURS, mode="nearest")
    below = np.flatnonzero(power < 0.5)
    if below.size == 0:
        return math.nan, math.nan
    curve = CubicSpline(np.log(frequency), np.log(np.maximum(power, TINY)))
    if below[0] == 0:
        bandwidth = float(frequency[0])
    else:
        crossing = curve.solve(math.log(0.5), extrapolate=False)
        first = np.log(frequency[below[0] - 1])
        bandwidth = math.exp(float(crossing[crossing >= first][0]))
    low, high = np.log(frequency[[0, -1]]).tolist()
    dense = np.linspace(low, high, 32 * len(frequency))
    inside = float(np.trapezoid(np.exp(curve(dense) + dense), dense))
    outside = float((2 + power[0]) / 3 * frequency[0] + power[-1] * (highest - frequency[-1]))
    return bandwidth, inside + outside
