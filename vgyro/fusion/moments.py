"""Weights from second moments of block means: rolling, and exponentially weighted. The baselines that DCC must beat.

The moment is taken about zero, as the `level` definition of r_t does: at rest it holds noise, drift and bias of the
gyro; in motion it holds the motion as well. Where part of a recording is known to be at rest only its blocks count, and
the weights are held through the rest of it. Blocks are counted across gaps; no block reaches over one.
"""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused
from vgyro.fusion.weights import expand_weights

# A moment of fewer blocks is too uncertain to weight by (10 values: a standard deviation of 45 %).
FEWEST_BLOCKS = 10


def rolling_moment(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean square of the block means of the last `moment_window_s` before this block."""
    means, block, used = _blocks(array, parameters)
    length = max(FEWEST_BLOCKS, round(parameters.moment_window_s * parameters.block_hz))
    total = np.vstack([np.zeros(means.shape[1]), np.cumsum(np.where(used[:, None], means, 0.0) ** 2, axis=0)])
    count = np.concatenate([[0], np.cumsum(used)])
    # The window reaches back over `length` used blocks, however long ago they were.
    first = np.searchsorted(count, count[:-1] - length, side="left")
    first = np.where(count[:-1] <= length, 0, first)
    number = count[:-1] - count[first]
    moment = (total[:-1] - total[first]) / np.maximum(number, 1)[:, None]
    return _weighted(array, parameters, moment, number, block)


def ewma_causal(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean of the earlier blocks' squares with weights e^(-age/τ)."""
    means, block, used = _blocks(array, parameters)
    total, mass = _decayed(means**2, used, _keep(parameters))
    number = np.concatenate([[0], np.cumsum(used)[:-1]])
    return _weighted(array, parameters, total[:-1] / _positive(mass[:-1]), number, block)


def ewma_two_sided(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean of all blocks' squares with weights e^(-|age|/τ): it looks ahead."""
    means, block, used = _blocks(array, parameters)
    keep = _keep(parameters)
    past, past_mass = _decayed(means**2, used, keep)
    future, future_mass = _decayed((means**2)[::-1], used[::-1], keep)
    total = past[1:] + keep * future[::-1][1:]
    mass = past_mass[1:] + keep * future_mass[::-1][1:]
    return _weighted(array, parameters, total / _positive(mass), np.full(len(means), used.sum()), block)


def _keep(parameters: FilterParameters) -> float:
    return math.exp(-1.0 / (parameters.block_hz * parameters.ewma_time_s))


def _decayed(square: np.ndarray, used: np.ndarray, keep: float) -> tuple[np.ndarray, np.ndarray]:
    """Σ keep^(age)·square [M+1, N] and Σ keep^(age) [M+1, 1]; row k holds the blocks before k, the last at age 0."""
    from scipy.signal import lfilter

    columns = np.column_stack([np.where(used[:, None], square, 0.0), used.astype(float)])
    decayed = np.vstack([np.zeros(columns.shape[1]), lfilter([1.0], [1.0, -keep], columns, axis=0)])
    return decayed[:, :-1], decayed[:, -1:]


def _positive(mass: np.ndarray) -> np.ndarray:
    return np.where(mass > 0, mass, 1.0)


def _blocks(array: ArrayRates, parameters: FilterParameters) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Block means [M, N], block of each sample [T], blocks that count [M]; a remainder is of the last block."""
    size = max(1, round(array.rate_hz / parameters.block_hz))
    means, used, block, number = [], [], np.full(len(array.rate), -1), 0
    standing = array.at_rest if array.at_rest.any() else np.ones(len(array.rate), dtype=bool)
    for part in array.stretches():
        count = (part.stop - part.start) // size
        if count == 0:
            continue
        whole = slice(part.start, part.start + count * size)
        means.append(array.rate[whole].reshape(count, size, -1).mean(axis=1))
        used.append(standing[whole].reshape(count, size).all(axis=1))
        block[part] = number + np.minimum(np.arange(part.stop - part.start) // size, count - 1)
        number += count
    if sum(int(part.sum()) for part in used) < FEWEST_BLOCKS:
        raise CannotRun(
            f"fewer than {FEWEST_BLOCKS} blocks of {1.0 / parameters.block_hz:g} s",
            remedy="a longer recording is needed",
        )
    return np.vstack(means), block, np.concatenate(used)


def _weighted(
    array: ArrayRates, parameters: FilterParameters, moment: np.ndarray, number: np.ndarray, block: np.ndarray
) -> Fused:
    """Fuse with weights ∝ 1/moment of each block; equal weights where fewer than FEWEST_BLOCKS blocks are known."""
    size = moment.shape[1]
    # A moment of exactly zero is a dead channel, not a perfect gyro.
    alive = (moment > 0) & (number >= FEWEST_BLOCKS)[:, None]
    inverse = np.where(alive, 1.0 / np.where(alive, moment, 1.0), 0.0)
    total = inverse.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, inverse / _positive(total), 1.0 / size)
    sample_weights = expand_weights(weights, block)
    notes = []
    if parameters.in_motion and not array.at_rest.any():
        notes.append("in motion the second moment holds the motion: these are not the weights of the noise")
    elif parameters.in_motion:
        notes.append("moments of the rest stretches only; weights are held through the motion")
    equal = float(np.mean(np.append(~alive.any(axis=1), True)[block]))
    if equal > 0:
        notes.append(f"equal weights for {equal:.1%} of the samples: fewer than {FEWEST_BLOCKS} blocks were known")
    return Fused(np.einsum("tn,tn->t", array.rate, sample_weights), sample_weights, note="; ".join(notes))
