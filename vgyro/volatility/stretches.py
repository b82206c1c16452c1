"""Stretches of a series without a gap, and the rolling windows in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.runs import runs


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
    return [Window(start, stop) for start, stop in runs(*marks).tolist()]


@dataclass(frozen=True)
class RollingWindows:
    """All full windows of a series: [k·step, k·step + length) from the start of each stretch, never across its border.

    runs  : all stretches of the series, in order
    start : [K] first sample of each window;  run : [K] number of the stretch it lies in
    stretch_start, stretch_stop : [K] first sample of that stretch, and one past its last
    """

    runs: tuple[Window, ...]
    length: int
    step: int
    start: np.ndarray
    run: np.ndarray
    stretch_start: np.ndarray
    stretch_stop: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    @property
    def samples(self) -> int:
        """Samples of the series."""
        return self.runs[-1].stop if self.runs else 0

    def window(self, number: int) -> Window:
        """Samples of one window."""
        start = int(self.start[number])
        return Window(start, start + self.length)


def rolling_windows(runs: Sequence[Window], length: int, step: int) -> RollingWindows:
    """The rolling windows of a series whose stretches are `runs`."""
    edges = np.array(runs, dtype=np.int64).reshape(-1, 2)
    counts = np.maximum(0, (edges[:, 1] - edges[:, 0] - length) // step + 1)
    number = np.repeat(np.arange(len(edges)), counts)
    within = np.arange(len(number)) - (np.cumsum(counts) - counts)[number]
    first, last = edges[number].T
    return RollingWindows(tuple(runs), length, step, first + step * within, number, first, last)


def windows(segment: np.ndarray, window: int, step: int) -> list[Window]:
    """The rolling windows of a series as a list; segment [M] numbers its stretches."""
    plan = rolling_windows(stretches(segment), window, step)
    return [plan.window(number) for number in range(len(plan))]
