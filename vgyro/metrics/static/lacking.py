"""A series that lacks values: those that it has, and when they were taken, at a rate of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vgyro.metrics.correlation import Correlation, correlation_matrix
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.static.series import without_outliers

MOST_APART = 0.5
"""Share of the values that must follow one another at the own rate, for it to be one."""


def own_samples(values: np.ndarray, sampling: Sampling) -> tuple[np.ndarray, Sampling]:
    """The values that are there, and when they were taken.

    values   : array [T], NaN where there is none;  sampling : of all T samples
    returns  : the same objects where nothing is missing. Else the values [n] and their sampling, in which the missing
               samples count as lost. Where most values are every k-th sample only, as of a gyro at half the rate of the
               others, the rate is the k-th part, and what lies between two slots of it is left out.
    """
    gone = np.isnan(values)
    if not gone.any():
        return values, sampling
    values, own = values[~gone], sampling.without(gone)
    steps = np.diff(own.position)[np.diff(own.stretch) == 0]
    every = int(np.median(steps)) if steps.size else 1
    if every < 2 or np.mean(steps == every) < MOST_APART:
        return values, own
    return _every(values, own, every)


def _every(values: np.ndarray, sampling: Sampling, every: int) -> tuple[np.ndarray, Sampling]:
    """The values at the slots of a rate that is the `every`-th part."""
    phase = sampling.position % every
    usual = int(np.bincount(phase, minlength=every).argmax())
    kept = phase == usual
    position, stretch = sampling.position[kept] // every, sampling.stretch[kept]
    own = replace(sampling, rate_hz=sampling.rate_hz / every, position=position, stretch=stretch)
    return values[kept], own.without(np.zeros(len(position), dtype=bool))


def cleaned_of(values: np.ndarray, rate_hz: float, segment: np.ndarray, threshold: float | None) -> np.ndarray:
    """A series [T] with its outliers replaced by what is around them; NaN stays, where there is no value.

    segment : [T] number of the gap-free stretch
    """
    gone = np.isnan(values)
    if not gone.any():
        return without_outliers(values, rate_hz, segment, threshold)[0]
    found = values.copy()
    found[~gone] = without_outliers(values[~gone], rate_hz, segment[~gone], threshold)[0]
    return found


def correlation_of(
    series: Sequence[np.ndarray],
    incomplete: Sequence[int],
    rate_hz: float,
    segment: np.ndarray,
    confidence: float,
    truth: np.ndarray | None = None,
) -> Correlation:
    """correlation_matrix of series some of which lack values: each pair from the samples that both have.

    series : N arrays [T], NaN where there is no value;  incomplete : places of those that lack some
    The others are as if these were not there. A pair without a sample in common is NaN.
    """
    if not incomplete:
        return correlation_matrix(series, rate_hz, segment, confidence, truth)
    whole = [place for place in range(len(series)) if place not in incomplete]
    number = len(series)
    found = Correlation(*(np.full((number, number), np.nan) for _ in range(4)))
    if whole:
        _put(found, whole, correlation_matrix([series[place] for place in whole], rate_hz, segment, confidence, truth))
    for place in incomplete:
        own = series[place]
        for other in range(number):
            if other == place or (other in incomplete and other < place):
                continue
            beside = series[other]
            both = np.isfinite(own) & np.isfinite(beside)
            if both.sum() > 2:
                pair = correlation_matrix(
                    [own[both], beside[both]], rate_hz, segment[both], confidence,
                    None if truth is None else truth[both],
                )  # fmt: skip
                _put(found, [place, other], pair)
    return found


def _put(found: Correlation, places: list[int], part: Correlation) -> None:
    for name in ("value", "low", "high", "effective"):
        matrix = getattr(found, name)
        # A pair's own variance is of fewer samples than the gyro has: the diagonal stays as it is.
        kept = matrix[places, places].copy()
        matrix[np.ix_(places, places)] = getattr(part, name)
        known = np.isfinite(kept)
        matrix[np.array(places)[known], np.array(places)[known]] = kept[known]
