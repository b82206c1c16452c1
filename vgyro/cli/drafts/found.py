"""From files to drafts of recordings: of a board's dumps, of a board's logs, or of logs that name their own gyros."""

from __future__ import annotations

import argparse
import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from vgyro.board import Board
from vgyro.calibration import find_rest
from vgyro.cli.drafts.found_words import array_lines, clock_lines, moving_words
from vgyro.cli.drafts.looking import Choices, LogLook, are_one_array, array_of, log_of, look_at
from vgyro.cli.drafts.manifest_text import ArrayDraft, RecordingDraft, manifest_text
from vgyro.cli.drafts.sniffing import best_board, board_of_columns, is_dump, log_draft, measured_rate
from vgyro.config import IntegrityOptions, RestOptions
from vgyro.dataset import array_board, parse_manifest
from vgyro.errors import ConfigError, DataError, UsageError
from vgyro.runs import true_runs
from vgyro.storage.decode import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.inputs import read_board
from vgyro.storage.integrity import Integrity
from vgyro.storage.logs.names import is_called_time
from vgyro.storage.logs.roles import Roles

LARGEST_LOOKED_AT = 400 << 20
MOVES = 0.02


@dataclass
class FoundFiles:
    """What the files are.

    board : name of a board file, or the gyros themselves;  used_board : the board in both cases
    notes : why this board;  lines : what a person is told
    """

    board: str | ArrayDraft
    used_board: Board
    drafts: list[RecordingDraft]
    notes: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @property
    def board_name(self) -> str | None:
        """Name of the board file; None where the manifest names the gyros."""
        return self.board if isinstance(self.board, str) else None


def find(options: argparse.Namespace, folder: Path, manifest: Path, names: Sequence[str]) -> FoundFiles:
    """Look at the files.  folder : that holds them all;  manifest : the folder of the manifest;  names : of recordings

    raises : DataError, UsageError, ConfigError
    """
    named = read_board(options.board, boards=options.boards) if options.board else None
    dumps = [is_dump(path, options.boards, named) for path in options.files]
    if all(dumps):
        return _dumps(options, folder, manifest, names)
    if any(dumps):
        first, other = options.files[dumps.index(True)], options.files[dumps.index(False)]
        raise DataError(f"is a dump, and {other} is a log", str(first), "make a data set of each")
    board, notes = _board(options)
    if board is not None:
        return _logs_of_board(options, folder, manifest, names, board, notes)
    return _logs(options, folder, names)


def _relative(path: Path, folder: Path) -> str:
    return path.resolve().relative_to(folder).as_posix()


def _written(name: str | None, board: Board, manifest: Path) -> str:
    """How the manifest names the board: a path counts from its folder, not from here."""
    if name is None or not name.endswith((".yaml", ".yml")):
        return board.name
    path = Path(name).resolve()
    return Path(os.path.relpath(path, manifest.resolve())).as_posix() if path.is_relative_to(Path.cwd()) else str(path)


def _board(options: argparse.Namespace) -> tuple[Board | None, list[str]]:
    """The board of logs: as given, or the one whose gyros have columns there, with values in its range."""
    if options.board:
        return read_board(options.board, boards=options.boards), ["given on the command line"]
    return board_of_columns(options.files[0], options.boards)


def _dumps(options: argparse.Namespace, folder: Path, manifest: Path, names: Sequence[str]) -> FoundFiles:
    if options.board:
        board, notes = read_board(options.board, boards=options.boards), ["given on the command line"]
    else:
        board, notes = _same_board(options.files, options.boards)
    drafts = []
    for path, name in zip(options.files, names, strict=True):
        rate = options.rate or measured_rate(path, board)
        told = [f"its time stamps say {rate:g} Hz, the board's rate is {board.frame_rate_hz:g} Hz"] if rate else []
        kind = {"kind": options.kind, "why": "as you say"} if options.kind else {}
        drafts.append(RecordingDraft(name, [_relative(path, folder)], rate_hz=rate, notes=told, **kind))
    runs = "1 recording" if len(drafts) == 1 else f"{len(drafts)} recordings"
    line = f"board {board.name} ({notes[0]}), {runs}"
    return FoundFiles(_written(options.board, board, manifest), board, drafts, notes, [line])


