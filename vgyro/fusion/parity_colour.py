"""Colour of the noise from the differences between the gyros: its correlation from one sample to the next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vgyro.fusion.array import ArrayRates
from vgyro.fusion.parity_blocks import BlockMoments
from vgyro.fusion.parity_hat import pair_variances

PARTS = 24
PART_SAMPLES = 1 << 16
FEWEST_SAMPLES = 32
"""Samples of a part, at least."""
SIGNIFICANT = 3.0
LARGEST = 0.999


def colour(array: ArrayRates, moments: BlockMoments) -> np.ndarray:
    """φ [N] of each gyro's noise, an AR(1) process: its lag-1 autocovariance over its variance.

    From up to 24 parts of the recording, without their slow part. For two gyros i, j the differences have the lag-k
    autocovariance γ_i(k) + γ_j(k); least squares over all pairs gives each γ_i, and the differences between the parts
    the standard error of φ. 0 where it is not positive by 3 of these, or cannot be told (two gyros: of both together).
    """
    gyros = array.rate.shape[1]
    found = np.array(list(_parts(array, moments)))
    if len(found) < 4:
        return np.zeros(gyros)
    still, moved = (np.array([_shares(found[:, lag].sum(axis=0))]) for lag in (0, 1))
    # Each part left out in turn: the jackknife.
    totals = found.sum(axis=0) - found
    each = np.array([_ratio(_shares(lag0), _shares(lag1)) for lag0, lag1 in totals])
    error = np.sqrt((len(each) - 1) * each.var(axis=0))
    phi = _ratio(still[0], moved[0])
    return np.where(phi > SIGNIFICANT * error, np.clip(phi, 0.0, LARGEST), 0.0)


def _ratio(variance: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    return np.where(variance > 0, covariance / np.where(variance > 0, variance, 1.0), 0.0)


def _shares(square: np.ndarray) -> np.ndarray:
    """Each gyro's part [N] of the second moments [N, N] of the differences: the N-cornered hat, of either sign."""
    gyros = len(square)
    pairs = pair_variances(square)
    total = pairs.sum(axis=1)
    if gyros == 2:
        return total / 2.0
    return (total - total.sum() / (2.0 * (gyros - 1))) / (gyros - 2)


def _parts(array: ArrayRates, moments: BlockMoments) -> Iterator[np.ndarray]:
    """Second moments [2, N, N] of each part, of lag 0 and 1: Σ dd' and Σ (d_t d_{t+1}' + d_{t+1} d_t')/2."""
    good = ~moments.excluded.any(axis=1)
    edges = np.unique(np.linspace(0, len(good), PARTS + 1).astype(np.int64))
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        blocks = np.flatnonzero(good[begin:end]) + begin
        if len(blocks) == 0:
            continue
        # One run of blocks, so that each sample but its last has a next one.
        run = np.split(blocks, np.flatnonzero((np.diff(blocks) > 1) | (np.diff(moments.low[blocks]) > 1)) + 1)
        longest = max(run, key=len)
        first = int(moments.start[longest[0]])
        last = min(int(moments.stop[longest[-1]]), first + PART_SAMPLES)
        if last - first >= FEWEST_SAMPLES:
            yield _of_part(array, moments, slice(first, last))


def _of_part(array: ArrayRates, moments: BlockMoments, rows: slice) -> np.ndarray:
    values = np.array(array.rate[rows].T, dtype=float, order="C")
    values -= values.mean(axis=0)
    block = np.searchsorted(moments.stop, np.arange(rows.start, rows.stop), side="right")
    near = slice(int(block[0]), int(block[-1]) + 1)
    total = np.concatenate([np.zeros((1, len(values))), np.cumsum(moments.mean * moments.size[:, None], axis=0)])
    high, low = moments.high[near] + 1, moments.low[near]
    count = np.concatenate([[0], np.cumsum(moments.size)])
    number = (count[high] - count[low])[:, None]
    slow = (total[high] - total[low]) / number
    values -= slow[block - near.start].T
    still, moved = values @ values.T, values[:, 1:] @ values[:, :-1].T
    samples = values.shape[1]
    # White noise loses 1/number of its variance with the slow part, and as much of every covariance.
    share = float(np.mean(1.0 / number[block - near.start]))
    still = still * samples / (samples * (1.0 - share))
    return np.stack([still, (moved + moved.T) / 2.0 * samples / (samples - 1) + share * still])
