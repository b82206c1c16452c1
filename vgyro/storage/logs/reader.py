"""Logs → frames: the rows of each stream placed in time by its clock, channels that have gaps of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.errors import DataError
from vgyro.log import Log, LogArray, Values
from vgyro.storage.clocks import Clock, ClockOptions, survey
from vgyro.storage.frames import Frames, channel_watches
from vgyro.storage.integrity import FileRecord, Integrity, Ledger
from vgyro.storage.logs.files import log_files, open_all
from vgyro.storage.logs.intake import SAME, STAMP, Intake, Taken, take_in
from vgyro.storage.logs.rows import RowClock
from vgyro.storage.logs.streams import streams_of
from vgyro.storage.logs.table import LogFile
from vgyro.storage.tables import sha256_of_file
from vgyro.storage.verdict import Outcome, conclude, refuse_if_needed

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
WITHOUT_VALUE = "rows without a value"


@dataclass
class LogReader:
    """Logs of one recording. A row is a frame; a channel without a value in it has NaN there.

    log     : how columns and values are to be understood
    rate_hz : declared rows a second; None: by the stamps
    array   : the gyros, where the manifest names them itself
    """

    paths: Sequence[str | Path]
    recording: Recording
    board: Board
    options: IntegrityOptions
    array: LogArray | None = None
    engine: str = "native"
    integrity: Integrity | None = None

    def __post_init__(self) -> None:
        if self.recording.log is None:
            raise ValueError(f"recording {self.recording.name!r} has no log")
        self.log: Log = self.recording.log
        self.rate_hz = self.recording.rate_hz or self.board.rate_hz
        self._files = log_files(self.paths)
        self._heads, self._left_out = open_all(self._files, self.log, self.engine)
        self._streams = streams_of(self._files, self.log, self.board, self.array, self._heads)
        self._ledger = Ledger()
        self._watches = channel_watches(self.board, rates=self.values == "rates")

    @property
    def values(self) -> Values:
        """Do the frames hold counts, or rates in deg/s?"""
        if self.array is not None:
            return "rates" if self.array.rates else "counts"
        return self.log.values

    @property
    def expected_frames(self) -> int:
        """As many as the logs say they have rows; 0 where they do not say."""
        return sum(max((table.rows or 0 for table in head.tables), default=0) for head in self._heads.values())

    def __iter__(self) -> Iterator[Frames]:
        """Read everything, learn the clocks, then place the rows block by block.  raises : DataError, Refused"""
        taken = take_in(self._streams, self.log, self.array, self._heads, self._ledger)
        self._good, self._end, self._segments = 0, None, 0
        if len(taken.intakes) == 1:
            placing = Placing(taken.intakes[0], self.rate_hz, self.board)
            frames = placing.frames(self._ledger)
            clocks: list[Placing] = [placing]
        else:
            from vgyro.storage.logs.joined import Joined

            joined = Joined(taken.intakes, self.recording, self.rate_hz, self.board)
            frames, clocks = joined.frames(self._ledger), joined.placings
        for chunk in frames:
            self._good += len(chunk.counter)
            if len(chunk.counter):
                self._end, self._segments = float(chunk.time[-1]), int(chunk.segment[-1]) + 1
            for name, watch in self._watches.items():
                if name in chunk.counts:
                    watch.feed(chunk.counts[name], chunk.time)
            yield chunk
        self._conclude(taken, clocks)

    def _conclude(self, taken: Taken, clocks: Sequence[Placing]) -> None:
        where = str(self.paths[0]) if len(self.paths) == 1 else f"{self.paths[0]} and {len(self.paths) - 1} more"
        records = [one.record() for one in clocks]
        outcome = Outcome(
            board=self.board,
            values=self.values,
            files=[file_record(path, head, self.paths) for path, head in self._heads.items()],
            good=self._good,
            repeated=sum(one.repeated for one in clocks),
            end_s=self._end,
            declared_rate_hz=self.rate_hz,
            measured_rate_hz=clocks[0].measured_rate_hz,
            segments=self._segments,
            stamped=True,
            clocks=records,
            left_out=[*self._left_out, *taken.left_out],
        )
        channels = {name: watch.record() for name, watch in self._watches.items() if watch.samples}
        notes = [*taken.notes, *infinite_notes(taken.intakes), *(note for one in clocks for note in one.warnings())]
        self.integrity = conclude(outcome, self._ledger, channels, self.options, notes)
        refuse_if_needed(self.integrity, self.options, where, lambda: "check `log` and `rate_hz` in the manifest")


class Placing:
    """One stream on its clock."""

    def __init__(self, intake: Intake, rate_hz: float | None, board: Board) -> None:
        self.intake = intake
        self.alignment: dict[str, Any] = {}
        self._gyros = [gyro.field for gyro in board.gyros if gyro.field in intake.stream.columns]
        self.clock: Clock | RowClock
        if intake.time is None:
            self.clock = RowClock(rate_hz, intake.damaged, intake.stream.name)
        else:
            self.clock = survey(self._stamps(), clock_options(intake, rate_hz))

    @property
    def zero_s(self) -> float:
        """The first stamp, s on the log's own clock; 0 without stamps."""
        if self.intake.time is None:
            return 0.0
        for stamps, _ in self._stamps():
            known = stamps[np.isfinite(stamps)]
            if len(known):
                return float(known[0]) * SECONDS[self.clock.record().unit]
        return 0.0

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
        period, breaks, after_hole = 1 / record.rate_hz, 0, False
        for block in self.intake.spool.blocks([*self._stamp_name(), SAME, *self.intake.stream.columns]):
            same = block.pop(SAME)
            placed = self.clock.place(block.pop(STAMP, np.arange(len(same))), same)
            columns = {name: values[placed.keep] for name, values in block.items()}
            empty = without_value([columns[name] for name in self._gyros])
            for start, stop in runs_of(empty):
                ledger.add_gap(float(placed.time[start]), (stop - start) * period, stop - start, WITHOUT_VALUE)
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


