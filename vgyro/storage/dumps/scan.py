"""Find the good frames in a stream of bytes that comes in chunks; the size of the chunks changes nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Ints
from vgyro.board import BinaryFrame, Board
from vgyro.engine.frames import FrameColumn
from vgyro.storage.dumps.selection import STRAY_FRAMES, CounterRule, breaks_of, last_alone, select, strays
from vgyro.storage.layout import columns_of, kept_channels

# A buffer with overlapping candidates and no lone one is held back so far, then decided as it stands.
MAX_HELD = 1 << 26

NO_SYNC, BAD_CHECKSUM, INVALID = 0, 1, 2


class Content(NamedTuple):
    """The bytes of frames, to tell a repeated one: row k is buffer[places[k]:][:length]. Not copied until asked for."""

    buffer: np.ndarray
    places: np.ndarray
    length: int

    def rows(self) -> Ints:
        """uint8 [n, length]"""
        if not len(self.places):
            return np.empty((0, self.length), dtype=np.uint8)
        rows: Ints = np.lib.stride_tricks.sliding_window_view(self.buffer, self.length)[self.places]
        return rows


@dataclass
class Hole:
    """Damaged lines between two good ones of a text: bytes from first to last, in so many lines, and the worst."""

    first: int = 0
    last: int = 0
    lines: int = 0
    worst: int = NO_SYNC

    def add(self, start: int, stop: int, lines: int, damage: int) -> None:
        """Note damaged bytes [start, stop), as many as `lines` lines."""
        self.first = self.first if self.lines else start
        self.last, self.lines, self.worst = stop, self.lines + lines, max(self.worst, damage)


NO_HOLES: Mapping[int, Hole] = MappingProxyType({})


class FoundFrames(NamedTuple):
    """Good frames of one chunk, in order.

    start, stop : int64 [n], offsets in the stream, [start, stop)
    damage      : uint8 [n], worst thing seen between the frame before and this one (NO_SYNC, BAD_CHECKSUM, INVALID)
    content     : to tell a repeated frame
    counter     : int64 [n] as sent, or None;  stamp : int64 [n] as sent, or None
    channels    : channel → [n], all but the raw counter
    breaks      : rows that do not begin where the one before ends, or whose counter does not follow, and row 0
    holes       : text: row → the damaged lines before it, where they are and how many
    """

    start: np.ndarray
    stop: np.ndarray
    damage: np.ndarray
    content: Content
    counter: np.ndarray | None
    stamp: np.ndarray | None
    channels: dict[str, np.ndarray]
    breaks: np.ndarray
    holes: Mapping[int, Hole] = NO_HOLES

    def take(self, index: np.ndarray, rule: CounterRule | None) -> FoundFrames:
        """The frames of an index or a mask."""
        start, stop = self.start[index], self.stop[index]
        counter = None if self.counter is None else self.counter[index]
        return FoundFrames(
            start,
            stop,
            self.damage[index],
            self.content._replace(places=self.content.places[index]),
            counter,
            None if self.stamp is None else self.stamp[index],
            {name: values[index] for name, values in self.channels.items()},
            breaks_of(start, stop, counter, rule),
        )


class Tail(NamedTuple):
    """What follows the last good frame: [start, stop) of the stream, the worst thing seen there, and whether a frame
    breaks off at the end. lines : damaged ones, of text."""

    start: int
    stop: int
    damage: int
    broken_off: bool
    lines: int | None = None


class Scanner(Protocol):
    """Good frames of a stream, chunk by chunk; `tail` is right after the last one.

    others  : lines of another kind so far;  refused : place and text of the first damaged line; both of text alone
    """

    typical_length: float
    others: int
    refused: tuple[int, bytes] | None

    def feed(self, data: bytes | memoryview, last: bool = False) -> FoundFrames:
        """Take the next bytes; return the frames that are certain by now."""

    def tail(self) -> Tail:
        """What follows the last good frame, after feed(last=True)."""


@dataclass
class BinaryScanner:
    """Frames of fixed length: sync, constants and checksum must be right; overlaps are resolved by `select`."""

    board: Board
    engine: str = "native"
    typical_length: float = 0
    others: int = 0
    refused: tuple[int, bytes] | None = None
    _buffer: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.uint8))
    _base: int = 0
    _done: int = 0  # end of the last frame that was given out
    _previous: tuple[int, int] | None = None  # its start and counter, strays included
    _failed: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _tail: Tail = field(default=Tail(0, 0, NO_SYNC, False))

    def __post_init__(self) -> None:
        frame = self.board.layout
        if not isinstance(frame, BinaryFrame):
            raise TypeError(f"board {self.board.name!r} sends text")
        self._frame = frame
        self.typical_length = self._length = frame.length
        self._kernels = engines.get(self.engine).frames
        self._finder = self._kernels.Finder(frame)
        counter, stamp = self.board.counter, self.board.timestamp
        self._rule = CounterRule(counter.step, counter.modulus) if counter else None
        self._kept = kept_channels(self.board)
        self._columns = columns_of(frame, self._kept)
        self._counter_column = columns_of(frame, [counter.field] if counter else [])
        self._stamp_column = columns_of(frame, [stamp.field] if stamp else [])

    def feed(self, data: bytes | memoryview, last: bool = False) -> FoundFrames:
        """Take the next bytes; return the frames that are certain by now."""
        self._buffer = np.concatenate([self._buffer, np.frombuffer(data, dtype=np.uint8)])
        end = self._base + len(self._buffer)
        places, failed = self._finder.find(self._buffer)
        # What is still in the buffer is judged again, so only older failures are kept.
        known = self._failed[: np.searchsorted(self._failed, self._base)]
        self._failed = np.concatenate([known, self._base + failed])
        settled, keep_from = self._settled(places, end - self._base, last)
        found = self._emit(places, settled, last or settled == len(places))
        if last:
            self._tail = self._rest(end)
        self._keep(self._base + keep_from)
        return found

    def tail(self) -> Tail:
        """What follows the last good frame, after feed(last=True)."""
        return self._tail

    def _rest(self, end: int) -> Tail:
        damage = BAD_CHECKSUM if np.any(self._failed >= self._done) else NO_SYNC
        rest = self._buffer[max(0, self._done - self._base, len(self._buffer) - self._length + 1) :].tobytes()
        sync = bytes.fromhex(self._frame.sync)
        broken_off = any(sync.startswith(rest[place : place + len(sync)]) for place in range(len(rest)))
        return Tail(self._done, end, damage, broken_off)

    def _settled(self, places: np.ndarray, end: int, last: bool) -> tuple[int, int]:
        """How many candidates can be decided now, and the place in the buffer that must be kept for the rest.

        The cut is just before a candidate that overlaps nothing, also nothing that may still come: every choice
        takes it, so what lies before it can be decided without what lies behind.
        """
        length = self._length
        if last:
            return len(places), end
        waiting = end - length + 1
        if not len(places):
            return 0, waiting
        if places[-1] + (STRAY_FRAMES + 2) * length < end or end > MAX_HELD:
            return len(places), max(waiting, int(places[-1]) + length)
        certain = last_alone(places, length, end - 2 * length + 1)
        if certain is None:
            return 0, min(waiting, int(places[0]))
        return certain, int(places[certain])

    def _emit(self, places: np.ndarray, settled: int, final: bool) -> FoundFrames:
        """The first `settled` candidates without those that overlap better ones and those that are there by chance."""
        counter, rule = self._read(places, self._counter_column), self._rule
        breaks = self._breaks(places, counter)
        following = settled < len(places) and not final
        apart = places[breaks[1:]] - places[breaks[1:] - 1]
        if np.any(apart < self._length):
            chosen = select(places, self._length, counter, rule)[:settled]
            index = np.flatnonzero(np.append(chosen, True) if following else chosen)
            places, counter = places[index], None if counter is None else counter[index]
            breaks = self._breaks(places, counter)
        else:
            places, counter, breaks = _head(settled + following, places, counter, breaks)
        stray = self._strays(places, counter, breaks)
        if following:
            stray = stray[stray < len(places) - 1]
            places, counter, breaks = _head(len(places) - 1, places, counter, breaks)
        if len(places):
            self._previous = self._base + int(places[-1]), 0 if counter is None else int(counter[-1])
        if len(stray):
            self._failed = np.union1d(self._failed, self._base + places[stray])
            places, counter = np.delete(places, stray), None if counter is None else np.delete(counter, stray)
            breaks = self._breaks(places, counter)
        return self._found(places, counter, breaks)

    def _breaks(self, places: Ints, counter: Ints | None) -> Ints:
        step, modulus = (self._rule.step, self._rule.modulus) if self._rule else (0, 0)
        return self._kernels.breaks(places, self._length, counter, step, modulus)

    def _strays(self, places: np.ndarray, counter: np.ndarray | None, breaks: np.ndarray) -> np.ndarray:
        """Rows that are frames by chance; only beside a break can one be."""
        if counter is None or self._rule is None or not len(places):
            return np.empty(0, dtype=np.int64)
        rows = np.concatenate([breaks, breaks[1:] - 1])
        previous = None if self._previous is None else (self._previous[0] - self._base, self._previous[1])
        return strays(places, self._length, counter, self._rule, rows, previous)

    def _found(self, places: np.ndarray, counter: np.ndarray | None, breaks: np.ndarray) -> FoundFrames:
        start, stop = places + self._base, places + (self._base + self._length)
        damage = np.zeros(len(start), dtype=np.uint8)
        if len(start):
            before = stop[breaks - 1]
            before[0] = self._done
            failures = np.searchsorted(self._failed, start[breaks]) - np.searchsorted(self._failed, before)
            damage[breaks[failures > 0]] = BAD_CHECKSUM
            self._done = int(stop[-1])
        channels = self._kernels.read_columns(self._buffer, places, self._length, self._columns)
        return FoundFrames(
            start,
            stop,
            damage,
            Content(self._buffer, places, self._length),
            counter,
            self._read(places, self._stamp_column),
            dict(zip(self._kept, channels, strict=True)),
            breaks,
        )

    def _read(self, places: Ints, columns: list[FrameColumn]) -> Ints | None:
        """Counter or time stamp of frames, int64 [n]; None for a board without."""
        if not columns:
            return None
        (values,) = self._kernels.read_columns(self._buffer, places, self._length, columns)
        counts: Ints = values.astype(np.int64)
        return counts

    def _keep(self, keep_from: int) -> None:
        keep_from = max(keep_from, self._base)
        self._buffer = self._buffer[keep_from - self._base :].copy()
        self._base = keep_from
        # Failures that are not read again all lie between the last good frame and the next: one tells as much as many.
        failed = self._failed[np.searchsorted(self._failed, self._done) :]
        gone = int(np.searchsorted(failed, keep_from))
        self._failed = failed[max(0, gone - 1) :]


def _head(
    count: int, places: np.ndarray, counter: np.ndarray | None, breaks: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """The first rows of all three."""
    return places[:count], None if counter is None else counter[:count], breaks[: np.searchsorted(breaks, count)]
