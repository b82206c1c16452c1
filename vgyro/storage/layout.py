"""Fields of a frame: bytes → channels."""

from __future__ import annotations

import numpy as np

from vgyro.board import TYPE_BYTES, BinaryFrame, Board, ByteOrder, ChannelField, FieldType, TextFrame

# NumPy has no 24-bit integers; they are kept as 32-bit ones.
DTYPES: dict[FieldType, str] = {
    "u8": "u1", "i8": "i1", "u16": "u2", "i16": "i2", "u24": "u4", "i24": "i4", "u32": "u4", "i32": "i4", "u64": "u8",
    "i64": "i8", "f32": "f4", "f64": "f8",
}  # fmt: skip


def channel_types(frame: BinaryFrame | TextFrame) -> dict[str, np.dtype]:
    """NumPy type of every channel of a frame, in the frame's order."""
    return {name: np.dtype(DTYPES[field.type]) for field in frame.fields for name in field.channels()}


def kept_channels(board: Board) -> list[str]:
    """Channels that frames.parquet holds: all but the raw counter, which stands there without its wraps."""
    counter = board.counter.field if board.counter else None
    return [name for name in board.channels if name != counter]


def read_channels(frames: np.ndarray, frame: BinaryFrame, names: list[str]) -> dict[str, np.ndarray]:
    """Values of the named channels, each [n], in the field's own type.

    frames : uint8 [n, length], C-contiguous
    """
    values = {}
    for field in frame.fields:
        for channel, at in zip(field.channels(), _offsets(field), strict=True):
            if channel in names:
                values[channel] = _value(frames, field.type, at, field.byte_order or frame.byte_order)
    return {name: values[name] for name in names}


def _offsets(field: ChannelField) -> list[int]:
    if field.at is None:
        raise ValueError(f"field {field.name!r} of a binary frame has no offset")
    stride = field.stride or TYPE_BYTES[field.type]
    return [field.at + index * stride for index in range(field.count)]


def _value(frames: np.ndarray, kind: FieldType, at: int, order: ByteOrder) -> np.ndarray:
    size = TYPE_BYTES[kind]
    if size == 3:
        return _value_24(frames, kind, at, order)
    sign = ">" if order == "big" else "<"
    stored = np.dtype({"names": ["x"], "formats": [sign + DTYPES[kind]], "offsets": [at], "itemsize": frames.shape[1]})
    return frames.reshape(-1).view(stored)["x"].astype(DTYPES[kind])


def _value_24(frames: np.ndarray, kind: FieldType, at: int, order: ByteOrder) -> np.ndarray:
    high, middle, low = (at, at + 1, at + 2) if order == "big" else (at + 2, at + 1, at)
    # The 24 bits go to the top of 32, so that the shift back down spreads the sign.
    value = frames[:, high].astype(np.uint32) << 24
    value |= frames[:, middle].astype(np.uint32) << 16
    value |= frames[:, low].astype(np.uint32) << 8
    return value.view(np.int32) >> 8 if kind == "i24" else value >> 8
