"""Moving-block bootstrap of means and second moments, many series resampled together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.metrics.allan import stretches
from vgyro.metrics.correlation import autocorrelation, correlation_length

UNIT_S = 1.0
FEWEST_UNITS = 8
FEWEST_BLOCKS = 8
UNITS_AT_ONCE = 256


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


@dataclass(frozen=True)
class UnitGrid:
    """Where samples are cut into units of about 1 s, the last one of a stretch longer.

    at [U] : first sample of each unit;  samples, length : of the series, and of an ordinary unit
    valid [U] : samples of the unit at which a second difference may begin: all but those at the end of a stretch
    """

    at: np.ndarray
    samples: int
    length: int
    valid: np.ndarray

    def units_of(self, series: np.ndarray) -> Units:
        """Units of one series [T], a part of it at a time."""
        count = np.diff(np.append(self.at, self.samples))
        sums = np.zeros((3, len(self.at)))
        for start in range(0, len(self.at), UNITS_AT_ONCE):
            part = slice(start, start + UNITS_AT_ONCE)
            sums[:, part] = self._sums(series, self.at[part], count[part], self.valid[part])
        total, squares, steps = sums[:, :, None]
        return Units(count.astype(float), total, squares, steps, self.valid.astype(float))

    def _sums(self, series: np.ndarray, at: np.ndarray, count: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """Sum, squares, and squares of half the second differences at 1 s, [3, units of this part]."""
        first, samples, length = int(at[0]), int(count.sum()), self.length
        values = series[first : first + samples + 2 * length].astype(float)
        angle = np.empty(values.size + 1)
        angle[0] = 0.0
        np.cumsum(values - values.mean(), out=angle[1:])
        inside, own = at - first, values[:samples]
        steps = np.zeros(samples)
        whole = min(max(angle.size - 2 * length, 0), samples)
        if whole:
            middle = angle[length : length + whole]
            difference = angle[2 * length : 2 * length + whole] - middle - (middle - angle[:whole])
            steps[:whole] = difference**2 / (2 * length**2)
        for unit in np.flatnonzero(valid < count).tolist():
            steps[inside[unit] + valid[unit] : inside[unit] + count[unit]] = 0.0
        return np.stack([np.add.reduceat(row, inside) for row in (own, own**2, steps)])


def unit_grid(cuts: list[tuple[int, int]], rate_hz: float) -> UnitGrid:
    """Cut the samples at rate_hz into units of 1 s, at least one sample.

    cuts : first sample and last + 1 of each gap-free stretch, one after another; no unit lies across two
    """
    length = max(round(UNIT_S * rate_hz), 1)
    starts = [start + length * np.arange(max((stop - start) // length, 1)) for start, stop in cuts]
    ends = [np.full(len(one), stop) for one, (_, stop) in zip(starts, cuts, strict=True)]
    at = np.concatenate([np.empty(0, np.int64), *starts])
    last = np.concatenate([np.empty(0, np.int64), *ends]) - 2 * length + 1
    samples = cuts[-1][1] if cuts else 0
    return UnitGrid(at, samples, length, np.clip(last - at, 0, np.diff(np.append(at, samples))))


def joined(units: list[Units]) -> Units:
    """The units of several series on one grid."""
    total, squares, steps = (
        np.concatenate([getattr(one, name) for one in units], axis=1) for name in ("total", "squares", "steps")
    )
    return Units(units[0].count, total, squares, steps, units[0].step_count)


def make_units(rate: np.ndarray, rate_hz: float, segment: np.ndarray | None = None) -> Units:
    """Units of series [T, S] at rate_hz."""
    grid = unit_grid(stretches(np.zeros(len(rate), np.int8) if segment is None else segment), rate_hz)
    return joined([grid.units_of(rate[:, column]) for column in range(rate.shape[1])])


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
    count = block_sums(units.count[:, None], starts, block)
    centre = units.total.sum(axis=0) / units.count.sum()
    # Moments about the overall mean: those about zero would cancel where a bias is large against the noise.
    shifted = units.total - units.count[:, None] * centre
    squares = units.squares - 2 * centre * units.total + units.count[:, None] * centre**2
    mean = block_sums(shifted, starts, block) / count
    variance = (block_sums(squares, starts, block) - count * mean**2) / np.maximum(count - 1, 1)
    step_count = block_sums(units.step_count[:, None], starts, block)
    with np.errstate(invalid="ignore", divide="ignore"):
        allan = block_sums(units.steps, starts, block) / step_count
    return Resampled(mean + centre, np.sqrt(np.maximum(variance, 0)), np.sqrt(np.maximum(allan, 0)), block)


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
