"""Which board made these files? By the frames of a dump, or by the columns of a log."""

from __future__ import annotations

from pathlib import Path

from vgyro.board import Board
from vgyro.errors import DataError
from vgyro.storage.inputs import read_board
from vgyro.storage.sniff import all_boards, sniff

PARQUET_MAGIC = b"PAR1"
ENOUGH = 0.5
RATE_TOLERANCE = 0.01


def is_parquet(path: Path) -> bool:
    """True for a Parquet file, and for a folder (of Parquet files)."""
    if path.is_dir():
        return True
    with open(path, "rb") as stream:
        return stream.read(len(PARQUET_MAGIC)) == PARQUET_MAGIC


def best_board(path: Path, boards: Path) -> tuple[Board, list[str]]:
    """The board that fits a file best, and why.  raises : DataError where none does"""
    return _by_columns(path, boards) if is_parquet(path) else _by_frames(path, boards)


def measured_rate(path: Path, board: Board) -> float | None:
    """The rate of a dump by its time stamps, Hz, where it contradicts the board's; else None."""
    if is_parquet(path):
        return None
    found = sniff(path, [board])
    rate = found[0].rate_hz if found else None
    if rate is None or abs(rate / board.rate_hz - 1) <= RATE_TOLERANCE:
        return None
    return round(rate, 3)


def columns_of(path: Path) -> dict[str, bool]:
    """Columns of a Parquet file, or of the first one in a folder: name → floating point?  raises : DataError"""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = min(path.rglob("*.parquet")) if path.is_dir() else path
    try:
        return {column.name: pa.types.is_floating(column.type) for column in pq.read_schema(file)}
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"not a Parquet file: {error}", str(file), "name a dump or a whole Parquet file") from None


def _by_frames(path: Path, boards: Path) -> tuple[Board, list[str]]:
    found = sniff(path, all_boards(boards))
    if not found or found[0].good_share < ENOUGH:
        best = f"; the nearest, {found[0].board}, explains {found[0].good_share:.0%} of it" if found else ""
        remedy = "name the board by --board, or describe it (docs/extending.md)"
        raise DataError(f"no board of {boards} fits its first megabyte{best}", str(path), remedy)
    first = found[0]
    notes = [f"guessed: its frames make up {first.good_share:.1%} of the first megabyte of {path.name}"]
    others = [f"{entry.board} {entry.good_share:.1%}" for entry in found[1:] if entry.good_share >= ENOUGH]
    if others:
        notes.append(f"these fit too: {', '.join(others)}")
    return read_board(first.board, boards=boards), notes


def _by_columns(path: Path, boards: Path) -> tuple[Board, list[str]]:
    columns = set(columns_of(path))
    for board in all_boards(boards):
        if all({gyro.name, gyro.field} & columns for gyro in board.gyros):
            return board, [f"guessed: {path.name} has a column for each of its gyros"]
    known = ", ".join(sorted(columns))
    what = f"no board of {boards} has gyros with the names of its columns: {known}"
    raise DataError(what, str(path), "name the board by --board")
