"""Stamps as logged → seconds that go on: wraps undone, restarts found."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Bools, Floats

DAY_S = 86_400.0
LONGEST_STEP = 1e9  # periods; the clock was set if the stamps jump by more
FAR = 1000  # periods that may pass across a wrap that is known to exist
INT_LIMIT = 1 << 62  # differences of smaller integers do not overflow
LATEST_S = 1e13


class UnfoldRule(NamedTuple):
    """How stamps go on; all but scale in ticks.

    scale  : s a tick
    period : usual advance from row to row
    usual  : largest usual step
    back   : a stamp may come this much before the one ahead of it; beyond, the clock began anew
    wraps  : where the stamps might begin anew, until the first one fits
    known  : where they do, if that is known from the start
    """

    scale: float
    period: float
    usual: float
    back: float
    wraps: tuple[float, ...]
    known: float | None


class Unfolded(NamedTuple):
    """seconds: float64 [n], NaN where the stamp is bad; restart: bool [n]."""

    seconds: np.ndarray
    restart: np.ndarray


def known_wraps(unit: str, scale: float) -> tuple[float, ...]:
    """Ticks after which clocks begin anew: counters of 16, 24 and 32 bits, millis of a 32-bit µs counter, fields of
    seconds, minutes and hours."""
    counters = [float(1 << 16), float(1 << 24), float(1 << 32)] + ([2**32 / 1000] if unit == "ms" else [])
    return tuple(sorted({*counters, 60 / scale, 3600 / scale, DAY_S / scale}))


def usable(stamps: Floats, scale: float) -> Bools:
    """bool [n]: stamps that can be reckoned with."""
    if np.issubdtype(stamps.dtype, np.integer):
        return (stamps > -INT_LIMIT) & (stamps < INT_LIMIT)
    return np.isfinite(stamps) & (np.abs(stamps) < LATEST_S / scale)


def spikes(stamps: Floats, good: Bools, rule: UnfoldRule) -> Bools:
    """bool [n]: stamps far off while those before and after fit each other: one damaged number. Never the ends."""
    found = np.zeros(len(stamps), dtype=bool)
    if len(stamps) < 3:
        return found
    safe = np.where(good, stamps, 0)
    before, here, after = safe[:-2], safe[1:-1], safe[2:]
    across = after - before
    fit = (across >= 0) & (across <= 2 * rule.usual)
    far = max(5 * rule.period, 2 * rule.usual)
    off = (here - np.maximum(before, after) > far) | (np.minimum(before, after) - here > far)
    found[1:-1] = fit & off & good[:-2] & good[2:]
    return found & good


def fits(step: np.ndarray, before: np.ndarray, wrap: float, limit: np.ndarray | float) -> np.ndarray:
    """bool [n]: backward steps that are usual steps across a wrap."""
    across = step + wrap
    return (step < 0) & (across >= 0) & (across <= limit) & (before <= wrap)


@dataclass
class Unfolder:
    """Unfold block by block. wraps: how many so far; wrap: at how many ticks, once known; restarts: how many so far."""

    rule: UnfoldRule
    wraps: int = 0
    restarts: int = 0

    def __post_init__(self) -> None:
        self.wrap = self.rule.known
        self._last: np.ndarray | None = None  # the last good stamp [1]
        self._base: np.ndarray | None = None  # the stamp from which seconds are counted …
        self._start = 0.0  # … and its own seconds
        self._turns = 0  # wraps since
        self._seconds = 0.0  # of the last good stamp
        self._rows = 0  # bad rows since

    def feed(self, stamps: np.ndarray, bad: np.ndarray) -> Unfolded:
        """stamps: [n]; bad: bool [n]. A restart follows one period after the row before."""
        out = Unfolded(np.full(len(stamps), np.nan), np.zeros(len(stamps), dtype=bool))
        rows = np.flatnonzero(~bad)
        if not len(rows):
            self._rows += len(stamps)
            return out
        values = stamps[rows]
        if self._last is None or self._base is None:
            self._last, self._base = values[:1], values[:1]
            self._rows = -int(rows[0]) - 1
        before = np.concatenate([self._last, values[:-1]])
        apart = np.diff(rows, prepend=-1 - self._rows)
        step = values - before
        turn = self._turned(step, before, apart)
        forward = step > LONGEST_STEP * self.rule.period * np.maximum(apart, 1)
        again = ((step < -self.rule.back) & ~turn) | forward
        out.seconds[rows] = self._counted(values, turn, again, apart)
        out.restart[rows] = again
        self.wraps += int(turn.sum())
        self.restarts += int(again.sum())
        self._last = values[-1:]
        self._rows = len(stamps) - 1 - int(rows[-1])
        return out

    def _turned(self, step: np.ndarray, before: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """bool [n]: rows before which the stamps wrapped."""
        first = 0
        limit = self.rule.usual * np.maximum(apart, 1)
        if self.wrap is None:
            backward = np.flatnonzero(step < 0)
            hits = [
                (int(backward[hit[0]]), wrap)
                for wrap in self.rule.wraps
                if len(hit := np.flatnonzero(fits(step[backward], before[backward], wrap, limit[backward])))
            ]
            if not hits:
                return np.zeros(len(step), dtype=bool)
            first, self.wrap = min(hits)
        far = self.wrap / 2 if self.rule.known is not None else min(self.wrap / 2, FAR * self.rule.period)
        turn = fits(step, before, self.wrap, np.maximum(limit, far))
        turn[:first] = False
        return turn

    def _counted(self, values: np.ndarray, turn: np.ndarray, again: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Seconds of each good row; reckoned from the last restart, so that blocks of any size give the same."""
        seconds = np.empty(len(values))
        borders = [0, *np.flatnonzero(again).tolist(), len(values)]
        for number, (low, high) in enumerate(itertools.pairwise(borders)):
            if number:
                self._start = self._seconds + self.rule.period * self.rule.scale * max(1, int(apart[low]))
                self._base, self._turns = values[low : low + 1], 0
            if low == high:
                continue
            turns = self._turns + np.cumsum(turn[low:high])
            ticks = (values[low:high] - self._base).astype(np.float64)
            if self.wrap is not None:
                ticks += turns * self.wrap
            seconds[low:high] = ticks * self.rule.scale + self._start
            self._turns, self._seconds = int(turns[-1]), float(seconds[high - 1])
        return seconds
