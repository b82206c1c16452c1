"""The slow part of a residual: block means, the white noise in them, and how far the level wanders beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.faults.candidate import running_sum, spread
from vgyro.fusion.faults.residuals import Residuals
from vgyro.runs import run_starts, true_runs

HIGH_SHARE = 0.8
HIGH_SQUARE = 1.642
"""Quantile of the square of a standard normal variable: hard motion adds more than its share."""
LEAST_VARIANCE = 1e-3
ENOUGH_BLOCKS = 50
ENOUGH_SHARE = 0.2
NEARBY = 4  # blocks on each side
EDGE = 8  # blocks on each side of a hole


@dataclass(frozen=True)
class Slow:
    """The residual of one gyro in block means, and its healthy behaviour.

    mean   : [B] deg/s;  white : [B] (deg/s)², variance of its white part, from the noise in and around the block
    counts : [B], false where the mean is filled in;  run : [B], as of BlockSums
    flicker, walk : (deg/s)² and (deg/s)² a block: the difference of two neighbouring means of n blocks has the variance
                    flicker + 2/3·n·walk beside its white part
    """

    mean: np.ndarray
    white: np.ndarray
    counts: np.ndarray
    run: np.ndarray
    flicker: float = 0.0
    walk: float = 0.0

    def wander(self, length: float) -> float:
        """Variance of the difference of neighbouring means of `length` blocks on average, without its white part."""
        return self.flicker + self.walk * length * 2.0 / 3.0

    @property
    def usual_white(self) -> float:
        return float(np.median(self.white))


def local_variance(found: Residuals, gyro: int) -> Floats:
    """Variance of a sample of the residual in and around each block [B]: the greater one of the two, for bursts."""
    variance = np.where(np.isfinite(found.variance[:, gyro]), found.variance[:, gyro], found.expected[:, gyro])
    # A gyro that gives one value alone has noise all the same: that of its converter.
    variance = np.maximum(variance, LEAST_VARIANCE * found.expected[:, gyro])
    sums = running_sum(variance)
    blocks = np.arange(len(variance))
    low, high = np.maximum(blocks - NEARBY, 0), np.minimum(blocks + NEARBY + 1, len(variance))
    local: Floats = np.maximum((sums[high] - sums[low]) / (high - low), variance)
    return local


def slow_part(found: Residuals, gyro: int, counts: np.ndarray, run: np.ndarray, mean: np.ndarray) -> Slow:
    """The residual means [B] of a gyro as a series without holes: a straight line bridges blocks that do not count.

    What does not count at an end of a run is a run of its own, of which nothing is known.
    """
    mean = mean.copy()
    borders = {*run_starts(run).tolist(), len(run)}
    for first, last in true_runs(~counts).tolist() if counts.any() else ():
        near = slice(max(0, first - EDGE), first), slice(last, last + EDGE)
        before, after = (_middle(mean[rows][counts[rows]]) for rows in near)
        ends = (after if np.isnan(before) else before, before if np.isnan(after) else after)
        mean[first:last] = np.linspace(*ends, last - first)
        if first in borders or last in borders:
            borders |= {first, last}
    number = np.zeros(len(run), dtype=int)
    number[sorted(borders - {len(run)})] = 1
    return Slow(mean, _white(mean, found, gyro, counts), counts, np.cumsum(number))


def _middle(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _white(mean: np.ndarray, found: Residuals, gyro: int, counts: np.ndarray) -> np.ndarray:
    """Variance of a block mean [B]: proportional to that of the samples, and to the motion where the board moves."""
    local = local_variance(found, gyro)
    power = found.motion[:, gyro] ** 2 + found.energy[:, gyro]
    steps = np.diff(mean)
    both = counts[1:] & counts[:-1]
    moving = found.moving[1:] | found.moving[:-1]
    quiet = both & ~moving
    if quiet.sum() < max(ENOUGH_BLOCKS, ENOUGH_SHARE * both.sum()):
        quiet = both
    pair = local[1:] + local[:-1]
    share = spread(steps[quiet] / np.sqrt(pair[quiet])) ** 2 if quiet.any() else 1.0
    leak = 0.0
    if (both & moving).sum() >= ENOUGH_BLOCKS and not np.array_equal(quiet, both):
        excess = steps**2 - share * pair
        ratio = (excess / (power[1:] + power[:-1]))[both & moving]
        leak = max(float(np.quantile(ratio, HIGH_SHARE)) / HIGH_SQUARE, 0.0)
    return share * local + leak * np.where(found.moving, power, 0.0)


def contrasts(slow: Slow, length: int, before: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differences between the mean of some blocks and the mean of those just before them, at every place.

    slow   : the residual of one gyro in block means
    length : blocks of the mean that begins at the place;  before : blocks of the mean that ends there; None: `length`
    returns : places [P], numbers of blocks; differences [P], deg/s; variances of their white parts [P], (deg/s)². A
              place at which the blocks of both means do not lie in one run is left out
    """
    ahead = before or length
    sums, white = running_sum(slow.mean), running_sum(slow.white)
    places = np.arange(ahead, len(slow.mean) - length + 1)
    places = places[slow.run[places - ahead] == slow.run[places + length - 1]]
    high, middle, low = places + length, places, places - ahead
    difference = (sums[high] - sums[middle]) / length - (sums[middle] - sums[low]) / ahead
    noise = (white[high] - white[middle]) / length**2 + (white[middle] - white[low]) / ahead**2
    return places, difference, noise
