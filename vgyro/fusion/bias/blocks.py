"""Blocks of samples, about a second long, on which the slow errors of the gyros are estimated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.blocks import PIECE
from vgyro.fusion.events import excluded
from vgyro.fusion.types import ArrayRates
from vgyro.runs import run_starts

MOST_NUMBERS = 8_000_000
"""Blocks × N² at most: those of a larger array are longer."""
MOST_STEPS = 12


@dataclass(frozen=True)
class SlowBlocks:
    """Blocks of `size` samples in the gap-free stretches; what is left of a stretch is a shorter block.

    first [B], first sample of each;  length [B], samples;  time [B] s, of the middle;  stretch [B], in which it lies
    Every sample lies in one block, and no block reaches over a gap.
    """

    first: np.ndarray
    length: np.ndarray
    time: np.ndarray
    stretch: np.ndarray

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def of(cls, array: ArrayRates, block_s: float = 1.0) -> SlowBlocks:
        """Blocks of about `block_s`, of one sample at least, for one recording."""
        samples, gyros = array.rate.shape
        size = max(1, round(array.rate_hz * block_s), -(-samples * gyros**2 // MOST_NUMBERS))
        stretches = array.stretches()
        begin = np.array([part.start for part in stretches])
        time = array.stretch_time if array.stretch_time is not None else begin * array.period
        first = np.concatenate([np.arange(part.start, part.stop, size) for part in stretches])
        length = np.diff(first, append=samples)
        stretch = np.searchsorted(begin, first, side="right") - 1
        middle = first - begin[stretch] + (length - 1) / 2
        return cls(first, length, np.asarray(time, dtype=float)[stretch] + middle * array.period, stretch)

    @property
    def middle(self) -> np.ndarray:
        """Place of the middle of each block among the samples [B], in samples."""
        return self.first + (self.length - 1) / 2

    @property
    def gap(self) -> np.ndarray:
        """Time since the block before [B], s; 0 for the first."""
        return np.diff(self.time, prepend=self.time[:1])

    def mean(self, values: Floats) -> Floats:
        """Means [B] of the values [T] of the samples, in double precision."""
        means: Floats = np.add.reduceat(values, self.first, dtype=float) / self.length
        return means

    def all(self, values: np.ndarray) -> np.ndarray:
        """Is it so in every sample of the block [B]? values [T] of bool"""
        return np.logical_and.reduceat(values, self.first)

    def mean_of(self, first: Ints, values: Floats) -> Floats:
        """Means [B, N] of what is constant from one sample to another.

        first [M] : samples from which the values [M, N] hold, each until the next; increasing. Before the first of them
        its values hold as well.
        """
        stop = int(self.first[-1] + self.length[-1])
        edges = np.union1d(first[(first > 0) & (first < stop)], self.first)
        held = values[np.maximum(np.searchsorted(first, edges, side="right") - 1, 0)]
        lasting = np.diff(edges, append=stop)[:, None]
        means: Floats = (
            np.add.reduceat(held * lasting, np.searchsorted(edges, self.first), axis=0) / self.length[:, None]
        )
        return means

    def pieces(self, rows: slice) -> Iterator[tuple[slice, slice]]:
        """Pieces of the samples `rows`, each in one stretch, and the blocks whose middles lie in and next to each."""
        begin = run_starts(self.stretch)
        end, middle = np.append(begin[1:], len(self)), self.middle
        borders = self.first[begin]
        inside = borders[(borders > rows.start) & (borders < rows.stop)]
        edges = np.unique(np.concatenate([np.arange(rows.start, rows.stop, PIECE), inside, [rows.stop]]))
        for start, stop in pairwise(edges.astype(int).tolist()):
            number = int(np.searchsorted(borders, start, side="right")) - 1
            low = int(np.searchsorted(middle, start, side="right")) - 1
            high = int(np.searchsorted(middle, stop - 1, side="left")) + 1
            yield slice(start, stop), slice(max(low, int(begin[number])), min(high, int(end[number])))

    def between(self, samples: slice, near: slice, values: Floats) -> Floats:
        """Values [B] of the blocks at a piece of the samples: linear between middles, held beyond the last ones."""
        return np.interp(np.arange(samples.start, samples.stop), self.middle[near], values[near])

    def at_fault(self, array: ArrayRates) -> np.ndarray:
        """Does the block touch a stretch in which the gyro is at fault? [B, N] of bool"""
        samples, gyros = array.rate.shape
        touched = np.zeros((len(self), gyros), dtype=bool)
        for gyro, spans in enumerate(excluded(array.faults, samples, gyros)):
            low = np.searchsorted(self.first, spans[:, 0], side="right") - 1
            high = np.searchsorted(self.first, spans[:, 1], side="left")
            for start, stop in zip(low.tolist(), high.tolist(), strict=True):
                touched[start:stop, gyro] = True
        return touched

    def steps(self, array: ArrayRates) -> list[tuple[int, int, float]]:
        """Biases that may be others after a drift or a step of their gyro: first block after it, gyro, size in deg/s.

        MOST_STEPS of them at most, the largest.
        """
        found = [
            (int(np.searchsorted(self.first, event.stop, side="left")), event.gyro, abs(event.size))
            for event in array.faults
            if event.kind in ("drift", "step") and np.isfinite(event.size)
        ]
        inside = [one for one in found if one[0] < len(self)]
        return sorted(sorted(inside, key=lambda one: -one[2])[:MOST_STEPS])
