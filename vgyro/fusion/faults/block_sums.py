"""Sums over blocks of samples from which any combination of the gyros has its mean and its variance inside a block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.array import ArrayRates

FEWEST_SAMPLES = 8  # in a block, so that it has a variance
PIECE = 1 << 15
SILENT = 1e-10


@dataclass(frozen=True)
class BlockSums:
    """Blocks of about equal length; none crosses a gap.

    edges  : [B + 1] samples; block b is [edges[b], edges[b + 1]), for a stretch ends where the next one begins
    count  : [B] samples
    mean   : [B, N + 1] deg/s, of each gyro less the average of all, and of that average
    moment : [B, N + 1, N + 1] (deg/s)², second moments about these means, 1/count
    run    : [B] number of the stretch, those with a short gap between them taken as one
    """

    edges: np.ndarray
    count: np.ndarray
    mean: np.ndarray
    moment: np.ndarray
    run: np.ndarray

    @property
    def gyros(self) -> int:
        return self.mean.shape[1] - 1

    def __len__(self) -> int:
        return len(self.count)


def silent_share(sums: BlockSums) -> np.ndarray:
    """Share of the blocks in which each gyro gives one value alone [N]."""
    together = sums.moment[:, -1, -1, None] + 2.0 * sums.moment[:, :-1, -1]
    own = together + np.diagonal(sums.moment, axis1=1, axis2=2)[:, :-1]
    return np.mean(own <= SILENT * np.max(own, axis=0), axis=0)


def block_length(rate_hz: float, block_s: float) -> int:
    """Samples of a block: block_s, or more where that holds too few for a variance."""
    return max(FEWEST_SAMPLES, round(rate_hz * block_s))


def block_sums(array: ArrayRates, length: int, dead: list[np.ndarray], longest_gap_s: float) -> BlockSums:
    """Sums over blocks of about `length` samples, in one pass over the rates.

    dead : of each gyro, stretches [M, 2] of samples without a rate; the average of the others is taken for them
    longest_gap_s : a longer time without samples ends a run
    """
    first, run = _blocks(array, length, longest_gap_s)
    edges = np.append(first, len(array.rate))
    count = np.diff(edges)
    gyros = array.rate.shape[1]
    mean = np.empty((len(count), gyros + 1))
    moment = np.empty((len(count), gyros + 1, gyros + 1), dtype=np.float32 if gyros > 16 else np.float64)
    block, per_piece = 0, max(1, PIECE // length)
    while block < len(count):
        last = min(block + per_piece, len(count))
        rows = slice(int(edges[block]), int(edges[last]))
        columns = _columns(array.rate, rows, dead)
        begins = edges[block:last] - rows.start
        sizes = count[block:last]
        mean[block:last] = (np.add.reduceat(columns, begins, axis=1) / sizes).T
        columns -= np.repeat(mean[block:last].T, sizes, axis=1)
        for one in range(gyros + 1):
            for other in range(one + 1):
                product = np.add.reduceat(columns[one] * columns[other], begins) / sizes
                moment[block:last, one, other] = moment[block:last, other, one] = product
        block = last
    return BlockSums(edges, count, mean, moment, run)


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


def _columns(rate: np.ndarray, rows: slice, dead: list[np.ndarray]) -> np.ndarray:
    """[N + 1, n] of the samples: each gyro less the average, and the average, dead gyros left out of it."""
    gyros = rate.shape[1]
    columns = np.empty((gyros + 1, rows.stop - rows.start))
    gone = np.zeros((gyros, rows.stop - rows.start), dtype=bool)
    for gyro in range(gyros):
        columns[gyro] = rate[rows, gyro]
        for start, stop in dead[gyro]:
            if start < rows.stop and stop > rows.start:
                gone[gyro, max(start - rows.start, 0) : stop - rows.start] = True
    if gone.any():
        columns[:gyros][gone] = 0.0
        alive = gyros - gone.sum(axis=0)
        columns[gyros] = columns[:gyros].sum(axis=0) / np.maximum(alive, 1)
        columns[:gyros] -= columns[gyros]
        columns[:gyros][gone] = 0.0
    else:
        columns[gyros] = columns[:gyros].mean(axis=0)
        columns[:gyros] -= columns[gyros]
    return columns
