"""Weighted sums of the gyros, a piece of the recording at a time; weights are fixed or change from block to block.

No [T, N] array is ever made here: a day at 200 Hz has 17 million samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

PIECE = 1 << 16
"""Samples at a time: few enough to stay in the cache."""


def combined(rate: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Σ w_i·y_i in double precision: rate [T, N] of any precision, weights [N] or [T, N] → [T]."""
    fused = np.zeros(len(rate))
    for start in range(0, len(rate), PIECE):
        rows = slice(start, start + PIECE)
        for gyro in range(rate.shape[1]):
            share = weights[gyro] if weights.ndim == 1 else weights[rows, gyro]
            fused[rows] += np.multiply(rate[rows, gyro], share, dtype=float)
    return fused


@dataclass(frozen=True)
class SampleWeights:
    """Weights that change with time: those of blocks of samples.

    block : array [T] of int, number of the block that each sample lies in; it never falls, but for -1: in no block
    rows  : slices of blocks, in order and without a hole → one after the other the weights [B, N] of each
    gyros : N
    A sample in no block has equal weights.
    """

    block: np.ndarray
    rows: Callable[[list[slice]], Iterator[np.ndarray]]
    gyros: int

    @classmethod
    def of(cls, weights: np.ndarray, block: np.ndarray) -> SampleWeights:
        """Weights [M, N] of all blocks."""
        return cls(block, lambda slices: (weights[blocks] for blocks in slices), weights.shape[1])

    def part(self, samples: slice) -> SampleWeights:
        """The weights of some of the samples, first to last - 1."""
        block = self.block[samples]
        inside = block[block >= 0]
        first = int(inside[0]) if inside.size else 0

        def rows(slices: list[slice]) -> Iterator[np.ndarray]:
            return self.rows([slice(one.start + first, one.stop + first) for one in slices])

        return SampleWeights(np.where(block >= 0, block - first, block), rows, self.gyros)

    def pieces(self) -> Iterator[np.ndarray]:
        """Weights [n, N] of the samples, piece by piece."""
        parts = list(cut(self.block))
        for (samples, blocks), weights in zip(parts, self.rows([blocks for _, blocks in parts]), strict=True):
            # The last column is for the samples in no block, whose number -1 - blocks.start becomes -1.
            table = np.full((self.gyros, len(weights) + 1), 1.0 / self.gyros)
            table[:, :-1] = weights.T
            yield table[:, np.maximum(self.block[samples] - blocks.start, -1)].T

    def combine(self, rate: np.ndarray) -> tuple[np.ndarray, float]:
        """Σ w_i(t)·y_i(t) [T] of the rates [T, N], and the share of samples whose weights are equal."""
        fused, equal, first = np.empty(len(rate)), 0, 0
        for weights in self.pieces():
            rows = slice(first, first + len(weights))
            fused[rows] = combined(rate[rows], weights)
            equal += int((weights == weights[:, :1]).all(axis=1).sum())
            first = rows.stop
        return fused, equal / len(rate)


def cut(block: np.ndarray) -> Iterator[tuple[slice, slice]]:
    """Pieces of samples, none of which cuts a block, and the blocks that lie in each."""
    start, first = 0, 0
    while start < len(block):
        stop = min(start + PIECE, len(block))
        while stop < len(block) and block[stop] == block[stop - 1] >= 0:
            stop += 1
        last = max(first, int(block[start:stop].max()) + 1)
        yield slice(start, stop), slice(first, last)
        start, first = stop, last


def block_of_sample(time: np.ndarray, block_time: np.ndarray, block_s: float, rate_hz: float) -> np.ndarray:
    """Number of the block that each sample lies in, -1 for none: array [T] of int32.

    time       : [T] of the samples, increasing, s
    block_time : [M], time of each block's first sample, increasing, s
    block_s    : length of a block, s
    """
    block = np.full(len(time), -1, dtype=np.int32)
    for start in range(0, len(time) if len(block_time) else 0, PIECE):
        # Half a sample keeps the rounding of time stamps away from the borders.
        late = time[start : start + PIECE] + 0.5 / rate_hz
        # Only the blocks near this piece are searched.
        low, high = np.searchsorted(block_time, late[[0, -1]], side="right")
        near = max(0, low - 1)
        index = near + np.searchsorted(block_time[near:high], late, side="right") - 1
        inside = (index >= 0) & (late - block_time[np.maximum(index, 0)] < block_s)
        block[start : start + PIECE][inside] = index[inside]
    return block
