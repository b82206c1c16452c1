"""Decoding of a damaged dump against the loop over `struct` that one writes first."""

from __future__ import annotations

import binascii
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.simulate.serial.encode import encode
from vgyro.simulate.serial.line import damage
from vgyro.simulate.twin import LineDamage
from vgyro.storage.dumps.reader import DumpReader
from vgyro.storage.inputs import read_board

BOARDS = Path(__file__).resolve().parents[1] / "config" / "boards"
LAPS = 65536
"""Frames after which the counter starts again: so many frames, repeated, are a seamless stream."""
SYNC, FRAME = b"\xeb\x90", struct.Struct(">2sH6h6hH")
# Read the dump once, write 12 int16 channels, int64 counter, float64 time and int32 segment of each frame of 30 bytes.
BYTES_OUT = (12 * 2 + 8 + 8 + 4) / FRAME.size


def contests(quick: bool) -> list[Contest]:
    """Ours decodes the whole dump from its file; the loop decodes the first part of it, timed a byte."""
    laps, corruptions, part = (2, 160, 1_000_000) if quick else (254, 20_000, 20_000_000)
    board = read_board("dsp6", boards=BOARDS)
    folder = tempfile.TemporaryDirectory(prefix="vgyro-benchmarks-")
    path = Path(folder.name) / "dump.bin"
    content = damaged_dump(board, laps, corruptions)
    path.write_bytes(content)
    size, start = len(content), content[:part]
    del content

    def ours() -> int:
        # The folder lives as long as this function does.
        assert folder.name
        return sum(len(frames.counter) for frames in _reader(path, board))

    def accuracy() -> list[Accuracy]:
        first = Path(folder.name) / "part.bin"
        first.write_bytes(start)
        chunks = list(_reader(first, board))
        mine = np.column_stack([np.concatenate([chunk.counts[name] for chunk in chunks]) for name in _channels(board)])
        theirs = struct_loop(start)
        assert np.array_equal(theirs, struct_loop(start, table_crc))
        same = len(mine) == len(theirs) and np.array_equal(mine, theirs[:, 1:])
        return [
            Accuracy("frames of the part", float(len(mine))),
            Accuracy("frames of ours − frames of the loop", float(len(mine) - len(theirs))),
            Accuracy("frames whose counts differ", 0.0 if same else _differing(mine, theirs), 0.0),
        ]

    fast = Side(f"struct loop, CRC by binascii, first {part / 1e6:g} MB", lambda: struct_loop(start), part)
    plain = Side(f"struct loop, CRC in Python, first {part / 1e6:g} MB", lambda: struct_loop(start, table_crc), part)
    return [
        Contest(
            "decode", f"Decoding, {size / 1e6:.0f} MB, {corruptions} corruptions", "byte", Side("vgyro", ours, size),
            (Rival(fast, 25), Rival(plain, 25)), arithmetic(transferred=1 + BYTES_OUT), accuracy,
            "ours reads the file, hashes it, places every frame in time and keeps the account of damage, too",
        )
    ]  # fmt: skip


def _reader(path: Path, board: Board) -> DumpReader:
    return DumpReader([path], board, board.frame_rate_hz, IntegrityOptions(), boards=BOARDS)


def _channels(board: Board) -> list[str]:
    return [gyro.field for gyro in board.gyros] + [temperature.field for temperature in board.temperatures]


def _differing(mine: np.ndarray, theirs: np.ndarray) -> float:
    """Frames of either side that the other has not."""
    ours, other = (
        {row.tobytes() for row in np.ascontiguousarray(table, dtype=np.int64)} for table in (mine, theirs[:, 1:])
    )
    return float(len(ours ^ other))


def damaged_dump(board: Board, laps: int, corruptions: int) -> bytes:
    """Frames of noise, one lap of the counter repeated; then flipped, lost and inserted bytes at random places."""
    rng = np.random.default_rng(17)
    counts = {name: rng.integers(-3000, 3000, LAPS) for name in _channels(board)}
    lap = encode(board, np.arange(LAPS), counts).data
    starts = np.arange(laps * LAPS, dtype=np.int64) * FRAME.size
    third = corruptions // 3
    spec = LineDamage(flips=corruptions - 2 * third, drops=third, insertions=third)
    return damage(lap * laps, spec, rng, starts)[0]


def binascii_crc(data: bytes) -> int:
    """CRC-16/CCITT-FALSE by the standard library's C."""
    return binascii.crc_hqx(data, 0xFFFF)


def table_crc(data: bytes) -> int:
    """The same in Python, a table look-up a byte."""
    register = 0xFFFF
    for byte in data:
        register = (register << 8) & 0xFFFF ^ TABLE[register >> 8 ^ byte]
    return register


TABLE = [binascii.crc_hqx(bytes([byte]), 0) for byte in range(256)]


def struct_loop(data: bytes, crc: Callable[[bytes], int] = binascii_crc) -> np.ndarray:
    """Counter and 12 channels of every frame with a right checksum, [T, 13]: find the sync word, check, unpack."""
    rows, at, last = [], data.find(SYNC), len(data) - FRAME.size
    while 0 <= at <= last:
        fields = FRAME.unpack_from(data, at)
        if crc(data[at : at + 28]) == fields[-1]:
            rows.append(fields[1:-1])
            at += FRAME.size
        else:
            at += 1
        at = data.find(SYNC, at)
    return np.array(rows)
