"""Moving-block bootstrap of means, second moments and Allan deviations at 1 s, many series resampled together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.metrics.allan.deviation import stretches
from vgyro.metrics.intervals.block_rule import block_length
from vgyro.metrics.intervals.unit_grid import UNITS_AT_ONCE, UnitGrid, Units, joined, sampled_grid, unit_grid

STATISTICS = ("mean", "sigma", "adev_1s")

__all__ = [
    "STATISTICS",
    "UNITS_AT_ONCE",
    "Resampled",
    "UnitGrid",
    "Units",
    "block_length",
    "block_sums",
    "joined",
    "make_units",
    "percentile_limits",
    "resample",
    "sampled_grid",
    "scale_limits",
    "unit_grid",
]


def make_units(rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None) -> Units:
    """Units of series [T, S] at rate_hz."""
    grid = unit_grid(stretches(np.zeros(len(rate), np.int8) if segment is None else segment), rate_hz)
    return joined([grid.units_of(rate[:, column]) for column in range(rate.shape[1])])


@dataclass(frozen=True)
class Resampled:
    """Statistics of R replicates: mean, sigma, adev_1s [R, S]; blocks : length of the blocks of each, in units"""

    mean: np.ndarray
    sigma: np.ndarray
    adev_1s: np.ndarray
    blocks: dict[str, int]


def resample(units: Units, replicates: int, seed: int, block: int | None = None) -> Resampled:
    """Moving-block bootstrap of all series together: one set of blocks for all, so their ratios keep what they share.

    block : length of the blocks; None: for each statistic the longest that Units.block_length gives for any series
    Künsch (1989), Annals of Statistics 17(3).
    """
    number, series = units.total.shape
    blocks = {
        name: max(units.block_length(column, name) for column in range(series)) if block is None else block
        for name in STATISTICS
    }
    centre = units.total.sum(axis=0) / units.count.sum()
    # Moments about the overall mean: those about zero would cancel where a bias is large against the noise.
    shifted = units.total - units.count[:, None] * centre
    squares = units.squares - 2 * centre * units.total + units.count[:, None] * centre**2

    def starts_of(name: str) -> np.ndarray:
        shape = replicates, -(-number // blocks[name])
        return np.random.default_rng(seed).integers(0, number - blocks[name] + 1, shape)

    def sums(values: np.ndarray, name: str) -> np.ndarray:
        return block_sums(values, starts_of(name), blocks[name])

    count = units.count[:, None]
    mean = sums(shifted, "mean") / sums(count, "mean")
    counted = sums(count, "sigma")
    variance = (sums(squares, "sigma") - sums(shifted, "sigma") ** 2 / counted) / np.maximum(counted - 1, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        allan = sums(units.steps, "adev_1s") / sums(units.step_count[:, None], "adev_1s")
    return Resampled(mean + centre, np.sqrt(np.maximum(variance, 0)), np.sqrt(np.maximum(allan, 0)), blocks)


def block_sums(values: np.ndarray, starts: np.ndarray, block: int) -> np.ndarray:
    """Sums [R, S] of values [U, S] over the blocks that begin at starts [R, blocks]."""
    sums = np.empty((len(starts), values.shape[1]))
    for column in range(values.shape[1]):
        running = np.concatenate(([0.0], np.cumsum(values[:, column])))
        sums[:, column] = (running[block:] - running[:-block])[starts].sum(axis=1)
    return sums


def percentile_limits(replicates: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Limits [S] by the percentiles of replicates [R, S]."""
    tail = (1 - confidence) / 2
    low, high = np.quantile(replicates, [tail, 1 - tail], axis=0)
    return low, high


def scale_limits(value: float, replicates: np.ndarray, confidence: float) -> tuple[float, float]:
    """Limits of a figure of size (a 1σ, a ratio): percentiles of replicates [R], moved by a factor to have the figure
    itself as their median.

    Blocks are shorter than a slow drift and lose a part of it, so that plain percentiles may miss the figure.
    """
    tail = (1 - confidence) / 2
    median = float(np.median(replicates))
    factor = value / median if median > 0 else 1.0
    low, high = (factor * float(limit) for limit in np.quantile(replicates, [tail, 1 - tail]))
    return low, high
