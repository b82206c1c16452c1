"""Find the good lines in a stream of text."""

from __future__ import annotations

import io
import re
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.csv

from vgyro.board import Board, TextFrame
from vgyro.storage.dumps.scan import BAD_CHECKSUM, INVALID, NO_SYNC, Content, FoundFrames, Hole, Tail
from vgyro.storage.dumps.selection import CounterRule, breaks_of
from vgyro.storage.dumps.text_form import (
    BLANK,
    Kinds,
    first_is_whole,
    line_pattern,
    opening,
    readable,
    separator_pattern,
    type_limits,
)
from vgyro.storage.layout import channel_types, kept_channels

NEWLINE = b"\n"
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
LONGEST_LINE = 4096  # of another kind; what goes on longer is damage
FIRST_LINES = 16  # the first line is judged by so many after it …
FIRST_BYTES = 1 << 16  # … as far as they come within so many bytes
SAME_WIDTHS = 8  # so many last fields of one width, and that of an unfinished line is whole if it has it, too


@dataclass
class TextScanner:
    """Lines of the right form, XOR and range. A line that lost its end is still read, where it has a checksum.

    others : lines of another kind so far;  good_bytes : bytes of good lines so far, without their ends
    refused : place and text of the first line that is damaged, None so far
    """

    board: Board
    typical_length: float = 0
    forms: Iterable[bytes] = ()
    others: int = 0
    good_bytes: int = 0
    refused: tuple[int, bytes] | None = None
    _buffer: bytes = b""
    _base: int = 0
    _done: int = 0  # end of the last good line
    _judged: int = 0  # what lies before is known to be good, damage or other
    _hole: Hole = field(default_factory=Hole)
    _first_open: bool = False  # the first line is not judged yet
    _fresh: bool = True
    _widths: deque[int] = field(default_factory=lambda: deque(maxlen=SAME_WIDTHS))
    _tail: Tail = field(default=Tail(0, 0, NO_SYNC, False))

    def __post_init__(self) -> None:
        frame = self.board.layout
        if not isinstance(frame, TextFrame):
            raise TypeError(f"board {self.board.name!r} sends binary frames")
        self._frame = frame
        self._pattern = re.compile(line_pattern(frame))
        self._plain = re.compile(line_pattern(frame, blanks=False))
        self._separator = re.compile(separator_pattern(frame))
        self._kinds = Kinds(frame, self.forms)
        self._types = channel_types(frame)
        # Without a checksum and a prefix the first line may have lost its beginning and not show it.
        self._first_open = frame.checksum.family == "none" and not opening(frame)
        self.typical_length = self.typical_length or float(len(frame.prefix) + 4 * len(self._types))

    def feed(self, data: bytes | memoryview, last: bool = False) -> FoundFrames:
        """Take the next bytes; return the frames that are certain by now."""
        if self._fresh and self._frame.checksum.family == "none":
            # A line must begin after a line end; the stream's first line gets one, and is judged apart.
            self._buffer, self._base = NEWLINE, -1
        self._fresh = False
        self._buffer += data
        if self._base <= 0 and self._buffer[-self._base :].startswith(BYTE_ORDER_MARK):
            self._buffer = self._buffer.replace(BYTE_ORDER_MARK, b"   ", 1)
        complete = self._buffer + NEWLINE if last and self._ends_whole() else self._buffer
        texts, start, stop = self._lines(complete)
        end = self._base + len(self._buffer)
        if self._first_open:
            if not self._first_can_be_judged(start, end, last):
                return self._found([], start[:0], stop[:0], self._judged)
            texts, start, stop = self._without_cut_first(texts, start, stop)
        found = self._found(texts, start, stop, end)
        if last:
            self._finish(end)
        self._keep(end)
        return found

    def tail(self) -> Tail:
        """What follows the last good line, after feed(last=True)."""
        return self._tail

    def _ends_whole(self) -> bool:
        """True if the form of a line shows that nothing is missing at its end."""
        if self._frame.checksum.family == "xor":
            return True
        entry = self._frame.fields[-1]
        if entry.channels()[-1] in self._frame.require or entry.decimals is not None:
            return True
        rest = re.split(rb"[\r\n]", self._buffer)[-1].strip(BLANK)
        fresh = (len(self._fields(match[1])[-1]) for match in self._pattern.finditer(self._buffer))
        widths = [*self._widths, *fresh][-SAME_WIDTHS:]
        return len(widths) == SAME_WIDTHS and {len(self._fields(rest)[-1])} == set(widths)

    def _fields(self, text: bytes) -> list[bytes]:
        return self._separator.split(text)

    def _lines(self, text: bytes) -> tuple[list[bytes], np.ndarray, np.ndarray]:
        """Fields, start and stop of the lines of the right form and XOR."""
        pattern = self._pattern if b" " in text or b"\t" in text else self._plain
        matches = [m for m in pattern.finditer(text) if m.end(1) - m.start(1) <= self._frame.max_length]
        start = np.array([m.start() for m in matches], dtype=np.int64) + self._base
        stop = np.array([m.end() for m in matches], dtype=np.int64) + self._base
        texts = [m.group(1) for m in matches]
        good = np.ones(len(matches), dtype=bool)
        if self._frame.checksum.family == "xor" and matches:
            stated = np.array([int(m.group(2), 16) for m in matches])
            first = np.array([m.start() + 1 for m in matches])
            star = np.array([m.start(2) - 1 for m in matches])
            good = xor_of(text, first, star) == stated
        kept = np.flatnonzero(good)
        return [texts[i] for i in kept], start[kept], stop[kept]

    def _first_can_be_judged(self, start: np.ndarray, end: int, last: bool) -> bool:
        if not len(start):
            # A first line without its end may still become one.
            return last or end > FIRST_BYTES or len(re.split(rb"[\r\n]", self._buffer.strip(BLANK))) > 1
        return bool(start[0] > 0) or last or end > FIRST_BYTES or len(start) > FIRST_LINES

    def _without_cut_first(
        self, texts: list[bytes], start: np.ndarray, stop: np.ndarray
    ) -> tuple[list[bytes], np.ndarray, np.ndarray]:
        """The lines without the stream's first if that may have lost its beginning."""
        self._first_open = False
        if not len(start) or start[0] > 0:
            return texts, start, stop
        first, *after = [
            self._fields(text)[0]
            for text, place in zip(texts[: FIRST_LINES + 1], stop.tolist(), strict=False)
            if place <= FIRST_BYTES
        ]
        if first_is_whole(first, after, self.board):
            return texts, start, stop
        return texts[1:], start[1:], stop[1:]

    def _found(self, texts: list[bytes], start: np.ndarray, stop: np.ndarray, end: int) -> FoundFrames:
        """The frames of the lines; what lies between them and up to `end` is judged as far as its lines are whole."""
        values, fits = self._values(texts)
        if not texts:
            self._judge(self._judged, end, set(), whole=False)
            return self._frames(values, start, stop, np.empty(0, dtype=np.uint8), {})
        valid = np.ones(len(texts), dtype=bool)
        for name, value in self._frame.require.items():
            valid &= values[name] == value
        good = fits & valid
        invalid = set(start[fits & ~valid].tolist())
        kept = [texts[row] for row in np.flatnonzero(good)[-SAME_WIDTHS:]]
        start, stop = start[good], stop[good]
        self.good_bytes += int((stop - start).sum())
        self._widths.extend(len(self._fields(text)[-1]) for text in kept)
        damage, holes = np.zeros(len(start), dtype=np.uint8), {}
        before = np.insert(stop[:-1], 0, self._judged) if len(start) else start
        # Line ends and padding are nobody's damage.
        dirty = ~self._blank(before, start)
        if len(start):
            dirty[0] |= self._hole.lines > 0
        begin = np.insert(stop[:-1], 0, self._done) if len(start) else start
        real, start = start, begin.copy()
        for row in np.flatnonzero(dirty).tolist():
            self._judge(int(before[row]), int(real[row]), invalid)
            hole, self._hole = self._hole, Hole()
            if hole.lines:
                holes[row], damage[row] = hole, hole.worst
                # As long as the damaged lines would have been; lines of another kind take no room.
                start[row] += min(round(hole.lines * self.typical_length), int(real[row] - begin[row]))
        if len(start):
            self._done = self._judged = int(stop[-1])
        self._judge(self._judged, end, invalid, whole=False)
        return self._frames({name: column[good] for name, column in values.items()}, start, stop, damage, holes)

    def _frames(
        self,
        values: dict[str, np.ndarray],
        start: np.ndarray,
        stop: np.ndarray,
        damage: np.ndarray,
        holes: dict[int, Hole],
    ) -> FoundFrames:
        raw = np.column_stack([column.astype(np.float64) for column in values.values()])
        content = Content(raw.reshape(-1).view(np.uint8), np.arange(len(raw)) * raw.strides[0], raw.strides[0])
        counter = values[self.board.counter.field].astype(np.int64) if self.board.counter else None
        stamp = values[self.board.timestamp.field].astype(np.int64) if self.board.timestamp else None
        channels = {name: values[name] for name in kept_channels(self.board)}
        rule = CounterRule(self.board.counter.step, self.board.counter.modulus) if self.board.counter else None
        breaks = breaks_of(start, stop, counter, rule)
        return FoundFrames(start, stop, damage, content, counter, stamp, channels, breaks, holes)

    def _judge(self, begin: int, end: int, invalid: set[int], whole: bool = True) -> None:
        """Sort the lines from begin to end, none of them good, into damaged and other ones.

        invalid : places of lines that the board itself marks;  whole : false: the last line may go on after `end`
        """
        text, first = self._between(begin, end), max(begin, self._base)
        lines = [match.span() for match in re.finditer(rb"[^\r\n]+", text)]
        if begin < first and (not lines or lines[0][0] > 0):
            # A line that went on so long that the buffer no longer holds any of it.
            lines.insert(0, (0, 0))
        for start, stop in lines:
            place, stop_place = first + start if start else begin, first + stop
            if not whole and stop_place == end:
                self._judged = place
                return
            marked = bool(invalid) and any(place <= other < stop_place for other in invalid)
            self._sort(text[start:stop], place, stop_place, marked)
        if not whole:
            self._judged = max(begin, end)

    def _sort(self, line: bytes, start: int, stop: int, invalid: bool) -> None:
        too_long = stop - start > LONGEST_LINE
        if not line.strip(BLANK) and not too_long:
            return
        if not too_long and not invalid and self._kinds.is_other(line):
            self.others += 1
            return
        if self.refused is None and not invalid:
            self.refused = start, line[:LONGEST_LINE]
        # Bytes that cannot be text have no lines to be counted.
        by_form = readable(line) and not too_long
        lines = self._kinds.count(line) if by_form else max(1, round((stop - start) / self.typical_length))
        self._hole.add(start, stop, lines, INVALID if invalid else BAD_CHECKSUM)

    def _finish(self, end: int) -> None:
        """Judge the last line, which has no end, and say what follows the last good one."""
        rest = self._between(self._judged, end)
        self._judge(self._judged, end, set())
        hole = self._hole
        if not hole.lines:
            self._tail = Tail(self._done, self._done, NO_SYNC, False)
            return
        broken_off = bool(rest.strip(BLANK)) and hole.last == self._judged + len(rest.rstrip(b"\r\n"))
        self._tail = Tail(hole.first, hole.last, hole.worst, broken_off, hole.lines)

    def _values(self, texts: list[bytes]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Columns of the lines in their declared types, and which lines are within the types' ranges."""
        names = list(self._types)
        if not texts:
            return {name: np.empty(0, dtype=kind) for name, kind in self._types.items()}, np.empty(0, dtype=bool)
        separator, whole = self._frame.separator, NEWLINE.join(texts) + NEWLINE
        if len(separator) != 1 or separator.isspace() or b" " in whole or b"\t" in whole:
            separator, whole = ",", self._separator.sub(b",", whole)
        kinds = {name: pa.float64() if kind.kind == "f" else pa.int64() for name, kind in self._types.items()}
        table = pa.csv.read_csv(
            io.BytesIO(whole),
            read_options=pa.csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=pa.csv.ParseOptions(delimiter=separator, quote_char=False),
            convert_options=pa.csv.ConvertOptions(column_types=kinds, null_values=[]),
        )
        values, fits = {}, np.ones(len(texts), dtype=bool)
        for entry in self._frame.fields:
            for name in entry.channels():
                column, kind = table.column(name).to_numpy(), self._types[name]
                if kind.kind != "f":
                    low, high = type_limits(entry)
                    fits &= (column >= low) & (column <= high)
                values[name] = column.astype(kind)
        return values, fits

    def _blank(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """bool [n]: true where all bytes from begin to end are white space."""
        result = np.zeros(len(begin), dtype=bool)
        text = np.frombuffer(self._buffer, dtype=np.uint8)
        blanks = np.isin(text, np.frombuffer(BLANK, dtype=np.uint8))
        count = np.insert(np.cumsum(blanks), 0, 0)
        held = begin >= self._base
        first, last = begin[held] - self._base, end[held] - self._base
        result[held] = count[last] - count[first] == last - first
        return result

    def _between(self, start: int, stop: int) -> bytes:
        return self._buffer[max(0, start - self._base) : max(0, stop - self._base)]

    def _keep(self, end: int) -> None:
        """Keep the line that is not whole yet, and the byte before it; of one that goes on too long, the end."""
        room = LONGEST_LINE + 2 * self._frame.max_length
        keep_from = max(self._base, self._judged - 1, end - room)
        if self.refused is None and keep_from > self._judged:
            # It is damage, whatever follows; here its beginning can still be shown.
            self.refused = self._judged, self._between(self._judged, self._judged + LONGEST_LINE)
        self._buffer = self._buffer[keep_from - self._base :]
        self._base = keep_from


def xor_of(text: bytes, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """XOR of text[first:last] of each stretch, uint8 [n]; the stretches are in order and do not overlap."""
    values = np.frombuffer(text, dtype=np.uint8)
    borders = np.column_stack([first, last]).reshape(-1)
    return np.bitwise_xor.reduceat(values, borders)[::2]
