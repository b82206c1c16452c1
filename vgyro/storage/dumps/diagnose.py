"""Why does a board not read a dump of binary frames? Other layouts are tried on its head; only what fits is said."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Ints
from vgyro.board import TYPE_BYTES, BinaryFrame, Board, ByteOrder
from vgyro.engine.frames import FrameColumn
from vgyro.engine.reference.frames import verifier
from vgyro.storage.dumps.rechecksum import right_checksum, same_order, shown_key
from vgyro.storage.layout import columns_of

HEAD = 1 << 18  # bytes that are looked at
ENOUGH = 0.5  # a board that explains so large a share of the head is right about its frames
SURE = 0.9  # share of the frames for which a claim must hold
FEWEST = 16  # frames for any claim
SMOOTHER = 16.0  # fields in the right byte order change so many times less from frame to frame
UNBROKEN = 256  # so many frames must follow each other without a loss where the sync bytes are not known
LONGEST = 1024  # bytes of a frame that are looked for


class Layout(NamedTuple):
    """Frames that stand at `places` of the buffer, and how they differ from the board's, as (key, value)."""

    frame: BinaryFrame
    places: np.ndarray
    changes: tuple[tuple[str, str], ...] = ()


def diagnose(head: bytes, board: Board) -> list[str]:
    """What in a board file should be different, each with the evidence in the dump; empty where nothing is certain.

    head : the first bytes of a dump;  board : one with a binary frame, else there is nothing to say
    """
    frame = board.frame
    if not isinstance(frame, BinaryFrame):
        return []
    buffer = np.frombuffer(head[:HEAD], dtype=np.uint8)
    good = engines.get("native").frames.Finder(frame).find(buffer).good
    if frame.checksum.family != "none" and len(good) * frame.length >= ENOUGH * len(buffer):
        return _of_fields(buffer, Layout(frame, good), board)
    for layout in _layouts(buffer, frame, board):
        if len(layout.places) < FEWEST:
            continue
        found = _of_layout(buffer, layout, board)
        if found:
            return found
    return []


def _of_layout(buffer: np.ndarray, layout: Layout, board: Board) -> list[str]:
    """What is wrong with a board whose frames stand where the layout says."""
    frame, places, changes = layout
    if frame.checksum.family == "none":
        return (
            [_said(changes, "the frames follow each other", len(places), len(places))]
            if changes
            else _of_fields(buffer, layout, board)
        )
    fixed = right_checksum(buffer, places, frame)
    if fixed is None:
        return []
    rule, right = fixed
    flipped = _flipped(frame.byte_order)
    # A checksum that is right in the other byte order may mean the whole frame, if the counter agrees.
    if same_order(rule, frame, flipped) and _whole_frame(buffer, places, board, frame, flipped):
        changes += (("frame.byte_order", flipped),)
        return [_said(changes, "every checksum is right", right, len(places))]
    names = type(frame.checksum).model_fields
    changes += tuple(
        (f"frame.checksum.{name}", shown_key(name, getattr(rule, name), rule.width))
        for name in names
        if getattr(rule, name) != getattr(frame.checksum, name)
    )
    if not changes:
        return []
    mended = frame.model_copy(update={"checksum": rule})
    said = [_said(changes, "every checksum is right", right, len(places))]
    return said + _of_fields(buffer, Layout(mended, places), board)


def _said(changes: tuple[tuple[str, str], ...], claim: str, right: int, count: int) -> str:
    claim = claim if right == count else claim.replace("every checksum is right", "the checksum is right")
    short = ", ".join(f"{key.removeprefix('frame.')}: {value}" for key, value in changes)
    keys = ", ".join(f"{key}: {value}" for key, value in changes)
    return f"with {short} {claim} ({right} of {count} frames): set {keys} in the board file"


def _whole_frame(buffer: np.ndarray, places: np.ndarray, board: Board, frame: BinaryFrame, order: ByteOrder) -> bool:
    """True if counter, or without one the gyros, are right in that byte order as well."""
    other = frame.model_copy(update={"byte_order": order})
    if board.counter is not None:
        return _in_step(buffer, places, board, other) > _in_step(buffer, places, board, frame)
    return _roughness(buffer, places, board, other) < _roughness(buffer, places, board, frame)


def _layouts(buffer: np.ndarray, frame: BinaryFrame, board: Board) -> Iterator[Layout]:
    """Where the frames may be, the nearest to the board's word first."""
    sync = bytes.fromhex(frame.sync)
    fixed = _places_of(buffer, sync)
    places = _chain(fixed, frame.length, len(buffer))
    if len(places) * frame.length >= ENOUGH * len(buffer):
        yield from _with_constants(buffer, Layout(frame, places))
        return
    distance = _usual_distance(fixed)
    if distance is not None and distance != frame.length:
        places = _chain(fixed, distance, len(buffer))
        layout = _with_length(frame, distance, places)
        if len(places) * distance >= ENOUGH * len(buffer) and _holds_all(layout.frame):
            yield layout
    for length in _periods(buffer, frame.length):
        yield from _other_sync(buffer, frame, length, board)


