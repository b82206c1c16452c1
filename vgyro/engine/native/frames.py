"""Frames of a serial dump in C: synchronisation, checksums, columns, runs. One pass, for any binary layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vgyro.engine.checksums import crc_tables
from vgyro.engine.frames import DTYPES, Candidates, FrameColumn, Run, fixed_bytes
from vgyro.engine.native import _frames

if TYPE_CHECKING:
    from vgyro.board import BinaryFrame

ROOM = 1 << 12
"""Candidates, beyond those of a dump of whole frames, for which there is room at first."""
FAMILIES = {"none": _frames.NO_CHECKSUM, "crc": _frames.CRC, "sum": _frames.SUM}


class Finder:
    """As vgyro.engine.protocols.reading.FrameFinder."""

    def __init__(self, frame: BinaryFrame) -> None:
        rule, fixed = frame.checksum, fixed_bytes(frame)
        first, last = rule.span or (0, 0)
        zeros, tables = 0, np.zeros((1, 256), dtype=np.uint8)
        if rule.family == "crc":
            zeros, tables = crc_tables(rule, last - first)
            # The sync bytes are always the same: what they add is known before.
            sync = bytes.fromhex(frame.sync)[first : last - 1]
            for table, byte in zip(tables, sync, strict=False):
                zeros ^= int(table[byte])
            first, tables = first + len(sync), tables[len(sync) :]
        self._length = frame.length
        self._layout = _frames.Layout(
            frame.length,
            np.array([value for _, value in fixed], dtype=np.uint8),
            np.array([place for place, _ in fixed], dtype=np.int64),
            FAMILIES[rule.family if rule.span else "none"],
            rule.width // 8,
            tables.reshape(-1).view(np.uint8),
            zeros,
            rule.equals or 0,
            -1 if rule.at is None else rule.at,
            first,
            last,
            (rule.byte_order or frame.byte_order) == "big",
        )

    def find(self, buffer: np.ndarray) -> Candidates:
        """As vgyro.engine.protocols.reading.FrameFinder.find."""
        good, failed, place = [], [], 0
        room = len(buffer) // self._length + ROOM
        while place < len(buffer):
            whole, broken = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
            wholes, brokens, place = self._layout.find(buffer, place, whole, broken)
            good.append(whole[:wholes])
            failed.append(broken[:brokens])
        return Candidates(_joined(good), _joined(failed))


def read_columns(
    buffer: np.ndarray, places: np.ndarray, length: int, columns: Sequence[FrameColumn]
) -> list[np.ndarray]:
    """As vgyro.engine.protocols.reading.FramesEngine.read_columns."""
    read = [np.empty(len(places), dtype=DTYPES[column.kind]) for column in columns]
    if not len(places):
        return read
    if places[0] < 0 or places[-1] + length > len(buffer):
        raise IndexError(f"frames of {length} bytes do not lie in a buffer of {len(buffer)}")
    wanted = [
        (column.at, column.size, column.order == "big", column.kind[0] == "i", values.view(np.uint8))
        for column, values in zip(columns, read, strict=True)
    ]
    _frames.columns(buffer, places, wanted)
    return read


def breaks(start: np.ndarray, length: int, counter: np.ndarray | None, step: int, modulus: int) -> np.ndarray:
    """As vgyro.engine.protocols.reading.FramesEngine.breaks."""
    rows = np.empty(len(start), dtype=np.int64)
    if len(start):
        rows = rows[: _frames.breaks(start, counter, length, step, modulus, rows)].copy()
    return rows


def longest_run(values: np.ndarray, time: np.ndarray, since: float, least: float) -> tuple[Run | None, float]:
    """As vgyro.engine.protocols.reading.FramesEngine.longest_run."""
    # Only whether two integers are equal counts, not their sign.
    kind = f"i{values.itemsize}" if values.dtype.kind == "u" else values.dtype
    began, duration, last = _frames.longest_run(np.ascontiguousarray(values).view(kind), time, since, least)
    return (Run(began, duration) if duration > least else None), last


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.int64)
