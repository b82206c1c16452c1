"""Means over slots of an even time grid, of which some have no sample: of the samples that are there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Ints
from vgyro.engine.protocols.noise import AllanEngine

PRESENT_TENTHS = 9
"""A mean counts where so many tenths of its samples are there."""
SINGLE = np.array([1, 2, 4, 8])
"""Averaging factors that the variance of single samples is read from."""
MOST_BLOCKS = 1 << 20
PIECE = 1 << 12


@dataclass(frozen=True)
class SlotSums:
    """Sums of P = slots + S borders of slots, S stretches one after another.

    total [P] or [P, N] : sum of the samples before each border, about the mean of its stretch
    have [P] int32      : how many there are;  edges [S + 1] : first slot of each stretch, and one past the last slot
    """

    total: np.ndarray
    have: np.ndarray
    edges: np.ndarray

    @classmethod
    def of(cls, rate: np.ndarray, slot: np.ndarray, edges: np.ndarray, allan: AllanEngine) -> SlotSums:
        """rate [T] or [T, N], deg/s; slot [T] int, rising; edges [S + 1] in slots; allan: that module of an engine."""
        if rate.ndim == 1:
            total, have = allan.slot_sums(rate, slot, edges)
            return cls(total, have, edges)
        columns = [allan.slot_sums(np.ascontiguousarray(column), slot, edges) for column in rate.T]
        return cls(np.column_stack([total for total, _ in columns]), columns[0][1], edges)

    def differences(self, factor: int, stride: int, share: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Differences of adjacent means over `factor` slots.

        stride  : slots from one to the next;  share : stretches of less than share·factor slots are left out
        returns : d [n] or [n, N] deg/s; excess [n], (1/n₁ + 1/n₂ - 2/m)/2 of n₁ and n₂ samples that are there; number
                  there would be without a loss
        """
        slots = np.diff(self.edges)
        number = np.where(slots >= max(share, 2) * factor, (slots - 2 * factor) // stride + 1, 0)
        have = [_at(self.have, self.edges, number, stride, part * factor) for part in range(3)]
        before, after = have[1] - have[0], have[2] - have[1]
        need = (PRESENT_TENTHS * factor + 9) // 10
        good = (before >= need) & (after >= need)
        weights = 1.0 / before[good], 1.0 / after[good]
        total = [_at(self.total, self.edges, number, stride, part * factor)[good] for part in range(3)]
        columns = (-1, *[1] * (self.total.ndim - 1))
        d = (total[2] - total[1]) * weights[1].reshape(columns) - (total[1] - total[0]) * weights[0].reshape(columns)
        return d, (weights[0] + weights[1]) / 2 - 1 / factor, len(good)

    def block_means(self, factor: int) -> tuple[np.ndarray, np.ndarray]:
        """Means of adjacent blocks of `factor` slots that have half of their samples, about those of their stretches.

        returns : means [b]; edges [R + 1] of the runs of adjacent ones, and b
        Of more than a million blocks, pieces of 4096, evenly spread, stand for all.
        """
        number = np.diff(self.edges) // factor
        every = max(1, -(-int(number.sum()) // MOST_BLOCKS))
        pieces = -(-number // PIECE)
        stretch = np.repeat(np.arange(len(number)), pieces)
        piece = np.arange(int(pieces.sum())) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        stretch, piece = stretch[::every], piece[::every]
        within = (piece[:, None] * PIECE + np.arange(PIECE)).ravel()
        stretch = np.repeat(stretch, PIECE)
        inside = within < number[stretch]
        stretch, within = stretch[inside], within[inside]
        at = self.edges[stretch] + stretch + within * factor
        have = self.have[at + factor] - self.have[at]
        good = 2 * have >= factor
        means = (self.total[at + factor] - self.total[at])[good] / have[good]
        apart = (np.diff(at[good]) != factor) | (np.diff(stretch[good]) != 0)
        return means, np.concatenate([[0], np.flatnonzero(apart) + 1, np.full(int(len(means) > 0), len(means))])


def variance_of_samples(variance: np.ndarray, known: np.ndarray) -> float:
    """Variance of a single sample about the mean of 16, from the Allan variances of SINGLE samples.

    variance, known : arrays [4]; where the longer ones are not known, about the mean of fewer
    Each halving of a block adds half the Allan variance of its halves to the variance about the block's mean.
    """
    halvings = int(np.argmin(np.append(known, False)))
    block = 2**halvings
    return float(variance[:halvings].sum() / 2 * block / (block - 1)) if halvings else 0.0


def _at(values: np.ndarray, edges: Ints, number: Ints, stride: int, offset: int) -> np.ndarray:
    """values [P, …] at number [S] borders of each stretch, `stride` apart, the first `offset` behind its begin."""
    if len(number) == 1:
        return values[offset : offset + int(number[0]) * stride : stride][: int(number[0])]
    within = np.arange(int(number.sum())) - np.repeat(np.cumsum(number) - number, number)
    return values[np.repeat(edges[:-1] + np.arange(len(number)) + offset, number) + within * stride]
