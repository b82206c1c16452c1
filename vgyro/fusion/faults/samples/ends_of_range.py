"""Ends of range: samples that are clipped are no rates, and a gyro that clips where the others go on is at fault."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.samples.clipped import clipped
from vgyro.fusion.types import ArrayRates

AS_FAR = 0.8
"""The others go as far as so much of an end of the range while a gyro is at it: else it is stuck there."""
BEYOND = 1.1
"""They go on beyond it, by so much: the end is that gyro's own."""


def find_ends(array: ArrayRates) -> tuple[np.ndarray | None, list[FaultEvent]]:
    """Samples at the end of a gyro's range [T, N], None: there are none, and the gyros that clip before the others.

    One event a gyro, from its first clipped sample to its last.
    """
    mask = clipped(array)
    if mask is None:
        return None, []
    events = []
    mask = mask.copy()
    for gyro in range(mask.shape[1]):
        column, beyond = array.rate[:, gyro], -math.inf
        for end in _ends(column, mask[:, gyro]):
            at_end = mask[:, gyro] & (column == end)
            ratio = _others(array, gyro, at_end) / end if end else 0.0
            if float(np.median(ratio)) < AS_FAR:
                mask[at_end, gyro] = False
            else:
                beyond = max(beyond, float(np.max(ratio)))
        if beyond >= BEYOND and mask[:, gyro].any():
            events.append(_event(gyro, column, mask[:, gyro]))
    return (mask if mask.any() else None), events


def _ends(column: np.ndarray, at_end: np.ndarray) -> Iterator[float]:
    if at_end.any():
        yield from sorted({float(one) for one in (column[at_end].min(), column[at_end].max())})


def _others(array: ArrayRates, gyro: int, rows: Ints) -> Floats:
    """Median of the other gyros in some samples; the gyro itself if it is alone."""
    others = np.delete(np.arange(array.rate.shape[1]), gyro)
    median: Floats = np.median(array.rate[rows][:, others if len(others) else [gyro]].astype(float), axis=1)
    return median


def _event(gyro: int, column: np.ndarray, at_end: np.ndarray) -> FaultEvent:
    places = np.flatnonzero(at_end)
    size = float(np.max(np.abs(column[places])))
    return FaultEvent(gyro, "clipped", int(places[0]), int(places[-1]) + 1, math.inf, size, "deg/s")


def without_ends(dead: Sequence[FaultEvent], at_end: np.ndarray | None) -> list[FaultEvent]:
    """The runs of one value that are not at an end of the range: there a gyro is clipped, not stuck."""
    if at_end is None:
        return list(dead)
    return [one for one in dead if not at_end[one.start : one.stop, one.gyro].mean() > 0.5]
