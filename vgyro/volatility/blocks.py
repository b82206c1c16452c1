"""Block means of a recording that comes piece by piece."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.errors import ConfigError
from vgyro.runs import run_starts

PIECE = 1 << 18
"""Samples that block means are made of at a time."""


def block_length(rate_hz: float, block_hz: float | str) -> int:
    """Samples in a block: rate_hz/block_hz, rounded; 1 for "full".

    raises : ConfigError if block_hz is above rate_hz
    """
    if block_hz == "full":
        return 1
    if float(block_hz) > rate_hz * (1 + 1e-6):
        raise ConfigError(
            f"a series of {block_hz} Hz cannot be made of rates of {rate_hz:g} Hz",
            "analysis.volatility.rate_hz",
            "lower it, or write full",
        )
    return max(1, round(rate_hz / float(block_hz)))


@dataclass(frozen=True)
class Runs:
    """The runs of samples that are used, over which the time between two samples is known.

    start, stop [R] : first sample of each run, and one past its last
    jump, lost [J]  : samples before which a few samples were lost, within a run, and how many
    length          : slots in a block; a lost sample leaves its slot empty
    """

    start: np.ndarray
    stop: np.ndarray
    jump: np.ndarray
    lost: np.ndarray
    length: int

    def slots(self, sample: Ints) -> Ints:
        """Slots from the first sample of the recording to each sample, were nothing lost but within the runs."""
        total = np.concatenate([[0], np.cumsum(self.lost)])
        slots: Ints = sample + total[np.searchsorted(self.jump, sample, side="right")]
        return slots


class RunFinder:
    """Finds the runs: `add` the samples piece by piece, then `runs`.

    A gap of known duration, no longer than half a block, counts its lost samples. A longer one, a restart of the board,
    and a change between samples that are used and samples that are not end a run.
    """

    def __init__(self, rate_hz: float, length: int) -> None:
        self._rate_hz, self._length, self._count = rate_hz, length, 0
        self._before: tuple[np.ndarray, ...] = ()
        none = np.empty(0, dtype=np.int64)
        self._edges, self._jumps, self._lost, self._used = [none], [none], [none], [np.empty(0, dtype=bool)]

    def add(self, time: np.ndarray, segment: np.ndarray, use: np.ndarray) -> None:
        """time [B] s, segment [B] and use [B] of the next samples."""
        if len(time) == 0:
            return
        if not self._before:
            self._edges.append(np.zeros(1, dtype=np.int64))
            self._used.append(use[:1])
        offset = self._count - (1 if self._before else 0)
        if self._before:
            time, segment, use = (np.concatenate(pair) for pair in zip(self._before, (time, segment, use), strict=True))
        border, turned = segment[1:] != segment[:-1], use[1:] != use[:-1]
        place = np.flatnonzero(border | turned) + 1
        periods = np.rint((time[place] - time[place - 1]) * self._rate_hz).astype(np.int64)
        # Without lost samples in between, the time that passed is not known: the board was restarted.
        bridged = (periods >= 2) & (periods - 1 <= self._length // 2) & ~turned[place - 1]
        self._jumps.append(place[bridged] + offset)
        self._lost.append(periods[bridged] - 1)
        self._edges.append(place[~bridged] + offset)
        self._used.append(use[place[~bridged]])
        self._count = offset + len(time)
        self._before = (time[-1:], segment[-1:], use[-1:])

    def runs(self) -> Runs:
        """The runs of all samples so far that are used."""
        edges, used = np.concatenate(self._edges), np.concatenate(self._used)
        stop = np.append(edges[1:], self._count)[: len(edges)]
        jump, lost = np.concatenate(self._jumps), np.concatenate(self._lost)
        return Runs(edges[used], stop[used], jump, lost, self._length)


@dataclass(frozen=True)
class Blocks:
    """Some blocks: values [b, N] deg/s; time [b] s and segment [b] of the first sample; stretch [b]"""

    values: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    stretch: np.ndarray


class BlockMeans:
    """Makes the blocks: `add` the samples piece by piece, in order, and take the blocks that are complete.

    present : gyro → share of its samples that have a value, of the gyros that lack some (NaN). A block is the mean of
              the values that are there; with less than half as many as usual for that gyro it is NaN. Blocks in which
              no gyro has enough are left out.
    """

    def __init__(self, runs: Runs, present: Mapping[int, float] | None = None) -> None:
        self._runs, self._count = runs, 0
        self._present = dict(present or {})
        slots = runs.slots(runs.stop - 1) - runs.slots(runs.start) + 1
        # A run's last block is complete when the run reaches its last slot.
        self._complete = slots // runs.length
        # Blocks are numbered through, with a number left out between two runs.
        self._first = np.concatenate([[0], np.cumsum(self._complete + 2)])
        self._open: tuple[np.ndarray, ...] = ()
        self._last, self._stretch = -2, -1

    def add(self, rate: Sequence[np.ndarray], time: np.ndarray, segment: np.ndarray) -> Blocks:
        """The blocks that end in the next samples; rate: N arrays [B] deg/s (N may be 0), time [B] s, segment [B]."""
        run, sample = self._used(len(time))
        inside = sample - self._count
        self._count += len(time)
        if len(inside) < len(time):
            rate, time, segment = [one[inside] for one in rate], time[inside], segment[inside]
        slot = self._runs.slots(sample) - self._runs.slots(self._runs.start)[run]
        block = slot // self._runs.length + self._first[run]
        if self._runs.length == 1:
            values = _columns(rate, len(time))
            if self._present:
                some = np.isfinite(values).any(axis=1)
                block, values, time, segment = block[some], values[some], time[some], segment[some]
            return self._numbered(block, values, time, segment)
        if self._present:
            rate = self._with_counts(rate)
        first = run_starts(block)
        count = np.diff(first, append=len(block))
        sums = _columns([np.add.reduceat(one, first, dtype=float) if len(first) else one for one in rate], len(first))
        return self._whole(block[first], run[first], count, sums, time[first], segment[first])

    def _with_counts(self, rate: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The gyros, zero where one has no value, and behind them 1 or 0 for each that lacks some: has it one?"""
        there = [np.isfinite(rate[gyro]) for gyro in self._present]
        filled = list(rate)
        for gyro, mask in zip(self._present, there, strict=True):
            filled[gyro] = np.where(mask, rate[gyro], 0.0)
        return [*filled, *there]

    def _means(self, sums: Floats, count: Ints) -> Floats:
        """Means [b, N] of blocks with `count` [b] samples; NaN where a gyro has too few values."""
        if not self._present:
            return sums / count[:, None]
        gyros = sums.shape[1] - len(self._present)
        means = sums[:, :gyros] / count[:, None]
        for place, (gyro, share) in enumerate(self._present.items(), gyros):
            own = sums[:, place]
            enough = (own > 0) & (2 * own >= share * count)
            means[:, gyro] = np.divide(sums[:, gyro], own, out=np.full(len(own), np.nan), where=enough)
        return means

    def rest(self) -> Blocks | None:
        """What the last block gives, after all samples; None if none was begun."""
        found, self._open = self._open, ()
        return self._good(*found) if found else None

    def _used(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Run and number of each of the next `count` samples that lie in a run."""
        runs, begin, end = self._runs, self._count, self._count + count
        inside = np.arange(np.searchsorted(runs.stop, begin, side="right"), np.searchsorted(runs.start, end))
        start, stop = np.maximum(runs.start[inside], begin), np.minimum(runs.stop[inside], end)
        length = stop - start
        before = np.cumsum(length) - length
        sample = np.arange(int(length.sum())) + np.repeat(start - before, length)
        return np.repeat(inside, length), sample

    def _whole(
        self,
        block: np.ndarray,
        run: np.ndarray,
        count: np.ndarray,
        sums: np.ndarray,
        time: np.ndarray,
        segment: np.ndarray,
    ) -> Blocks:
        """Keep the last block open, for what the next samples add to it; give the blocks before it."""
        found: tuple[np.ndarray, ...] = (block, run, count, sums, time, segment)
        if self._open and len(block) and self._open[0][0] == block[0]:
            count[0] += self._open[2][0]
            sums[0] += self._open[3][0]
            time[0], segment[0] = self._open[4][0], self._open[5][0]
        elif self._open:
            found = tuple(np.concatenate(pair) for pair in zip(self._open, found, strict=True))
        self._open = tuple(one[-1:] for one in found) if len(found[0]) else ()
        return self._good(*(one[:-1] for one in found))

    def _good(
        self,
        block: np.ndarray,
        run: np.ndarray,
        count: np.ndarray,
        sums: np.ndarray,
        time: np.ndarray,
        segment: np.ndarray,
    ) -> Blocks:
        """The blocks that are complete and of which at least half of the samples are there."""
        good = (2 * count >= self._runs.length) & (block - self._first[run] < self._complete[run])
        values = self._means(sums[good], count[good])
        block, time, segment = block[good], time[good], segment[good]
        if self._present:
            some = np.isfinite(values).any(axis=1)
            block, values, time, segment = block[some], values[some], time[some], segment[some]
        return self._numbered(block, values, time, segment)

    def _numbered(self, block: np.ndarray, values: np.ndarray, time: np.ndarray, segment: np.ndarray) -> Blocks:
        """Number the stretches: a block that is left out, and the end of a run, begin a new one."""
        new = np.diff(block, prepend=self._last) != 1
        stretch = self._stretch + np.cumsum(new)
        if len(block):
            self._last, self._stretch = int(block[-1]), int(stretch[-1])
        return Blocks(values, time, segment, stretch.astype(np.int32))


def _columns(rate: Sequence[np.ndarray], rows: int) -> np.ndarray:
    return np.column_stack(rate) if rate else np.empty((rows, 0))
