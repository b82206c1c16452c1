"""Weights from second moments of block means: rolling, and exponentially weighted. The baselines that DCC must beat.

The moment is taken about zero, as the `level` definition of r_t does: at rest it holds noise, drift and bias of the
gyro; in motion it holds the motion as well. Where part of a recording is known to be at rest only its blocks count, and
the weights are held through the rest of it. Blocks are counted across gaps; no block reaches over one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.fusion.blocks import SampleWeights
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused

# A moment of fewer blocks is too uncertain to weight by (10 values: a standard deviation of 45 %).
FEWEST_BLOCKS = 10

Moments = Iterator[tuple[np.ndarray, np.ndarray]]
"""For one slice of blocks after the other: second moments [N, B], and how many blocks each is of [B]"""


@dataclass(frozen=True)
class MomentBlocks:
    """The rates in blocks of `size` samples, none of which reaches over a gap.

    rate  : [T, N], deg/s;  size : samples of a block; what is left at the end of a stretch counts as its last block's
    first : [M], first sample of each block;  used : [M] of bool, the block counts in the moments
    block : [T], number of the block of each sample; -1 for a sample in no block
    """

    rate: np.ndarray
    size: int
    first: np.ndarray
    used: np.ndarray
    block: np.ndarray

    def squares(self, blocks: slice) -> np.ndarray:
        """Squares of the block means [N, B]; zero where a block does not count."""
        samples = (self.first[blocks, None] + np.arange(self.size)).ravel()
        means = [column[samples].reshape(-1, self.size).mean(axis=1, dtype=float) for column in self.rate.T]
        return np.where(self.used[blocks], means, 0.0) ** 2


def rolling_moment(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean square of the block means of the last `moment_window_s` before this block."""
    length = max(FEWEST_BLOCKS, round(parameters.moment_window_s * parameters.block_hz))
    blocks = _blocks(array, parameters)
    return _fused(array, parameters, blocks, lambda slices: _rolling(blocks, slices, length))


