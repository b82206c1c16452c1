"""Find the good lines in a stream of text."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.csv

from vgyro.board import Board, TextFrame
from vgyro.engine.frames import DTYPES
from vgyro.storage.layout import channel_types, kept_channels
from vgyro.storage.scan import BAD_CHECKSUM, INVALID, NO_SYNC, Content, Found, Tail
from vgyro.storage.selection import CounterRule, breaks_of

BLANK = b"\r\n \t\0"
NEWLINE = b"\n"


@dataclass
class TextScanner:
    """Lines of the right form, XOR and range. A line that lost its end is still read, where it has a checksum."""

    board: Board
    typical_length: float = 0
    _buffer: bytes = b""
    _base: int = 0
    _done: int = 0
    _damage: int = NO_SYNC
    _held: tuple[bytes, int, int] | None = None  # the first line of a text without checksum
    _fresh: bool = True
    _tail: Tail = field(default=Tail(0, 0, NO_SYNC, False))

    def __post_init__(self) -> None:
        frame = self.board.layout
        if not isinstance(frame, TextFrame):
            raise TypeError(f"board {self.board.name!r} sends binary frames")
        self._frame = frame
        self._pattern = re.compile(line_pattern(frame))
        self._types = channel_types(frame)
        self.typical_length = self.typical_length or float(len(frame.prefix) + 4 * len(self._types))

    def feed(self, data: bytes | memoryview, last: bool = False) -> Found:
        """Take the next bytes; return the frames that are certain by now."""
        if self._fresh and self._frame.checksum.family == "none":
            # A line must begin after a line end; the stream's first line gets one, and is judged apart.
            self._buffer, self._base = NEWLINE, -1
        self._fresh = False
        self._buffer += data
        complete = self._buffer
        if last and self._ends_certainly():
            complete += NEWLINE
        texts, start, stop, bad = self._lines(complete)
        texts, start, stop = self._without_cut_first(texts, start, stop, last)
        found = self._found(texts, start, stop, bad)
        end = self._base + len(self._buffer)
        if last:
            rest = self._between(self._done, end)
            worst = max(self._damage, BAD_CHECKSUM if self._seems_a_line(rest) else NO_SYNC)
            stop_here = self._done if not rest.strip(BLANK) else end
            self._tail = Tail(self._done, stop_here, worst, bool(rest.strip(BLANK)) and not rest.endswith(NEWLINE))
        self._keep(end)
        return found

    def tail(self) -> Tail:
        """What follows the last good line, after feed(last=True)."""
        return self._tail

    def _ends_certainly(self) -> bool:
        """True if the form of a line shows that nothing is missing at its end."""
        last_field = self._frame.fields[-1].channels()[-1]
        return self._frame.checksum.family == "xor" or last_field in self._frame.require

    def _lines(self, text: bytes) -> tuple[list[bytes], np.ndarray, np.ndarray, np.ndarray]:
        """Fields, start and stop of the good lines, and places of bad ones."""
        matches = [m for m in self._pattern.finditer(text) if m.end(1) - m.start(1) <= self._frame.max_length]
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
        return [texts[i] for i in kept], start[kept], stop[kept], start[~good]

    def _without_cut_first(
        self, texts: list[bytes], start: np.ndarray, stop: np.ndarray, last: bool
    ) -> tuple[list[bytes], np.ndarray, np.ndarray]:
        """Without a checksum the first line of a stream may have lost its beginning and not show it.

        It is taken if it has as many digits as the line after it.
        """
        if self._frame.checksum.family != "none":
            return texts, start, stop
        if self._held is not None:
            # It is still in the buffer, and is found again.
            after = start >= self._held[2]
            texts = [self._held[0], *(text for text, later in zip(texts, after, strict=True) if later)]
            start, stop = np.insert(start[after], 0, self._held[1]), np.insert(stop[after], 0, self._held[2])
            self._held = None
        elif not len(start) or start[0] > 0:
            return texts, start, stop
        if len(texts) == 1 and not last:
            self._held = (texts[0], int(start[0]), int(stop[0]))
            return [], start[:0], stop[:0]
        if len(texts) == 1 or _digits(texts[0]) == _digits(texts[1]):
            return texts, start, stop
        return texts[1:], start[1:], stop[1:]

    def _found(self, texts: list[bytes], start: np.ndarray, stop: np.ndarray, bad: np.ndarray) -> Found:
        values, fits = self._values(texts)
        valid = np.ones(len(texts), dtype=bool)
        for name, value in self._frame.require.items():
            valid &= values[name] == value
        good = fits & valid
        spoilt = np.union1d(bad, start[~fits])
        invalid = start[fits & ~valid]
        start, stop = start[good], stop[good]
        damage = np.zeros(len(start), dtype=np.uint8)
        done, worst = self._done, self._damage
        before = np.insert(stop[:-1], 0, done) if len(start) else start
        # Line ends and padding are nobody's damage.
        clean = self._blank(before, start)
        start = np.where(clean, before, start)
        for index in np.flatnonzero(start > before):
            begin = int(before[index])
            between = self._between(begin, int(start[index]))
            damage[index] = self._worst(begin, int(start[index]), between, spoilt, invalid, worst if index == 0 else 0)
        if len(start):
            self._done, self._damage = int(stop[-1]), NO_SYNC
        rest = self._worst(self._done, 1 << 62, b"", spoilt, invalid, self._damage)
        self._damage = rest
        values = {name: column[good] for name, column in values.items()}
        raw = np.column_stack([column.astype(np.float64) for column in values.values()])
        content = Content(raw.reshape(-1).view(np.uint8), np.arange(len(raw)) * raw.strides[0], raw.strides[0])
        counter = values[self.board.counter.field].astype(np.int64) if self.board.counter else None
        stamp = values[self.board.timestamp.field].astype(np.int64) if self.board.timestamp else None
        channels = {name: values[name] for name in kept_channels(self.board)}
        rule = CounterRule(self.board.counter.step, self.board.counter.modulus) if self.board.counter else None
        breaks = breaks_of(start, stop, counter, rule)
        return Found(start, stop, damage, content, counter, stamp, channels, breaks)

    def _worst(self, begin: int, end: int, text: bytes, spoilt: np.ndarray, invalid: np.ndarray, known: int) -> int:
        worst = known
        if np.any((spoilt >= begin) & (spoilt < end)) or self._seems_a_line(text):
            worst = max(worst, BAD_CHECKSUM)
        if np.any((invalid >= begin) & (invalid < end)):
            worst = max(worst, INVALID)
        return worst

    def _seems_a_line(self, text: bytes) -> bool:
        prefix = self._frame.prefix.encode()
        return prefix in text if prefix else bool(text.strip(BLANK))

    def _values(self, texts: list[bytes]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Columns of the lines in their declared types, and which lines are within the types' ranges."""
        names = list(self._types)
        if not texts:
            return {name: np.empty(0, dtype=kind) for name, kind in self._types.items()}, np.empty(0, dtype=bool)
        separator = self._frame.separator
        lines = [b" ".join(text.split()) for text in texts] if separator == " " else texts
        kinds = {name: pa.float64() if kind.kind == "f" else pa.int64() for name, kind in self._types.items()}
        table = pa.csv.read_csv(
            io.BytesIO(NEWLINE.join(lines) + NEWLINE),
            read_options=pa.csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=pa.csv.ParseOptions(delimiter=separator, quote_char=False),
            convert_options=pa.csv.ConvertOptions(column_types=kinds, null_values=[]),
        )
        values, fits = {}, np.ones(len(texts), dtype=bool)
        for name, kind in self._types.items():
            column = table.column(name).to_numpy()
            if kind.kind != "f":
                limits = np.iinfo(kind)
                # uint64 does not fit into int64: the text form is limited to 2^63 - 1.
                fits &= (column >= limits.min) & (column <= min(limits.max, np.iinfo(np.int64).max))
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
        """Keep what may still become part of a good line: one line's length, and nothing that is given out."""
        held = self._held[1] if self._held else end
        keep_from = min(held, max(self._done - 1, end - 2 * self._frame.max_length, self._base))
        # The prefix may stand across the border.
        dropped = self._between(max(self._done, self._base), keep_from + len(self._frame.prefix))
        if dropped.strip(BLANK) and self._seems_a_line(dropped):
            self._damage = max(self._damage, BAD_CHECKSUM)
        self._buffer = self._buffer[keep_from - self._base :]
        self._base = keep_from


