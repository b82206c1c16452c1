"""Means over slots of an even time grid, of which some have no sample: of the samples that are there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PRESENT_TENTHS = 9
"""A mean counts where so many tenths of its samples are there."""


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
    def of(cls, rate: np.ndarray, slot: np.ndarray, edges: np.ndarray) -> SlotSums:
        """rate [T] or [T, N], deg/s; slot [T] int, rising; edges [S + 1] in slots, every stretch with a sample."""
        slots, stretches = int(edges[-1]), len(edges) - 1
        first = np.searchsorted(slot, edges[:-1])
        number = np.diff(np.append(first, len(slot)))
        stretch = np.repeat(np.arange(stretches), number)
        mean = np.add.reduceat(rate, first, axis=0, dtype=float) / number.reshape(-1, *[1] * (rate.ndim - 1))
        # The sum before border b of stretch s is at b + s; a sample adds to the border behind its slot.
        place = slot + stretch + 1
        total = np.zeros((slots + stretches, *rate.shape[1:]))
        total[place] = rate - mean[stretch]
        np.cumsum(total, axis=0, out=total)
        have = np.zeros(slots + stretches, dtype=np.int32)
        have[place] = 1
        return cls(total, np.cumsum(have, dtype=np.int32), edges)

    def differences(self, factor: int, stride: int, share: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Differences of adjacent means over `factor` slots.

        stride  : slots from one to the next;  share : stretches of less than share·factor slots are left out
        returns : d [n] or [n, N] deg/s; excess [n], (1/n₁ + 1/n₂ - 2/m)/2 of n₁ and n₂ samples that are there; number
                  there would be without a loss
        """
        slots = np.diff(self.edges)
        number = np.where(slots >= max(share, 2) * factor, (slots - 2 * factor) // stride + 1, 0)
        within = np.arange(int(number.sum())) - np.repeat(np.cumsum(number) - number, number)
        at = np.repeat(self.edges[:-1] + np.arange(len(slots)), number) + within * stride
        have = [self.have[at + part * factor] for part in range(3)]
        before, after = have[1] - have[0], have[2] - have[1]
        need = (PRESENT_TENTHS * factor + 9) // 10
        good = (before >= need) & (after >= need)
        at, weights = at[good], (1.0 / before[good], 1.0 / after[good])
        columns = (-1, *[1] * (self.total.ndim - 1))
        middle = self.total[at + factor]
        d = (self.total[at + 2 * factor] - middle) * weights[1].reshape(columns)
        d -= (middle - self.total[at]) * weights[0].reshape(columns)
        return d, (weights[0] + weights[1]) / 2 - 1 / factor, len(good)

    def block_means(self, factor: int) -> tuple[np.ndarray, np.ndarray]:
        """Means of adjacent blocks of `factor` slots that have half of their samples, about those of their stretches.

        returns : means [b]; edges [R + 1] of the runs of adjacent ones, and b
        """
        number = np.diff(self.edges) // factor
        stretch = np.repeat(np.arange(len(number)), number)
        within = np.arange(int(number.sum())) - np.repeat(np.cumsum(number) - number, number)
        at = self.edges[stretch] + stretch + within * factor
        have = self.have[at + factor] - self.have[at]
        good = 2 * have >= factor
        means = (self.total[at + factor] - self.total[at])[good] / have[good]
        kept = np.flatnonzero(good)
        apart = (np.diff(kept) != 1) | (np.diff(stretch[good]) != 0)
        return means, np.concatenate([[0], np.flatnonzero(apart) + 1, np.full(int(len(means) > 0), len(means))])
