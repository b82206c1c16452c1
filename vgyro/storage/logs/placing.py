"""One stream of a log on its clock: rows placed in time, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.runs import true_runs
from vgyro.storage.clocks import Clock, ClockOptions, survey
from vgyro.storage.clocks.model import ClockRecord
from vgyro.storage.frames import Frames
from vgyro.storage.integrity import Ledger
from vgyro.storage.logs.intake import SAME, STAMP, Intake
from vgyro.storage.logs.rows import RowClock

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
WITHOUT_VALUE = "rows without a value"
ORIGIN_ROWS = 4096


class Placing:
    """One stream on its clock.

    intake  : its rows;  rate_hz : declared;  board : whose gyros are among its channels
    unit    : of the stamps, where another stream of the same column told it
    origin_s : what the log's own clock read at time 0 of the frames, s; known when the first block was placed
    raises  : DataError where the stamps do not tell the rate and none is declared
    """

    def __init__(self, intake: Intake, rate_hz: float | None, board: Board, unit: str | None = None) -> None:
        self.intake = intake
        self.alignment: dict[str, Any] = {}
        self.origin_s = 0.0
        here = [gyro.field for gyro in board.gyros if gyro.field in intake.stream.columns]
        self.has_gyros = bool(here)
        # A row of thermometers alone is empty without any reading of theirs.
        self._needed = here or list(intake.stream.columns)
        if not intake.spool.rows:
            raise DataError("has no row", intake.stream.where_it_is, "check `log.columns` in the manifest")
        self.clock: Clock | RowClock
        if intake.time is None:
            self.clock = RowClock(rate_hz, intake.damaged, intake.stream.where_it_is)
            return
        try:
            options = clock_options(intake, rate_hz)
            if unit and options.unit == "auto":
                options = options._replace(unit=unit)
            self.clock = survey(self._stamps(), options)
        except DataError as error:
            raise DataError(error.what, error.where or intake.stream.where_it_is, error.remedy) from None

    @property
    def rate_hz(self) -> float:
        """Rows a second: measured, or declared where stamps say nothing."""
        return float(self.clock.record().rate_hz)

    @property
    def uneven(self) -> float:
        """Standard deviation of the steps over their mean; 0 where sampling is even."""
        return self.clock.record().uneven

    @property
    def measured_rate_hz(self) -> float | None:
        """By the stamps; None where there are none."""
        record = self.clock.record()
        return None if record.meaning == "none" else record.rate_hz

    @property
    def repeated(self) -> int:
        """Rows that were dropped because they came again."""
        return self.clock.record().repeated

    def record(self) -> dict[str, Any]:
        """The clock's part of integrity.json; its gaps stand in the list of all gaps."""
        record = asdict(self.clock.record())
        for name in ("gaps", "warnings"):
            record.pop(name)
        return {"stream": self.intake.stream.name, "channels": list(self.intake.stream.columns), **record,
                "alignment": self.alignment}  # fmt: skip

    def warnings(self) -> tuple[str, ...]:
        """What is good to know of the clock."""
        return tuple(self.clock.record().warnings)

    def frames(self, ledger: Ledger) -> Iterator[Frames]:
        """The rows on the clock, block by block. A row without any gyro's value is lost."""
        record = self.clock.record()
        for gap in record.gaps:
            ledger.add_gap(gap.time, gap.duration, gap.lost, gap.cause)
        holes = Holes(ledger, 1 / record.rate_hz)
        breaks, after_hole, first = 0, False, True
        for block in self.intake.spool.blocks([*self._stamp_name(), SAME, *self.intake.stream.columns]):
            same = block.pop(SAME)
            stamps = block.pop(STAMP, np.arange(len(same)))
            placed = self.clock.place(stamps, same)
            if first and self.intake.time is not None and len(placed.time):
                self.origin_s, first = origin_of(stamps[placed.keep], placed.time, placed.segment, record), False
            columns = {name: values[placed.keep] for name, values in block.items()}
            empty = without_value([columns[name] for name in self._needed])
            holes.take(empty, placed.time)
            ledger.bad += int(empty.sum())
            begins = np.append(after_hole, empty[:-1]) & ~empty if len(empty) else empty
            segment = placed.segment + breaks + np.cumsum(begins, dtype=np.int32)
            if len(empty):
                breaks, after_hole = breaks + int(begins.sum()), bool(empty[-1])
            whole = ~empty
            kept = {name: values[whole] for name, values in columns.items()} if empty.any() else columns
            yield Frames(kept, placed.counter[whole], placed.time[whole], segment[whole])

    def _stamp_name(self) -> list[str]:
        return [] if self.intake.time is None else [STAMP]

    def _stamps(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for block in self.intake.spool.blocks([STAMP, SAME]):
            yield block[STAMP], block[SAME]


def origin_of(stamps: np.ndarray, time: np.ndarray, segment: np.ndarray, record: ClockRecord) -> float:
    """What a clock read at time 0, s: the first stamp, less what its jitter or lateness adds to it.

    stamps : [n] as logged, time : [n] s, segment : [n] of the first rows
    """
    scale = SECONDS.get(record.unit, 1.0)
    rows = slice(0, int(np.searchsorted(segment[:ORIGIN_ROWS], segment[0], side="right")))
    known = np.isfinite(stamps[rows])
    if not known.any():
        return 0.0
    logged, taken = stamps[rows][known], time[rows][known]
    # Differences first: seconds since 1970 in ns are more than a float can hold.
    late = (logged - logged[0]).astype(np.float64) * scale - taken
    beyond = late.min() if record.time_from == "envelope" else late[0]
    beyond = np.median(late) if record.time_from == "line" else beyond
    return float(logged[0]) * scale + float(beyond)


def clock_options(intake: Intake, rate_hz: float | None) -> ClockOptions:
    """What the manifest and the log say of the stamps of a stream."""
    assert intake.time is not None
    timely = intake.kind in ("date", "day")
    return ClockOptions(
        unit="ns" if timely else intake.time.unit,
        meaning=intake.time.meaning,
        wrap=intake.time.wrap,
        rate_hz=rate_hz,
        name=intake.time.column,
        day=intake.kind == "day",
    )


class Holes:
    """Runs of rows without a value, across blocks. Those before the first value and behind the last one are no gaps."""

    def __init__(self, ledger: Ledger, period: float) -> None:
        self._ledger, self._period = ledger, period
        self._begun: float | None = None
        self._rows = 0
        self._inside = False

    def take(self, empty: np.ndarray, time: np.ndarray) -> None:
        """The next rows. empty : bool [n];  time : [n] s"""
        if not len(empty):
            return
        if not empty[0]:
            self._close()
        for start, stop in true_runs(empty).tolist():
            if start or self._begun is None:
                self._inside |= start > 0
                self._begun = float(time[start])
            self._rows += stop - start
            if stop < len(empty):
                self._close()
        self._inside |= not empty.all()

    def _close(self) -> None:
        if self._begun is not None and self._inside:
            self._ledger.add_gap(self._begun, self._rows * self._period, self._rows, WITHOUT_VALUE)
        self._begun, self._rows, self._inside = None, 0, True


def without_value(columns: Sequence[np.ndarray]) -> np.ndarray:
    """bool [n]: no column has a value."""
    empty = np.ones(len(columns[0]), dtype=bool)
    for values in columns:
        if values.dtype.kind != "f":
            return np.zeros(len(values), dtype=bool)
        empty &= np.isnan(values)
    return empty
