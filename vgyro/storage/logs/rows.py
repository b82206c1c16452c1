"""Rows of a log without time stamps: a row is a period of the declared rate, and a damaged line a lost one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.errors import DataError
from vgyro.storage.clocks.model import MAX_GAPS, ClockGap, ClockRecord, Placed

CAUSE = "damaged lines"


class RowClock:
    """Place rows by their number.

    rate_hz : declared;  damaged : rows before which a line is damaged, ascending
    raises  : DataError if no rate is declared
    """

    def __init__(self, rate_hz: float | None, damaged: Sequence[int], where: str) -> None:
        if rate_hz is None:
            what = "has no time column, so its rate is not known"
            raise DataError(what, where, "give `rate_hz` for the recording, or name the column under `log.time`")
        self._rate_hz, self._row = rate_hz, 0
        self._damaged = np.asarray(damaged, dtype=np.int64)

    def place(self, _: np.ndarray, same: np.ndarray) -> Placed:
        """Place the next rows; their stamps say nothing."""
        rows = np.arange(self._row, self._row + len(same))
        self._row += len(same)
        lost = np.searchsorted(self._damaged, rows, side="right")
        # What is damaged before the first row was never begun.
        leading = int(np.searchsorted(self._damaged, 0, side="right"))
        counter = rows + lost - leading
        before = np.unique(self._damaged[leading:])
        segment = np.searchsorted(before, rows, side="right").astype(np.int32)
        return Placed(np.ones(len(same), dtype=bool), counter / self._rate_hz, segment, counter)

    def record(self) -> ClockRecord:
        """There is no clock: what is known is the declared rate."""
        leading = int(np.searchsorted(self._damaged, 0, side="right"))
        rows, counts = np.unique(self._damaged[leading:], return_counts=True)
        before = np.cumsum(counts) - counts
        gaps = [
            ClockGap(float((row + lost) / self._rate_hz), float(count / self._rate_hz), int(count), CAUSE)
            for row, lost, count in zip(rows, before, counts, strict=True)
        ]
        return ClockRecord(
            meaning="none", even=None, time_from="rate", why="there is no time column: a row is a period of the rate",
            unit="", unit_why="", samples=self._row, rate_hz=self._rate_hz, rate_sd_hz=None, drift_ppm=None,
            jitter_s=None, resolution_s=None, wrap_s=None, wraps=0, midnights=0, restarts=0, repeated=0, held=1.0,
            lost=int(counts.sum()), least_loss=None, uneven=0.0, gaps=gaps[:MAX_GAPS],
            gaps_not_listed=max(0, len(gaps) - MAX_GAPS), bad_stamps=0, warnings=[],
        )  # fmt: skip
