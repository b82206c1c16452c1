"""Streams of one clock each, and their low-passed, thinned-out copies on which delays are estimated."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from vgyro.alignment.interpolation import interpolate
from vgyro.arrays import Floats

GAP = 1.5  # periods between two samples: more is a gap
LONGEST_HOLE = 3  # samples that are missing in a row and bridged by a straight line, for the estimate alone
OVERSAMPLING = 5.0  # rate of the thinned series over the cut-off; its stop band begins at twice the cut-off
STOP_DB = 60.0


class AlignedStream(NamedTuple):
    """One gyro, or the mean of one board's gyros, on its own clock.

    time    : array [T], s, readings of its own clock, rising and even between gaps
    rate    : array [T], deg/s; NaN where a sample is missing
    rate_hz : nominal samples a second of that clock
    """

    time: np.ndarray
    rate: np.ndarray
    rate_hz: float


class Band(NamedTuple):
    """A stream below a cut-off frequency.

    time       : array [K], s, on the stream's own clock
    rate       : array [K], deg/s, low-passed (zero phase)
    derivative : array [K], deg/s², of that
    segment    : array [K] int, gap-free stretch; samples of one segment are step_s apart
    step_s     : nominal time between two
    cutoff_hz  : pass band; the stop band begins at twice this
    """

    time: np.ndarray
    rate: np.ndarray
    derivative: np.ndarray
    segment: np.ndarray
    step_s: float
    cutoff_hz: float


def stretches(time: np.ndarray, rate_hz: float) -> np.ndarray:
    """Number of the gap-free stretch of each sample: time [T] s → int [T]. More than 1.5 periods are a gap."""
    steps = np.diff(time)
    return np.concatenate(([0], np.cumsum((steps > GAP / rate_hz) | (steps <= 0))))


def resample(stream: AlignedStream, time: np.ndarray) -> np.ndarray:
    """The stream at other readings of its own clock: time [M] s → array [M], deg/s; NaN in gaps and outside.

    Band-limited, see `interpolate`; a ClockFit turns times of another clock into readings of this one.
    """
    return interpolate(stream.rate, positions(stream, time), stretches(stream.time, stream.rate_hz))


def positions(stream: AlignedStream, time: Floats) -> Floats:
    """Readings of a stream's clock as positions in its samples, for `noise_gain`: [M] s → [M]; NaN outside."""
    places: Floats = np.interp(time, stream.time, np.arange(len(stream.time), dtype=float), left=np.nan, right=np.nan)
    return places


def highest_cutoff(rate_hz: float) -> float:
    """The highest cut-off, Hz, that a stream of this rate allows."""
    return rate_hz / OVERSAMPLING


def low_pass(stream: AlignedStream, cutoff_hz: float) -> Band:
    """A stream below cutoff_hz, at five times that rate or a little more.

    Stamps pass the same filter, so that jitter of stamps averages out. Holes of up to three samples are bridged by a
    straight line; at longer ones, and at gaps, a stretch ends. A stretch shorter than the filter gives nothing.
    """
    factor = max(int(stream.rate_hz / (OVERSAMPLING * cutoff_hz)), 1)
    taps, slopes = _filters(cutoff_hz / stream.rate_hz)
    half = len(taps) // 2
    parts = []
    for number, (start, stop) in enumerate(_usable(stream)):
        if stop - start < 2 * half + 1:
            continue
        centres = np.arange(start + half, stop - half, factor)
        nominal = np.arange(stop - start) / stream.rate_hz
        stamps = stream.time[start:stop] - stream.time[start]
        rate = _filled(stream.rate[start:stop])
        level = rate.mean()
        late = _thin(taps, stamps - nominal, factor, len(centres)) + nominal[half : half + 1]
        time = stream.time[start] + late + np.arange(len(centres)) * factor / stream.rate_hz
        smooth = _thin(taps, rate - level, factor, len(centres)) + level
        slope = _thin(slopes, rate - level, factor, len(centres)) * stream.rate_hz
        parts.append((time, smooth, slope, np.full(len(centres), number)))
    joined = [np.concatenate(columns) for columns in zip(*parts, strict=True)] if parts else [np.zeros(0)] * 4
    time, smooth, slope, segment = joined
    return Band(time, smooth, slope, segment.astype(np.int64), factor / stream.rate_hz, cutoff_hz)


def _filters(cutoff: float) -> tuple[np.ndarray, np.ndarray]:
    """Taps of the low pass and of its derivative by the sample; cutoff in cycles a sample."""
    from scipy import signal

    count, beta = signal.kaiserord(STOP_DB, 2 * cutoff)
    count += 1 - count % 2
    taps = signal.firwin(count, min(1.5 * cutoff, 0.45), window=("kaiser", beta), fs=1.0)
    # The derivative of a band-limited sequence is exact in the frequency domain; beyond the taps it is nearly nothing.
    padded = np.pad(taps, 4 * count)
    turns = 2j * np.pi * np.fft.rfftfreq(len(padded))
    slopes = np.fft.irfft(np.fft.rfft(padded) * turns, len(padded))[4 * count : 5 * count]
    slopes -= slopes[::-1]
    return taps, -slopes / (slopes @ np.arange(count))


def _thin(taps: Floats, values: Floats, factor: int, count: int) -> Floats:
    """Filtered values at every factor-th sample at which the filter lies within the stretch."""
    from scipy import signal

    skip = len(taps) - 1
    if factor == 1:
        thinned: Floats = signal.oaconvolve(values, taps, mode="valid")[:count]
        return thinned
    start = -skip % factor  # zeros in front, so that the first whole window falls on a kept sample
    out = signal.upfirdn(taps, np.concatenate((np.zeros(start), values)), 1, factor)
    first = (skip + start) // factor
    thinned = out[first : first + count]
    return thinned


def _usable(stream: AlignedStream) -> list[tuple[int, int]]:
    """Stretches without gaps and without long holes, from a good sample to a good sample."""
    good = np.isfinite(stream.rate) & np.isfinite(stream.time)
    kept = np.flatnonzero(good)
    if not len(kept):
        return []
    segment = stretches(np.where(np.isfinite(stream.time), stream.time, -np.inf), stream.rate_hz)[kept]
    cuts = np.flatnonzero((np.diff(kept) > LONGEST_HOLE + 1) | (np.diff(segment) != 0)) + 1
    edges = [0, *cuts.tolist(), len(kept)]
    return [(int(kept[a]), int(kept[b - 1]) + 1) for a, b in itertools.pairwise(edges)]


def _filled(rate: np.ndarray) -> np.ndarray:
    rate = np.asarray(rate, dtype=float)
    bad = ~np.isfinite(rate)
    if bad.any():
        index = np.arange(len(rate))
        rate = np.where(bad, np.interp(index, index[~bad], rate[~bad]), rate)
    return rate
