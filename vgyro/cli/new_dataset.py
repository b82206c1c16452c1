"""Sniff dumps or Parquet logs and write a commented raw/<name>/dataset.yaml for them.

Each file (or folder of Parquet files) becomes one recording, of kind static until you say otherwise. The files stay
where they are. An existing dataset.yaml is never overwritten.
"""

from __future__ import annotations

import argparse
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vgyro.board import Board
    from vgyro.cli.manifest_text import LogDraft, RecordingDraft

EPILOG = """\
examples:
  vgyro new-dataset ~/dumps/*.bin
  vgyro new-dataset ~/dumps/a.bin ~/dumps/b.bin.gz --name bench --board dsp6
  vgyro new-dataset /archive/2026-02 --name winter --board adis16405     a folder of Parquet files

exit codes:
  0  written
  2  the data set exists already, or its name cannot be used
  3  there is no such board
  4  a file is not there, is empty, or fits no board
"""
ENDINGS = (".gz", ".zst", ".parquet", ".bin", ".dat", ".txt", ".log", ".raw", ".csv")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("files", nargs="+", metavar="FILE", type=Path, help="dump (.gz and .zst too), or Parquet log")
    parser.add_argument("--name", help="name of the data set; default: that of the files' folder")
    parser.add_argument("--board", help="board in config/boards; default: the one that fits best")
    parser.add_argument("--raw", type=Path, default=Path("raw"), help="default: %(default)s")
    parser.add_argument("--boards", type=Path, default=Path("config/boards"), help="default: %(default)s")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(options: argparse.Namespace) -> int:
    """Sniff, write, return the exit code."""
    from vgyro.cli.manifest_text import manifest_text
    from vgyro.dataset import check_against_board, parse_manifest
    from vgyro.storage.inputs import read_board
    from vgyro.storage.tables import write_text

    target = _target(options)
    for path in options.files:
        _must_exist(path)
    board = read_board(options.board, boards=options.boards) if options.board else None
    board, notes = (board, ["given on the command line"]) if board else _guess_board(options.files, options.boards)
    folder = Path(os.path.commonpath([path.resolve().parent for path in options.files]))
    names: set[str] = set()
    drafts = [_draft(path, folder, board, names) for path in options.files]
    text = manifest_text(board.name, notes, _folder_text(folder, target.parent), drafts)
    manifest = parse_manifest(text, str(target))
    assert not check_against_board(manifest, board, str(target))
    write_text(target, text)
    if options.json:
        recordings = [{"name": draft.name, "file": draft.file, "rate_hz": draft.rate_hz} for draft in drafts]
        record = {"manifest": str(target), "board": board.name, "recordings": recordings, "notes": notes}
        print(json.dumps(record, indent=1, ensure_ascii=False))
    else:
        runs = "1 recording" if len(drafts) == 1 else f"{len(drafts)} recordings"
        print(f"{target}: board {board.name} ({notes[0]}), {runs}")
        print("next: correct the kind of each recording in it, then vgyro check, then snakemake --cores 2")
    return 0


def _target(options: argparse.Namespace) -> Path:
    from vgyro.errors import UsageError
    from vgyro.tasks.inputs_check import DATASET_NAME, MANIFEST, RESERVED

    name = options.name or _identifier(options.files[0].resolve().parent.name)
    if not DATASET_NAME.fullmatch(name) or name in RESERVED:
        what = f"{name!r} cannot be the name of a data set"
        raise UsageError(what, None, f"give letters, digits, - and _ by --name, and none of {', '.join(RESERVED)}")
    target = options.raw / name / MANIFEST
    if target.exists():
        raise UsageError("it exists already, and is not overwritten", str(target), "give another --name, or edit it")
    return target


def _must_exist(path: Path) -> None:
    from vgyro.errors import DataError

    if not path.exists():
        raise DataError("no such file", str(path), "check the path")
    if path.is_dir() and not any(path.rglob("*.parquet")):
        raise DataError("a folder without Parquet files", str(path), "name the dumps in it one by one")


def _guess_board(files: list[Path], boards: Path) -> tuple[Board, list[str]]:
    """The board that fits every file best, and why.  raises : DataError where there is none"""
    from vgyro.cli.sniffing import best_board
    from vgyro.errors import DataError

    guesses: dict[str, tuple[Board, list[str]]] = {}
    for path in files:
        board, notes = best_board(path, boards)
        guesses.setdefault(board.name, (board, notes))
        if len(guesses) > 1:
            what = f"the files come from different boards: {' and '.join(guesses)}"
            raise DataError(what, str(path), "make one data set a board, or name the board by --board")
    return next(iter(guesses.values()))


def _draft(path: Path, folder: Path, board: Board, names: set[str]) -> RecordingDraft:
    from vgyro.cli.manifest_text import RecordingDraft
    from vgyro.cli.sniffing import is_parquet, measured_rate

    name = _unique(_identifier(_stem(path)), names)
    file = path.resolve().relative_to(folder).as_posix()
    if is_parquet(path):
        return RecordingDraft(name, file, log=_log(path, board))
    rate = measured_rate(path, board)
    notes = [f"its time stamps say {rate:g} Hz, the board's rate is {board.rate_hz:g} Hz"] if rate else []
    return RecordingDraft(name, file, rate_hz=rate, notes=notes)


def _log(path: Path, board: Board) -> LogDraft:
    """Columns of a Parquet log, and which gyro each one is: by name, or the same name but for case and signs."""
    from vgyro.cli.manifest_text import LogDraft
    from vgyro.cli.sniffing import columns_of

    there = columns_of(path)
    plain = {re.sub(r"[^a-z0-9]", "", column.lower()): column for column in there}
    columns, missing = {}, []
    for gyro in board.gyros:
        found = next((name for name in (gyro.field, gyro.name) if name in there), None)
        alike = plain.get(re.sub(r"[^a-z0-9]", "", gyro.field.lower())) or plain.get(f"gyro{gyro.field.lower()[1:]}")
        if found or alike:
            columns[found or gyro.field] = found or str(alike)
        else:
            missing.append(gyro.field)
    time = next((column for column in there if column.lower() in {"time", "t", "time_s", "t_s", "seconds"}), None)
    floating = any(there[column] for column in columns.values())
    return LogDraft(columns, missing, list(there), time, "rates" if floating else "counts")


def _folder_text(folder: Path, manifest: Path) -> str:
    """Relative inside the project, so that it can be moved; absolute outside."""
    if folder.is_relative_to(Path.cwd()):
        return Path(os.path.relpath(folder, manifest.resolve())).as_posix()
    return folder.as_posix()


def _stem(path: Path) -> str:
    name = path.name
    while (ending := Path(name).suffix.lower()) in ENDINGS:
        name = name[: -len(ending)]
    return name


def _identifier(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_") or "recording"


def _unique(name: str, names: set[str]) -> str:
    from vgyro.dataset import RESERVED

    number, chosen = 1, name
    while chosen in names or chosen in RESERVED:
        number += 1
        chosen = f"{name}-{number}"
    names.add(chosen)
    return chosen
