"""Where does the board stand still? Found from the gyros themselves."""

from __future__ import annotations

import math

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.config import RestOptions
from vgyro.runs import runs

STEPS_PER_WINDOW = 4
QUIET_QUANTILE = 0.1
MOVING_SHARE = 4  # motion about one axis of three moves a third of the gyros: a quarter of them must see it
SMOOTH = 3.0  # a spread so many times that of adjacent samples is motion, not noise
FEWEST_SAMPLES = 4
WINDOWS_AT_ONCE = 1 << 12


def find_rest(
    rates: np.ndarray, rate_hz: float, options: RestOptions | None = None, segment: np.ndarray | None = None
) -> np.ndarray:
    """True where the board stands still.

    rates   : array [T, N], deg/s or counts, all gyros of the board, every axis; NaN where a gyro has no value. A gyro
              that never changes is left out
    options : window_s, min_duration_s, guard_s, threshold
    segment : array [T] int; no window and no stretch goes across a gap
    returns : bool [T]
    Windows of window_s, a quarter of it apart. A window moves if, for at least a quarter of the gyros, its standard
    deviation exceeds threshold times the gyro's quiet level (the lowest tenth of all windows), or its mean is that far
    from the gyro's level in the quiet windows (a steady turn). Stretches covered by windows at rest are cut by guard_s
    at both ends, and kept if they last min_duration_s. If even the quietest windows vary much more than adjacent
    samples do, the board never rests. A turn slower than threshold times the noise of one sample, begun and ended that
    slowly, is not seen.
    """
    options = options or RestOptions()
    rates = np.asarray(rates)
    samples = len(rates)
    length = max(round(options.window_s * rate_hz), FEWEST_SAMPLES)
    step = max(length // STEPS_PER_WINDOW, 1)
    whole = [[0, samples]] if segment is None else runs(segment).tolist()
    parts = [np.arange(a, b - length + 1, step) for a, b in whole if b - a >= length]
    if not parts:
        return np.zeros(samples, dtype=bool)
    starts = np.concatenate(parts)
    scores = [
        score for column in range(rates.shape[1]) if (score := _scores(rates[:, column], starts, length)) is not None
    ]
    if not scores:
        return np.zeros(samples, dtype=bool)
    score = _most(np.stack(scores))
    covered = np.zeros(samples + 1, dtype=np.int32)
    resting = starts[score < options.threshold]
    np.add.at(covered, resting, 1)
    np.add.at(covered, resting + length, -1)
    still = np.cumsum(covered, out=covered)[:-1] > 0
    return _long_stretches(still, segment, round(options.guard_s * rate_hz), round(options.min_duration_s * rate_hz))


def _most(scores: Floats) -> Floats:
    """Of scores [N, n] the one that a quarter of the gyros reach, in each window; NaN: the gyro has no value there."""
    known = ~np.isnan(scores)
    if known.all():
        score: Floats = np.sort(scores, axis=0)[-math.ceil(len(scores) / MOVING_SHARE)]
        return score
    number = known.sum(axis=0)
    needed = np.maximum(-(-number // MOVING_SHARE), 1)
    ordered = np.sort(np.where(known, scores, -np.inf), axis=0)
    found = ordered[len(scores) - needed, np.arange(scores.shape[1])]
    return np.where(number > 0, found, np.inf)


def _scores(rate: Floats, starts: Ints, length: int) -> Floats | None:
    """How far each window is from rest, in quiet levels, NaN where it has too few values.

    None for a gyro that never changes, or never has a value.
    """
    ends, there = starts + length, np.isfinite(rate)
    if not there.all():
        # The values that are there, one after another; a gyro at half the rate is judged by half as many.
        place = np.concatenate([[0], np.cumsum(there)])
        rate, starts, ends = rate[there], place[starts], place[ends]
        if not len(rate):
            return None
    middle = float(np.median(rate))
    number = math.ceil(len(starts) / WINDOWS_AT_ONCE)
    pieces = zip(np.array_split(starts, number), np.array_split(ends, number), strict=True)
    mean, spread, roughness = np.concatenate([_moments(rate, middle, *piece) for piece in pieces], axis=1)
    if not (spread > 0).any():
        return None
    quiet = float(np.quantile(spread[spread > 0], QUIET_QUANTILE))
    if quiet > SMOOTH * float(np.quantile(roughness[spread > 0], QUIET_QUANTILE)):
        return np.full(len(starts), np.inf)
    calm = spread <= 2 * quiet
    level = float(np.median(mean[calm]))
    scores: Floats = np.maximum(spread, np.abs(mean - level)) / quiet
    return scores


def _moments(rate: np.ndarray, middle: float, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Mean (less `middle`), standard deviation and that of adjacent samples, of each window: [3, n]."""
    first = int(starts[0])
    centred = rate[first : int(ends[-1])].astype(float) - middle
    starts, ends = starts - first, ends - first
    sums, squares = (np.concatenate(([0.0], np.cumsum(values))) for values in (centred, centred**2))
    steps = np.concatenate(([0.0, 0.0], np.cumsum(np.diff(centred) ** 2)))[: len(centred) + 1]
    length = (ends - starts).astype(float)
    length[length < FEWEST_SAMPLES] = np.nan
    mean = (sums[ends] - sums[starts]) / length
    spread = np.sqrt(np.maximum((squares[ends] - squares[starts]) / length - mean**2, 0))
    begins = np.minimum(starts + 1, len(centred))
    roughness = np.sqrt(np.maximum(steps[ends] - steps[begins], 0) / (2 * (length - 1)))
    return np.stack([mean, spread, roughness])


def _long_stretches(still: np.ndarray, segment: np.ndarray | None, guard: int, shortest: int) -> np.ndarray:
    kept = np.zeros(len(still), dtype=bool)
    for start, stop in (runs(still) if segment is None else runs(still, segment)).tolist():
        if still[start] and stop - start - 2 * guard >= max(shortest, 1):
            kept[start + guard : stop - guard] = True
    return kept
