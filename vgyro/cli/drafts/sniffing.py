"""Dump or log, and which board made it? By the frames of a dump, or by the columns of a log and their values."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa

from vgyro.arrays import Floats
from vgyro.board import Board
from vgyro.cli.drafts.looking import HEAD_ROWS, head_of
from vgyro.cli.drafts.manifest_text import LogDraft
from vgyro.errors import DataError
from vgyro.log import Log
from vgyro.storage.dumps.sniff import all_boards, sniff
from vgyro.storage.frames import gyro_rails
from vgyro.storage.inputs import files_inside, read_board
from vgyro.storage.layout import kept_channels
from vgyro.storage.logs.families import HEAD, family_of, open_log
from vgyro.storage.logs.refused import NOT_A_LOG
from vgyro.storage.logs.refused import named as refused
from vgyro.storage.logs.roles import roles_of
from vgyro.storage.logs.table import LogFile, LogTable

ENOUGH = 0.5
RATE_TOLERANCE = 0.01
MOST_OUT_OF_RANGE = 0.5
BEYOND_RANGE = 1.5


def is_dump(path: Path, boards: Path, named: Board | None = None) -> bool:
    """Is a file a dump of frames? A text is one where a board's lines make up most of it.

    named  : the board that the user names, which need not be one of the folder `boards`
    raises : DataError where it is neither a dump of a known board nor a log
    """
    if path.is_dir():
        return False
    known = all_boards(boards) if named is None else [named]
    try:
        family = family_of(path)
    except DataError as error:
        found = sniff(path, known)
        if found and found[0].good_share >= ENOUGH:
            return True
        with open(path, "rb") as file:
            kind = refused(file.read(HEAD))
        if kind is not None:
            remedy = "name a dump or a log" if kind.remedy == NOT_A_LOG else kind.remedy
            raise DataError(f"is {kind.what}, neither a dump nor a log", str(path), remedy) from None
        best = f"; the nearest, {found[0].board}, explains {found[0].good_share:.0%} of it" if found else ""
        remedy = "name the board by --board, or describe it (docs/extending.md)"
        fits = f"no board of {boards} fits" if named is None else f"board {named.name} does not fit"
        what = f"{fits} its first megabyte{best}; and as a log it {error.what}"
        raise DataError(what, str(path), error.remedy or remedy) from None
    if family != "text":
        return False
    found = sniff(path, known)
    return bool(found) and found[0].good_share >= ENOUGH


def best_board(path: Path, boards: Path) -> tuple[Board, list[str]]:
    """The board whose frames fit a dump best, and why.  raises : DataError where none does"""
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


def measured_rate(path: Path, board: Board) -> float | None:
    """The rate of a dump by its time stamps, Hz, where it contradicts the board's; else None."""
    found = sniff(path, [board])
    rate = found[0].rate_hz if found else None
    if rate is None or abs(rate / board.frame_rate_hz - 1) <= RATE_TOLERANCE:
        return None
    return round(rate, 3)


def board_of_columns(path: Path, boards: Path) -> tuple[Board | None, list[str]]:
    """The board whose counts a log holds, and why; None where no board is sure.

    It is sure where every channel of the board has a column of its name, and the gyros hold whole numbers within its
    rails. Names alone are not enough: gx, gy and gz stand in many a log, in many a unit.
    """
    opened = opened_log(path)
    for board in all_boards(boards):
        for table in opened.tables:
            there = set(_names(table))
            if set(kept_channels(board)) <= there and holds_counts(opened, table, board):
                return board, [f"guessed: {path.name} has a column for each of its channels, with counts in its range"]
    return None, []


def holds_counts(opened: LogFile, table: LogTable, board: Board) -> bool:
    """Are the gyros' columns whole numbers, most of them within the board's rails and the gyro's range?

    Not where the board has neither. The range counts half as much again: a gyro gives more than its data sheet says.
    """
    columns = [gyro.field for gyro in board.gyros]
    rows = next(iter(opened.rows(table.name, columns)), None)
    if rows is None:
        return False
    for gyro, column in zip(board.gyros, rows.batch.columns, strict=True):
        if not pa.types.is_integer(column.type) and not pa.types.is_floating(column.type):
            return False
        values, (low, high) = _known(column), gyro_rails(board, gyro)
        if not len(values) or not np.isfinite(high) or np.any(values != np.rint(values)):
            return False
        outside = (values <= low) | (values >= high)
        if gyro.range_deg_s is not None:
            outside |= np.abs(values - gyro.bias) * gyro.scale > BEYOND_RANGE * gyro.range_deg_s
        if outside.mean() > MOST_OUT_OF_RANGE:
            return False
    return True


def _known(column: pa.Array) -> Floats:
    values = column.to_numpy(zero_copy_only=False)[:HEAD_ROWS].astype(np.float64)
    known: Floats = values[np.isfinite(values)]
    return known


def _fractions(values: np.ndarray) -> bool:
    """Are some values no whole numbers?"""
    return values.dtype.kind == "f" and bool(np.any(np.isfinite(values) & (values != np.rint(values))))


def opened_log(path: Path) -> LogFile:
    """A log, or the first one of a folder."""
    return open_log(files_inside(path)[0] if path.is_dir() else path, Log())


def log_draft(path: Path, board: Board) -> LogDraft:
    """Columns of a board's log, and which gyro each one is: by name, or the same name but for case and signs."""
    opened = opened_log(path)
    table = max(opened.tables, key=lambda known: sum(gyro.field in _names(known) for gyro in board.gyros))
    there = _names(table)
    plain = {re.sub(r"[^a-z0-9]", "", column.lower()): column for column in there}
    columns, missing = {}, []
    for gyro in board.gyros:
        found = next((name for name in (gyro.field, gyro.name) if name in there), None)
        alike = plain.get(re.sub(r"[^a-z0-9]", "", gyro.field.lower())) or plain.get(f"gyro{gyro.field.lower()[1:]}")
        if found or alike:
            columns[found or gyro.field] = found or str(alike)
        else:
            missing.append(gyro.field)
    head = head_of(opened, table)
    floating = any(_fractions(head[column]) for column in columns.values())
    return LogDraft(
        family=opened.family,
        there=list(there),
        time=roles_of(table.columns, head, table.name).time,
        table=table.name if len(opened.tables) > 1 else None,
        places={name: column for name, column in columns.items() if name != column},
        form=list(table.text),
        values="rates" if floating else "counts",
        missing=missing,
    )


def _names(table: LogTable) -> list[str]:
    return [column.name for column in table.columns]
