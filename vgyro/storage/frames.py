"""Frames of a recording, and what every reader of recordings shares."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from vgyro.board import Board, Gyro
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
    """Chunks of frames; `integrity` is complete when the last one is read.

    expected_frames : about how many there are, for whoever wants room for them
    """

    integrity: Integrity | None

    @property
    def expected_frames(self) -> int: ...

    def __iter__(self) -> Iterator[Frames]:
        """raises : Refused if the recording cannot be used, which may show only at its end"""


def gather(reader: Reader, board: Board) -> Frames:
    """All chunks of a reader as one."""
    whole: list[np.ndarray] = []
    names: list[str] = []
    count = 0
    for chunk in reader:
        names = list(chunk.counts)
        columns = [chunk.counter, chunk.time, chunk.segment, *chunk.counts.values()]
        stop = count + len(chunk.counter)
        if not whole:
            whole = [np.empty(max(stop, reader.expected_frames), dtype=column.dtype) for column in columns]
        if stop > len(whole[0]):
            whole = [np.concatenate([column[:count], np.empty(stop, dtype=column.dtype)]) for column in whole]
        for column, values in zip(whole, columns, strict=True):
            column[count:stop] = values
        count = stop
    if not whole:
        return empty_frames(board)
    counter, time, segment, *counts = (column[:count] for column in whole)
    return Frames(dict(zip(names, counts, strict=True)), counter, time, segment)


def empty_frames(board: Board) -> Frames:
    """Frames of a recording that has none, with the columns and types that it would have."""
    kinds = channel_types(board.frame) if board.frame else {name: np.dtype(np.int32) for name in board.channels}
    counts = {name: np.empty(0, dtype=kinds[name]) for name in kept_channels(board)}
    return Frames(counts, np.empty(0, np.int64), np.empty(0, np.float64), np.empty(0, np.int32))


def gyro_rails(board: Board, gyro: Gyro, rates: bool = False) -> tuple[float, float]:
    """Lowest and highest value of a gyro's channel: what lies there or beyond is clipped, or no value of this gyro.

    rates   : the channel holds deg/s, not counts
    returns : the rails of the converter; where these are not known, or a log holds rates, what the gyro's range comes
              to by its data sheet; -inf and inf where that is not known, either. Counts, or deg/s where rates.
    The one rule for what the page says of clipping (decode) and what is left out of the figures at rest (convert).
    """
    if board.adc is not None and not rates:
        return float(board.adc.low), float(board.adc.high)
    if gyro.range_deg_s is None:
        return -np.inf, np.inf
    reach = gyro.range_deg_s / (1.0 if rates else gyro.scale)
    middle = 0.0 if rates else gyro.bias
    return middle - reach, middle + reach


def channel_watches(board: Board, rates: bool = False, engine: str = "native") -> dict[str, ChannelWatch]:
    """A watch for every gyro and temperature channel; rails of gyros as gyro_rails says, of others the converter's."""
    watches = {gyro.field: ChannelWatch(*gyro_rails(board, gyro, rates), engine) for gyro in board.gyros}
    adc = None if rates else board.adc
    rails = (-np.inf, np.inf) if adc is None else (float(adc.low), float(adc.high))
    for temperature in board.temperatures:
        watches.setdefault(temperature.field, ChannelWatch(*rails, engine))
    return watches
