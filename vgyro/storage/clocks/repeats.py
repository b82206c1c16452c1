"""Rows that bring no new reading: sent twice, or logged faster than the sensor reads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Bools

MIN_RUNS = 20
TWO_LENGTHS = 0.8  # share of runs with one of two adjacent lengths; by chance at most 0.385
BEAT_ROWS = 16.0  # variance of the rows in a window, if lengths came by chance
BEAT_LIMIT = 0.2  # … and the share of it that a beat may show
MIN_WINDOWS = 20


class KeepRule(NamedTuple):
    """drop_repeats: same stamp and values is a repeat. held: rows per reading; 1: each row is one. why: of it."""

    drop_repeats: bool = True
    held: float = 1.0
    why: str = ""


def keep_rule(stamps: np.ndarray, same: np.ndarray) -> KeepRule:
    """Judge the head of a recording.

    Repeats. Rows with the stamp of the row before either repeat it, or the stamps are coarse. Rows that differ show how
    often stamps repeat without the row being a repeat; let p be the share of equal rows among those whose stamp
    advances. If no more rows with an equal stamp are equal than twice what p explains, none is called a repeat.

    Held readings. A logger faster than the sensor gives runs of equal rows with one of two adjacent lengths m, m+1, in
    a regular order; coarse counts that repeat by chance give lengths at random: (1-p) p^(length-1), with which two
    adjacent lengths above 1 never hold more than 0.385 of the runs. Held, if
      (a) for some m >= 2 at least 0.8 of 20 or more runs are m or m+1 rows long; or
      (b) at least 0.98 of the runs are 1 or 2 long, and the number of rows in windows of w runs, w chosen so that
          chance would give a variance of 16, varies less than 0.2 of that in 20 or more windows.

    stamps : [n]
    same   : bool [n]; equal to the row before in every channel
    """
    still = np.zeros(len(stamps), dtype=bool)
    still[1:] = stamps[1:] == stamps[:-1]
    moving = ~still
    moving[:1] = False
    chance = float(same[moving].mean()) if moving.any() else 0.0
    equal, other = int((still & same).sum()), int((still & ~same).sum())
    explained = other * chance / (1 - chance) if chance < 1 else math.inf
    drop = other == 0 or equal > 2 * explained
    rest = same[~(still & same)] if drop else same
    held, why = _held(_lengths(rest))
    return KeepRule(drop, held, why)


def _lengths(same: np.ndarray) -> np.ndarray:
    """Rows of each run of equal rows, without the first and the last run, which may be cut."""
    return np.diff(np.flatnonzero(~same))[1:]


def _held(lengths: np.ndarray) -> tuple[float, str]:
    if len(lengths) < MIN_RUNS:
        return 1.0, ""
    counts = np.bincount(np.minimum(lengths, 100_000))
    pairs = np.append(counts, 0)[:-1] + np.append(counts, [0, 0])[1:-1]
    if len(pairs) > 2:
        m = 2 + int(np.argmax(pairs[2:]))
        share = float(pairs[m]) / len(lengths)
        if share >= TWO_LENGTHS:
            if counts[m] == 0:
                m += 1
            single = lengths[(lengths == m) | (lengths == m + 1)]
            return float(single.mean()), f"{share:.0%} of the runs of equal rows are {m} or {m + 1} rows long"
    return _beat(lengths)


def _beat(lengths: np.ndarray) -> tuple[float, str]:
    variance = float(lengths.var())
    if variance == 0 or np.mean(lengths <= 2) < 0.98:
        return 1.0, ""
    window = max(1, round(BEAT_ROWS / variance))
    windows = len(lengths) // window
    if windows < MIN_WINDOWS:
        return 1.0, ""
    rows = lengths[: windows * window].reshape(windows, window).sum(axis=1)
    share = float(rows.var()) / (window * variance)
    if share >= BEAT_LIMIT:
        return 1.0, ""
    return float(lengths.mean()), f"one or two equal rows alternate with {share:.1%} of the variance of chance"


@dataclass
class Keeper:
    """Choose rows block by block. repeated: rows dropped as repeats; held_back: as readings held."""

    rule: KeepRule
    repeated: int = 0
    held_back: int = 0

    def __post_init__(self) -> None:
        self._last: np.ndarray | None = None
        self._offset = 0  # rows since the last new reading

    def feed(self, stamps: np.ndarray, same: np.ndarray) -> np.ndarray:
        """bool [n]: rows to keep."""
        keep = np.ones(len(stamps), dtype=bool)
        if not len(stamps):
            return keep
        if self._last is None:
            same = same.copy()
            same[0] = False
        before = np.concatenate([stamps[:1] if self._last is None else self._last, stamps[:-1]])
        self._last = stamps[-1:]
        if self.rule.drop_repeats:
            keep = ~(same & (stamps == before))
            self.repeated += len(keep) - int(keep.sum())
        if self.rule.held > 1:
            chosen = self._chosen(same[keep])
            self.held_back += len(chosen) - int(chosen.sum())
            keep[keep] = chosen
        return keep

    def _chosen(self, same: Bools) -> Bools:
        """bool [n]: the first row of each reading; in a run too long for one reading, where the next ones are due."""
        if not len(same):
            return same
        rows = np.arange(1, len(same) + 1)
        new = np.maximum.accumulate(np.where(same, 0, rows))
        offset = np.where(new > 0, rows - new, self._offset + rows)
        self._offset = int(offset[-1])
        readings = np.floor(offset / self.rule.held + 1e-9)
        chosen: Bools = np.ceil(readings * self.rule.held - 1e-9) == offset
        return chosen
