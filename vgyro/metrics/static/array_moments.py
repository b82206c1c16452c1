"""Mean and 1σ of series of one recording, with replicates of all of them together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.config import MetricsOptions
from vgyro.metrics.figures import Reading
from vgyro.metrics.improvement import improvement_by_draws, improvement_factor
from vgyro.metrics.intervals.block_rule import block_length
from vgyro.metrics.intervals.bootstrap import Resampled, Units, block_sums, percentile_limits, resample
from vgyro.metrics.intervals.drift import Drawn


@dataclass(frozen=True)
class ArrayMoments:
    """Moments of S series, deg/s, and R replicates.

    mean, sigma [S];  mean_drawn, sigma_drawn [R, S]
    sigma_expected : what the replicates of 1σ scatter about, [S], or [R, S] where each has its own
    """

    mean: np.ndarray
    sigma: np.ndarray
    mean_drawn: np.ndarray
    sigma_drawn: np.ndarray
    sigma_expected: np.ndarray
    note: str

    def readings(self, confidence: float) -> list[dict[str, Reading]]:
        """Mean and 1σ of each series."""
        low, high = percentile_limits(self.mean_drawn, confidence)
        tail = (1 - confidence) / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(self.sigma_expected > 0, self.sigma_drawn / self.sigma_expected, 1.0)
        above, below = np.quantile(share, [1 - tail, tail], axis=0)
        return [
            {
                "mean": Reading(float(mean), float(low[one]), float(high[one]), self.note),
                "sigma": Reading(float(sigma), float(sigma / above[one]), float(sigma / below[one]), self.note),
            }
            for one, (mean, sigma) in enumerate(zip(self.mean, self.sigma, strict=True))
        ]

    def mean_factor(self, singles: int, column: int, confidence: float) -> Reading:
        """Improvement factor of |mean|."""
        drawn = self.mean_drawn
        return improvement_factor(
            self.mean[:singles], float(self.mean[column]), drawn[:, :singles], drawn[:, column], confidence, False
        )

    def sigma_factor(self, singles: int, column: int, confidence: float) -> Reading:
        """Improvement factor of 1σ."""
        drawn, expected = self.sigma_drawn, self.sigma_expected
        with np.errstate(invalid="ignore", divide="ignore"):
            centre = np.mean(expected[..., :singles], axis=-1) / expected[..., column]
        return improvement_by_draws(
            self.sigma[:singles], float(self.sigma[column]), drawn[:, :singles], drawn[:, column], centre, confidence
        )


def array_moments(
    sums: Units, inside: Units | None, resampled: Resampled, drawn: Drawn | None, unit_s: float, options: MetricsOptions
) -> ArrayMoments:
    """Moments of S series, with the limits of a moving-block bootstrap, and of a drift that blocks cannot resample.

    sums, inside : units of the series, and of the series without the means of their poses (for 1σ; None: no poses)
    resampled    : bootstrap of `sums`
    drawn        : the fitted noise of the series, drawn again, for what is slower than its blocks; None: the bootstrap
                   alone, whose blocks lose a part of a drift
    The variance about the means of the drawn blocks is resampled by short blocks, and that of these means is drawn;
    the two add up. A mean varies as the drawn means do, but no less than the blocks say.
    """
    spread = sums if inside is None else inside
    mean, sigma = _mean(sums), _sigma(spread)
    if drawn is None:
        sigmas = resampled if inside is None else resample(inside, options.bootstrap, options.seed)
        note = f"bootstrap of blocks of {sigmas.blocks['sigma'] * unit_s:g} s"
        centre = np.median(sigmas.sigma, axis=0)
        return ArrayMoments(mean, sigma, resampled.mean, sigmas.sigma, centre, note)
    squares, count = _about_block_means(spread, max(round(drawn.block_s / unit_s), 1))
    within = squares.sum(axis=0) / count.sum()
    block = max(block_length(column / count) for column in squares.T)
    shape = options.bootstrap, -(-len(squares) // block)
    starts = np.random.default_rng(options.seed).integers(0, len(squares) - block + 1, shape)
    fast = block_sums(squares, starts, block) / block_sums(count[:, None], starts, block)
    sigma_drawn = np.sqrt(np.maximum(fast, 0) + drawn.variance)
    with np.errstate(invalid="ignore", divide="ignore"):
        wider = np.fmax(np.std(resampled.mean, axis=0) / np.std(drawn.mean, axis=0), 1.0)
    note = f"bootstrap of blocks of {block * drawn.block_s:g} s, the fitted drift drawn again"
    return ArrayMoments(
        mean, sigma, mean + drawn.mean * wider, sigma_drawn, np.sqrt(within + drawn.variance_expected), note
    )  # fmt: skip


def _mean(sums: Units) -> Floats:
    mean: Floats = sums.total.sum(axis=0) / sums.count.sum()
    return mean


def _sigma(sums: Units) -> Floats:
    count, mean = sums.count.sum(), _mean(sums)
    squares = np.sum(sums.squares - 2 * mean * sums.total + sums.count[:, None] * mean**2, axis=0)
    sigma: Floats = np.sqrt(np.maximum(squares, 0) / max(count - 1, 1))
    return sigma


def _about_block_means(sums: Units, units: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums of squares [B, S] of blocks of `units` units about the mean of each, and samples in it [B]."""
    block = np.arange(len(sums.count)) // units
    count = np.bincount(block, sums.count)
    found = np.empty((len(count), sums.total.shape[1]))
    for column, (total, squares) in enumerate(zip(sums.total.T, sums.squares.T, strict=True)):
        # About the unit's own mean first: a large bias would cancel badly.
        mean = total / sums.count
        of_block = np.bincount(block, total) / count
        inside = squares - total * mean
        found[:, column] = np.bincount(block, inside + sums.count * (mean - of_block[block]) ** 2)
    return found, count