def _same_board(files: Sequence[Path], boards: Path) -> tuple[Board, list[str]]:
    """The board that fits every file best, and why.  raises : DataError where there is none"""
    guesses: dict[str, tuple[Board, list[str]]] = {}
    for path in files:
        board, notes = best_board(path, boards)
        guesses.setdefault(board.name, (board, notes))
        if len(guesses) > 1:
            what = f"the files come from different boards: {' and '.join(guesses)}"
            raise DataError(what, str(path), "make one data set a board, or name the board by --board")
    return next(iter(guesses.values()))


def _logs_of_board(
    options: argparse.Namespace, folder: Path, manifest: Path, names: Sequence[str], board: Board, notes: list[str]
) -> FoundFiles:
    drafts = []
    for path, name in zip(options.files, names, strict=True):
        draft = RecordingDraft(name, [_relative(path, folder)], rate_hz=options.rate, log=log_draft(path, board))
        drafts.append(draft)
    written = _written(options.board, board, manifest)
    lines = [f"board {board.name} ({notes[0]})"]
    found = FoundFiles(written, board, drafts, notes, lines)
    for draft in drafts:
        if draft.log is not None and not draft.log.missing:
            lines += _surveyed(found, draft, folder, options.kind)
    return found


def _logs(options: argparse.Namespace, folder: Path, names: Sequence[str]) -> FoundFiles:
    looks = [look_at(_first_file(path)) for path in options.files]
    choices = Choices(options.rate, options.scale, options.unit, options.axis, options.together)
    together = options.together
    if together is None:
        together = are_one_array(looks, [_rows(look) for look in looks]) if len(looks) > 1 else False
    array = array_of(looks, choices, together)
    _must_be_alike(looks, together)
    if together:
        log = replace(log_of(looks[0], array), places=dict(array.places))
        files = [_relative(path, folder) for path in options.files]
        drafts = [RecordingDraft(_common_name(names), files, rate_hz=options.rate, log=log)]
    else:
        drafts = [
            RecordingDraft(name, [_relative(path, folder)], rate_hz=options.rate, log=log_of(look, array))
            for look, path, name in zip(looks, options.files, names, strict=True)
        ]
    for draft in drafts:
        if draft.log is not None and draft.log.time is None and options.rate is None:
            still = _times_that_stand(looks[0].sources[0].roles)
            what = f"has no column of time stamps{still}, so its rate is not known"
            raise UsageError(what, str(options.files[0]), "give it: --rate HZ")
    found = FoundFiles(array, _board_of(array, drafts), drafts, [], list(array_lines(looks, array, together)))
    for draft in drafts:
        found.lines += _surveyed(found, draft, folder, options.kind)
    return found


def _times_that_stand(roles: Roles) -> str:
    """A phrase on columns that are called times and are none; "" without."""
    names = [name for name, kind in roles.other.items() if kind == "other" and is_called_time(name)]
    return f" ({', '.join(names)}: does not go up)" if names else ""


def _first_file(path: Path) -> Path:
    from vgyro.storage.inputs import files_inside

    return files_inside(path)[0] if path.is_dir() else path


def _rows(look: LogLook) -> int:
    first = look.sources[0]
    return sum(rows.batch.num_rows for rows in look.opened.rows(first.table.name, [first.roles.gyros[0].column]))


def _must_be_alike(looks: Sequence[LogLook], together: bool) -> None:
    columns = [tuple(gyro.column for gyro in look.sources[0].roles.gyros) for look in looks]
    for look, one in zip(looks, columns, strict=True):
        if one != columns[0] and not together:
            what = f"its gyros have other columns ({', '.join(one)}) than those of {looks[0].path.name}"
            raise DataError(what, str(look.path), "make a data set of each, or one array of all by --together")


