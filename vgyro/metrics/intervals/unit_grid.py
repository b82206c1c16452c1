"""Sums over units of about 1 s on the recording's time grid: what the bootstrap resamples instead of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.metrics.intervals.block_rule import FEWEST_BLOCKS, block_length
from vgyro.metrics.sampling import Sampling
from vgyro.runs import run_starts

UNIT_S = 1.0
UNITS_AT_ONCE = 256
PARTS_IN_UNIT = 4  # steps of a quarter lose a twentieth of the degrees of freedom of steps of one sample
MOSTLY_THERE = 0.9


@dataclass(frozen=True)
class Units:
    """Sums over units of about 1 s, none across the end of a stretch.

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

    def block_length(self, column: int, statistic: str = "mean") -> int:
        """Length of the blocks for one series and one statistic (mean, sigma, adev_1s), in units.

        The rule is applied to what the statistic is a mean of: the unit means, the mean squares about the overall
        mean, the mean squared second differences. Each has its own memory: a drift makes the blocks of the mean long,
        and the Allan deviation at 1 s hardly sees it.
        """
        total, most = self.total[:, column], max(len(self.count) // FEWEST_BLOCKS, 1)
        if statistic == "mean":
            return block_length(total / self.count)
        if statistic == "sigma":
            centre = total.sum() / self.count.sum()
            return block_length((self.squares[:, column] - 2 * centre * total) / self.count + centre**2)
        there = self.step_count > 0
        return min(block_length(self.steps[there, column] / self.step_count[there]), most)


@dataclass(frozen=True)
class UnitGrid:
    """Where samples are cut into units of about 1 s, the last one of a stretch longer, and those into parts.

    at [U]   : first sample of each unit;  samples, length : of the series, and slots of an ordinary unit
    part_at, slot [P] : first sample of each part, and its place on an even grid of parts; stretches are set apart by
               more than a unit. Parts without a sample are not there
    count [P], first [U] : samples of each part; first part of each unit
    per_unit : parts in an ordinary unit, which is unit_s long;  stretch [P] : number of the stretch of each part
    """

    at: np.ndarray
    samples: int
    length: int
    part_at: np.ndarray
    slot: np.ndarray
    count: np.ndarray
    first: np.ndarray
    per_unit: int
    stretch: np.ndarray
    unit_s: float

    def units_of(self, series: np.ndarray, cleaned: np.ndarray | None = None) -> Units:
        """Units of one series [T].

        cleaned : the same [T] with its outliers replaced, for the second differences; None: it has none
        """
        total, squares = self.sums_of(series)
        steps, there = self._steps(total if cleaned is None else self.sums_of(cleaned)[0])
        sums = [self._added(row) for row in (self.count, total, squares, steps, there)]
        return Units(sums[0], sums[1][:, None], sums[2][:, None], sums[3][:, None], sums[4])

    def sums_of(self, series: np.ndarray) -> np.ndarray:
        """Sum and sum of squares of each part [2, P]; some parts at a time."""
        sums = np.zeros((2, len(self.part_at)))
        edges = np.append(self.part_at, self.samples)
        for start in range(0, len(self.part_at), UNITS_AT_ONCE):
            stop = min(start + UNITS_AT_ONCE, len(self.part_at))
            values = np.asarray(series[edges[start] : edges[stop]], dtype=float)
            inside = edges[start:stop] - edges[start]
            sums[0, start:stop] = np.add.reduceat(values, inside)
            sums[1, start:stop] = np.add.reduceat(values * values, inside)
        return sums

    def seconds(self) -> tuple[np.ndarray, Sampling]:
        """Place of each unit of the even grid that is 0.9 full, as `means_of` wants it, and when it was [B]."""
        whole = np.unique(self.slot // self.per_unit)
        count = self._windows(self.count)[whole * self.per_unit]
        stretch = self.stretch[np.searchsorted(self.slot, whole * self.per_unit)]
        full = count >= MOSTLY_THERE * self.length
        return whole[full] * self.per_unit, Sampling(1 / self.unit_s, whole[full], stretch[full], 2 * self.unit_s)

    def means_of(self, total: Floats, places: Ints) -> Floats:
        """Means [B] of the units at `places` from the sums of the parts [P]."""
        means: Floats = self._windows(total)[places] / self._windows(self.count)[places]
        return means

    def _windows(self, values: np.ndarray) -> np.ndarray:
        """Sums of values [P] over a unit from every place of the even grid of parts on."""
        size = int(self.slot[-1]) + 1 if len(self.slot) else 0
        running = np.zeros(size + self.per_unit + 1)
        running[self.slot + 1] = values
        np.cumsum(running, out=running)
        running[size + 1 :] = running[size]
        return running[self.per_unit :] - running[: -self.per_unit]

    def _steps(self, total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Half the squared difference of the means of the unit from each part on and the next; 1 or 0: each [P]."""
        if len(total) == 0:
            return total, total
        centred = total - self.count * (total.sum() / self.count.sum())
        count = np.append(self._windows(self.count), np.zeros(self.per_unit))
        full = count >= MOSTLY_THERE * self.length
        mean = np.append(self._windows(centred), np.zeros(self.per_unit)) / np.where(full, count, 1.0)
        following = self.slot + self.per_unit
        there = full[self.slot] & full[following]
        return np.where(there, (mean[following] - mean[self.slot]) ** 2 / 2, 0.0), there.astype(float)

    def _added(self, values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, self.first) if len(self.first) else np.zeros(0)


def unit_grid(cuts: list[tuple[int, int]], rate_hz: float) -> UnitGrid:
    """Cut samples at rate_hz into units of 1 s, at least one sample.

    cuts : first sample and last + 1 of each gap-free stretch, one after another; no unit lies across two
    """
    edges = np.array(cuts, dtype=np.int64).reshape(-1, 2)
    return _grid(edges[:, 0], edges[:, 1] - edges[:, 0], edges[:, 0], np.arange(len(edges)), rate_hz)


def sampled_grid(sampling: Sampling) -> UnitGrid:
    """The same for samples with short losses: a unit is 1 s of the time grid, with the samples that are there."""
    begins = np.empty(len(sampling), dtype=bool)
    begins[:1] = True
    begins[1:] = np.diff(sampling.position) != 1
    begins[1:] |= np.diff(sampling.stretch) != 0
    start = np.flatnonzero(begins)
    length = np.diff(np.append(start, len(sampling)))
    return _grid(start, length, sampling.position[start], sampling.stretch[start], sampling.rate_hz)


def _grid(start: np.ndarray, number: np.ndarray, position: np.ndarray, stretch: np.ndarray, rate_hz: float) -> UnitGrid:
    """From the gap-free runs: first sample, samples, slot of the first, stretch, each [R]."""
    length = max(round(UNIT_S * rate_hz), 1)
    part = max(size for size in range(1, max(length // PARTS_IN_UNIT, 1) + 1) if length % size == 0)
    per_unit, samples = length // part, int(number.sum())
    if samples == 0:
        none = np.zeros(0, np.int64)
        return UnitGrid(none, 0, length, none, none, np.zeros(0), none, per_unit, none, length / rate_hz)
    heads = run_starts(stretch)
    of = np.repeat(np.arange(len(heads)), np.diff(np.append(heads, len(stretch))))
    behind = position - position[heads][of]
    slots = (behind + number)[np.append(heads[1:], len(stretch)) - 1]
    # The parts of each run, those that two runs share taken once.
    low, high = behind // part, (behind + number - 1) // part
    of_run = np.repeat(np.arange(len(start)), high - low + 1)
    place = np.arange(len(of_run)) - np.repeat(np.cumsum(high - low + 1) - (high - low + 1), high - low + 1)
    place += low[of_run]
    part_at = start[of_run] + np.maximum(place * part - behind[of_run], 0)
    owner = of[of_run]
    own = run_starts(place, owner)
    place, part_at, owner = place[own], part_at[own], owner[own]
    # Stretches apart by more than two units, each from a whole unit on.
    room = (-(-slots // length) + 3) * per_unit
    slot = place + (np.cumsum(room) - room)[owner]
    unit = np.minimum(place // per_unit, np.maximum(slots // length, 1)[owner] - 1) + (np.cumsum(room) - room)[owner]
    first = run_starts(unit)
    count = np.diff(np.append(part_at, samples)).astype(float)
    return UnitGrid(part_at[first], samples, length, part_at, slot, count, first, per_unit, owner, length / rate_hz)


def joined(units: list[Units]) -> Units:
    """The units of several series on one grid."""
    total, squares, steps = (
        np.concatenate([getattr(one, name) for one in units], axis=1) for name in ("total", "squares", "steps")
    )
    return Units(units[0].count, total, squares, steps, units[0].step_count)
