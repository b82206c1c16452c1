"""Blocks of any size → chunks of one size, stamps filled in where they are bad."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

CHUNK = 1 << 17


class Chunk(NamedTuple):
    """stamps: [n] int64 or float64; same: bool [n]; before, after: the neighbouring rows' stamps, [0] or [1]."""

    stamps: np.ndarray
    same: np.ndarray
    before: np.ndarray
    after: np.ndarray


def as_stamps(stamps: np.ndarray) -> np.ndarray:
    """int64 if they are integers that fit, else float64."""
    stamps = np.asarray(stamps)
    if np.issubdtype(stamps.dtype, np.signedinteger) or (
        np.issubdtype(stamps.dtype, np.unsignedinteger) and stamps.dtype.itemsize < 8
    ):
        return stamps.astype(np.int64, copy=False)
    return stamps.astype(np.float64, copy=False)


def chunked(blocks: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[Chunk]:
    """Chunks of 131 072 rows, the last one shorter; at least one, which may be empty."""
    waiting: Chunk | None = None
    for stamps, same in _regular(blocks):
        if waiting is not None:
            yield waiting._replace(after=stamps[:1])
        before = stamps[:0] if waiting is None else waiting.stamps[-1:]
        waiting = Chunk(stamps, same, before, stamps[:0])
    yield waiting if waiting is not None else Chunk(*(np.empty(0), np.empty(0, dtype=bool)), np.empty(0), np.empty(0))


def _regular(blocks: Iterable[tuple[np.ndarray, np.ndarray]]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    held = 0
    for stamps, same in blocks:
        if not len(stamps):
            continue
        parts.append((as_stamps(stamps), np.asarray(same, dtype=bool)))
        held += len(stamps)
        if held >= CHUNK:
            stamps = np.concatenate([part[0] for part in parts])
            same = np.concatenate([part[1] for part in parts])
            whole = held // CHUNK * CHUNK
            for low in range(0, whole, CHUNK):
                yield stamps[low : low + CHUNK], same[low : low + CHUNK]
            parts, held = [(stamps[whole:], same[whole:])], held - whole
    if held:
        yield np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


class BadRuns(NamedTuple):
    """Runs of kept rows without a usable stamp, and the times around them.

    start, length : int64 [runs], kept rows
    before, after : float64 [runs], s
    """

    start: np.ndarray
    length: np.ndarray
    before: np.ndarray
    after: np.ndarray

    def fill(self, seconds: np.ndarray, first: int) -> np.ndarray:
        """seconds: [n], NaN where bad; first: number of its first row.  returns : interpolated"""
        rows = np.flatnonzero(np.isnan(seconds))
        if not len(rows):
            return seconds
        place = np.searchsorted(self.start, rows + first, side="right") - 1
        share = (rows + first - self.start[place] + 1) / (self.length[place] + 1)
        seconds = seconds.copy()
        seconds[rows] = self.before[place] + (self.after[place] - self.before[place]) * share
        return seconds


class Filler:
    """Interpolate times across bad stamps; rows after the last good one wait for the next.

    period : s; beyond the first and the last good stamp rows follow each other by it
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._runs: list[tuple[np.ndarray, ...]] = []
        self._last: float | None = None
        self._waiting = 0
        self._rows = 0  # given out
        self.bad = 0

    def feed(self, seconds: np.ndarray, restart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """seconds: [n], NaN where bad; restart: bool [n].  returns : both, for rows that are known by now"""
        self.bad += int(np.isnan(seconds).sum())
        seconds = np.concatenate([np.full(self._waiting, np.nan), seconds])
        restart = np.concatenate([np.zeros(self._waiting, dtype=bool), restart])
        good = np.flatnonzero(~np.isnan(seconds))
        known = int(good[-1]) + 1 if len(good) else 0
        self._waiting = len(seconds) - known
        return self._filled(seconds[:known], good), restart[:known]

    def flush(self) -> np.ndarray:
        """Rows at the end without a stamp; nothing if there never was a good one."""
        rows, self._waiting = self._waiting, 0
        if not rows or self._last is None:
            return np.empty(0)
        after = self._last + self._period * (rows + 1)
        self._note(np.array([self._rows]), np.array([rows]), np.array([self._last]), np.array([after]))
        self._rows += rows
        return self._last + self._period * np.arange(1.0, rows + 1)

    def runs(self) -> BadRuns:
        """All of them."""
        if not self._runs:
            return BadRuns(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))
        return BadRuns(*(np.concatenate(column) for column in zip(*self._runs, strict=True)))

    def _filled(self, seconds: np.ndarray, good: np.ndarray) -> np.ndarray:
        if not len(seconds):
            return seconds
        previous = np.concatenate([[-1], good[:-1]])
        length = good - previous - 1
        holes = np.flatnonzero(length)
        if len(holes):
            start = previous[holes] + 1
            after = seconds[good[holes]]
            before = seconds[np.maximum(previous[holes], 0)]
            if start[0] == 0:
                first = after[0] - self._period * (length[holes[0]] + 1)
                before[0] = first if self._last is None else self._last
            runs = (start + self._rows, length[holes], before, after)
            self._note(*runs)
            seconds = BadRuns(*runs).fill(seconds, self._rows)
        self._last = float(seconds[-1])
        self._rows += len(seconds)
        return seconds

    def _note(self, *columns: np.ndarray) -> None:
        self._runs.append(columns)
