"""Counts → bytes of frames, for every declared board. Written apart from the decoder, so that each tests the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Ints
from vgyro.board import TYPE_BYTES, BinaryFrame, Board, Checksum, TextFrame
from vgyro.errors import DataError

LINE_END = b"\r\n"


@dataclass(frozen=True)
class Encoded:
    """data : the frames, one after another;  starts : [T] offset of the first byte of each"""

    data: bytes
    starts: np.ndarray


def encode_frames(
    board: Board, counter: np.ndarray, counts: Mapping[str, np.ndarray], time: np.ndarray | None = None
) -> bytes:
    """The bytes that `board` sends.

    counter : [T], frame number without wraps; it is wrapped, and stepped, as the board does
    counts  : channel → [T]; a channel that is left out is 0 (or what the frame requires there)
    time    : [T], s, for the time stamp of a board that sends one; None: counter / board.frame_rate_hz
    raises  : DataError for a channel that the board lacks or a value that does not fit its field; ConfigError for a
              board that sends no frames
    """
    return encode(board, counter, counts, time).data


def encode(
    board: Board, counter: np.ndarray, counts: Mapping[str, np.ndarray], time: np.ndarray | None = None
) -> Encoded:
    """As encode_frames, with the place of each frame."""
    counter = np.asarray(counter, dtype=np.int64)
    values = {name: np.asarray(value) for name, value in counts.items()}
    for name in values:
        if name not in board.channels:
            raise DataError(
                f"board {board.name!r} has no channel {name!r}", remedy=f"it has {', '.join(board.channels)}"
            )
    if board.counter is not None:
        values[board.counter.field] = counter * board.counter.step % board.counter.modulus
    if board.timestamp is not None:
        clock = counter / board.frame_rate_hz if time is None else np.asarray(time)
        ticks = np.rint(clock / board.timestamp.tick_s).astype(np.int64)
        values[board.timestamp.field] = ticks % board.timestamp.wrap if board.timestamp.wrap else ticks
    frame = board.layout
    if isinstance(frame, BinaryFrame):
        frames = _binary(frame, values, counter.size)
        return Encoded(frames.tobytes(), np.arange(counter.size, dtype=np.int64) * frame.length)
    return _text(frame, values, counter.size)


def _binary(frame: BinaryFrame, values: Mapping[str, np.ndarray], size: int) -> np.ndarray:
    frames = np.zeros((size, frame.length), dtype=np.uint8)
    for offset, digits in frame.constants.items():
        _place(frames, offset, bytes.fromhex(digits))
    _place(frames, 0, bytes.fromhex(frame.sync))
    for field in frame.fields:
        assert field.at is not None
        width = TYPE_BYTES[field.type]
        order = field.byte_order or frame.byte_order
        for index, channel in enumerate(field.channels()):
            if channel in values:
                at = field.at + index * (field.stride or width)
                frames[:, at : at + width] = to_bytes(values[channel], field.type, order, channel)
    _add_checksum(frames, frame.checksum, frame.checksum.byte_order or frame.byte_order)
    return frames


def _place(frames: np.ndarray, offset: int, constant: bytes) -> None:
    frames[:, offset : offset + len(constant)] = np.frombuffer(constant, dtype=np.uint8)


def to_bytes(values: np.ndarray, kind: str, order: str, channel: str = "") -> np.ndarray:
    """[T] numbers as [T, width] bytes.  raises : DataError where one does not fit"""
    width = TYPE_BYTES[kind]
    if kind[0] == "f":
        packed = np.asarray(values, dtype=f">f{width}")
    else:
        low, high = type_limits(kind)
        whole = np.asarray(values)
        if whole.size and (whole.min() < low or whole.max() > high):
            raise DataError(f"values {whole.min()} to {whole.max()} do not fit a field of type {kind}", channel or None)
        stored = 4 if width == 3 else width
        packed = whole.astype(f">{kind[0]}{stored}")
    stored_bytes = packed.reshape(-1, 1).view(np.uint8)[:, -width:]
    return stored_bytes if order == "big" else stored_bytes[:, ::-1]


def type_limits(kind: str) -> tuple[int, int]:
    """Smallest and largest number that an integer field holds."""
    bits = 8 * TYPE_BYTES[kind]
    return (0, 2**bits - 1) if kind[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _add_checksum(frames: np.ndarray, checksum: Checksum, order: str) -> None:
    if checksum.family == "none" or checksum.span is None:
        return
    width = checksum.width // 8
    first, last = checksum.span
    if checksum.equals is not None:
        # The stored value is the last of the span, and makes the total come out right.
        at = last - width
        value = (checksum.equals - frames[:, first:at].sum(axis=1, dtype=np.int64)) % (1 << checksum.width)
    else:
        assert checksum.at is not None
        at = checksum.at
        value = _checksum(frames[:, first:last], checksum)
    frames[:, at : at + width] = to_bytes(value, f"u{checksum.width}", order)


def _checksum(covered: Ints, checksum: Checksum) -> Ints:
    if checksum.family == "crc":
        return crc(covered, checksum)
    if checksum.family == "xor":
        found: Ints = np.bitwise_xor.reduce(covered, axis=1).astype(np.int64)
        return found
    found = covered.sum(axis=1, dtype=np.int64) % (1 << checksum.width)
    return found


def crc(covered: np.ndarray, checksum: Checksum) -> np.ndarray:
    """CRC of each row of bytes [T, L], all rows at once, a table look-up a column; [T] int64."""
    width, mask = checksum.width, (1 << checksum.width) - 1
    table = _crc_table(width, checksum.polynomial, checksum.reflected)
    init = _mirror(checksum.init, width) if checksum.reflected else checksum.init
    padding = -covered.shape[1] % checksum.pad_to
    columns = [*covered.T.astype(np.int64), *[np.zeros(covered.shape[0], dtype=np.int64)] * padding]
    register = np.full(covered.shape[0], init, dtype=np.int64)
    for column in columns:
        if checksum.reflected:
            register = (register >> 8) ^ table[(register ^ column) & 0xFF]
        else:
            register = ((register << 8) & mask) ^ table[(register >> (width - 8)) ^ column]
    return register ^ checksum.xor_out


def _crc_table(width: int, polynomial: int, reflected: bool) -> np.ndarray:
    top, mask = 1 << (width - 1), (1 << width) - 1
    table = []
    for byte in range(256):
        register = (_mirror(byte, 8) if reflected else byte) << (width - 8)
        for _ in range(8):
            register = ((register << 1) ^ polynomial if register & top else register << 1) & mask
        table.append(_mirror(register, width) if reflected else register)
    return np.array(table, dtype=np.int64)


def _mirror(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


def _text(frame: TextFrame, values: Mapping[str, np.ndarray], size: int) -> Encoded:
    columns, formats = [], []
    for field in frame.fields:
        for channel in field.channels():
            column = values.get(channel, np.full(size, frame.require.get(channel, 0)))
            whole = field.type[0] != "f"
            if whole and size:
                to_bytes(column, field.type, "big", channel)
            columns.append(column.astype(np.int64 if whole else np.float64).tolist())
            formats.append("%d" if whole else f"%.{6 if field.decimals is None else field.decimals}f")
    prefix = frame.prefix
    if prefix and not prefix.endswith(frame.separator):
        prefix += frame.separator
    pattern = prefix.replace("%", "%%") + frame.separator.join(formats)
    bodies = [(pattern % row).encode("ascii") for row in zip(*columns, strict=True)]
    endings = [LINE_END] * size if frame.checksum.family == "none" else _endings(bodies, frame.checksum)
    lines = [body + ending for body, ending in zip(bodies, endings, strict=True)]
    lengths = np.array([len(line) for line in lines], dtype=np.int64)
    return Encoded(b"".join(lines), np.cumsum(lengths) - lengths)


def _endings(bodies: list[bytes], checksum: Checksum) -> list[bytes]:
    """`*XX` and the end of the line; XX is the XOR, or the sum, of the characters after a leading $."""
    if not bodies:
        return []
    covered = [body[1:] if body.startswith(b"$") else body for body in bodies]
    lengths = np.array([len(body) for body in covered])
    combine = np.bitwise_xor if checksum.family == "xor" else np.add
    flat = np.frombuffer(b"".join(covered), dtype=np.uint8).astype(np.int64)
    values = combine.reduceat(flat, np.cumsum(lengths) - lengths) & 0xFF
    return [b"*%02X" % value + LINE_END for value in values.tolist()]
