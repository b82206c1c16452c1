"""Stretches of a series without a gap, and the rolling windows in them."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np


class Window(NamedTuple):
    """Samples start to stop - 1 of the series."""

    start: int
    stop: int

    @property
    def length(self) -> int:
        """Number of samples."""
        return self.stop - self.start


def stretches(*marks: np.ndarray) -> list[Window]:
    """The runs over which none of the marks [M] changes, in order."""
    if len(marks[0]) == 0:
        return []
    changed = np.zeros(len(marks[0]) - 1, dtype=bool)
    for mark in marks:
        changed |= mark[1:] != mark[:-1]
    edges = [0, *(np.flatnonzero(changed) + 1).tolist(), len(marks[0])]
    return [Window(start, stop) for start, stop in pairwise(edges)]


def longest_stretch(segment: np.ndarray) -> Window:
    """The longest segment, the first of several; empty for an empty series."""
    return max(stretches(segment), key=lambda stretch: stretch.length, default=Window(0, 0))


def windows(segment: np.ndarray, window: int, step: int) -> list[Window]:
    """All full windows: [k·step, k·step + window) from the start of each segment, never across its border."""
    return [
        Window(start, start + window)
        for stretch in stretches(segment)
        for start in range(stretch.start, stretch.stop - window + 1, step)
    ]
