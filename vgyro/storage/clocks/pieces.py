"""Pieces of a recording between restarts and long interruptions, and the events within them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from vgyro.storage.clocks.evenness import Judgement
from vgyro.storage.clocks.lines import Bins
from vgyro.storage.clocks.losses import FoundEvents, LossFinder
from vgyro.storage.clocks.model import MAX_GAPS

LONG_LOSS = 1000  # samples; after as many, a line through both sides would hang on their number


@dataclass
class ClockPiece:
    """start: its first kept row. restart: the clock began anew there. elapsed: s from the row before, else.

    first, last : stamps of its first and last row, s
    counter     : number of its last sample, from 0
    lost        : samples missing inside
    """

    start: int
    restart: bool
    elapsed: float
    first: float
    bins: Bins
    last: float = 0.0
    counter: int = -1
    lost: int = 0


@dataclass
class Event:
    """A gap that is listed: kept row after it, lost samples, stamps before and after it, s."""

    row: int
    lost: int
    before: float
    after: float


@dataclass
class Collector:
    """Take filled-in times row by row, find what is lost, sum up what the line needs.

    judgement : what the stamps are
    bin_rows  : rows of a bin
    """

    judgement: Judgement
    bin_rows: int
    pieces: list[ClockPiece] = field(default_factory=list)
    listed: list[Event] = field(default_factory=list)
    set_clocks: int = 0  # lasting steps of the stamps that are no whole periods
    step_sum: float = 0.0  # of usual steps, uneven stamps
    step_squares: float = 0.0
    step_count: int = 0

    def __post_init__(self) -> None:
        self._finder = LossFinder(self.judgement, self._take)
        self._row = 0  # kept rows so far
        self._restart = True
        self._shift = 0.0  # of the stamps' clock in this piece, s
        self._rows: list[np.ndarray] = []
        self._lost: list[np.ndarray] = []

    def feed(self, times: np.ndarray, restart: np.ndarray) -> None:
        """times: float64 [n], s; restart: bool [n], rows at which the clock began anew"""
        borders = [0, *np.flatnonzero(restart).tolist(), len(times)]
        for number, (low, high) in enumerate(itertools.pairwise(borders)):
            if number:
                self._finder.flush()
                self._restart = True
            if high > low:
                self._finder.feed(times[low:high])

    def close(self) -> None:
        """The recording ends."""
        self._finder.flush()

    def events(self) -> tuple[np.ndarray, np.ndarray]:
        """Kept rows before which samples are missing, and how many; within pieces."""
        if not self._rows:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        return np.concatenate(self._rows), np.concatenate(self._lost)

    def _take(self, times: np.ndarray, found: FoundEvents) -> None:
        long = (found.lost > LONG_LOSS) & (self.judgement.losses != "pauses")
        cuts = found.rows[long].tolist()
        elapsed = (found.shift[long] + self.judgement.period).tolist()
        borders = [0, *cuts, len(times)]
        for number, (low, high) in enumerate(itertools.pairwise(borders)):
            if high == low:
                continue
            if number or self._restart:
                self._begin(times[low], self._restart and not number, elapsed[number - 1] if number else 0.0)
                self._restart = False
            inside = (found.rows >= low) & (found.rows < high) & ~long
            self._add(times[low:high], found.rows[inside] - low, found.lost[inside], found.shift[inside])

    def _begin(self, first: float, restart: bool, elapsed: float) -> None:
        self._shift = 0.0
        bins = Bins(self.judgement.period, self.bin_rows)
        self.pieces.append(ClockPiece(self._row, restart and bool(self.pieces), elapsed, float(first), bins))

    def _add(self, times: np.ndarray, rows: np.ndarray, lost: np.ndarray, shift: np.ndarray) -> None:
        piece = self.pieces[-1]
        missing = np.zeros(len(times), dtype=np.int64)
        missing[rows] = lost
        counter = piece.counter + np.cumsum(missing + 1)
        moved = np.zeros(len(times))
        moved[rows[lost == 0]] = shift[lost == 0]
        moved = self._shift + np.cumsum(moved)
        if self.judgement.even:
            piece.bins.add(counter.astype(np.float64), times - moved)
        else:
            self._count_steps(times, piece)
        self._list(times, rows, lost, piece)
        real = lost > 0
        self.set_clocks += int((~real).sum())
        if real.any():
            self._rows.append(rows[real] + self._row)
            self._lost.append(lost[real])
        piece.lost += int(lost.sum())
        piece.counter, piece.last, self._shift = int(counter[-1]), float(times[-1]), float(moved[-1])
        self._row += len(times)

    def _list(self, times: np.ndarray, rows: np.ndarray, lost: np.ndarray, piece: ClockPiece) -> None:
        room = MAX_GAPS - len(self.listed)
        for row, count in zip(rows[lost > 0][:room].tolist(), lost[lost > 0][:room].tolist(), strict=True):
            before = times[row - 1] if row else piece.last
            self.listed.append(Event(row + self._row, count, float(before), float(times[row])))

    def _count_steps(self, times: np.ndarray, piece: ClockPiece) -> None:
        steps = np.diff(times, prepend=times[:1] if piece.counter < 0 else piece.last)
        steps = steps[int(piece.counter < 0) :]
        steps = steps[steps <= self.judgement.pause]
        self.step_sum += float(steps.sum())
        self.step_squares += float((steps**2).sum())
        self.step_count += len(steps)
