"""Where two streams may lie over each other: peaks of their correlation, for a grid of drifts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import fft, ndimage

from vgyro.alignment.blocks import BLOCK_S
from vgyro.alignment.pair import ClockRelation
from vgyro.alignment.streams import Band

PIECE_S = 600.0
MOST_PIECES = 4
SMEAR_S = 0.05  # the most by which the drift, between two of the grid, moves the ends of a piece
LEAST_OVERLAP_S = 5.0
PEAKS = 10
NEAR_S = 0.1  # peaks of different drifts that are one


class LineCandidate(NamedTuple):
    """A line to start from, and the part of the reference, s, in which it was found."""

    line: ClockRelation
    start_s: float
    stop_s: float
    score: float


class LineSearch(NamedTuple):
    """What was found, and among how many lags and drifts."""

    candidates: list[LineCandidate]
    tried: int


def search(reference: Band, other: Band, most_offset_s: float, most_drift: float) -> LineSearch:
    """Candidates for the line between two bands, the best first.

    most_offset_s : most by which one stream begins after the other; most_drift : of the clocks, a ratio
    The pieces of the reference (ten minutes) that move most, over all of the other, by FFT, the correlation normalised
    by the power of both in the overlap. The score is the log likelihood ratio for white noise.
    """
    step = reference.step_s
    x, x_good = _grid(reference, 0.0, step)
    found: list[LineCandidate] = []
    tried = 0
    for start, stop in _pieces(x, round(PIECE_S / step)):
        drifts = _drifts((stop - start) * step, most_drift)
        peaks: list[LineCandidate] = []
        for drift in drifts:
            y, y_good = _grid(other, drift, step)
            lags, scores = _scores(x[start:stop], x_good[start:stop], y, y_good, step)
            shift = (lags - start) * step
            scores[np.abs(shift) > most_offset_s] = 0.0
            tried += int(np.count_nonzero(scores))
            centre = (start + stop) / 2 * step
            for peak in _peaks(scores):
                line = ClockRelation(centre, (centre + shift[peak]) * (1 + drift) - centre, drift)
                peaks.append(LineCandidate(line, start * step, stop * step, float(scores[peak])))
        found += _merged(peaks)
    return LineSearch(sorted(found, key=lambda c: -c.score), max(tried, 1))


def _drifts(seconds: float, most: float) -> np.ndarray:
    count = math.ceil(most * seconds / 2 / SMEAR_S)
    return np.linspace(-most, most, 2 * count + 1) if count else np.zeros(1)


def _grid(band: Band, drift: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """A band on an even grid from time 0, as a clock without that drift would read, and where it is known.

    Slow drift of the gyro is removed.
    """
    time = np.arange(0.0, band.time[-1] / (1 + drift), step) * (1 + drift)
    after = np.clip(np.searchsorted(band.time, time), 1, len(band.time) - 1)
    good = (band.segment[after] == band.segment[after - 1]) & (time >= band.time[0])
    values = np.where(good, np.interp(time, band.time, band.rate), 0.0)
    width = min(round(BLOCK_S / step), len(time))
    share = ndimage.uniform_filter1d(good.astype(float), width, mode="constant")
    level = ndimage.uniform_filter1d(values, width, mode="constant") / np.maximum(share, 1e-9)
    return np.where(good, values - level, 0.0), good


def _pieces(x: np.ndarray, length: int) -> list[tuple[int, int]]:
    if len(x) <= 1.5 * length:
        return [(0, len(x))]
    edges = np.linspace(0, len(x), round(len(x) / length) + 1).astype(int)
    power = np.add.reduceat(x**2, edges[:-1])
    chosen = np.sort(np.argsort(-power)[:MOST_PIECES])
    return [(int(edges[k]), int(edges[k + 1])) for k in chosen]


def _scores(
    x: np.ndarray, x_good: np.ndarray, y: np.ndarray, y_good: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Lags in samples (y index less x index) and the score of each."""
    size = fft.next_fast_len(len(x) + len(y), real=True)
    conj = [np.conj(fft.rfft(v, size)) for v in (x, x**2, x_good.astype(float))]
    plain = [fft.rfft(v, size) for v in (y, y_good.astype(float), y**2)]
    cross, x_power, y_power = (fft.irfft(a * b, size) for a, b in zip(conj, plain, strict=True))
    overlap = fft.irfft(conj[2] * plain[1], size)
    lags = np.arange(1 - len(x), len(y))
    cross, x_power, y_power, overlap = (
        np.concatenate((v[1 - len(x) :], v[: len(y)])) if len(x) > 1 else v[: len(y)]
        for v in (cross, x_power, y_power, overlap)
    )
    tiny = 1e-9 * max(float(x_power.max(initial=0)), float(y_power.max(initial=0)), 1e-100)
    square = np.clip(cross**2 / np.maximum(x_power * y_power, tiny**2), 0.0, 1 - 1e-9)
    return lags, np.where(overlap * step >= LEAST_OVERLAP_S, -overlap * np.log1p(-square), 0.0)


def _peaks(scores: np.ndarray) -> np.ndarray:
    inner = scores[1:-1]
    tops = np.flatnonzero((inner > 0) & (inner >= scores[:-2]) & (inner > scores[2:])) + 1
    return tops[np.argsort(-scores[tops])[:PEAKS]]


def _merged(peaks: list[LineCandidate]) -> list[LineCandidate]:
    kept: list[LineCandidate] = []
    for peak in sorted(peaks, key=lambda c: -c.score):
        if all(abs(peak.line.lag_s - other.line.lag_s) > NEAR_S for other in kept):
            kept.append(peak)
    return kept[:PEAKS]
