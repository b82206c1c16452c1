"""Moving-block bootstrap of means and second moments, many series resampled together."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from vgyro.metrics.correlation import autocorrelation, correlation_length

UNIT_S = 1.0
FEWEST_UNITS = 8
FEWEST_BLOCKS = 8


@dataclass(frozen=True)
class Units:
    """Sums over units of about 1 s, none across a gap: what the bootstrap resamples instead of samples.

    count [U]; total, squares [U, S] : samples, their sum and the sum of squares, of S series
    steps, step_count [U, S], [U]    : Σ (second difference at 1 s)²/(2τ²) that begin in the unit, and how many
    """

    count: np.ndarray
    total: np.ndarray
    squares: np.ndarray
    steps: np.ndarray
    step_count: np.ndarray

    def only(self, column: int) -> Units:
        """The units of one series."""
        one = slice(column, column + 1)
        return Units(self.count, self.total[:, one], self.squares[:, one], self.steps[:, one], self.step_count)

    def block_length(self, column: int) -> int:
        """Length of the blocks for one series, in units."""
        return block_length(self.total[:, column] / self.count)


def block_length(units: np.ndarray) -> int:
    """Length of the bootstrap's blocks for a series [U] of unit means.

    (6^(1/2) ρ/(1-ρ²))^(2/3) · U^(1/3), the rule for an AR(1) series (Carlstein 1986; Politis & White 2004), ρ that of
    the AR(1) with the series' own correlation length; at least U^(1/3), at most U/8, so that there are blocks to
    choose from: limits of a series that drifts all the time are then too narrow.
    """
    number = len(units)
    lowest, highest = int(np.ceil(number ** (1 / 3))), max(number // FEWEST_BLOCKS, 1)
    centred = units - units.mean()
    if number < FEWEST_UNITS or not np.any(centred):
        return min(lowest, highest)
    length = correlation_length(autocorrelation(centred, max(number // 2, 2)))
    rho = (length - 1) / (length + 1)
    rule = int(np.ceil((np.sqrt(6) * rho / (1 - rho**2)) ** (2 / 3) * number ** (1 / 3)))
    return int(min(max(rule, lowest), highest))


def make_units(rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None) -> Units:
    """Cut series [T, S] at rate_hz into units of 1 s (at least one sample); a stretch's last unit may be longer."""
    samples, number = rate.shape
    length = max(round(UNIT_S * rate_hz), 1)
    borders = [0, samples] if segment is None else [0, *(np.flatnonzero(np.diff(segment)) + 1).tolist(), samples]
    starts: list[int] = []
    for start, stop in itertools.pairwise(borders):
        starts += [start + index * length for index in range(max((stop - start) // length, 1 if stop > start else 0))]
    at = np.array(starts, dtype=np.int64)
    count = np.diff(np.append(at, samples)).astype(float)
    total, squares, steps = (np.empty((len(at), number)) for _ in range(3))
    valid = _differences_valid(samples, length, borders)
    step_count = np.add.reduceat(valid.astype(float), at)
    for column in range(number):
        series = np.ascontiguousarray(rate[:, column], dtype=float)
        total[:, column] = np.add.reduceat(series, at)
        squares[:, column] = np.add.reduceat(series**2, at)
        steps[:, column] = np.add.reduceat(_squared_steps(series, length, valid), at)
    return Units(count, total, squares, steps, step_count)


def _differences_valid(samples: int, length: int, borders: list[int]) -> np.ndarray:
    valid = np.zeros(samples, dtype=bool)
    for start, stop in itertools.pairwise(borders):
        valid[start : max(stop - 2 * length + 1, start)] = True
    return valid


def _squared_steps(series: np.ndarray, length: int, valid: np.ndarray) -> np.ndarray:
    """Half the squared difference of adjacent means over `length` samples, for the difference that begins at k."""
    angle = np.concatenate(([0.0], np.cumsum(series - series.mean())))
    steps = np.zeros(series.size)
    whole = series.size - 2 * length + 1
    if whole > 0:
        difference = angle[2 * length :] - 2 * angle[length:-length] + angle[: -2 * length]
        steps[:whole] = difference**2 / (2 * length**2)
    steps[~valid] = 0.0
    return steps


@dataclass(frozen=True)
class Resampled:
    """Statistics of R replicates: mean, sigma, adev_1s [R, S]; block : length of the blocks in units"""

    mean: np.ndarray
    sigma: np.ndarray
    adev_1s: np.ndarray
    block: int


def resample(units: Units, replicates: int, seed: int, block: int | None = None) -> Resampled:
    """Moving-block bootstrap of all series together: one set of blocks for all, so their ratios keep what they share.

    block : length of the blocks; None: the longest that block_length gives for any of the series
    Künsch (1989), Annals of Statistics 17(3).
    """
    number, series = units.total.shape
    if block is None:
        block = max(units.block_length(column) for column in range(series))
    blocks = -(-number // block)
    starts = np.random.default_rng(seed).integers(0, number - block + 1, (replicates, blocks))
    count = _block_sums(units.count[:, None], starts, block)
    centre = units.total.sum(axis=0) / units.count.sum()
    # Moments about the overall mean: those about zero would cancel where a bias is large against the noise.
    shifted = units.total - units.count[:, None] * centre
    squares = units.squares - 2 * centre * units.total + units.count[:, None] * centre**2
    mean = _block_sums(shifted, starts, block) / count
    variance = (_block_sums(squares, starts, block) - count * mean**2) / np.maximum(count - 1, 1)
    step_count = _block_sums(units.step_count[:, None], starts, block)
    with np.errstate(invalid="ignore", divide="ignore"):
        allan = _block_sums(units.steps, starts, block) / step_count
    return Resampled(mean + centre, np.sqrt(np.maximum(variance, 0)), np.sqrt(np.maximum(allan, 0)), block)


def _block_sums(values: np.ndarray, starts: np.ndarray, block: int) -> np.ndarray:
    running = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)))
    sums = running[block:] - running[:-block]
    return np.stack([sums[row].sum(axis=0) for row in starts])


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