def _with_constants(buffer: np.ndarray, layout: Layout) -> Iterator[Layout]:
    """The layout; with other constants where the frames hold others."""
    frame, places, changes = layout
    rows = np.lib.stride_tricks.sliding_window_view(buffer, frame.length)[places]
    constants = dict(frame.constants)
    for offset, text in frame.constants.items():
        size = len(bytes.fromhex(text))
        values, counts = np.unique(rows[:, offset : offset + size], axis=0, return_counts=True)
        usual = values[np.argmax(counts)].tobytes()
        if counts.max() >= SURE * len(rows) and usual != bytes.fromhex(text):
            constants[offset] = usual.hex(" ").upper()
            changes += ((f"frame.constants.{offset}", constants[offset]),)
    yield Layout(frame.model_copy(update={"constants": constants}), places, changes)


def _with_length(frame: BinaryFrame, length: int, places: np.ndarray) -> Layout:
    rule, moved = frame.checksum, length - frame.length
    if rule.at is not None and rule.at + rule.width // 8 == frame.length:
        # A checksum at the end stays at the end.
        span = (rule.span[0], rule.span[1] + moved) if rule.span else None
        rule = rule.model_copy(update={"at": rule.at + moved, "span": span})
    changes = [("frame.length", str(length))]
    changes += [
        (f"frame.checksum.{name}", shown_key(name, getattr(rule, name), rule.width))
        for name in ("at", "span")
        if getattr(rule, name) != getattr(frame.checksum, name)
    ]
    return Layout(frame.model_copy(update={"length": length, "checksum": rule}), places, tuple(changes))


