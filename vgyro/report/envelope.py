"""Thinning of long series for plots: minimum and maximum of each bin, so that no spike is lost."""

from __future__ import annotations

import numpy as np

MAX_POINTS = 2000
GAP = 3.0  # times the usual step


def envelope(time: np.ndarray, values: np.ndarray, points: int = MAX_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and maximum of each of points/2 runs of neighbouring samples, in turn, as one zigzag curve.

    time [T], values [T, N] or [T] → time [M], values [M, N] or [M]; M <= points. A short series comes back as it is.
    A run whose values are all NaN gives NaN.
    """
    length = len(time)
    if length <= points:
        return time, values
    edges = np.linspace(0, length, points // 2 + 1).astype(np.int64)[:-1]
    hollow = np.isnan(values)
    low = np.minimum.reduceat(np.where(hollow, np.inf, values), edges, axis=0)
    high = np.maximum.reduceat(np.where(hollow, -np.inf, values), edges, axis=0)
    zigzag = np.stack([low, high], axis=1).reshape(-1, *values.shape[1:])
    zigzag[~np.isfinite(zigzag)] = np.nan
    stops = np.append(edges[1:], length) - 1
    return np.stack([time[edges], time[stops]], axis=1).ravel(), zigzag


def thin(time: np.ndarray, values: np.ndarray, points: int = MAX_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Every k-th sample, the last one included, for curves that change slowly; M <= points."""
    if len(time) <= points:
        return time, values
    chosen = np.linspace(0, len(time) - 1, points).round().astype(np.int64)
    return time[chosen], values[chosen]


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


def stretches(time: np.ndarray, flag: np.ndarray) -> list[tuple[float, float]]:
    """(start, stop) of each run of true values of `flag` [T], in the unit of `time` [T]."""
    padded = np.concatenate([[False], flag.astype(bool), [False]])
    changes = np.flatnonzero(padded[1:] != padded[:-1])
    return [
        (float(time[start]), float(time[stop - 1])) for start, stop in zip(changes[::2], changes[1::2], strict=True)
    ]


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
