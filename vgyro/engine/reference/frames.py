"""Frames of a serial dump with NumPy alone: synchronisation, checksums, columns, runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vgyro.arrays import Bools, Ints
from vgyro.board import TYPE_BYTES, BinaryFrame, ByteOrder, Checksum
from vgyro.engine.checksums import crc_tables, mask
from vgyro.engine.frames import DTYPES, Candidates, FrameColumn, Run, fixed_bytes

Verifier = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Finder:
    """As vgyro.engine.protocols.reading.FrameFinder."""

    def __init__(self, frame: BinaryFrame) -> None:
        self._length, self._fixed, self._verify = frame.length, fixed_bytes(frame), verifier(frame)

    def find(self, buffer: np.ndarray) -> Candidates:
        """As vgyro.engine.protocols.reading.FrameFinder.find."""
        places = self._sync_places(buffer)
        good = self._verify(buffer, places)
        return Candidates(places[good], places[~good])

    def _sync_places(self, buffer: np.ndarray) -> np.ndarray:
        room = len(buffer) - self._length + 1
        if room <= 0:
            return np.empty(0, dtype=np.int64)
        match = np.ones(room, dtype=bool)
        for place, value in self._fixed[:2]:
            match &= buffer[place : place + room] == value
        places = np.flatnonzero(match)
        for place, value in self._fixed[2:]:
            places = places[buffer[places + place] == value]
        return places


def read_columns(
    buffer: np.ndarray, places: np.ndarray, length: int, columns: Sequence[FrameColumn]
) -> list[np.ndarray]:
    """As vgyro.engine.protocols.reading.FramesEngine.read_columns."""
    if not len(places):
        return [np.empty(0, dtype=DTYPES[column.kind]) for column in columns]
    frames = np.lib.stride_tricks.sliding_window_view(buffer, length)[places]
    return [_value(frames, column) for column in columns]


def breaks(start: np.ndarray, length: int, counter: np.ndarray | None, step: int, modulus: int) -> np.ndarray:
    """As vgyro.engine.protocols.reading.FramesEngine.breaks."""
    if not len(start):
        return np.empty(0, dtype=np.int64)
    follows = np.diff(start) == length
    if counter is not None:
        difference = np.diff(counter)
        follows &= (difference == step) | (difference == step - modulus)
    return np.flatnonzero(np.insert(~follows, 0, True))


def longest_run(values: np.ndarray, time: np.ndarray, since: float, least: float) -> tuple[Run | None, float]:
    """As vgyro.engine.protocols.reading.FramesEngine.longest_run."""
    first = np.insert(np.flatnonzero(values[1:] != values[:-1]) + 1, 0, 0)
    last = np.append(first[1:], len(values)) - 1
    began = time[first]
    began[0] = since
    duration = time[last] - began
    longest = int(np.argmax(duration))
    found = Run(float(began[longest]), float(duration[longest])) if duration[longest] > least else None
    return found, float(began[-1])


def checksum(data: Ints, rule: Checksum) -> Ints:
    """Checksum of each row of `data`.

    data    : uint8 [n, m], the covered bytes alone; the rule's padding is added here
    returns : uint64 [n]
    """
    if rule.family == "sum":
        sums: Ints = data.sum(axis=1, dtype=np.uint64) & np.uint64(mask(rule.width))
        return sums
    if rule.family != "crc":
        raise ValueError(f"a {rule.family} checksum is not one of binary frames")
    zeros, tables = crc_tables(rule, data.shape[1])
    result = np.full(len(data), zeros, tables.dtype)
    for place, table in enumerate(tables):
        result ^= table[data[:, place]]
    return result.astype(np.uint64)


def verifier(frame: BinaryFrame) -> Verifier:
    """Return a function: buffer uint8 [m], places int64 [n] → bool [n], true where a frame that begins there is right.

    Nothing is copied out of the buffer, so that a stretch that is all sync bytes costs no memory.
    """
    rule = frame.checksum
    if rule.family == "none" or rule.span is None:
        return lambda _buffer, places: np.ones(len(places), dtype=bool)
    first, last = rule.span
    order = rule.byte_order or frame.byte_order
    if rule.family == "crc":
        # Made once: building the tables for every chunk would cost more than using them.
        zeros, tables = crc_tables(rule, last - first)

    def verify(buffer: Ints, places: Ints) -> Bools:
        if rule.family == "crc":
            found = np.full(len(places), zeros, tables.dtype)
            for offset, table in enumerate(tables, first):
                found ^= table[buffer[places + offset]]
        else:
            total = np.insert(np.cumsum(buffer, dtype=np.uint64), 0, np.uint64(0))
            found = (total[places + last] - total[places + first]) & np.uint64(mask(rule.width))
        if rule.at is None:
            good: Bools = found == rule.equals
            return good
        good = found == stored_value(buffer, places + rule.at, rule.width // 8, order)
        return good

    return verify


def stored_value(buffer: np.ndarray, places: np.ndarray, size: int, order: ByteOrder) -> np.ndarray:
    """Unsigned integer of `size` bytes that begins at each place of the buffer, uint64 [n]."""
    value = np.zeros(len(places), dtype=np.uint64)
    for offset in range(size) if order == "big" else range(size - 1, -1, -1):
        value = (value << np.uint64(8)) | buffer[places + offset]
    return value


def _value(frames: np.ndarray, column: FrameColumn) -> np.ndarray:
    if TYPE_BYTES[column.kind] == 3:
        return _value_24(frames, column)
    stored = np.dtype({
        "names": ["x"], "formats": [(">" if column.order == "big" else "<") + DTYPES[column.kind]],
        "offsets": [column.at], "itemsize": frames.shape[1],
    })  # fmt: skip
    return frames.reshape(-1).view(stored)["x"].astype(DTYPES[column.kind])


def _value_24(frames: np.ndarray, column: FrameColumn) -> np.ndarray:
    at = column.at
    high, middle, low = (at, at + 1, at + 2) if column.order == "big" else (at + 2, at + 1, at)
    # The 24 bits go to the top of 32, so that the shift back down spreads the sign.
    value = frames[:, high].astype(np.uint32) << 24
    value |= frames[:, middle].astype(np.uint32) << 16
    value |= frames[:, low].astype(np.uint32) << 8
    return value.view(np.int32) >> 8 if column.kind == "i24" else value >> 8
