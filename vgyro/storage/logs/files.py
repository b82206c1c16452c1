"""Files of a recording: folders opened, each file by its family."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from vgyro.errors import DataError
from vgyro.log import Log
from vgyro.storage.inputs import BAG_RECORD, files_inside
from vgyro.storage.logs.families import open_log
from vgyro.storage.logs.table import LogFile
from vgyro.storage.sources import check_exists


def log_files(paths: Sequence[str | Path]) -> list[Path]:
    """Files of a recording: those named, and those in the folders that are named."""
    found: list[Path] = []
    for path in map(Path, paths):
        found += files_inside(path) if path.is_dir() else [path]
    return found


def shown_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Names of the files for people: of each alone, or with the folders below the common one where two are alike."""
    if len({path.name for path in paths}) == len(set(paths)):
        return {path: path.name for path in paths}
    common = Path(os.path.commonpath([path.absolute().parent for path in paths]))
    return {path: path.absolute().relative_to(common).as_posix() for path in paths}


def open_all(paths: Sequence[Path], log: Log, engine: str) -> tuple[dict[Path, LogFile], list[str]]:
    """The files that open, and a sentence on each one that does not.

    raises : DataError if none opens: that of the first
    """
    opened: dict[Path, LogFile] = {}
    errors: list[DataError] = []
    for path in paths:
        try:
            check_exists(path)
            if path.is_dir() and not (path / BAG_RECORD).is_file():
                raise DataError("is an empty folder", str(path), "check `files` in the manifest")
            opened[path] = open_log(path, log, engine)
        except DataError as error:
            errors.append(error)
    if not opened:
        raise errors[0]
    return opened, [str(error) for error in errors]
