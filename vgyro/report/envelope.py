"""Thinning of long series for plots: minimum and maximum of each bin, so that no spike is lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vgyro.runs import true_runs

MAX_POINTS = 2000
GAP = 3.0  # times the usual step


class Envelope:
    """Minimum and maximum of each of points/2 runs of neighbouring samples, in turn, as one zigzag curve.

    length : samples of the whole series, which comes in pieces and is never held;  columns : names of its columns
    A short series comes back as it is. A run whose values are all NaN gives NaN.
    """

    def __init__(self, length: int, columns: Sequence[str], points: int = MAX_POINTS) -> None:
        count = length if length <= points else points // 2
        self._edges = np.linspace(0, length, count + 1).astype(np.int64)
        self._whole = length <= points
        self._done = 0
        self._first, self._last = np.zeros(count), np.zeros(count)
        self._low = {name: np.full(count, np.inf) for name in columns}
        self._high = {name: np.full(count, -np.inf) for name in columns}

    def feed(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Take the next samples: time [P] and every column [P]."""
        if not len(time):
            return
        begin, end = self._done, self._done + len(time)
        first = int(np.searchsorted(self._edges, begin, side="right")) - 1
        stop = int(np.searchsorted(self._edges, end, side="left"))
        bins = slice(first, stop)
        starts = np.maximum(self._edges[bins], begin) - begin
        opened = self._edges[bins] >= begin
        self._first[bins][opened] = time[starts[opened]]
        ends = np.minimum(self._edges[first + 1 : stop + 1], end) - begin
        self._last[bins] = time[ends - 1]
        for name, low in self._low.items():
            values = np.asarray(columns[name], dtype=float)
            # fmin and fmax pass over NaN, which only the slower of the two ways needs.
            least, most = (np.fmin, np.fmax) if np.isnan(values).any() else (np.minimum, np.maximum)
            low[bins] = np.fmin(low[bins], least.reduceat(values, starts))
            self._high[name][bins] = np.fmax(self._high[name][bins], most.reduceat(values, starts))
        self._done = end

    def result(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """time [M] and each column [M]; M <= points."""
        if self._whole:
            return self._first, {name: _finite(low) for name, low in self._low.items()}
        zigzag = {name: _finite(np.stack([low, self._high[name]], axis=1).ravel()) for name, low in self._low.items()}
        return np.stack([self._first, self._last], axis=1).ravel(), zigzag


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)


def places_of(length: int, points: int = MAX_POINTS) -> np.ndarray:
    """Numbers of at most `points` samples, evenly spaced, the last one included: for curves that change slowly."""
    return np.linspace(0, length - 1, points).round().astype(np.int64) if length > points else np.arange(length)


def logarithmic(frequency: np.ndarray, values: np.ndarray, points: int = MAX_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and maximum of bins of equal width in log frequency, for a spectrum; frequency > 0 [F], values [F, N]."""
    kept = frequency > 0
    frequency, values = frequency[kept], values[kept]
    if len(frequency) <= points:
        return frequency, values
    edges = np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], points // 2 + 1)[:-1])
    edges = np.unique(edges)
    low, high = np.minimum.reduceat(values, edges, axis=0), np.maximum.reduceat(values, edges, axis=0)
    stops = np.append(edges[1:], len(frequency)) - 1
    single = stops == edges
    both = np.stack([low, high], axis=1).reshape(-1, *values.shape[1:])
    at = np.stack([frequency[edges], frequency[stops]], axis=1).ravel()
    # A bin of one sample would give the same point twice.
    keep = np.ones(len(at), dtype=bool)
    keep[1::2][single] = False
    return at[keep], both[keep]


def stretches(flag: np.ndarray) -> list[tuple[int, int]]:
    """First and last place of each run of true values of `flag` [T]."""
    return [(start, stop - 1) for start, stop in true_runs(flag.astype(bool)).tolist()]


def broken(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """NaN put between two points that a gap in time parts, so that no line bridges it. time [T], values [T, N]"""
    step = np.diff(time)
    if not len(step):
        return time, values
    # An envelope's two points of one run may share a time: the usual step is that of two points together.
    after = (
        np.flatnonzero(step > GAP * 2 * np.median(step[step > 0])) + 1 if (step > 0).any() else np.empty(0, np.int64)
    )
    return np.insert(time, after, time[after]), np.insert(values.astype(float), after, np.nan, axis=0)
