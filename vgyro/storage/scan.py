"""Find the good frames in a stream of bytes that comes in chunks; the size of the chunks changes nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from vgyro.board import BinaryFrame, Board
from vgyro.storage.checksums import verifier
from vgyro.storage.layout import kept_channels, read_channels
from vgyro.storage.selection import STRAY_FRAMES, CounterRule, alone, select, strays

# A buffer with overlapping candidates and no lone one is held back so far, then decided as it stands.
MAX_HELD = 1 << 26

NO_SYNC, BAD_CHECKSUM, INVALID = 0, 1, 2


class Found(NamedTuple):
    """Good frames of one chunk, in order.

    start, stop : int64 [n], offsets in the stream, [start, stop)
    damage      : uint8 [n], worst thing seen between the frame before and this one (NO_SYNC, BAD_CHECKSUM, INVALID)
    raw         : uint8 [n, m], the frame's content, to tell a repeated frame
    counter     : int64 [n] as sent, or None;  stamp : int64 [n] as sent, or None
    channels    : channel → [n], all but the raw counter
    """

    start: np.ndarray
    stop: np.ndarray
    damage: np.ndarray
    raw: np.ndarray
    counter: np.ndarray | None
    stamp: np.ndarray | None
    channels: dict[str, np.ndarray]

    def take(self, index: np.ndarray) -> Found:
        """The frames of an index or a mask."""
        return Found(
            self.start[index],
            self.stop[index],
            self.damage[index],
            self.raw[index],
            None if self.counter is None else self.counter[index],
            None if self.stamp is None else self.stamp[index],
            {name: values[index] for name, values in self.channels.items()},
        )


class Tail(NamedTuple):
    """What follows the last good frame: [start, stop) of the stream, the worst thing seen there, and whether a frame
    breaks off at the end."""

    start: int
    stop: int
    damage: int
    broken_off: bool


class Scanner(Protocol):
    """Good frames of a stream, chunk by chunk; `tail` is right after the last one."""

    typical_length: float

    def feed(self, data: bytes, last: bool = False) -> Found:
        """Take the next bytes; return the frames that are certain by now."""

    def tail(self) -> Tail:
        """What follows the last good frame, after feed(last=True)."""


@dataclass
class BinaryScanner:
    """Frames of fixed length: sync, constants and checksum must be right; overlaps are resolved by `select`."""

    board: Board
    typical_length: float = 0
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
        self._verify = verifier(frame)
        self.typical_length = frame.length
        self._pattern = [(place, value) for place, value in enumerate(bytes.fromhex(frame.sync))]
        for offset, text in frame.constants.items():
            self._pattern += [(offset + place, value) for place, value in enumerate(bytes.fromhex(text))]
        self._channels = kept_channels(self.board)
        counter = self.board.counter
        self._rule = CounterRule(counter.step, counter.modulus) if counter else None

    def feed(self, data: bytes, last: bool = False) -> Found:
        """Take the next bytes; return the frames that are certain by now."""
        self._buffer = np.concatenate([self._buffer, np.frombuffer(data, dtype=np.uint8)])
        length = self._frame.length
        end = self._base + len(self._buffer)
        places = self._sync_places()
        good = self._verify(self._buffer, places)
        # What is still in the buffer is judged again, so only older failures are kept.
        known = self._failed[: np.searchsorted(self._failed, self._base)]
        self._failed = np.concatenate([known, self._base + places[~good]])
        places = places[good]
        start = self._base + places
        if len(places):
            frames = np.lib.stride_tricks.sliding_window_view(self._buffer, length)[places]
        else:
            frames = np.empty((0, length), dtype=np.uint8)
        settled, keep_from = self._settled(start, end, last)
        found = self._emit(start, frames, settled, last or settled == len(start))
        if last:
            self._tail = self._rest(end)
        self._keep(keep_from)
        return found

    def tail(self) -> Tail:
        """What follows the last good frame, after feed(last=True)."""
        return self._tail

    def _rest(self, end: int) -> Tail:
        damage = BAD_CHECKSUM if np.any(self._failed >= self._done) else NO_SYNC
        rest = self._buffer[max(0, self._done - self._base, len(self._buffer) - self._frame.length + 1) :].tobytes()
        sync = bytes.fromhex(self._frame.sync)
        broken_off = any(sync.startswith(rest[place : place + len(sync)]) for place in range(len(rest)))
        return Tail(self._done, end, damage, broken_off)

    def _sync_places(self) -> np.ndarray:
        """Offsets in the buffer where a whole frame with the right sync and constants could stand."""
        room = len(self._buffer) - self._frame.length + 1
        if room <= 0:
            return np.empty(0, dtype=np.int64)
        match = np.ones(room, dtype=bool)
        for place, value in self._pattern[:2]:
            match &= self._buffer[place : place + room] == value
        places = np.flatnonzero(match)
        for place, value in self._pattern[2:]:
            places = places[self._buffer[places + place] == value]
        return places

    def _settled(self, start: np.ndarray, end: int, last: bool) -> tuple[int, int]:
        """How many candidates can be decided now, and the stream offset that must be kept for the rest.

        The cut is just before a candidate that overlaps nothing, also nothing that may still come: every choice
        takes it, so what lies before it can be decided without what lies behind.
        """
        length = self._frame.length
        if last:
            return len(start), end
        waiting = end - length + 1
        if not len(start):
            return 0, waiting
        if start[-1] + (STRAY_FRAMES + 2) * length < end or len(self._buffer) > MAX_HELD:
            return len(start), max(waiting, int(start[-1]) + length)
        certain = np.flatnonzero(alone(start, length) & (start <= end - 2 * length + 1))
        if not len(certain):
            return 0, min(waiting, int(start[0]))
        return int(certain[-1]), int(start[certain[-1]])

    def _emit(self, start: np.ndarray, frames: np.ndarray, settled: int, final: bool) -> Found:
        """The first `settled` candidates without those that overlap better ones and those that are there by chance."""
        counter = self._counter(frames)
        chosen = select(start, self._frame.length, counter, self._rule)[:settled]
        following = settled < len(start) and not final
        index = np.flatnonzero(np.append(chosen, True) if following else chosen)
        if counter is not None and self._rule is not None:
            stray = self._strays(start[index], counter[index])
        else:
            stray = np.zeros(len(index), dtype=bool)
        if following:
            index, stray = index[:-1], stray[:-1]
        if len(index):
            final_counter = 0 if counter is None else int(counter[index[-1]])
            self._previous = (int(start[index[-1]]), final_counter)
        if stray.any():
            self._failed = np.union1d(self._failed, start[index[stray]])
        return self._found(start[index[~stray]], frames[index[~stray]])

    def _strays(self, start: np.ndarray, counter: np.ndarray) -> np.ndarray:
        length, rule = self._frame.length, self._rule
        if rule is None:
            raise TypeError("strays are told by their counter")
        if self._previous is None:
            return strays(start, length, counter, rule)
        with_previous = np.insert(start, 0, self._previous[0]), np.insert(counter, 0, self._previous[1])
        return strays(with_previous[0], length, with_previous[1], rule)[1:]

    def _found(self, start: np.ndarray, frames: np.ndarray) -> Found:
        stop = start + self._frame.length
        before = np.insert(stop[:-1], 0, self._done) if len(start) else stop
        failures = np.searchsorted(self._failed, start) - np.searchsorted(self._failed, before)
        damage = np.where(failures > 0, BAD_CHECKSUM, NO_SYNC).astype(np.uint8)
        if len(start):
            self._done = int(stop[-1])
        stamp = None
        if self.board.timestamp:
            stamp = read_channels(frames, self._frame, [self.board.timestamp.field])[self.board.timestamp.field]
            stamp = stamp.astype(np.int64)
        channels = read_channels(frames, self._frame, self._channels)
        return Found(start, stop, damage, frames, self._counter(frames), stamp, channels)

    def _counter(self, frames: np.ndarray) -> np.ndarray | None:
        if self.board.counter is None:
            return None
        name = self.board.counter.field
        return read_channels(frames, self._frame, [name])[name].astype(np.int64)

    def _keep(self, keep_from: int) -> None:
        keep_from = max(keep_from, self._base)
        self._buffer = self._buffer[keep_from - self._base :].copy()
        self._base = keep_from
        # Failures that are not read again all lie between the last good frame and the next: one tells as much as many.
        failed = self._failed[np.searchsorted(self._failed, self._done) :]
        gone = int(np.searchsorted(failed, keep_from))
        self._failed = failed[max(0, gone - 1) :]
