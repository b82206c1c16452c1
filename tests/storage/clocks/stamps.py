"""Helpers of the tests of clocks: survey and place in one go."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from vgyro.storage.clocks import ClockOptions, ClockRecord, Placed, survey

LOGS = Path(__file__).resolve().parents[2] / "cases" / "logs"


class Run(NamedTuple):
    record: ClockRecord
    placed: Placed

    @property
    def end_rate(self):
        """(n - 1 + lost) / (last - first)"""
        return float(self.placed.counter[-1] / self.placed.time[-1])


def run(stamps, same=None, block=None, **options):
    """Survey the stamps in blocks of so many rows (all at once by default), and place them."""
    stamps = np.asarray(stamps)
    same = np.zeros(len(stamps), dtype=bool) if same is None else np.asarray(same)
    size = block or max(1, len(stamps))
    blocks = [(stamps[low : low + size], same[low : low + size]) for low in range(0, max(1, len(stamps)), size)]
    clock = survey(iter(blocks), ClockOptions(**options))
    parts = [clock.place(*block) for block in blocks]
    return Run(clock.record(), Placed(*(np.concatenate(column) for column in zip(*parts, strict=True))))


def same_as_before(values):
    """bool [n]: equal to the value before."""
    values = np.asarray(values)
    return np.concatenate([[False], values[1:] == values[:-1]])
