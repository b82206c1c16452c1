"""Colour of the noise from the differences between the gyros: its correlation from one sample to the next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.noise.cornered_hat import pair_variances, patterns
from vgyro.fusion.noise.difference_blocks import BlockMoments
from vgyro.fusion.types import ArrayRates

PARTS = 24
FEWEST_PARTS = 4
PART_SAMPLES = 1 << 16
FEWEST_SAMPLES = 32
"""Samples of a part, at least."""
SIGNIFICANT = 3.0
MOST_WEIGHT = 0.5
LARGEST = 0.999


def colour(array: ArrayRates, moments: BlockMoments, variance: np.ndarray) -> np.ndarray:
    """φ [N] of each gyro's noise, an AR(1) process: its lag-1 autocovariance over its variance.

    variance [N] : (deg/s)², about that of the noise
    From up to 24 parts of the recording, without their slow part. The residual e = A·y, A = I - 1u', has the lag-k
    autocovariances (A∘A)·γ(k) of γ_i(k), those of the gyros: a linear system; the jackknife over the parts has the
    standard error of φ. 0 where φ is not positive by 3 of these. Two gyros: of both together.
    """
    phi = np.zeros(array.rate.shape[1])
    missing = np.ones(len(phi), dtype=bool)
    # The most frequent sets of good gyros first, until each gyro was in one.
    for excluded, good in sorted(patterns(moments.excluded), key=lambda one: -len(one[1])):
        kept = np.flatnonzero(~excluded)
        if missing[kept].any() and len(kept) > 1:
            found = _significant(np.array(list(_parts(array, moments, good, kept))), _weights(variance[kept]))
            phi[kept] = np.where(missing[kept], found, phi[kept])
            missing[kept] = False
    return phi


def _significant(parts: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """φ [K] from the second moments [P, 2, K, K] of the parts."""
    if len(parts) < FEWEST_PARTS:
        return np.zeros(len(weights))
    # Each part left out in turn: the jackknife.
    totals = parts.sum(axis=0) - parts
    each = np.array([_ratio(*_shares(one, weights)) for one in totals])
    error = np.sqrt((len(each) - 1) * each.var(axis=0))
    phi = _ratio(*_shares(parts.sum(axis=0), weights))
    return np.where(phi > SIGNIFICANT * error, np.clip(phi, 0.0, LARGEST), 0.0)


def _ratio(variance: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    return np.where(variance > 0, covariance / np.where(variance > 0, variance, 1.0), 0.0)


def _weights(variance: Floats) -> Floats:
    """Weights [N] of the first-pass rate, ∝ 1/variance, none above a half: a gyro's residual must show the gyro."""
    weights = 1.0 / variance / np.sum(1.0 / variance)
    small = weights < MOST_WEIGHT
    kept = np.minimum(weights, MOST_WEIGHT)
    limited: Floats = kept + (1.0 - kept.sum()) * small / max(int(small.sum()), 1)
    return limited


def _shares(square: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The gyros' own autocovariances [2, N] of lag 0 and 1 from the second moments [2, N, N] of the differences."""
    gyros = len(weights)
    if gyros == 2:
        return np.repeat(pair_variances(square)[:, 0, 1:] / 2.0, 2, axis=1)
    A = np.eye(gyros) - weights
    return np.linalg.solve(A**2, np.einsum("ij,ljk,ik->il", A, square, A)).T


def _parts(array: ArrayRates, moments: BlockMoments, good: np.ndarray, kept: np.ndarray) -> Iterator[np.ndarray]:
    """Second moments [2, K, K] of each part, of lag 0 and 1: Σ dd' and Σ (d_t d_{t+1}' + d_{t+1} d_t')/2.

    good : numbers of the blocks to use, in order;  kept [K] : the gyros
    """
    for blocks in np.array_split(good, PARTS):
        if len(blocks) == 0:
            continue
        # One run of blocks, so that each sample but its last has a next one.
        run = np.split(blocks, np.flatnonzero((np.diff(blocks) > 1) | (np.diff(moments.low[blocks]) > 1)) + 1)
        longest = max(run, key=len)
        first = int(moments.start[longest[0]])
        last = min(int(moments.stop[longest[-1]]), first + PART_SAMPLES)
        if last - first >= FEWEST_SAMPLES:
            yield _of_part(array, moments, slice(first, last), kept)


def _of_part(array: ArrayRates, moments: BlockMoments, rows: slice, kept: np.ndarray) -> np.ndarray:
    values = np.array(array.rate[rows].T, dtype=float, order="C")
    values -= values.mean(axis=0)
    values = values[kept]
    block = np.searchsorted(moments.stop, np.arange(rows.start, rows.stop), side="right")
    near = slice(int(block[0]), int(block[-1]) + 1)
    total = np.concatenate(
        [np.zeros((1, len(values))), np.cumsum(moments.mean[:, kept] * moments.size[:, None], axis=0)]
    )
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
