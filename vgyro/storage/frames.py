"""Frames of a recording, and what every reader of recordings shares."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from vgyro.board import Board
from vgyro.storage.integrity import ChannelWatch, Integrity
from vgyro.storage.layout import channel_types, kept_channels


class Frames(NamedTuple):
    """Decoded frames, of a whole recording or of one chunk of it.

    counts    : channel → [T], as sent, in the field's type (deg/s where a log holds rates)
    counter   : int64 [T], frame counter without its wraps; frame number where the board has none
    time      : float64 [T], s since the first frame
    segment   : int32 [T], number of the gap-free stretch
    integrity : the record; None for a chunk
    """

    counts: dict[str, np.ndarray]
    counter: np.ndarray
    time: np.ndarray
    segment: np.ndarray
    integrity: Integrity | None = None


class Reader(Protocol):
    """Chunks of frames; `integrity` is complete when the last one is read."""

    integrity: Integrity | None

    def __iter__(self) -> Iterator[Frames]:
        """raises : Refused if the recording cannot be used, which may show only at its end"""


def gather(reader: Reader, board: Board) -> Frames:
    """All chunks of a reader as one."""
    chunks = list(reader) or [empty_frames(board)]

    def whole(parts: list[np.ndarray]) -> np.ndarray:
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    return Frames(
        {name: whole([chunk.counts.pop(name) for chunk in chunks]) for name in list(chunks[0].counts)},
        whole([chunk.counter for chunk in chunks]),
        whole([chunk.time for chunk in chunks]),
        whole([chunk.segment for chunk in chunks]),
    )


def empty_frames(board: Board) -> Frames:
    """Frames of a recording that has none, with the columns and types that it would have."""
    kinds = channel_types(board.frame) if board.frame else {name: np.dtype(np.int32) for name in board.channels}
    counts = {name: np.empty(0, dtype=kinds[name]) for name in kept_channels(board)}
    return Frames(counts, np.empty(0, np.int64), np.empty(0, np.float64), np.empty(0, np.int32))


def channel_watches(board: Board, rates: bool = False, engine: str = "native") -> dict[str, ChannelWatch]:
    """A watch for every gyro and temperature channel; rails by the converter, else by the gyro's range."""
    watches = {}
    adc = None if rates else board.adc
    for gyro in board.gyros:
        low, high = (-np.inf, np.inf) if adc is None else (float(adc.low), float(adc.high))
        if adc is None and gyro.range_deg_s is not None:
            reach = gyro.range_deg_s / (1.0 if rates else gyro.scale)
            middle = 0.0 if rates else gyro.bias
            low, high = middle - reach, middle + reach
        watches[gyro.field] = ChannelWatch(low, high, engine)
    for temperature in board.temperatures:
        low, high = (-np.inf, np.inf) if adc is None else (float(adc.low), float(adc.high))
        watches.setdefault(temperature.field, ChannelWatch(low, high, engine))
    return watches