def _common_name(names: Sequence[str]) -> str:
    same = itertools.takewhile(lambda signs: len(set(signs)) == 1, zip(*names, strict=False))
    return "".join(signs[0] for signs in same).strip("-_0123456789") or "array"


def _board_of(array: ArrayDraft, drafts: Sequence[RecordingDraft]) -> Board:
    manifest = parse_manifest(manifest_text(array, [], ".", drafts), "dataset.yaml")
    board = array_board(manifest, "log")
    assert board is not None
    return board


def _surveyed(found: FoundFiles, draft: RecordingDraft, folder: Path, kind: str | None) -> list[str]:
    """Read the recording as the pipeline will, set its kind, and say what was seen."""
    size = sum(one.stat().st_size for name in draft.files for one in _all_files(folder / name))
    if kind is not None:
        draft.kind, draft.why = kind, "as you say"  # type: ignore[assignment]  # the manifest's validation judges it
    if size > LARGEST_LOOKED_AT:
        if kind is None:
            most = f"{LARGEST_LOOKED_AT >> 20} MiB"
            draft.why = f"not looked at, for the files are larger than {most}: correct it"
        return [f"  {draft.name}: {size >> 20} MiB, too large to be looked at as a whole here"]
    record, share, stretches = survey(found, draft, folder)
    if kind is None:
        draft.kind = "static" if share >= 1 - MOVES else "free"
        draft.why = f"{100 * share:.0f} % of the time at rest: {draft.kind}"
    frames = record.frames
    lines = [f"  {draft.name}:" if len(found.drafts) > 1 else ""]
    counts = f"{frames.lost} lost, {frames.bad} damaged, {frames.repeated} repeated"
    lines.append(f"  samples    {frames.good} at {record.rate_hz:.6g} Hz, {record.duration_s:.6g} s; {counts}")
    lines += clock_lines(record)
    for clock in record.clocks:
        if draft.log is not None and draft.log.time is not None:
            draft.log.meaning = f"found to be {clock['meaning']}"
            draft.log.time_unit = draft.log.time_unit or clock["unit"]
    lines += [f"  {'suspect':<10} {text}" for text in record.reasons] + [
        f"  {'note':<10} {text}" for text in record.warnings
    ]
    moving = f", moves from {moving_words(stretches)}" if 0 < share < 1 - MOVES else ""
    lines.append(f"  kind       {draft.kind}: {100 * share:.0f} % at rest{moving}")
    return [line for line in lines if line]


def _all_files(path: Path) -> list[Path]:
    return [one for one in path.rglob("*") if one.is_file()] if path.is_dir() else [path]


def survey(
    found: FoundFiles, draft: RecordingDraft, folder: Path
) -> tuple[Integrity, float, list[tuple[float, float]]]:
    """The integrity record, the share of the time at rest, and when the board moved, s.  raises : DataError, Refused"""
    manifest = parse_manifest(manifest_text(found.board, [], ".", [draft]), "dataset.yaml")
    recording = manifest.recordings[0]
    board = found.used_board
    paths = [folder / name for name in draft.files]
    reader = open_recording(paths, recording, board, IntegrityOptions(), array=manifest.array)
    frames = gather(reader, board)
    if reader.integrity is None:
        raise ConfigError("the reader ended without a record")
    gyros = np.column_stack([frames.counts[gyro.field] * gyro.scale for gyro in board.gyros])
    at_rest = find_rest(gyros, reader.integrity.rate_hz, RestOptions(guard_s=0.0), frames.segment)
    return reader.integrity, *_rest_share(at_rest, frames.time)


def _rest_share(at_rest: np.ndarray, time: np.ndarray) -> tuple[float, list[tuple[float, float]]]:
    if not len(time):
        return 0.0, []
    moving = [(float(time[a]), float(time[b - 1])) for a, b in true_runs(~at_rest).tolist()]
    return float(at_rest.mean()), moving