def _holds_all(frame: BinaryFrame) -> bool:
    """True if checksum and fields lie within the frame's length."""
    rule = frame.checksum
    ends = [
        (field.at or 0) + (field.count - 1) * (field.stride or size) + size
        for field in frame.fields
        for size in [TYPE_BYTES[field.type]]
    ]
    ends += [rule.at + rule.width // 8] if rule.at is not None else []
    span = rule.span or (0, 1)
    return span[0] < span[1] <= frame.length and max(ends) <= frame.length


def _other_sync(buffer: np.ndarray, frame: BinaryFrame, length: int, board: Board) -> Iterator[Layout]:
    """Frames of that length that begin with other bytes: the checksum, or the counter, must say where."""
    size = len(bytes.fromhex(frame.sync))
    buffer = buffer[: (UNBROKEN + 2) * length]
    start = np.arange(0, len(buffer) - 2 * length, length)
    if len(start) < FEWEST:
        return
    base = frame if length == frame.length else _with_length(frame, length, start).frame
    if len(start) < FEWEST or not _holds_all(base):
        return
    verify = verifier(base)
    for offset in range(length):
        places = start + offset
        if base.checksum.family != "none":
            fits = float(np.mean(verify(buffer, places)))
        else:
            fits = _in_step(buffer, places, board, base)
        if fits < SURE:
            continue
        rows = np.lib.stride_tricks.sliding_window_view(buffer, size)[places]
        values, counts = np.unique(rows, axis=0, return_counts=True)
        if counts.max() >= SURE * len(rows):
            usual = values[np.argmax(counts)].tobytes()
            changes: tuple[tuple[str, str], ...] = (("frame.sync", usual.hex(" ").upper()),)
            if length != frame.length:
                changes += _with_length(frame, length, start).changes
            yield Layout(base.model_copy(update={"sync": usual.hex(" ").upper()}), places, changes)


def _periods(buffer: np.ndarray, length: int) -> list[int]:
    """The declared length, and the lag at which most bytes are equal to those a lag before."""
    longest = min(LONGEST, len(buffer) // 4)
    part = buffer[: 16 * LONGEST]
    lags = np.arange(2, max(3, longest))
    same = np.array([np.mean(part[lag:] == part[:-lag]) for lag in lags])
    best = int(lags[int(np.argmax(same))])
    # The smallest period of which the best is a multiple and that is nearly as good.
    for lag, share in zip(lags.tolist(), same.tolist(), strict=True):
        if best % lag == 0 and share >= SURE * same.max():
            best = lag
            break
    return list(dict.fromkeys([length, best]))


def _places_of(buffer: np.ndarray, sync: bytes) -> np.ndarray:
    room = len(buffer) - len(sync) + 1
    match = np.ones(max(0, room), dtype=bool)
    for place, value in enumerate(sync):
        match &= buffer[place : place + room] == value
    return np.flatnonzero(match)


def _chain(places: np.ndarray, length: int, size: int) -> np.ndarray:
    """Places that have another one frame before or after them, and a whole frame of room."""
    places = places[places + length <= size]
    return places[np.isin(places + length, places) | np.isin(places - length, places)]


def _usual_distance(places: np.ndarray) -> int | None:
    """The distance of places that most often comes, a few neighbours on; None where there is none."""
    if len(places) < FEWEST:
        return None
    # A sync pattern in a payload stands between two true ones.
    steps = np.concatenate([places[k:] - places[:-k] for k in (1, 2, 3)])
    values, counts = np.unique(steps[steps <= LONGEST], return_counts=True)
    return int(values[np.argmax(counts)]) if len(values) else None


def _of_fields(buffer: np.ndarray, layout: Layout, board: Board) -> list[str]:
    """The byte order of counter and gyros, where frames and checksums are right."""
    frame, places, _ = layout
    if len(places) < FEWEST:
        return []
    other = _turned(frame)
    if board.counter is not None:
        here, there = _in_step(buffer, places, board, frame), _in_step(buffer, places, board, other)
        if there >= SURE and here < ENOUGH:
            step = _usual_step(buffer, places, board, frame)
            now = f"the counter steps by {step}" if step is not None else "the counter is not in step"
            order, keys = _order_key(frame, {board.counter.field})
            return [f"{now}: with byte_order: {order} it steps by {board.counter.step}: set {keys} in the board file"]
    rough, smooth = _roughness(buffer, places, board, frame), _roughness(buffer, places, board, other)
    if smooth > 0 and SMOOTHER * smooth <= rough:
        times = f"{rough / smooth:.0f} times" if np.isfinite(rough) else "far"
        order, keys = _order_key(frame, _gyro_channels(board), of_fields=board.counter is not None)
        return [
            f"with byte_order: {order} the gyros change {times} less from frame to frame: set {keys} in the board file"
        ]
    return []


def _order_key(frame: BinaryFrame, channels: set[str], of_fields: bool = False) -> tuple[ByteOrder, str]:
    """The other byte order of some channels, and which key of the board file sets it.

    of_fields : true: the frame's own byte order is right for other fields
    """
    fields = [field for field in frame.fields if channels & set(field.channels())]
    order = _flipped(fields[0].byte_order or frame.byte_order)
    if of_fields or fields[0].byte_order is not None:
        return order, f"byte_order: {order} for field {', '.join(field.name for field in fields)}"
    rule, keys = frame.checksum, f"frame.byte_order: {order}"
    if rule.byte_order is None and rule.at is not None and rule.width > 8:
        # The checksum is right as it is.
        keys += f" and frame.checksum.byte_order: {frame.byte_order}"
    return order, keys


def _turned(frame: BinaryFrame) -> BinaryFrame:
    """The frame with every field in the other byte order."""
    fields = tuple(
        field.model_copy(update={"byte_order": _flipped(field.byte_order or frame.byte_order)})
        for field in frame.fields
    )
    return frame.model_copy(update={"fields": fields})


def _flipped(order: ByteOrder) -> ByteOrder:
    return "little" if order == "big" else "big"


def _steps(buffer: Ints, places: Ints, board: Board, frame: BinaryFrame) -> Ints:
    """Steps of the counter between frames that follow each other."""
    if board.counter is None:
        return np.empty(0, dtype=np.int64)
    (values,) = _read(buffer, places, frame, columns_of(frame, [board.counter.field]))
    steps = np.mod(np.diff(values.astype(np.int64)), board.counter.modulus)
    whole: Ints = steps[np.diff(places) == frame.length]
    return whole


def _in_step(buffer: np.ndarray, places: np.ndarray, board: Board, frame: BinaryFrame) -> float:
    """Share of the frames whose counter is one step after the one before."""
    steps = _steps(buffer, places, board, frame)
    return float(np.mean(steps == board.counter.step)) if board.counter is not None and len(steps) else 0.0


def _usual_step(buffer: np.ndarray, places: np.ndarray, board: Board, frame: BinaryFrame) -> int | None:
    values, counts = np.unique(_steps(buffer, places, board, frame), return_counts=True)
    return int(values[np.argmax(counts)]) if len(values) and counts.max() > counts.sum() / 2 else None


def _gyro_channels(board: Board) -> set[str]:
    return {gyro.field for gyro in board.gyros}


def _roughness(buffer: np.ndarray, places: np.ndarray, board: Board, frame: BinaryFrame) -> float:
    """How much the gyros change from frame to frame, counts: the median over their medians; inf: no numbers."""
    columns = [column for column in columns_of(frame, sorted(_gyro_channels(board))) if column.size > 1]
    if not columns:
        return 0.0
    medians = []
    for values in _read(buffer, places, frame, columns):
        with np.errstate(over="ignore", invalid="ignore"):
            change = np.abs(np.diff(values.astype(np.float64)))
        # A float in the wrong byte order is often no number at all.
        medians.append(float(np.median(np.where(np.isfinite(change), change, np.inf))))
    return float(np.median(medians))


def _read(buffer: Ints, places: Ints, frame: BinaryFrame, columns: list[FrameColumn]) -> list[np.ndarray]:
    return engines.get("reference").frames.read_columns(buffer, places, frame.length, columns)
