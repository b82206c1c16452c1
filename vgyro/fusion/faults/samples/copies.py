"""Two channels that are one: a gyro whose samples are those of another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vgyro.fusion.events import FaultEvent
from vgyro.fusion.types import ArrayRates
from vgyro.runs import true_runs

SAME = 1e-3
"""Two changes from one sample to the next are one if they differ by less than this share of the usual change: a
calibration of each channel's own turns equal counts into rates that differ by a factor and a constant."""
MOST_APART = 2.0
"""That factor, or one over it, at most: sensitivities of one array are alike."""
ROUNDINGS = 4.0
LOOK, WINDOWS = 512, 32
LIKELY = 0.5
"""A pair is looked at closely if so many of the changes of some window are the same."""
CERTAIN = 16.0
"""Log of how much too unlikely it must be by chance, after the number of samples."""
LEAST_CHANCE, UNKNOWN_CHANCE = 0.01, 0.9
"""Share of the changes that two gyros have in common by chance, at least, and where no pair of them shows it."""
SHORTEST_S = 10.0
WHOLE = 0.95
"""A copy for so much of the recording is one from its first sample to its last."""


@dataclass(frozen=True)
class _Pair:
    """Changes of `later` are `factor` times those of `first`.  agreed : share of the changes in the windows, at most"""

    first: int
    later: int
    factor: float
    agreed: float
    usual: float


def find_copies(array: ArrayRates) -> list[FaultEvent]:
    """Stretches in which a gyro repeats another one, sample by sample; of two the later one in the array is named.

    Only changes count, and how many of them other pairs have in common: coarse counts are equal for long by chance, and
    what does not change at all is stuck.
    """
    samples, gyros = array.rate.shape
    if gyros < 2 or samples < 3:
        return []
    pairs = _pairs(array)
    suspects = [pair for pair in pairs if pair.agreed >= LIKELY]
    usual = [pair.agreed for pair in pairs if pair.agreed < 1.0]
    chance = float(np.clip(np.median(usual), LEAST_CHANCE, UNKNOWN_CHANCE)) if usual else UNKNOWN_CHANCE
    found: list[FaultEvent] = []
    for pair in suspects:
        for start, stop in _stretches(array, pair, chance):
            # Of three equal channels the second and the third repeat the first.
            if not any(one.gyro in (pair.first, pair.later) and one.start < stop and start < one.stop for one in found):
                found.append(FaultEvent(pair.later, "copy", start, stop, math.inf, math.nan, "", pair.first))
    return found


def _pairs(array: ArrayRates) -> list[_Pair]:
    """What some windows show of every pair."""
    samples, gyros = array.rate.shape
    length = min(LOOK, samples)
    first = np.unique(np.linspace(0, samples - length, WINDOWS).astype(int))
    changes = np.array([np.diff(array.rate[one : one + length].astype(float), axis=0) for one in first])
    usual = [_usual(changes[:, :, gyro]) for gyro in range(gyros)]
    found = []
    for one, other in combinations(range(gyros), 2):
        if usual[one] == 0 or usual[other] == 0:
            continue
        mine, theirs = changes[:, :, one], changes[:, :, other]
        agreed = [_agreed(mine[window], theirs[window], usual[other]) for window in range(len(mine))]
        factor, share = max(agreed, key=lambda pair: pair[1])
        found.append(_Pair(one, other, factor, share, usual[other]))
    return found


def _usual(change: np.ndarray) -> float:
    seen = np.abs(change[change != 0])
    return float(np.median(seen)) if seen.size else 0.0


def _agreed(mine: np.ndarray, theirs: np.ndarray, usual: float) -> tuple[float, float]:
    """Factor between the changes of two gyros, and the share of the changes that fit it."""
    changed = (mine != 0) & (theirs != 0)
    some = (mine != 0) | (theirs != 0)
    if not changed.any():
        return 1.0, 0.0
    factor = float(np.median(theirs[changed] / mine[changed]))
    if not 1.0 / MOST_APART < abs(factor) < MOST_APART:
        return 1.0, 0.0
    same = np.abs(theirs - factor * mine) <= SAME * usual
    return factor, float((same & some).sum() / some.sum())


def _stretches(array: ArrayRates, pair: _Pair, chance: float) -> list[tuple[int, int]]:
    """Samples [start, stop) of the runs in which all changes are the same, and too many for chance."""
    mine, theirs = array.rate[:, pair.first], array.rate[:, pair.later]
    samples = len(mine)
    step, follows = np.diff(mine).astype(float), np.diff(theirs).astype(float)
    tolerance = SAME * pair.usual + ROUNDINGS * float(np.finfo(theirs.dtype).eps) * float(np.abs(theirs).max())
    same = np.abs(follows - pair.factor * step) <= tolerance
    changed = np.concatenate([[0], np.cumsum((step != 0) | (follows != 0))])
    edges = true_runs(same)
    needed = (CERTAIN + math.log(samples)) / -math.log(chance)
    counts = changed[edges[:, 1]] - changed[edges[:, 0]]
    long = (counts >= needed) & (edges[:, 1] - edges[:, 0] >= SHORTEST_S * array.rate_hz)
    spans = [(int(first), int(last) + 1) for first, last in edges[long]]
    if sum(stop - start for start, stop in spans) >= WHOLE * samples:
        return [(0, samples)]
    return spans