def line_pattern(frame: TextFrame) -> bytes:
    """Regular expression of a whole line; group 1 holds the fields, group 2 the checksum."""
    separator = rb"[ \t]+" if frame.separator == " " else re.escape(frame.separator.encode())
    forms = []
    for entry in frame.fields:
        form = rb"-?\d{1,19}"
        if DTYPES[entry.type].startswith("u"):
            form = rb"\d{1,19}"
        elif DTYPES[entry.type].startswith("f"):
            form = rb"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d{1,3})?"
            if entry.decimals is not None:
                form = rb"[+-]?\d+\.\d{%d}" % entry.decimals
        forms += [form] * entry.count
    fields = rb"(" + separator.join(forms) + rb")"
    if frame.checksum.family == "xor":
        return re.escape(frame.prefix.encode()) + separator + fields + rb"\*([0-9A-Fa-f]{2})"
    prefix = re.escape(frame.prefix.encode()) + separator if frame.prefix else b""
    return rb"(?<=[\r\n])[ \t]*" + prefix + fields + rb"[ \t]*(?=[\r\n])"


def xor_of(text: bytes, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """XOR of text[first:last] of each stretch, uint8 [n]; the stretches are in order and do not overlap."""
    values = np.frombuffer(text, dtype=np.uint8)
    borders = np.column_stack([first, last]).reshape(-1)
    return np.bitwise_xor.reduceat(values, borders)[::2]


def _digits(text: bytes) -> int:
    return len(text.split()[0].lstrip(b"+-").split(b".")[0])
