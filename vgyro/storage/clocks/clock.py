"""The clock of one recording: the first pass makes it, the second one asks it for sampling times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.errors import DataError
from vgyro.storage.clocks.head import Rules
from vgyro.storage.clocks.lines import ClockLine
from vgyro.storage.clocks.model import ClockRecord, Placed
from vgyro.storage.clocks.repeats import Keeper
from vgyro.storage.clocks.stream import BadRuns, as_stamps
from vgyro.storage.clocks.unfold import Unfolder, usable


@dataclass(frozen=True)
class Track:
    """Where rows lie, by their number among the kept ones.

    events  : int64 [k], rows before which samples are missing, or the clock began anew, ascending
    lost    : int64 [k + 1], samples missing up to there; 0 first
    starts  : int64 [p], first rows of pieces; counters: their sample numbers; times: s since the first sample
    lines   : one a piece; empty: the stamps are the times
    spikes  : int64, rows as logged whose stamp is one damaged number
    """

    events: np.ndarray
    lost: np.ndarray
    starts: np.ndarray
    counters: np.ndarray
    times: np.ndarray
    lines: list[ClockLine]
    spikes: np.ndarray
    bad: BadRuns

    def counter(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sample number (int64) and gap-free stretch (int32) of kept rows."""
        passed = np.searchsorted(self.events, rows, side="right")
        return rows + self.lost[passed], passed.astype(np.int32)

    def on_line(self, rows: np.ndarray, counter: np.ndarray) -> np.ndarray:
        """Sampling times by the lines of the pieces, s."""
        piece = np.searchsorted(self.starts, rows, side="right") - 1
        times = np.empty(len(rows))
        # Rows ascend, so a piece is one slice.
        for number in np.unique(piece).tolist():
            part = slice(*np.searchsorted(piece, [number, number + 1]).tolist())
            local = (counter[part] - self.counters[number]).astype(np.float64)
            times[part] = self.times[number] + self.lines[number](local)
        return times


class Clock:
    """What `survey` found. `place` wants the same blocks in the same order, once; `rewind` begins again."""

    def __init__(self, rules: Rules, track: Track | None, record: ClockRecord) -> None:
        self._rules, self._track, self._record = rules, track, record
        self.rewind()

    def rewind(self) -> None:
        """The next block is the first one."""
        self._keeper = Keeper(self._rules.keep)
        self._unfolder = None if self._rules.unfold is None else Unfolder(self._rules.unfold)
        self._rows = self._kept = 0
        self._latest = 0.0

    def record(self) -> ClockRecord:
        """What the stamps are and what they say."""
        return self._record

    def place(self, stamps: np.ndarray, same: np.ndarray) -> Placed:
        """Place the rows of the next block.

        stamps : [n] as logged; same: bool [n], row equals the row before in every channel
        raises : DataError if there are more rows than were surveyed
        """
        stamps, same = as_stamps(stamps), np.asarray(same, dtype=bool)
        keep = self._keeper.feed(stamps, same)
        first = self._kept
        rows = np.arange(first, first + int(keep.sum()), dtype=np.int64)
        self._kept += len(rows)
        if self._kept > self._record.samples:
            raise DataError("more rows are to be placed than were surveyed", None, "pass the same blocks twice")
        if self._track is None or self._unfolder is None:
            return Placed(keep, rows / self._record.rate_hz, np.zeros(len(rows), dtype=np.int32), rows)
        counter, segment = self._track.counter(rows)
        if self._track.lines:
            return Placed(keep, self._onward(self._track.on_line(rows, counter)), segment, counter)
        bad = ~usable(stamps, self._rules.scale)
        low, high = np.searchsorted(self._track.spikes, [self._rows, self._rows + len(stamps)])
        bad[self._track.spikes[low:high] - self._rows] = True
        self._rows += len(stamps)
        seconds = self._unfolder.feed(stamps, bad).seconds[keep]
        time = self._track.bad.fill(seconds, first) - self._track.times[0]
        return Placed(keep, self._onward(time), segment, counter)

    def _onward(self, time: np.ndarray) -> np.ndarray:
        """Jitter, a damaged stamp or rounding must not turn time back."""
        time = np.maximum.accumulate(np.concatenate([[self._latest], time]))[1:]
        self._latest = float(time[-1]) if len(time) else self._latest
        return time
