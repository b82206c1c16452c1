"""Serial dumps → frames: scan → clock → frames, with a ledger of all that is not a good frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from vgyro.board import BinaryFrame, Board, TextFrame
from vgyro.config import IntegrityOptions
from vgyro.storage.dumps.clock import LOST, PAUSE, FrameClock, Timed
from vgyro.storage.dumps.diagnose import diagnose
from vgyro.storage.dumps.scan import BAD_CHECKSUM, INVALID, NO_SYNC, FoundFrames, Tail
from vgyro.storage.dumps.sniff import Probe, boards_that_fit, probe, scanner_of
from vgyro.storage.dumps.text_refusal import describe, first_line, line_number, refuse_text
from vgyro.storage.frames import Frames, channel_watches
from vgyro.storage.inputs import BOARDS
from vgyro.storage.integrity import FileRecord, Gap, Integrity, Ledger
from vgyro.storage.sources import Sources, open_sources
from vgyro.storage.verdict import RecordingOutcome, conclude, refuse_if_needed

CHUNK_BYTES = 1 << 22
BOOT_BYTES = 4096  # an acknowledgement or boot text of so many bytes is not held against a recording

LARGEST_FREED = 31 << 20

LEADING = "leading bytes"
FORM = "form"  # a line of a text without checksum that is not as the board's lines are
SEEN = ("checksum", FORM, "marked invalid by the board", "truncated at the end")
CAUSES = {NO_SYNC: "no sync", BAD_CHECKSUM: "checksum", INVALID: "marked invalid by the board"}


@dataclass
class DumpReader:
    """Dumps of one recording, streamed: scan → clock → frames, with a ledger of all that is not a good frame."""

    paths: Sequence[str | Path]
    board: Board
    rate_hz: float
    options: IntegrityOptions
    chunk_bytes: int = CHUNK_BYTES
    boards: Path = BOARDS
    engine: str = "native"
    integrity: Integrity | None = None

    def __post_init__(self) -> None:
        self.board.layout  # noqa: B018  a board without frame is refused here
        self._sources = open_sources(self.paths)
        self._ledger = Ledger()
        self._good = self._repeated = 0
        self._stop = 0  # end of the last good frame
        self._time: float | None = None  # of the last kept frame
        self._segment = 0
        self._watches = channel_watches(self.board, engine=self.engine)
        # Of a text without checksum only the form of a line tells that it is damaged.
        layout = self.board.layout
        self._checked = isinstance(layout, BinaryFrame) or layout.checksum.family != "none"
        self._cut_line: int | None = None
        self._diagnosis: list[str] | None = None

    @property
    def expected_frames(self) -> int:
        """As many as the files could hold if they were not compressed; 0 for text."""
        layout = self.board.layout
        return sum(file.size for file in self._sources.files) // layout.length if isinstance(layout, BinaryFrame) else 0

    def __iter__(self) -> Iterator[Frames]:
        """Decode chunk by chunk.  raises : Refused"""
        # Once glibc has seen so large an array go, it keeps freed memory for the next chunk instead of mapping it anew.
        np.empty(LARGEST_FREED, dtype=np.uint8)
        seen = probe(self._sources, self.board)
        self._probe = seen
        scanner = self._scanner = scanner_of(self.board, seen.typical_length, self.engine, seen.forms)
        self._clock = FrameClock(self.board, self.rate_hz, seen.period_ticks, seen.typical_length)
        self._length = seen.typical_length
        for block in self._sources.chunks(self.chunk_bytes):
            yield from self._chunk(scanner.feed(block))
        yield from self._chunk(scanner.feed(b"", last=True))
        self._note_tail(scanner.tail())
        self._conclude()

    def _chunk(self, found: FoundFrames) -> Iterator[Frames]:
        if not len(found.start):
            return
        timed = self._clock.feed(found)
        self._good += len(timed.counter)
        self._repeated += timed.repeated
        self._note(found, timed)
        if not len(timed.counter):
            return
        self._time, self._segment = float(timed.time[-1]), int(timed.segment[-1])
        for name, watch in self._watches.items():
            watch.feed(timed.found.channels[name], timed.time)
        yield Frames(timed.found.channels, timed.counter, timed.time, timed.segment)

    def _note(self, found: FoundFrames, timed: Timed) -> None:
        """Damaged bytes before each frame, and gaps in time."""
        borders = self._sources.borders()
        jumps = {jump.row if timed.rows is None else int(timed.rows[jump.row]): jump for jump in timed.jumps}
        ends, starts = found.stop[found.breaks - 1], found.start[found.breaks]
        ends[0] = self._stop
        holes = dict(zip(found.breaks[starts > ends].tolist(), ends[starts > ends].tolist(), strict=True))
        rows = sorted({*holes, *jumps})
        for row, stop, damage in zip(rows, found.start[rows].tolist(), found.damage[rows].tolist(), strict=True):
            start, jump = holes.get(row, stop), jumps.get(row)
            if stop > start:
                lost = (jump.lost or 0) if jump else 0
                hole = found.holes.get(row)
                first, last = (start, stop) if hole is None else (hole.first, hole.last)
                cause = self._cause(first, last, damage, borders)
                estimate = self._time is None and row == 0
                self._note_damage((first, last), lost, cause, borders, estimate, hole.lines if hole else None)
            if jump:
                last = timed.time.item(jump.row - 1) if jump.row else self._time or 0.0
                due = last + 1 / self.rate_hz
                duration = timed.time.item(jump.row) - due if jump.known else None
                cause = _gap_cause(jump.kind, start, stop, borders)
                self._ledger.add_gap(due, duration, jump.lost, cause, jump.ambiguous)
        self._stop = int(found.stop[-1])

    def _note_tail(self, tail: Tail) -> None:
        if tail.stop > tail.start:
            borders = self._sources.borders()
            cause = self._cause(tail.start, tail.stop, tail.damage, borders)
            if tail.broken_off and tail.stop - tail.start < 2 * self._length:
                cause = "truncated at the end"
            self._cut_line = tail.start if tail.lines == 1 and tail.broken_off else None
            self._note_damage((tail.start, tail.stop), 0, cause, borders, estimate=True, lines=tail.lines)

    def _note_damage(
        self, span: tuple[int, int], lost: int, cause: str, borders: list[int], estimate: bool, lines: int | None = None
    ) -> None:
        """Write damaged bytes down, a file at a time; the frames are lost in the file that holds most of the bytes."""
        start, stop = span
        frames = max(int(cause in SEEN), round((stop - start) / self._length)) if lines is None else lines
        if cause != LEADING or stop - start > BOOT_BYTES:
            self._ledger.bad += frames
        if estimate:
            lost = frames if cause in SEEN else 0
        if not borders:
            self._ledger.add_damage(self._sources.files[0].name, start, stop, lost, cause)
            return
        places = [start, *(place for place in borders if start < place < stop), stop]
        largest = max(map(int.__sub__, places[1:], places))
        for first, last in pairwise(places):
            file, place = self._sources.place(first)
            share, lost = (lost, 0) if last - first == largest else (0, lost)
            self._ledger.add_damage(file.name, place, place + last - first, share, cause)

    def _cause(self, start: int, stop: int, damage: int, borders: list[int]) -> str:
        begins = start == 0 or start in borders
        # A line of text has no fixed length: one that lost its beginning may be longer than the usual one.
        shortest = self._length if isinstance(self.board.layout, BinaryFrame) else 2 * self._length
        if begins and (damage == NO_SYNC or stop - start < shortest):
            return LEADING
        return FORM if damage == BAD_CHECKSUM and not self._checked else CAUSES[damage]

    def _conclude(self) -> None:
        where = str(self.paths[0]) if len(self.paths) == 1 else f"{self.paths[0]} and {len(self.paths) - 1} more"
        outcome = RecordingOutcome(
            board=self.board,
            values="counts",
            files=file_records(self._sources),
            good=self._good,
            repeated=self._repeated,
            end_s=self._time,
            declared_rate_hz=self.rate_hz,
            measured_rate_hz=self._clock.measured_rate_hz,
            segments=self._segment + 1 if self._good else 0,
            still=self._clock.still,
            left_out=self._sources.left_out,
        )
        watches = {name: watch.record() for name, watch in self._watches.items()}
        fault = self._fault()
        hints = self._hints(self._probe) + self._text_hints(fault)
        self.integrity = conclude(outcome, self._ledger, watches, self.options, hints)
        if isinstance(self.board.layout, TextFrame):
            others = self._scanner.others
            refuse_text(self.integrity, self.options, where, fault, others, self._remedy)
        refuse_if_needed(self.integrity, self.options, where, self._remedy)

    def _fault(self) -> str:
        """Where a text has lines that do not fit: which is the first, and why."""
        frame, refused = self.board.layout, self._scanner.refused
        if not isinstance(frame, TextFrame) or (refused is None and self._good):
            return ""
        place, line = refused or first_line(self._probe.head)
        file, offset = self._sources.place(place)
        return describe(file, offset, line, frame) if line else ""

    def _text_hints(self, fault: str) -> list[str]:
        """What is good to know of the lines of a text."""
        found = []
        if self._scanner.others:
            found.append(f"{self._scanner.others} lines of another kind were passed over; nothing is missing for them")
        if self._good and fault:
            found.append(fault)
        if self._good and self._cut_line is not None:
            file, offset = self._sources.place(self._cut_line)
            number = line_number(file, offset)
            found.append(f"line {number} of {file.name}, the last, has no line end and may be cut: it is left out")
        return found

    def _hints(self, seen: Probe) -> list[str]:
        found = [f"the compressed data of {file.name} break off" for file in self._sources.files if file.cut_short]
        counter = self.board.counter
        odd = counter is not None and seen.counter_step != counter.step and seen.frames > 1
        if odd and self._advice():
            found += self._advice()
        elif counter and seen.counter_step is not None and odd:
            found.append(
                f"adjacent frames differ by {seen.counter_step} in the counter, where board {self.board.name} says"
                f" {counter.step}: if nothing is missing, set counter.step: {seen.counter_step} in the board file"
            )
        return found

    def _advice(self) -> list[str]:
        """What should be different in the board file, as far as the dump proves it."""
        if self._diagnosis is None:
            self._diagnosis = diagnose(self._probe.head, self.board)
        return self._diagnosis

    def _remedy(self) -> str:
        fits = boards_that_fit(self.paths[0], self.boards, self.board.name)
        if fits:
            return f"the file reads as board {' or '.join(fits)}: set `board` in the manifest"
        if self._advice():
            return "; ".join(self._advice())
        longest = max((gap for gap in self._ledger.gaps if gap.frames_lost), key=_frames_lost, default=None)
        if longest is not None and _frames_lost(longest) > self._ledger.lost / 2:
            return (
                f"most are missing in one gap at {longest.time:.6g} s: make two recordings of it, or lower"
                " integrity.min_good_share"
            )
        hints = self._hints(self._probe)
        if hints:
            return hints[-1]
        if isinstance(self.board.layout, TextFrame):
            return f"mend `frame` in the file of board {self.board.name} (prefix, separator, fields), or `board`"
        return "check that `board` and its frame layout are right, and that the logger stored raw bytes"


def _gap_cause(kind: str, start: int, stop: int, borders: list[int]) -> str:
    if kind == PAUSE:
        return "the counter is in step, the clock is not: the board paused"
    if kind != LOST:
        return "the counter or clock restarted"
    if any(start <= border <= stop for border in borders):
        return "between two files"
    return "damaged bytes" if stop > start else "not in the dump"


def _frames_lost(gap: Gap) -> int:
    return gap.frames_lost or 0


def file_records(sources: Sources) -> list[FileRecord]:
    """Name, size and hash of every file."""
    return [FileRecord(f.name, f.size, f.sha256, f.compression, f.content_bytes) for f in sources.files]
