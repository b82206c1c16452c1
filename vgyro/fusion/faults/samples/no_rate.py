"""Gyros that give no rate: one value repeated (stuck), or the value of zero counts, or none (dropout)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.events import FaultEvent, FaultKind
from vgyro.fusion.samples.quantised import steps
from vgyro.fusion.types import ArrayRates
from vgyro.runs import true_runs

SHORTEST_S = 1.0
RAREST = 1e-9
"""A run is no chance where the expected number of runs as long as it in the whole recording is below this."""
TIMES_USUAL = 10.0
USUAL_SHARE = 0.75
SAME = 1e-3
"""Two samples are one value if they differ by less than this share of the usual difference: a compensation of the
temperature turns a repeated count into rates that creep."""
LEAST_USUAL = 0.05
"""The usual difference of a gyro is that of the middle one times this, at least."""
ALIVE_CHANGES = 0.2
"""Where the others change from fewer of their samples to the next, their counts are coarser than their noise."""
MOVED_STEPS = 2.0
SLOW, FEWEST_RUNS = 0.5, 10
"""Runs of missing samples a value there, and at all, from which a gyro counts as one at a lower rate."""
PIECE = 1 << 18
MOST_SAMPLED = 200_000
NEAR = 6.0  # s.d. of a sample


def find_dead(array: ArrayRates, zero: np.ndarray | None = None) -> list[FaultEvent]:
    """Stretches in which a gyro repeats one value, longer than it does by chance, or has none.

    Values that are missing, and were filled in (array.missing), are a dropout where they are for a second or more.
    zero : [N, 2] deg/s, between which the rate of a count of zero lies, NaN where not known
    A run is judged against this channel's own: the chance of equal neighbours, and its usual run, since few levels make
    equal counts normal, and against what the others do meanwhile. It is a dropout where its value is that of zero
    counts, or far from what the gyro gave before.
    """
    found = []
    gyros = array.rate.shape[1]
    usual = np.array([_usual_difference(array.rate[:, gyro]) for gyro in range(gyros)])
    # A repeated count creeps where the temperature is compensated: its own differences are none.
    usual = np.maximum(usual, LEAST_USUAL * np.median(usual))
    for gyro in range(gyros):
        column = array.rate[:, gyro]
        runs = _runs(column, array.segment, float(usual[gyro]))
        level = (math.nan, math.nan) if zero is None else (float(zero[gyro, 0]), float(zero[gyro, 1]))
        long = (run for run in _too_long(runs, array) if not may_be_rounded(array, gyro, *run))
        found += [_event(array, gyro, start, stop, level) for start, stop in long]
        if array.missing is None:
            found += [_empty(gyro, start, stop) for start, stop in _missing(column)]
        else:
            found += [_empty(gyro, start, stop) for start, stop in _long_gone(array.missing[:, gyro], array.rate_hz)]
    return sorted(found, key=lambda event: (event.start, event.gyro))


def may_be_rounded(array: ArrayRates, gyro: int, start: int, stop: int) -> bool:
    """May a healthy gyro repeat one value in samples [start, stop)? It may where counts are coarser than the noise.

    Such gyros do not change between two counts, and one that lies near a border does; but what the board moves by some
    counts, it must follow. While the others go to and fro between two counts alone, nothing moves by one.
    """
    others = np.delete(np.arange(array.rate.shape[1]), gyro)
    if not len(others):
        return False
    part, step = array.rate[start:stop][:, others], steps(array)
    if bool(np.median(np.ptp(part, axis=0) - step[others] * (1.0 + SAME)) <= 0.0):
        return True
    if float(np.median(np.mean(part[1:] != part[:-1], axis=0))) >= ALIVE_CHANGES:
        return False
    together = np.median(part, axis=1)
    return float(np.ptp(together)) <= MOVED_STEPS * float(step[gyro])


def _usual_difference(column: np.ndarray) -> float:
    """Median of the differences between neighbours that are not equal."""
    step = max(1, len(column) // MOST_SAMPLED)
    some = np.abs(np.diff(column.astype(float))[::step]) if step == 1 else _some_differences(column, step)
    some = some[some > 0]
    return float(np.median(some)) if some.size else 0.0


def _some_differences(column: Floats, step: int) -> Floats:
    places = np.arange(0, len(column) - 1, step)
    return np.abs(column[places + 1].astype(float) - column[places])


def _runs(column: np.ndarray, segment: np.ndarray, usual: float) -> np.ndarray:
    """[M, 2] runs of two or more samples of one value; none crosses a gap."""
    parts, open_from = [], -1
    for first in range(0, len(column) - 1, PIECE):
        last = min(first + PIECE, len(column) - 1)
        values = column[first : last + 1]
        same = np.abs(np.diff(values)) <= SAME * usual
        same &= segment[first : last + 1][1:] == segment[first : last + 1][:-1]
        turns = np.flatnonzero(np.diff(np.concatenate([[open_from >= 0], same]).astype(np.int8)))
        begins, ends = turns[same[turns]] + first, turns[~same[turns]] + first + 1
        if open_from >= 0 and ends.size:
            begins, open_from = np.append(open_from, begins), -1
        if begins.size > ends.size:
            open_from, begins = int(begins[-1]), begins[:-1]
        parts.append(np.column_stack([begins, ends]))
    if open_from >= 0:
        parts.append(np.array([[open_from, len(column)]]))
    return np.concatenate(parts) if parts else np.empty((0, 2), dtype=np.int64)


def _too_long(runs: np.ndarray, array: ArrayRates) -> Iterator[tuple[int, int]]:
    """The runs that are no chance."""
    lengths = runs[:, 1] - runs[:, 0]
    candidates = np.flatnonzero(lengths >= max(2, SHORTEST_S * array.rate_hz))
    if candidates.size == 0:
        return
    samples, equal = len(array.rate), float((lengths - 1).sum())
    order = np.sort(lengths)
    for index in candidates:
        length = int(lengths[index])
        others = max(equal - (length - 1), 0.0) / max(samples - length, 1)
        chance = (length - 1) * math.log(max(others, 1e-12)) + math.log(samples)
        if chance < math.log(RAREST) and length >= TIMES_USUAL * _usual_run(order, length, samples):
            yield int(runs[index, 0]), int(runs[index, 1])


def _usual_run(order: np.ndarray, length: int, samples: int) -> int:
    """Length of the run that holds a sample at the 75th percentile; one run of `length` is left out.

    order : [M] lengths of all runs, sorted
    """
    held = np.cumsum(order) - length * (order >= length)
    others = samples - length
    single = others - int(order.sum() - length)
    if single >= USUAL_SHARE * others:
        return 1
    place = int(np.searchsorted(held, USUAL_SHARE * others - single))
    return int(order[min(place, len(order) - 1)])


def _event(array: ArrayRates, gyro: int, start: int, stop: int, zero: tuple[float, float]) -> FaultEvent:
    kind: FaultKind = "dropout" if _is_dropout(array, gyro, start, stop, zero) else "stuck"
    return FaultEvent(gyro, kind, start, stop, math.inf, math.nan, "")


def _is_dropout(array: ArrayRates, gyro: int, start: int, stop: int, zero: tuple[float, float]) -> bool:
    column = array.rate[:, gyro]
    value = float(column[(start + stop) // 2])
    usual = _usual_difference(column[max(0, start - 2000) : start])
    if math.isfinite(zero[0]):
        return zero[0] <= value <= zero[1]
    around = np.r_[max(0, start - 20) : start, stop : min(len(column), stop + 20)]
    if around.size < 4 or array.rate.shape[1] < 2:
        return False
    others = np.delete(np.arange(array.rate.shape[1]), gyro)
    now = column[around].astype(float) - np.median(array.rate[around][:, others], axis=1)
    # What is stuck repeats a rate that was right when the run began.
    jump = value - float(np.median(array.rate[start, others])) - float(np.median(now))
    spread = float(np.median(np.abs(now - np.median(now)))) * 1.4826
    return abs(jump) > NEAR * max(spread, usual)


def _missing(column: np.ndarray) -> Iterator[tuple[int, int]]:
    """Runs of samples without a number."""
    for first in range(0, len(column), PIECE):
        if np.isnan(column[first : first + PIECE]).any():
            yield from ((int(start), int(stop)) for start, stop in true_runs(np.isnan(column)))
            return


def _long_gone(gone: np.ndarray, rate_hz: float) -> Iterator[tuple[int, int]]:
    """Runs of missing samples, each a second or more and longer than a slow gyro's values usually lie apart.

    gone : [T] where one gyro has no value, and was filled in.  Shorter ones are filled in well enough.
    """
    runs = true_runs(gone)
    if not len(runs):
        return
    lengths = runs[:, 1] - runs[:, 0]
    # Of a gyro at a lower rate than the others most values stand alone between two runs.
    slow = len(runs) >= max(FEWEST_RUNS, SLOW * (len(gone) - lengths.sum()))
    usual = TIMES_USUAL * float(np.median(lengths)) if slow else 0.0
    for start, stop in runs[lengths >= max(SHORTEST_S * rate_hz, usual)]:
        yield int(start), int(stop)


def _empty(gyro: int, start: int, stop: int) -> FaultEvent:
    return FaultEvent(gyro, "dropout", start, stop, math.inf, math.nan, "")
