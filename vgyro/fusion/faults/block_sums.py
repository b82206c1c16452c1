"""Sums over blocks of samples from which any combination of the gyros has its mean and its variance inside a block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.faults.candidate import NORMAL_MEDIAN
from vgyro.fusion.types import ArrayRates

FEWEST_SAMPLES = 8  # in a block, so that it has a variance
PIECE = 1 << 15
SILENT = 1e-10
FARTHEST = 4.0
"""A sample counts as no farther from the middle of its block than so many deviations, by the median of the distances:
tails of the noise are no burst, while a burst has a median of its own."""
CALMEST = 0.25
"""Quantile of the deviations of the blocks: that of a block is at least so great, for few samples tell it roughly."""


@dataclass(frozen=True)
class BlockSums:
    """Blocks of about equal length; none crosses a gap.

    edges  : [B + 1] samples; block b is [edges[b], edges[b + 1]), for a stretch ends where the next one begins
    count  : [B] samples
    mean   : [B, N + 1] deg/s, of each gyro less the average of all, and of that average
    moment : [B, N + 1, N + 1] (deg/s)², second moments about these means, 1/count
    run    : [B] number of the stretch, those with a short gap between them taken as one
    alive  : [B, N] the gyro has a rate in every sample of the block
    """

    edges: np.ndarray
    count: np.ndarray
    mean: np.ndarray
    moment: np.ndarray
    run: np.ndarray
    alive: np.ndarray

    @property
    def gyros(self) -> int:
        gyros: int = self.mean.shape[1] - 1
        return gyros

    def __len__(self) -> int:
        return len(self.count)

    def variance(self, gyro: int) -> Floats:
        """Variance of a gyro in each block [B], (deg/s)²."""
        variance: Floats = self.moment[:, gyro, gyro] + 2.0 * self.moment[:, gyro, -1] + self.moment[:, -1, -1]
        return variance


def silent_share(sums: BlockSums) -> Floats:
    """Share of the blocks in which each gyro gives one value alone [N], of those in which it has rates."""
    together = sums.moment[:, -1, -1, None] + 2.0 * sums.moment[:, :-1, -1]
    own = together + np.diagonal(sums.moment, axis1=1, axis2=2)[:, :-1]
    silent = (own <= SILENT * np.max(own, axis=0)) & sums.alive
    share: Floats = silent.sum(axis=0) / np.maximum(sums.alive.sum(axis=0), 1)
    return share


def block_length(rate_hz: float, block_s: float) -> int:
    """Samples of a block: block_s, or more where that holds too few for a variance."""
    return max(FEWEST_SAMPLES, round(rate_hz * block_s))


def block_sums(
    array: ArrayRates, length: int, longest_gap_s: float, gone: np.ndarray | None = None, odd: np.ndarray | None = None
) -> BlockSums:
    """Sums over blocks of about `length` samples, in one pass over the rates.

    longest_gap_s : a longer time without samples ends a run
    gone, odd : [T, N] samples of a gyro that are no rates, and single ones that are absurd; None: there are none. A
                block with one that is gone has no rate of that gyro; what is odd is replaced by what the others say
    """
    first, run = _blocks(array, length, longest_gap_s)
    edges = np.append(first, len(array.rate))
    count = np.diff(edges)
    gyros = array.rate.shape[1]
    mean = np.empty((len(count), gyros + 1))
    moment = np.empty((len(count), gyros + 1, gyros + 1), dtype=np.float32 if gyros > 16 else np.float64)
    alive = np.ones((len(count), gyros), dtype=bool)
    block, per_piece = 0, max(1, PIECE // length)
    while block < len(count):
        last = min(block + per_piece, len(count))
        rows = slice(int(edges[block]), int(edges[last]))
        begins = edges[block:last] - rows.start
        sizes = count[block:last]
        lost = None if gone is None or not gone[rows].any() else gone[rows].T
        if lost is not None:
            alive[block:last] = ~np.logical_or.reduceat(lost, begins, axis=1).T
        columns = _columns(array.rate[rows].T, lost, None if odd is None else odd[rows].T, begins)
        mean[block:last] = (np.add.reduceat(columns, begins, axis=1) / sizes).T
        columns -= np.repeat(mean[block:last].T, sizes, axis=1)
        for one in range(gyros + 1):
            for other in range(one + 1):
                product = np.add.reduceat(columns[one] * columns[other], begins) / sizes
                moment[block:last, one, other] = moment[block:last, other, one] = product
        block = last
    return BlockSums(edges, count, mean, moment, run, alive)


def _blocks(array: ArrayRates, length: int, longest_gap_s: float) -> tuple[np.ndarray, np.ndarray]:
    """First sample and run of each block; what is left of a stretch is shared among its blocks."""
    first, run, number = [], [], 0
    stretches = array.stretches()
    for index, stretch in enumerate(stretches):
        if index and array.stretch_time is not None:
            before = stretches[index - 1]
            end = array.stretch_time[index - 1] + (before.stop - before.start) * array.period
            number += bool(array.stretch_time[index] - end > longest_gap_s)
        samples = stretch.stop - stretch.start
        blocks = max(1, round(samples / length))
        begins = stretch.start + np.arange(blocks) * samples // blocks
        first.append(begins)
        run.append(np.full(blocks, number))
    return np.concatenate(first), np.concatenate(run)


def _columns(values: np.ndarray, lost: np.ndarray | None, odd: np.ndarray | None, begins: np.ndarray) -> np.ndarray:
    """[N + 1, n] of the samples: each gyro less the average, and the average, tails cut off and holes filled in.

    values [N, n];  lost, odd [N, n] : samples that are none
    """
    gyros = len(values)
    columns = np.empty((gyros + 1, values.shape[1]))
    columns[:gyros] = values
    hole = lost if odd is None else odd if lost is None else lost | odd
    if hole is not None and hole.any():
        columns[:gyros][hole] = np.nan
        columns[:gyros, hole.all(axis=0)] = 0.0
        middle = np.nanmedian(columns[:gyros], axis=0)
    else:
        middle = np.median(columns[:gyros], axis=0)
    columns[:gyros] -= middle
    _cut(columns[:gyros], begins)
    average = columns[:gyros].mean(axis=0)
    columns[:gyros] -= average
    columns[gyros] = middle + average
    return columns


def _cut(away: np.ndarray, begins: np.ndarray) -> None:
    """Cut off what is far from the median of its gyro and block; what is not known becomes that median. In place.

    away [N, n] : distances from the middle gyro, NaN: not known;  begins [B] : first places of the blocks
    """
    sizes = np.diff(begins, append=away.shape[1])
    width = int(sizes.max())
    places = np.minimum(begins[:, None] + np.arange(width), away.shape[1] - 1)
    outside = np.arange(width) >= sizes[:, None]
    for one in away:
        known = np.isfinite(one)
        size = np.add.reduceat(known, begins, dtype=int)
        level = _block_medians(np.where(known, one, np.inf)[places], outside, size)
        one -= np.repeat(level, sizes)
        deviation = _block_medians(np.where(known, np.abs(one), np.inf)[places], outside, size) / NORMAL_MEDIAN
        calm = float(np.quantile(deviation[size > 0], CALMEST)) if (size > 0).any() else 0.0
        most = FARTHEST * np.maximum(deviation, calm)
        most[most <= 0] = np.inf
        most = np.repeat(most, sizes)
        np.clip(one, -most, most, out=one)
        one[~known] = 0.0
        one += np.repeat(level, sizes)


def _block_medians(values: np.ndarray, outside: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Lower medians [B] of the `size` least of values [B, n] that are not outside; 0 where there is none."""
    order = np.sort(np.where(outside, np.inf, values), axis=1)
    middle = order[np.arange(len(order)), np.maximum(size - 1, 0) // 2]
    return np.where(size > 0, middle, 0.0)