def without_value(columns: Sequence[np.ndarray]) -> np.ndarray:
    """bool [n]: no column has a value."""
    empty = np.ones(len(columns[0]), dtype=bool)
    for values in columns:
        if values.dtype.kind != "f":
            return np.zeros(len(values), dtype=bool)
        empty &= np.isnan(values)
    return empty


def runs_of(mask: np.ndarray) -> Iterator[tuple[int, int]]:
    """Start and stop of each run of true."""
    if mask.any():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
        yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def infinite_notes(intakes: Sequence[Intake]) -> list[str]:
    """A sentence on each channel with infinite values."""
    return [
        f"{channel} is infinite in {count} sample{'s' * (count != 1)}: they count as missing"
        for intake in intakes
        for channel, count in intake.infinite.items()
    ]


def file_record(path: Path, head: LogFile, paths: Sequence[str | Path]) -> FileRecord:
    """Name, size and hash of a log."""
    size = path.stat().st_size if path.is_file() else sum(one.stat().st_size for one in path.rglob("*"))
    account = head.account
    digest = account.sha256 or (sha256_of_file(path) if path.is_file() else "")
    return FileRecord(_shown(path, paths), size, digest, account.compression, account.content_bytes or size)


def _shown(path: Path, paths: Sequence[str | Path]) -> str:
    """The file's name, with the date folders it lies in."""
    for folder in map(Path, paths):
        if folder.is_dir() and path != folder and path.is_relative_to(folder):
            return path.relative_to(folder).as_posix()
    return path.name


def rate_of(placing: Placing) -> float:
    """Rows a second of a stream.  raises : DataError if it is not known"""
    rate = placing.clock.record().rate_hz
    if rate is None:
        raise DataError("has no rate", placing.intake.stream.name, "give `rate_hz` for the recording")
    return rate
