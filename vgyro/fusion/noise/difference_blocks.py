"""Second moments of the differences between the gyros in fine blocks: all that parity needs of the samples.

A residual y - 1·u'y with weights u that are constant within a block has the second moment A·S·A', A = I - 1u', whatever
u is: so the samples are read once, and every iteration runs over blocks. The motion cancels in S.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.blocks import PIECE
from vgyro.fusion.events import excluded
from vgyro.fusion.samples.missing import away
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates

BLOCK_S = 0.25
FEWEST_SAMPLES = 16
"""A finer block says little of its own variance."""
SINGLE_BELOW_HZ = 8.0
"""Below this rate every sample is a block."""
SLOW_BLOCKS = 32
"""The slow part of a residual is its mean over so many blocks on either side of its own."""
STUCK_SAMPLES = 16
STUCK_SHARE = 1e-3
"""A gyro is stuck where its steps from sample to sample have, over so many samples, less than this share of the square
that they have in the median of the gyros. Noise that small is of a gyro that does not measure, not of a perfect one.
One whose values have steps is stuck only where the others move by such a step from sample to sample: else it rounds."""


@dataclass(frozen=True)
class BlockMoments:
    """First and second moments of N gyros in M blocks of samples, none of which reaches over a gap.

    Every sample is in one block. What is counted is d = y - the mean over the gyros or, for a board at rest, y - each
    gyro's mean over the recording.
    start, stop : [M] int64, first sample of each block and first one after it
    low, high   : [M], first and last block of the window about each block, over which its slow part is the mean
    square      : [M, N, N], (deg/s)², the sum of d·d' over the samples of the block
    mean        : [M, N], deg/s, mean of d
    excluded    : [M, N] of bool, the gyro is at fault or stuck, or has no value for as long as a fine block
    """

    start: np.ndarray
    stop: np.ndarray
    low: np.ndarray
    high: np.ndarray
    square: np.ndarray
    mean: np.ndarray
    excluded: np.ndarray

    @property
    def size(self) -> Ints:
        """Samples of each block [M]."""
        size: Ints = self.stop - self.start
        return size

    def part(self, blocks: np.ndarray) -> BlockMoments:
        """Some of the blocks, by number; their windows are still those of all."""
        return BlockMoments(*(getattr(self, one.name)[blocks] for one in fields(self)))

    def window_sum(self, values: Floats | Ints) -> Floats:
        """Sums of values [M, ...] over the window about each block."""
        total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        sums: Floats = total[self.high + 1] - total[self.low]
        return sums

    def residual(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean squares, (deg/s)², and means, deg/s, [M, N] of y - 1·u'y in each block, for u [M, N] with Σu = 1."""
        cross = np.matmul(self.square, weights[:, :, None])[:, :, 0]
        own = np.einsum("bii->bi", self.square)
        total = own - 2.0 * cross + np.sum(cross * weights, axis=1, keepdims=True)
        mean = self.mean - np.sum(self.mean * weights, axis=1, keepdims=True)
        return np.maximum(total, 0.0) / self.size[:, None], mean


def block_moments(array: ArrayRates, size: int | None = None, own: bool = False) -> BlockMoments:
    """Moments of blocks of `size` samples; None: of about 0.25 s, 16 samples at least, single ones below 8 Hz.

    own : of the rates themselves, each less its mean over the recording, in place of the differences
    """
    edges = _edges(array, block_size(array.rate_hz) if size is None else size)
    start, stop = edges.start, edges.stop
    gyros = array.rate.shape[1]
    level = np.array([column.mean(dtype=float) for column in array.rate.T])[:, None] if own else None
    square = np.empty((len(start), gyros, gyros))
    mean = np.empty((len(start), gyros))
    step = np.empty((len(start), gyros))
    for blocks in _pieces(start, stop):
        rows = slice(int(start[blocks.start]), int(stop[blocks.stop - 1]))
        begin = start[blocks] - rows.start
        values = np.array(array.rate[rows].T, dtype=float, order="C")
        step[blocks] = _steps(values, array.rate[rows.start - 1] if rows.start else values[:, 0], begin)
        values -= values.mean(axis=0) if level is None else level
        mean[blocks] = (_sums(values, begin) / (stop[blocks] - start[blocks])).T
        for one in range(gyros):
            for other in range(one + 1):
                square[blocks, one, other] = square[blocks, other, one] = _sums(values[one] * values[other], begin)
    bad = _stuck(step, stop - start, steps(array))
    _mark(bad, start, stop, excluded(array.faults, len(array.rate), gyros))
    if array.missing is not None:
        _mark(bad, start, stop, [away(column, block_size(array.rate_hz)) for column in array.missing.T])
    return BlockMoments(*edges, square, mean, bad)


