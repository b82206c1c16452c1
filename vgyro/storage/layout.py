"""Fields of a frame: bytes → channels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vgyro.board import TYPE_BYTES, BinaryFrame, Board, TextFrame
from vgyro.engine.frames import DTYPES, FrameColumn


def channel_types(frame: BinaryFrame | TextFrame) -> dict[str, np.dtype]:
    """NumPy type of every channel of a frame, in the frame's order."""
    return {name: np.dtype(DTYPES[field.type]) for field in frame.fields for name in field.channels()}


def kept_channels(board: Board) -> list[str]:
    """Channels that frames.parquet holds: all but the raw counter, which stands there without its wraps."""
    counter = board.counter.field if board.counter else None
    return [name for name in board.channels if name != counter]


def columns_of(frame: BinaryFrame, names: Iterable[str]) -> list[FrameColumn]:
    """Where the named channels stand in a frame."""
    columns = {}
    for field in frame.fields:
        if field.at is None:
            raise ValueError(f"field {field.name!r} of a binary frame has no offset")
        stride = field.stride or TYPE_BYTES[field.type]
        for index, channel in enumerate(field.channels()):
            columns[channel] = FrameColumn(field.type, field.at + index * stride, field.byte_order or frame.byte_order)
    return [columns[name] for name in names]
