"""Absurd samples: so far from the other gyros that not even the tails of this recording's noise reach there."""

from __future__ import annotations

import math

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.faults.candidate import spread
from vgyro.fusion.types import ArrayRates

FEWEST_GYROS, FEWEST_SAMPLES = 3, 1000
TAILS = (0.02, 0.0025)
"""Shares of the samples from which a tail is carried on, by what is left of it after FURTHER times fewer."""
FURTHER = 8.0
THINNEST = 20.0
"""Exponent of a tail, at most."""
ODDS = 1e-6
"""Chance of one such sample in the whole recording, by the tails."""
BY_MOTION = 3.0
"""It is farther off than so many times what the others move within NEAR samples."""
NEAR = 4
JOINED = 3  # samples
PIECE = 1 << 16
MOST_SAMPLED = 100_000


def find_absurd(array: ArrayRates, length: int, gone: np.ndarray | None, floor: np.ndarray) -> list[FaultEvent]:
    """Single samples, or a few in a row, that are absurd, each with its gyro.

    length : of a block, samples: what lasts for half of it is no outlier
    gone [T, N] : samples that are known to be no rates;  floor [N] deg/s : what a sample is off by in any case, a count
    The tail of the distances from the middle gyro, less their median in the block, is carried on as a power law by its
    own quantiles (Hill 1975): noise may have tails as heavy as it likes, as long as all of the recording has them.
    Where most gyros have such samples they belong to the noise.
    """
    samples, gyros = array.rate.shape
    if gyros < FEWEST_GYROS or samples < FEWEST_SAMPLES:
        return []
    away, moved = _distances(array, length, gone)
    limits = np.array([_limit(np.abs(one), samples * gyros, least) for one, least in zip(away, floor, strict=True)])
    limits = np.maximum(limits, np.median(limits[np.isfinite(limits)]) if np.isfinite(limits).any() else math.inf)
    found: list[list[FaultEvent]] = []
    for gyro in range(gyros):
        far = np.flatnonzero(np.abs(away[gyro]) > limits[gyro])
        of_gyro = (_event(gyro, run, away[gyro], moved, float(floor[gyro])) for run in _joined(far))
        found.append([one for one in of_gyro if one is not None and one.stop - one.start <= length // 2])
    if sum(bool(one) for one in found) > gyros / 2:
        return []
    return [event for events in found for event in events]


def _distances(array: ArrayRates, length: int, gone: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Of each gyro from the middle one [N, T], its median in blocks taken off, and the middle one itself [T]."""
    samples, gyros = array.rate.shape
    away, middle = np.empty((gyros, samples), dtype=np.float32), np.empty(samples)
    piece = max(1, PIECE // length) * length
    for first in range(0, samples, piece):
        rows = slice(first, min(first + piece, samples))
        values = np.array(array.rate[rows].T, dtype=float)
        if gone is None or not gone[rows].any():
            middle[rows] = np.median(values, axis=0)
        else:
            values[gone[rows].T] = np.nan
            values[:, np.isnan(values).all(axis=0)] = 0.0
            middle[rows] = np.nanmedian(values, axis=0)
        values -= middle[rows]
        whole = values.shape[1] // length * length
        parts = values[:, :whole].reshape(gyros, -1, length)
        parts -= _medians(parts)
        values[:, whole:] -= _medians(values[:, whole:])
        away[:, rows] = np.nan_to_num(values)
    return away, middle


def _medians(values: np.ndarray) -> np.ndarray:
    """Medians along the last axis of what is known, that axis kept; 0 where nothing is."""
    if values.size == 0 or not np.isnan(values).any():
        return np.median(values, axis=-1, keepdims=True) if values.size else np.zeros((*values.shape[:-1], 1))
    empty = np.isnan(values).all(axis=-1, keepdims=True)
    return np.where(empty, 0.0, np.nanmedian(np.where(empty, 0.0, values), axis=-1, keepdims=True))


def _limit(size: Floats, chances: int, floor: float) -> float:
    """Distance that no sample of the recording reaches by chance, deg/s."""
    limits = []
    for share in TAILS:
        places = [len(size) - 1 - int(share * len(size) / times) for times in (1.0, FURTHER)]
        near, far = (float(one) + floor for one in np.partition(size, places)[places])
        if near <= 0:
            return math.inf
        exponent = min(math.log(FURTHER) / max(math.log(far / near), 1e-9), THINNEST)
        limits.append(near * (share * chances / ODDS) ** (1.0 / exponent))
    limit: float = min(limits)
    return limit


def _joined(places: np.ndarray) -> list[tuple[int, int]]:
    """First sample, and one past the last, of places that lie together."""
    if places.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(places) > JOINED) + 1
    return [(int(part[0]), int(part[-1]) + 1) for part in np.split(places, breaks)]


def _event(gyro: int, run: tuple[int, int], away: np.ndarray, middle: np.ndarray, floor: float) -> FaultEvent | None:
    """The event; None: the board itself jumped then."""
    start, stop = run
    near = middle[max(start - NEAR, 0) : stop + NEAR]
    size = float(away[start + int(np.argmax(np.abs(away[start:stop])))])
    if abs(size) <= BY_MOTION * float(np.ptp(near)):
        return None
    deviation = max(spread(away[:: max(1, len(away) // MOST_SAMPLED)]), floor)
    evidence = abs(size) / deviation if deviation > 0 else math.inf
    return FaultEvent(gyro, "outlier", start, stop, evidence, size, "deg/s")
