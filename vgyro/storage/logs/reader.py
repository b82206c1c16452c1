"""Logs → frames: the rows of each stream placed in time by its clock, channels that have gaps of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.log import Log, LogArray, Values
from vgyro.storage.frames import Frames, channel_watches
from vgyro.storage.integrity import FileRecord, Integrity, Ledger, Refused
from vgyro.storage.logs.files import log_files, open_all, shown_names
from vgyro.storage.logs.intake import Intake, Taken, take_in
from vgyro.storage.logs.placing import Placing
from vgyro.storage.logs.streams import streams_of
from vgyro.storage.logs.table import LogFile
from vgyro.storage.logs.uneven import MOST_UNEVEN, too_uneven, uneven_note
from vgyro.storage.tables import sha256_of_file
from vgyro.storage.verdict import RecordingOutcome, conclude, refuse_if_needed


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
        self._streams = streams_of(self._files, self.log, self.board, self.array, self._heads, self._left_out)
        self._names = shown_names(self._files)
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
        taken = take_in(self._streams, self.log, self.array, self._heads, self._ledger, self._names)
        self._good, self._end, self._segments = 0, None, 0
        if len(taken.intakes) == 1:
            clocks = [Placing(taken.intakes[0], self.rate_hz, self.board)]
            frames, notes = clocks[0].frames(self._ledger), list[str]()
        else:
            from vgyro.storage.logs.joined import Joined

            joined = Joined(taken.intakes, self.recording, self.rate_hz, self.board)
            frames, clocks, notes = joined.frames(self._ledger), joined.placings, joined.notes
        for chunk in frames:
            self._good += len(chunk.counter)
            if len(chunk.counter):
                self._end, self._segments = float(chunk.time[-1]), int(chunk.segment[-1]) + 1
            for name, watch in self._watches.items():
                if name in chunk.counts:
                    watch.feed(chunk.counts[name], chunk.time)
            yield chunk
        self._conclude(taken, clocks, notes)

    def _conclude(self, taken: Taken, clocks: Sequence[Placing], notes: Sequence[str]) -> None:
        """The record. clocks : of the streams, that of the array's times first."""
        where = str(self.paths[0]) if len(self.paths) == 1 else f"{self.paths[0]} and {len(self.paths) - 1} more"
        records = [one.record() for one in clocks]
        outcome = RecordingOutcome(
            board=self.board,
            values=self.values,
            files=[file_record(path, head, self._names[path]) for path, head in self._heads.items()],
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
        uneven = [one for one in clocks if one.uneven > 0]
        hints = [
            *taken.notes,
            *notes,
            *infinite_notes(taken.intakes),
            *(note for one in clocks for note in one.warnings()),
        ]
        hints += [uneven_note(one.uneven, one.rate_hz, one.intake.stream.name) for one in uneven]
        self.integrity = conclude(outcome, self._ledger, channels, self.options, hints)
        reasons = [too_uneven(one.uneven, one.intake.stream.name) for one in uneven if one.uneven > MOST_UNEVEN]
        if reasons:
            status = "suspect" if self.integrity.status == "good" else self.integrity.status
            self.integrity = replace(self.integrity, status=status, reasons=[*self.integrity.reasons, *reasons])
        if not self._good:
            raise no_value(self.integrity, self.board, where)
        refuse_if_needed(self.integrity, self.options, where, lambda: "check `log` and `rate_hz` in the manifest")


def no_value(record: Integrity, board: Board, where: str) -> Refused:
    """The error for a log none of whose rows holds a value of a gyro."""
    gyros = ", ".join(gyro.name for gyro in board.gyros)
    what = f"no row has a value of a gyro ({gyros}): {record.frames.bad} are empty, NaN or infinite"
    error = Refused(record, what, where, "check the columns in the manifest, and what the logger wrote")
    error.integrity = replace(record, status="refused", reasons=[str(error), *record.reasons])
    return error


def infinite_notes(intakes: Sequence[Intake]) -> list[str]:
    """A sentence on each channel with infinite values."""
    return [
        f"{channel} is infinite in {count} sample{'s' * (count != 1)}: they count as missing"
        for intake in intakes
        for channel, count in intake.infinite.items()
    ]


def file_record(path: Path, head: LogFile, name: str) -> FileRecord:
    """Name, size and hash of a log."""
    size = path.stat().st_size if path.is_file() else sum(one.stat().st_size for one in path.rglob("*"))
    account = head.account
    digest = account.sha256 or (sha256_of_file(path) if path.is_file() else "")
    return FileRecord(name, size, digest, account.compression, account.content_bytes or size)