def ewma_causal(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean of the earlier blocks' squares with weights e^(-age/τ)."""
    blocks, decay = _blocks(array, parameters), Decay.of(parameters)
    return _fused(array, parameters, blocks, lambda slices: _before(blocks, slices, decay))


def ewma_two_sided(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """w_i ∝ 1/m_i², m_i² = mean of all blocks' squares with weights e^(-|age|/τ): it looks ahead."""
    blocks, decay = _blocks(array, parameters), Decay.of(parameters)
    return _fused(array, parameters, blocks, lambda slices: _around(blocks, slices, decay))


def _rolling(blocks: MomentBlocks, slices: list[slice], length: int) -> Moments:
    # Running totals after `behind`, behind + 1, … of the blocks that count: the window reaches back over `length` of
    # those, however long ago they were.
    total, behind = np.zeros((blocks.rate.shape[1], 1)), 0
    for part in slices:
        used = blocks.used[part]
        count = behind + total.shape[1] - 1 + np.cumsum(used) - used
        new = np.cumsum(np.hstack([total[:, -1:], blocks.squares(part)[:, used]]), axis=1)
        total = np.hstack([total, new[:, 1:]])
        first = np.maximum(count - length, 0)
        yield (total[:, count - behind] - total[:, first - behind]) / np.maximum(count - first, 1), count - first
        drop = max(0, total.shape[1] - length - 1)
        total, behind = total[:, drop:], behind + drop


@dataclass(frozen=True)
class Decay:
    """Sums in which a block counts `keep` to the power of its age."""

    keep: float
    low_pass: Callable[[np.ndarray, float, float, float], np.ndarray]

    @classmethod
    def of(cls, parameters: FilterParameters) -> Decay:
        """Time constant `ewma_time_s`."""
        keep = math.exp(-1.0 / (parameters.block_hz * parameters.ewma_time_s))
        return cls(keep, engines.get(parameters.engine).kalman.low_pass)

    def sums(self, blocks: MomentBlocks, part: slice, start: np.ndarray, back: bool = False) -> np.ndarray:
        """Exponentially weighted sums over the blocks before each block, or from it on.

        blocks : the rates in blocks;  part : B of the blocks, in order
        start  : [N + 1], the sums over what lies on the far side of the part, carried in
        back   : False sums the blocks before block k, the nearest at age 0; True sums block k and all after it
        returns : [N + 1, B + 1]. Column k holds, for each of the N gyros, the sum of keep^age times the squares of the
                  block means, (deg/s)², and in the last row the sum of keep^age itself
        """
        values = np.vstack([blocks.squares(part), blocks.used[part]])
        rows = values[:, ::-1] if back else values
        sums = np.column_stack(
            [start, [self.low_pass(row, self.keep, 1.0, float(s)) for row, s in zip(rows, start, strict=True)]]
        )
        return sums[:, ::-1] if back else sums


def _before(blocks: MomentBlocks, slices: list[slice], decay: Decay) -> Moments:
    past, known = np.zeros(blocks.rate.shape[1] + 1), 0
    for part in slices:
        sums = decay.sums(blocks, part, past)
        number = known + np.cumsum(blocks.used[part]) - blocks.used[part]
        yield sums[:-1, :-1] / _positive(sums[-1, :-1]), number
        past, known = sums[:, -1], known + int(blocks.used[part].sum())


def _around(blocks: MomentBlocks, slices: list[slice], decay: Decay) -> Moments:
    past = np.zeros(blocks.rate.shape[1] + 1)
    # The sums over all blocks after each part, from the last part to the first; copies, so that nothing else is kept.
    futures = [past]
    for part in reversed(slices[1:]):
        futures.append(decay.sums(blocks, part, futures[-1], back=True)[:, 0].copy())
    known = int(blocks.used.sum())
    for part, future in zip(slices, reversed(futures), strict=True):
        before, after = decay.sums(blocks, part, past), decay.sums(blocks, part, future, back=True)
        sums = before[:, 1:] + decay.keep * after[:, 1:]
        yield sums[:-1] / _positive(sums[-1]), np.full(sums.shape[1], known)
        past = before[:, -1]


def _positive(mass: np.ndarray) -> np.ndarray:
    return np.where(mass > 0, mass, 1.0)


def _blocks(array: ArrayRates, parameters: FilterParameters) -> MomentBlocks:
    size = max(1, round(array.rate_hz / parameters.block_hz))
    standing = array.at_rest if array.at_rest.any() else np.ones(len(array.rate), dtype=bool)
    block, number = np.full(len(array.rate), -1, dtype=np.int32), 0
    first, used = [np.empty(0, dtype=np.int32)], [np.empty(0, dtype=bool)]
    for part in array.stretches():
        count = (part.stop - part.start) // size
        if count == 0:
            continue
        whole = slice(part.start, part.start + count * size)
        first.append(np.arange(whole.start, whole.stop, size, dtype=np.int32))
        used.append(np.all(standing[whole].reshape(count, size), axis=1))
        block[whole] = np.repeat(np.arange(number, number + count, dtype=np.int32), size)
        number += count
        block[whole.stop : part.stop] = number - 1
    blocks = MomentBlocks(array.rate, size, np.concatenate(first), np.concatenate(used), block)
    if blocks.used.sum() < FEWEST_BLOCKS:
        raise CannotRun(
            f"fewer than {FEWEST_BLOCKS} blocks of {1.0 / parameters.block_hz:g} s",
            remedy="a longer recording is needed",
        )
    return blocks


def _fused(
    array: ArrayRates, parameters: FilterParameters, blocks: MomentBlocks, moments: Callable[[list[slice]], Moments]
) -> Fused:
    """Fuse with weights ∝ 1/moment of each block; equal weights where fewer than FEWEST_BLOCKS blocks are known."""

    def rows(slices: list[slice]) -> Iterator[np.ndarray]:
        return (_inverse(moment, number) for moment, number in moments(slices))

    weights = SampleWeights(blocks.block, rows, array.rate.shape[1])
    fused, equal = weights.combine(array.rate)
    notes = []
    if parameters.in_motion and not array.at_rest.any():
        notes.append("in motion the second moment holds the motion: these are not the weights of the noise")
    elif parameters.in_motion:
        notes.append("moments of the rest stretches only; weights are held through the motion")
    if equal > 0:
        few = f"fewer than {FEWEST_BLOCKS} blocks were known, or all their moments are the same"
        notes.append(f"equal weights for {equal:.1%} of the samples: {few}")
    return Fused.undelayed(fused, weights, "; ".join(notes))


def _inverse(moment: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Weights [B, N] ∝ 1/moment [N, B]; number [B] of blocks that the moments are of."""
    # A moment of exactly zero is a dead channel, not a perfect gyro.
    alive = (moment > 0) & (number >= FEWEST_BLOCKS)
    inverse = np.where(alive, 1.0 / np.where(alive, moment, 1.0), 0.0)
    total = inverse.sum(axis=0)
    return np.where(total > 0, inverse / _positive(total), 1.0 / len(moment)).T