def block_size(rate_hz: float) -> int:
    """Samples of a block."""
    return 1 if rate_hz < SINGLE_BELOW_HZ else max(FEWEST_SAMPLES, round(BLOCK_S * rate_hz))


class _Edges(NamedTuple):
    """As in BlockMoments."""

    start: np.ndarray
    stop: np.ndarray
    low: np.ndarray
    high: np.ndarray


def _edges(array: ArrayRates, size: int) -> _Edges:
    """Edges of the blocks; what is left over in a stretch is of its last block."""
    starts, stops, lows, highs, number = [], [], [], [], 0
    for part in array.stretches():
        count = max(1, (part.stop - part.start) // size)
        begin = part.start + size * np.arange(count, dtype=np.int64)
        place = number + np.arange(count)
        starts.append(begin)
        stops.append(np.append(begin[1:], part.stop))
        lows.append(np.maximum(place - SLOW_BLOCKS, number))
        highs.append(np.minimum(place + SLOW_BLOCKS, number + count - 1))
        number += count
    return _Edges(*(np.concatenate(one) for one in (starts, stops, lows, highs)))


def _pieces(start: np.ndarray, stop: np.ndarray) -> Iterator[slice]:
    """Slices of blocks with about PIECE samples each."""
    first = 0
    while first < len(start):
        last = max(first + 1, int(np.searchsorted(stop, start[first] + PIECE, side="right")))
        yield slice(first, last)
        first = last


def _sums(values: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """Sums [..., B] of values [..., n] over blocks that begin at samples `begin`."""
    return values if len(begin) == values.shape[-1] else np.add.reduceat(values, begin, axis=-1)


def _steps(values: np.ndarray, before: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """Sums of the squared steps [B, N] of values [N, n] in each block; the first step is from `before` [N]."""
    steps = np.diff(values, axis=1, prepend=np.asarray(before, dtype=float)[:, None])
    return _sums(steps * steps, begin).T


def _stuck(step: np.ndarray, size: np.ndarray, rounded: np.ndarray) -> np.ndarray:
    """[M, N]: blocks that lie in STUCK_SAMPLES samples with hardly a step; squared steps [M, N], samples [M].

    rounded : steps [N] of the gyros' values, deg/s; 0: none
    """
    stuck = np.zeros(step.shape, dtype=bool)
    blocks = STUCK_SAMPLES if int(np.median(size)) == 1 else 1
    windows = len(step) - blocks + 1
    if windows < 1:
        return stuck
    over, samples = (np.sum([one[shift : shift + windows] for shift in range(blocks)], axis=0) for one in (step, size))
    usual = np.median(over, axis=1, keepdims=True)
    small = (over <= STUCK_SHARE * usual) & (usual >= samples[:, None] * rounded**2)
    small &= np.greater_equal(samples, STUCK_SAMPLES)[:, None]
    for shift in range(blocks):
        stuck[shift : shift + windows] |= small
    return stuck


def _mark(bad: np.ndarray, start: np.ndarray, stop: np.ndarray, stretches: list[np.ndarray]) -> None:
    """Mark the blocks that a stretch of a fault touches, in place."""
    for gyro, spans in enumerate(stretches):
        for first, last in spans:
            bad[np.searchsorted(stop, first, side="right") : np.searchsorted(start, last, side="left"), gyro] = True
